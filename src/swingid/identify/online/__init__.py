"""One estimate per swing while the log is still being written: constant memory, the same numbers as over all swings."""

from __future__ import annotations

from swingid.identify.online.estimate import SwingEstimate
from swingid.identify.online.stream import online, swing_estimates

__all__ = ["SwingEstimate", "online", "swing_estimates"]
