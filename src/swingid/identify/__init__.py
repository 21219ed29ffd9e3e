"""Identification: one method per file, sharing nodes, turning points, results, uncertainty."""

from __future__ import annotations

from swingid.identify.run import METHODS, identify

__all__ = ["METHODS", "identify"]
