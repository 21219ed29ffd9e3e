"""The robotics standard: inverse-dynamics least squares on filtered and differentiated angles (equation error)."""

from __future__ import annotations

from swingid.methods.equation_error.method import equation_error

__all__ = ["equation_error"]
