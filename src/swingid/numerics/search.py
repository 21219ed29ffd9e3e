"""Where an instant lies among the stamps of a log: a search that begins where evenly spaced stamps would have it."""

from __future__ import annotations

from swingid.numerics.arrays import Array
from swingid.numerics.compiled import njit


@njit
def rows_before(time: Array, instant: float, included: bool) -> int:
    """Stamps of rising `time` before `instant`, with `included` also one at it: `np.searchsorted`, left or right."""
    count = len(time)
    share = (instant - time[0]) / (time[count - 1] - time[0])
    low = high = int(min(share, 1.0) * (count - 1)) if share > 0.0 else 0
    step = 1
    while low > 0 and not (time[low - 1] < instant or (included and time[low - 1] == instant)):
        low, step = max(low - step, 0), 2 * step
    step = 1
    while high < count and (time[high] < instant or (included and time[high] == instant)):
        high, step = min(high + step, count), 2 * step
    while low < high:
        middle = (low + high) // 2
        if time[middle] < instant or (included and time[middle] == instant):
            low = middle + 1
        else:
            high = middle
    return low
