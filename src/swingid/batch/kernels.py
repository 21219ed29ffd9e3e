"""Speeds and modulated integrals of logs with one even step: weights once, then sums of products.

With a window's ends on samples, every window has the same weights. The trapezoid rule with the first correction of
Euler and Maclaurin at the ends, where phi'' has a corner, leaves an error of (step / half-length)^4. Speeds come from
local cubics, with every reversal in its place: a cubic over both sides of a reversal finds it late where the
acceleration jumps by friction. One with a kink does not, but is four times as noisy, so only its mean over the log is
used (theory: `balance.delays`).
"""

from __future__ import annotations

import numpy as np

from swingid.numerics.arrays import Array, Ints
from swingid.numerics.spline import kinked_slopes, local_cubic
from swingid.numerics.test_functions import phi
from swingid.numerics.vectors import njit_sums, njit_sums_threads, sine_cosine, widest

INERTIA, COULOMB, VISCOUS, QUADRATIC, OFFSET, EVEN, GRAVITY, WHEEL, LATE, COLUMNS = range(10)
"""Places of the columns: integrals of phi'' q1, phi sgn v, phi v, phi v|v|, phi, phi |v|, phi sin q1, phi'' q2, and
what is added to that of phi sgn v if all reversals are one standard uncertainty later."""


FEWEST = 4
"""Samples on each side that a cubic with a kink requires."""

FARTHEST = 0.25
"""Delay of a reversal, in half-widths, beyond which the axis may rest as well: it is taken as it is found."""


def window_weights(reach: int, step: float) -> Array:
    """Weights (3, 2 reach + 1) of a window's samples for phi, phi', phi''; half-length `reach` steps of `step` (s)."""
    half = reach * step
    s = np.arange(-reach, reach + 1) / reach
    weights = np.array([phi(s, order) for order in range(3)])
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
    widest()
    rows = angle.shape[1]
    still, where = np.zeros(rows), np.empty(rows, np.int64)
    sine, speed, sign, late = np.empty(rows), np.empty(rows), np.empty(rows), np.empty(rows)
    for k in range(len(angle)):
        q1 = angle[k]
        slopes(q1, speeds[0], speed)
        signs(q1, speed, speeds[1], where, sign, late)
        for j in range(rows):
            sine[j] = sine_cosine(q1[j])[0]
        q2 = wheel[k] if len(wheel) > 0 else still
        project(q1, q2, sine, speed, sign, late, first, spacing, weights, result[k])


@njit_sums
def project(
    angle: Array,
    wheel: Array,
    sine: Array,
    speed: Array,
    sign: Array,
    late: Array,
    first: int,
    spacing: int,
    weights: Array,
    result: Array,
) -> None:
    """Modulated integrals of one log, its channels (rows,), into result (windows, COLUMNS), as of `project_runs`."""
    widest()
    test, rate, curve = weights[0], weights[1], weights[2]
    width, total = len(test), test.sum()
    for i in range(len(result)):
        begin = first + i * spacing
        end = begin + width
        q1, q2, sines = angle[begin:end], wheel[begin:end], sine[begin:end]
        v, side, shift = speed[begin:end], sign[begin:end], late[begin:end]
        q0, w0 = q1[width // 2], q2[width // 2]
        inertia = turn = gravity = viscous = coulomb = quadratic = even = moved = 0.0
        for j in range(width):
            x, size = q1[j] - q0, abs(v[j])
            inertia += curve[j] * x
            viscous -= rate[j] * x
            turn += curve[j] * (q2[j] - w0)
            gravity += test[j] * sines[j]
            coulomb += test[j] * side[j]
            quadratic += test[j] * v[j] * size
            even += test[j] * size
            moved += test[j] * shift[j]
        row = result[i]
        row[INERTIA], row[GRAVITY], row[WHEEL], row[VISCOUS] = inertia, gravity, turn, viscous
        row[COULOMB], row[QUADRATIC], row[OFFSET], row[EVEN], row[LATE] = coulomb, quadratic, total, even, moved


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


PART = 256
"""Samples of which `slopes` keeps the sums in the first-level cache."""


@njit_sums
def slopes(values: Array, weights: Array, result: Array) -> None:
    """Speeds at all samples of `values` (rows,) into result (rows,), 0 where the window reaches over an end."""
    widest()
    rows, reach = len(values), len(weights) - 1
    sums = np.empty(PART)
    for j in range(rows):
        result[j] = 0.0
    for first in range(reach, rows - reach, PART):
        count = min(PART, rows - reach - first)
        for j in range(count):
            sums[j] = 0.0
        for i in range(1, reach + 1):
            weight, before, after = weights[i], values[first - i :], values[first + i :]
            for j in range(count):
                sums[j] += weight * (after[j] - before[j])
        part = result[first:]
        for j in range(count):
            part[j] = sums[j]


@njit_sums
def reversals(v: Array, where: Ints) -> int:
    """Samples after which v (rows,) is on the other side of zero, into `where`; returns how many there are."""
    widest()
    count = 0
    for first in range(0, len(v) - 1, PART):
        part = v[first : min(first + PART + 1, len(v))]
        changes = 0
        for j in range(len(part) - 1):
            changes += (part[j] < 0.0) != (part[j + 1] < 0.0)
        for j in range(len(part) - 1 if changes else 0):
            if (part[j] < 0.0) != (part[j + 1] < 0.0):
                where[count] = first + j
                count += 1
    return count


@njit_sums
def too_fast(angle: Array, v: Array, weights: Array, where: Ints) -> tuple[float, float]:
    """(How much faster than nothing the axis is where v passes zero, its standard uncertainty), rad/s.

    Mean over the reversals `where` of a log in the direction of their acceleration, by which they are weighted: where
    the axis rests, v passes zero by chance. weights: `kinked`.
    """
    rows, reach = len(angle), len(weights) - 1
    total = size = squares = 0.0
    for twice in range(2):
        mean = total / size if size > 0.0 else 0.0
        for j in where:
            if j < reach or j >= rows - reach - 1:
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
                squares += (abs(change) * ((speed if change > 0.0 else -speed) - mean)) ** 2
    return (total / size, np.sqrt(squares) / size) if size > 0.0 else (0.0, 0.0)


@njit_sums
def signs(angle: Array, v: Array, weights: Array, where: Ints, result: Array, late: Array) -> None:
    """Sign of the speed into result (rows,), as its mean over the step about each sample, so that reversals count.

    late (rows,): what is added to it if all reversals are one standard uncertainty later. v: from `slopes`; weights:
    `kinked`; where (rows,): place for the reversals.
    """
    widest()
    rows = len(v)
    for j in range(rows):
        result[j] = 1.0 if v[j] > 0.0 else (-1.0 if v[j] < 0.0 else 0.0)
        late[j] = 0.0
    turns = where[: reversals(v, where)]
    fast, u = too_fast(angle, v, weights, turns)
    most = FARTHEST * (len(weights) - 1)
    for j in turns:
        change = v[j + 1] - v[j]
        direction = 1.0 if change > 0.0 else -1.0
        crossing = j - v[j] / change
        shift = fast / abs(change)
        at = crossing - shift if abs(shift) < most else crossing
        after = at + min(u / abs(change), most)
        for i in range(max(int(min(at, crossing)) - 1, 0), min(int(max(after, crossing)) + 3, rows)):
            result[i] = direction * min(max(2.0 * (i - at), -1.0), 1.0)
            late[i] = direction * min(max(2.0 * (i - after), -1.0), 1.0) - result[i]
