"""The symmetric momentum method: test functions on the angles, no motor constant, no speed, no law."""

from __future__ import annotations

from swingid.identify.momentum.method import momentum

__all__ = ["momentum"]
