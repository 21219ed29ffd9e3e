"""Where an instant lies among the stamps of a log: bisection that begins where evenly spaced stamps would have it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from swingid.numerics.compiled import njit

NEAR = 32
"""Rows beside the guess that are looked through one by one."""


@njit
def rows_before(time: NDArray[np.float64], instant: float, included: bool) -> int:
    """Stamps of rising `time` before `instant`, with `included` also one at it: `np.searchsorted`, left or right."""
    last = len(time) - 1
    share = (instant - time[0]) / (time[last] - time[0])
    k = int(min(share, 1.0) * last) if share > 0.0 else 0
    low, high = max(k - NEAR, 0), min(k + NEAR, last)
    if (low > 0 and time[low] >= instant) or (high < last and time[high] <= instant):
        return int(np.searchsorted(time, instant, side="right") if included else np.searchsorted(time, instant))
    while k > 0 and (time[k - 1] > instant or (time[k - 1] == instant and not included)):
        k -= 1
    while k <= last and (time[k] < instant or (time[k] == instant and included)):
        k += 1
    return k
