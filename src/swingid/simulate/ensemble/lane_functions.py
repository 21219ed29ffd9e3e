"""Elementary functions as straight-line arithmetic, so that the compiler computes them for many runs at once.

A call of the library's sin or exp keeps a loop scalar. Reduction by Cody and Waite (three parts of pi/2, exact products
for |x| < 1e5), polynomials of Taylor's series cut where the next term is below rounding on the reduced interval.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numba
import numpy as np

from swingid.numerics import compiled

njit_lane: Callable[[compiled.Function], compiled.Function] = partial(
    numba.njit, cache=True, error_model="numpy", forceinline=True, fastmath={"contract", "nsz"}
)
"""For the arithmetic of one run inside a loop over runs: inlined, products and sums fused."""

njit_threads: Callable[[compiled.Function], compiled.Function] = partial(
    numba.njit, cache=True, error_model="numpy", nogil=True, fastmath={"contract", "nsz"}
)
"""For what runs beside other threads."""

LARGEST_ANGLE = 1e5
"""rad: up to here `sine_cosine` is exact to 1e-15; a rig that turns further is not for the ensemble."""

TWO_OVER_PI = 2.0 / np.pi
# pi/2 in three parts; n times the first two is exact for |n| < 2^20 (fdlibm, e_rem_pio2.c).
HALF_PI_1, HALF_PI_2, HALF_PI_3 = 1.57079632673412561417e00, 6.07710050630396597660e-11, 2.02226624879595063154e-21

LOG2E, LN2_HIGH, LN2_LOW = 1.4426950408889634074, 6.93147180369123816490e-01, 1.90821492927058770002e-10
DEEPEST = 700.0


@njit_lane
def sine_cosine(x: float) -> tuple[float, float]:
    """Sine and cosine of x (rad), |x| < LARGEST_ANGLE, each to 1e-15."""
    n = np.rint(x * TWO_OVER_PI)
    r = ((x - n * HALF_PI_1) - n * HALF_PI_2) - n * HALF_PI_3
    z = r * r
    s = z * (1 / 6227020800 - z * (1 / 1307674368000))
    s = r - r * z * (1 / 6 - z * (1 / 120 - z * (1 / 5040 - z * (1 / 362880 - z * (1 / 39916800 - s)))))
    c = z * (1 / 479001600 - z * (1 / 87178291200 - z * (1 / 20922789888000)))
    c = 1.0 - z * (1 / 2 - z * (1 / 24 - z * (1 / 720 - z * (1 / 40320 - z * (1 / 3628800 - c)))))
    quarter = n - 4.0 * np.floor(0.25 * n)
    swapped = (quarter == 1.0) | (quarter == 3.0)
    sine, cosine = (c, s) if swapped else (s, c)
    return (-sine if quarter >= 2.0 else sine), (-cosine if (quarter == 1.0) | (quarter == 2.0) else cosine)


@njit_lane
def decay(x: float) -> float:
    """exp(-x) for x >= 0 to 1e-15 of its value; beyond 700 it stays at exp(-700)."""
    x = x if x < DEEPEST else DEEPEST
    n = np.rint(x * LOG2E)
    r = (n * LN2_HIGH - x) + n * LN2_LOW
    p = 1 / 39916800 + r * (1 / 479001600 + r * (1 / 6227020800))
    p = 1 / 5040 + r * (1 / 40320 + r * (1 / 362880 + r * (1 / 3628800 + r * p)))
    p = 1.0 + r * (1.0 + r * (1 / 2 + r * (1 / 6 + r * (1 / 24 + r * (1 / 120 + r * (1 / 720 + r * p))))))
    return float(p * np.int64((1023 - np.int64(n)) << 52).view(np.float64))
