"""Recursive least squares: one estimate per swing while the log is being written, in constant memory."""

from __future__ import annotations

from swingid.recursive.solution import SwingEstimate
from swingid.recursive.stream import online, swing_estimates

__all__ = ["SwingEstimate", "online", "swing_estimates"]
