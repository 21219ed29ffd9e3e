"""The reversals of a sequence: its alternating extremes."""

from __future__ import annotations

import numpy as np

from swingid.numerics.arrays import Array, Ints
from swingid.numerics.compiled import njit


@njit
def reversals(values: Array, threshold: float) -> Ints:
    """Indices of the alternating extremes of `values` that differ by more than `threshold` (hysteresis).

    The first may be where the values begin.
    """
    kept = np.empty(len(values), np.int64)
    count = low = high = direction = 0
    for k, value in enumerate(values):
        if value > values[high]:
            high = k
        if value < values[low]:
            low = k
        if direction >= 0 and values[high] - value > threshold:
            kept[count] = high
            count += 1
            direction, low, high = -1, k, k
        elif direction <= 0 and value - values[low] > threshold:
            kept[count] = low
            count += 1
            direction, high, low = 1, k, k
    return kept[:count].copy()
