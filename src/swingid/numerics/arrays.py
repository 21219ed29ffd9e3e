"""The array types of annotations, by element, and medians and quantiles of arrays without NaN.

One partition each; NumPy's take three, and more time with ties.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


def median(values: Array) -> float:
    """Return the median as `np.median`; NaN of no value."""
    if len(values) == 0:
        return float("nan")
    middle = len(values) // 2
    parted = np.partition(values, middle)
    high = float(parted[middle])
    return high if len(values) % 2 else (float(parted[:middle].max()) + high) / 2


def robust_spread(values: Array) -> float:
    """Standard deviation by the median distance from the median, which few outliers do not change; 0 of no value."""
    return 1.4826 * median(np.abs(values - median(values))) if len(values) else 0.0


def quantile(values: Array, share: float) -> float:
    """Return the quantile as `np.quantile`: between two ranks by a straight line; NaN of no value."""
    if len(values) == 0:
        return float("nan")
    place = share * (len(values) - 1)
    rank = int(place)
    parted = np.partition(values, rank)
    low = float(parted[rank])
    return low if rank == place else low + (place - rank) * (float(parted[rank + 1 :].min()) - low)


def stretches(values: NDArray[Any], width: int) -> NDArray[Any]:
    """View of all stretches of `width` successive values along the last axis, one more dimension; not to be written to.

    As `np.lib.stride_tricks.sliding_window_view`, whose checks take longer than the work on a log of some swings.
    """
    values = np.ascontiguousarray(values)
    *many, count = values.shape
    return np.ndarray((*many, count - width + 1, width), values.dtype, values, 0, (*values.strides, values.strides[-1]))


def sums_at(places: Ints, values: Array, count: int) -> Array:
    """Sums (count,) of the values with the same place, from 0 on; places and values of one shape."""
    return np.bincount(places.ravel(), values.ravel(), count).astype(np.float64, copy=False)
