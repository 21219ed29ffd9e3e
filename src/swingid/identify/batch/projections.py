"""The balance of row (I) on test functions, for logs with one even step: weights once, then sums of products.

With a window's ends on samples, every window has the same weights. The trapezoid rule with the first correction of
Euler and Maclaurin at the ends, where phi'' has a corner, leaves an error of (step / half-length)^4.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numba
import numpy as np
from numpy.typing import NDArray

from swingid.numerics import compiled
from swingid.numerics.test_functions import phi

Array = NDArray[np.float64]

njit_sums_threads: Callable[[compiled.Function], compiled.Function] = partial(
    numba.njit, cache=True, error_model="numpy", nogil=True, fastmath={"reassoc", "contract", "nsz"}
)

INERTIA, GRAVITY, WHEEL, VISCOUS, COULOMB, QUADRATIC, OFFSET, EVEN, COLUMNS = range(9)
"""Places of the columns: integrals of phi'' q1, phi sin q1, phi'' q2, phi v, phi sgn v, phi v|v|, phi, phi |v|."""


def window_weights(reach: int, step: float) -> Array:
    """Weights (3, 2 reach + 1) of a window's samples for phi, phi', phi''; half-length `reach` steps of `step` (s)."""
    half = reach * step
    s = np.arange(-reach, reach + 1) / reach
    weights = np.array([[phi(float(x), order) for x in s] for order in range(3)])
    weights *= step / half ** np.arange(3)[:, None]
    weights[2, [0, -1]] += 4.0 * step**2 / half**3  # -step^2/12 phi''' of both ends, which is 48/half^3
    return weights


@njit_sums_threads
def speed_columns(angle: Array, step: float, reach: int, columns: Array) -> None:
    """v, sgn v, v|v| and |v| at the samples of `angle` (rows,) into `columns` (4, rows).

    v is a difference over 2 reach steps, the sign its mean over the step about the sample, so that where it turns
    between two samples counts.
    """
    rows = len(angle)
    for j in range(rows):
        low, high = max(j - reach, 0), min(j + reach, rows - 1)
        columns[0, j] = (angle[high] - angle[low]) / ((high - low) * step)
    for j in range(rows):
        v = columns[0, j]
        change = abs(columns[0, min(j + 1, rows - 1)] - columns[0, max(j - 1, 0)]) / 4.0
        columns[1, j] = v / change if abs(v) < change else np.sign(v)
        columns[2, j], columns[3, j] = v * abs(v), abs(v)


@njit_sums_threads
def project_run(
    angle: Array, wheel: Array, first: int, spacing: int, weights: Array, work: Array, result: Array
) -> None:
    """Columns (windows, COLUMNS) of one log; windows every `spacing` samples, the first from sample `first` on.

    angle, wheel (rows,) (rad). work (5, rows): sin q1, and the columns of `speed_columns`.
    """
    width = weights.shape[1]
    reach = width // 2
    for j in range(len(angle)):
        work[4, j] = np.sin(angle[j])
    total = weights[0].sum()
    for i in range(len(result)):
        begin = first + i * spacing
        q0, w0 = angle[begin + reach], wheel[begin + reach]
        a = g = w = v = c = q = e = 0.0
        for j in range(width):
            x = angle[begin + j] - q0
            test = weights[0, j]
            a += weights[2, j] * x
            v -= weights[1, j] * x
            w += weights[2, j] * (wheel[begin + j] - w0)
            g += test * work[4, begin + j]
            c += test * work[1, begin + j]
            q += test * work[2, begin + j]
            e += test * work[3, begin + j]
        result[i, INERTIA], result[i, GRAVITY], result[i, WHEEL], result[i, VISCOUS] = a, g, w, v
        result[i, COULOMB], result[i, QUADRATIC], result[i, OFFSET], result[i, EVEN] = c, q, total, e


@njit_sums_threads
def project_runs(
    angle: Array, wheel: Array, step: float, blur: int, first: int, spacing: int, weights: Array, result: Array
) -> None:
    """`project_run` for all logs (n, rows), into result (n, windows, COLUMNS). wheel may have no rows: no wheel.

    blur: half the steps over which a speed is taken.
    """
    work = np.empty((5, angle.shape[1]))
    still = np.zeros(angle.shape[1])
    for k in range(len(angle)):
        speed_columns(angle[k], step, blur, work)
        project_run(angle[k], wheel[k] if len(wheel) > 0 else still, first, spacing, weights, work, result[k])
