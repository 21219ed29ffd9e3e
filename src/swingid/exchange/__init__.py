"""The identified rig for other programs: MJCF, URDF, python-control, MATLAB, and a Gymnasium environment."""

from __future__ import annotations

from swingid.exchange.export import export

__all__ = ["export"]
