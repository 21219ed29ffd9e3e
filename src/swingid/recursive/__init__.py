"""One estimate per swing while the log is still being written: constant memory, the same numbers as over all swings."""

from __future__ import annotations

from swingid.recursive.solution import SwingEstimate
from swingid.recursive.stream import online, swing_estimates

__all__ = ["SwingEstimate", "online", "swing_estimates"]
