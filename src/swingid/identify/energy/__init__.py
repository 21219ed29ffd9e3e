"""The paper's energy method: mirrored passes, as printed and better."""

from __future__ import annotations

from swingid.identify.energy.method import energy

__all__ = ["energy"]
