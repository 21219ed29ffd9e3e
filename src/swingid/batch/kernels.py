"""Speeds and modulated integrals of logs with one even step: weights once, then sums of products.

With a window's ends on samples, every window has the same weights. The trapezoid rule with the first correction of
Euler and Maclaurin at the ends, where phi'' has a corner, leaves an error of (step / half-length)^4. Speeds come from
local cubics, with every reversal in its place: a cubic over both sides of a reversal finds it late where the
acceleration jumps by friction. One with a kink does not, but is four times as noisy, so only its mean over the log is
used (theory: `balance.delays`).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numba
import numpy as np

from swingid.numerics import compiled
from swingid.numerics.arrays import Array
from swingid.numerics.spline import kinked_slopes, local_cubic
from swingid.numerics.test_functions import phi

njit_sums_threads: Callable[[compiled.Function], compiled.Function] = partial(
    numba.njit, cache=True, error_model="numpy", nogil=True, fastmath={"reassoc", "contract", "nsz"}
)

INERTIA, GRAVITY, WHEEL, VISCOUS, COULOMB, QUADRATIC, OFFSET, EVEN, LATE, COLUMNS = range(10)
"""Places of the columns: integrals of phi'' q1, phi sin q1, phi'' q2, phi v, phi sgn v, phi v|v|, phi, phi |v|, and
what is added to that of phi sgn v if all reversals are one standard uncertainty later."""


FEWEST = 4
"""Samples on each side that a cubic with a kink requires."""

FARTHEST = 0.25
"""Delay of a reversal, in half-widths, beyond which the axis may rest as well: it is taken as it is found."""


def window_weights(reach: int, step: float) -> Array:
    """Weights (3, 2 reach + 1) of a window's samples for phi, phi', phi''; half-length `reach` steps of `step` (s)."""
    half = reach * step
    s = np.arange(-reach, reach + 1) / reach
    weights = np.array([[phi(float(x), order) for x in s] for order in range(3)])
    weights *= step / half ** np.arange(3)[:, None]
    weights[2, [0, -1]] += 4.0 * step**2 / half**3  # -step^2/12 phi''' of both ends, which is 48/half^3
    return weights


@njit_sums_threads
def project_runs(
    angle: Array,
    wheel: Array,
    speeds: tuple[Array, Array],
    first: int,
    spacing: int,
    weights: Array,
    result: Array,
) -> None:
    """Modulated integrals of all logs (n, rows), rad, into result (n, windows, COLUMNS); wheel (0, rows): no wheel.

    speeds: weights of the speed and of `kinked`. Windows every `spacing` samples, the first from sample `first` on;
    weights: `window_weights`.
    """
    # sin q1, the speed, its sign and what is added to that, as of `signs`
    work, still = np.empty((4, angle.shape[1])), np.zeros(angle.shape[1])
    width, total = weights.shape[1], weights[0].sum()
    for k in range(len(angle)):
        q1, q2 = angle[k], wheel[k] if len(wheel) > 0 else still
        slopes(q1, speeds[0], work[1])
        signs(q1, work[1], speeds[1], work[2], work[3])
        for j in range(len(q1)):
            work[0, j] = np.sin(q1[j])
        for i in range(result.shape[1]):
            begin = first + i * spacing
            q0, w0 = q1[begin + width // 2], q2[begin + width // 2]
            a = g = w = v = c = q = e = late = 0.0
            for j in range(width):
                x = q1[begin + j] - q0
                test = weights[0, j]
                a += weights[2, j] * x
                v -= weights[1, j] * x
                w += weights[2, j] * (q2[begin + j] - w0)
                speed = work[1, begin + j]
                g += test * work[0, begin + j]
                c += test * work[2, begin + j]
                q += test * speed * abs(speed)
                e += test * abs(speed)
                late += test * work[3, begin + j]
            row = result[k, i]
            row[INERTIA], row[GRAVITY], row[WHEEL], row[VISCOUS] = a, g, w, v
            row[COULOMB], row[QUADRATIC], row[OFFSET], row[EVEN], row[LATE] = c, q, total, e, late


def least_squares(matrix: Array, known: Array, rcond: float) -> tuple[Array, Array, Array]:
    """Values (n, p), influence (n, rows) on the first of them, and its scores (influence times residual), of n fits.

    matrix (n, rows, p), known (n, rows); rcond: of the normal equations, with columns scaled to unit length.
    """
    size = np.linalg.norm(matrix, axis=1, keepdims=True)
    size[size == 0.0] = 1.0
    scaled = matrix / size
    inverse = np.linalg.pinv(scaled.transpose(0, 2, 1) @ scaled, rcond=rcond, hermitian=True)
    values = inverse @ (scaled.transpose(0, 2, 1) @ known[:, :, None])
    influence = (scaled @ inverse[:, :, :1])[:, :, 0] / size[:, :, 0]
    scores = influence * (known - (scaled @ values)[:, :, 0])
    return values[:, :, 0] / size[:, 0], influence, scores


def smoothing(half_width: float, step: float) -> Array:
    """Weights (2, m) of samples 0 ... m - 1 steps away: of the angle (even) and, odd, of the speed, by local cubics."""
    reach = int(np.floor(half_width / step * (1.0 - 1e-9)))
    time: Array = step * np.arange(-reach, reach + 1, dtype=np.float64)
    units = np.eye(2 * reach + 1)[reach:]
    return np.ascontiguousarray(np.array([local_cubic(time, unit, np.zeros(1), half_width)[0, :2] for unit in units]).T)


def kinked(half_width: float, step: float) -> Array:
    """Weights (m,) of differences of samples 0 ... m - 1 steps to both sides: speed of a cubic with a kink between."""
    reach = max(FEWEST, int(np.floor(half_width / step * (1.0 - 1e-9))))
    time: Array = step * np.arange(-reach, reach + 1, dtype=np.float64)
    units = np.eye(2 * reach + 1)[reach + 1 :]
    return np.array([0.0, *(kinked_slopes(time, unit, np.zeros(1), reach * step)[0] for unit in units)])


@njit_sums_threads
def slopes(values: Array, weights: Array, result: Array) -> None:
    """Speeds at all samples of `values` (rows,) into result (rows,), 0 where the window reaches over an end."""
    rows, reach = len(values), len(weights) - 1
    result[:] = 0.0
    for i in range(1, reach + 1):
        weight = weights[i]
        for j in range(reach, rows - reach):
            result[j] += weight * (values[j + i] - values[j - i])


@njit_sums_threads
def too_fast(angle: Array, v: Array, weights: Array) -> tuple[float, float]:
    """(How much faster than nothing the axis is where v passes zero, its standard uncertainty), rad/s.

    Mean over the reversals of a log in the direction of their acceleration, by which they are weighted: where the axis
    rests, v passes zero by chance. weights: `kinked`.
    """
    rows, reach = len(angle), len(weights) - 1
    total = size = squares = 0.0
    for twice in range(2):
        mean = total / size if size > 0.0 else 0.0
        for j in range(reach, rows - reach - 1):
            if (v[j] < 0.0) == (v[j + 1] < 0.0):
                continue
            change = v[j + 1] - v[j]
            near = j if abs(v[j]) < abs(v[j + 1]) else j + 1
            speed = -v[near]
            for i in range(1, reach + 1):
                speed += weights[i] * (angle[near + i] - angle[near - i])
            if twice == 0:
                total += change * speed
                size += abs(change)
            else:
                squares += (abs(change) * (np.sign(change) * speed - mean)) ** 2
    return (total / size, np.sqrt(squares) / size) if size > 0.0 else (0.0, 0.0)


@njit_sums_threads
def signs(angle: Array, v: Array, weights: Array, result: Array, late: Array) -> None:
    """Sign of the speed into result (rows,), as its mean over the step about each sample, so that reversals count.

    late (rows,): what is added to it if all reversals are one standard uncertainty later. v: from `slopes`; weights:
    `kinked`.
    """
    rows = len(v)
    for j in range(rows):
        result[j] = np.sign(v[j])
    late[:] = 0.0
    fast, u = too_fast(angle, v, weights)
    most = FARTHEST * (len(weights) - 1)
    for j in range(rows - 1):
        if (v[j] < 0.0) == (v[j + 1] < 0.0):
            continue
        change = v[j + 1] - v[j]
        found, way = j - v[j] / change, np.sign(change)
        shift = fast / abs(change)
        at = found - shift if abs(shift) < most else found
        after = at + min(u / abs(change), most)
        for i in range(max(int(min(at, found)) - 1, 0), min(int(max(after, found)) + 3, rows)):
            result[i] = way * min(max(2.0 * (i - at), -1.0), 1.0)
            late[i] = way * min(max(2.0 * (i - after), -1.0), 1.0) - result[i]
