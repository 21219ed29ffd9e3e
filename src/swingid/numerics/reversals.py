"""The reversals of a sequence: its alternating extremes."""

from __future__ import annotations

import numpy as np

from swingid.numerics.arrays import Array, Ints


def reversals(values: Array, threshold: float) -> Ints:
    """Indices of the alternating extremes of `values` that differ by more than `threshold` (hysteresis).

    The first may be where the values begin. One loop over the local extremes alone.
    """
    changes = np.diff(values)
    moves = np.flatnonzero(changes)
    turns = np.flatnonzero(np.diff(np.sign(changes[moves])))
    # of equal neighbours the first one
    places = np.concatenate([[0], moves[turns] + 1, moves[-1:] + 1]).astype(np.int64) if len(values) else moves
    kept: list[int] = []
    low = high = direction = 0
    extremes = values[places].tolist()
    for k, value in enumerate(extremes):
        if value > extremes[high]:
            high = k
        if value < extremes[low]:
            low = k
        if direction >= 0 and extremes[high] - value > threshold:
            kept.append(high)
            direction, low, high = -1, k, k
        elif direction <= 0 and value - extremes[low] > threshold:
            kept.append(low)
            direction, high, low = 1, k, k
    return places[kept]
