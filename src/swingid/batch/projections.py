"""The balance of row (I) on test functions, for logs with one even step: weights once, then sums of products.

With a window's ends on samples, every window has the same weights. The trapezoid rule with the first correction of
Euler and Maclaurin at the ends, where phi'' has a corner, leaves an error of (step / half-length)^4.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numba
import numpy as np

from swingid.numerics import compiled
from swingid.numerics.arrays import Array
from swingid.numerics.test_functions import phi

njit_sums_threads: Callable[[compiled.Function], compiled.Function] = partial(
    numba.njit, cache=True, error_model="numpy", nogil=True, fastmath={"reassoc", "contract", "nsz"}
)

INERTIA, GRAVITY, WHEEL, VISCOUS, COULOMB, QUADRATIC, OFFSET, EVEN, LATE, COLUMNS = range(10)
"""Places of the columns: integrals of phi'' q1, phi sin q1, phi'' q2, phi v, phi sgn v, phi v|v|, phi, phi |v|, and
what is added to that of phi sgn v if all reversals are one standard uncertainty later."""


def window_weights(reach: int, step: float) -> Array:
    """Weights (3, 2 reach + 1) of a window's samples for phi, phi', phi''; half-length `reach` steps of `step` (s)."""
    half = reach * step
    s = np.arange(-reach, reach + 1) / reach
    weights = np.array([[phi(float(x), order) for x in s] for order in range(3)])
    weights *= step / half ** np.arange(3)[:, None]
    weights[2, [0, -1]] += 4.0 * step**2 / half**3  # -step^2/12 phi''' of both ends, which is 48/half^3
    return weights


@njit_sums_threads
def project_run(
    angle: Array, wheel: Array, first: int, spacing: int, weights: Array, work: Array, result: Array
) -> None:
    """Columns (windows, COLUMNS) of one log; windows every `spacing` samples, the first from sample `first` on.

    angle, wheel (rows,) (rad). work (4, rows): sin q1, the speed, its sign and what is added to that, as of `signs`.
    """
    width = weights.shape[1]
    reach = width // 2
    for j in range(len(angle)):
        work[0, j] = np.sin(angle[j])
    total = weights[0].sum()
    for i in range(len(result)):
        begin = first + i * spacing
        q0, w0 = angle[begin + reach], wheel[begin + reach]
        a = g = w = v = c = q = e = late = 0.0
        for j in range(width):
            x = angle[begin + j] - q0
            test = weights[0, j]
            a += weights[2, j] * x
            v -= weights[1, j] * x
            w += weights[2, j] * (wheel[begin + j] - w0)
            speed = work[1, begin + j]
            g += test * work[0, begin + j]
            c += test * work[2, begin + j]
            q += test * speed * abs(speed)
            e += test * abs(speed)
            late += test * work[3, begin + j]
        result[i, INERTIA], result[i, GRAVITY], result[i, WHEEL], result[i, VISCOUS] = a, g, w, v
        result[i, COULOMB], result[i, QUADRATIC], result[i, OFFSET], result[i, EVEN] = c, q, total, e
        result[i, LATE] = late
