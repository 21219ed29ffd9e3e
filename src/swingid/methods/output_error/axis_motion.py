"""Equation (I) alone, with the measured wheel, a known torque or nothing as its input; with exact sensitivities.

With κ = a12/a11 and z = q1 + κ q2, (I) reads a11 z'' = τ − b sin q1 − F(q1'), q1 = z − κ q2, q1' = z' − κ q2': the
measured wheel enters by its angle, not by its acceleration (except while the axis rests). State (z, z'), classical
Runge–Kutta steps; a step ends where q1' passes zero. There z'' jumps by the Coulomb friction, and the sensitivities
with it, as in `motor_motion`; an axis whose friction can hold it rests until it is released.
"""

from __future__ import annotations

import math

import numpy as np

from swingid.methods.output_error.partials import axis_row, axis_slopes
from swingid.model.dynamics import held_load, sliding_load
from swingid.model.friction import release_margin
from swingid.model.parameters import A11, A12, AXIS_STICKS, SIZE, STRIBECK_SPEED
from swingid.numerics.arrays import Array, Ints
from swingid.numerics.compiled import njit, njit_inlined

GAIN = SIZE
"""Place of the gain of the torque (1), after those of the rig's vector."""

MOST_STEPS = 5_000

WHEEL, SPEED, TORQUE, COURSES = 0, 1, 2, 3
"""Rows of `courses`: cubics of the wheel's angle (from the segment's start, rad), its speed, and the torque (N m)."""

PEAK_SHARE = 0.25
"""Change of speed in one step, in Stribeck speeds, while the speed is below four of them."""

RESOLUTION = 1e-13  # s


@njit_inlined
def course_at(courses: Array, k: int, which: int, x: float) -> float:
    """A row of `courses` at x s past knot k."""
    return float(
        courses[k, which, 0] + x * (courses[k, which, 1] + x * (courses[k, which, 2] + x * courses[k, which, 3]))
    )


@njit_inlined
def turning_at(courses: Array, k: int, x: float) -> float:
    """q2'' of the wheel's speed course."""
    return float(courses[k, SPEED, 1] + x * (2.0 * courses[k, SPEED, 2] + 3.0 * x * courses[k, SPEED, 3]))


@njit_inlined
def acceleration(z: float, w: float, s: int, courses: Array, k: int, x: float, p: Array) -> float:
    """Acceleration z'' (rad/s²) at x s past knot k, sliding towards side s."""
    kappa = p[A12] / p[A11]
    q, v = z - kappa * course_at(courses, k, WHEEL, x), w - kappa * course_at(courses, k, SPEED, x)
    return float((sliding_load(q, v, s, 0.0, course_at(courses, k, TORQUE, x), p)) / p[A11])


@njit_inlined
def one_step(x: float, h: float, s: int, courses: Array, k: int, p: Array, stages: Array) -> None:
    """One step of h (s) from x s past knot k; rows 0 … 3 of `stages` (5, 2) are the stages' states, row 4 the end."""
    z, w = stages[0, 0], stages[0, 1]
    k1 = acceleration(z, w, s, courses, k, x, p)
    stages[1, 0], stages[1, 1] = z + 0.5 * h * w, w + 0.5 * h * k1
    k2 = acceleration(stages[1, 0], stages[1, 1], s, courses, k, x + 0.5 * h, p)
    stages[2, 0], stages[2, 1] = z + 0.5 * h * stages[1, 1], w + 0.5 * h * k2
    k3 = acceleration(stages[2, 0], stages[2, 1], s, courses, k, x + 0.5 * h, p)
    stages[3, 0], stages[3, 1] = z + h * stages[2, 1], w + h * k3
    k4 = acceleration(stages[3, 0], stages[3, 1], s, courses, k, x + h, p)
    stages[4, 0] = z + h / 6.0 * (w + 2.0 * stages[1, 1] + 2.0 * stages[2, 1] + stages[3, 1])
    stages[4, 1] = w + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)


@njit_inlined
def axis_speed(w: float, courses: Array, k: int, x: float, p: Array) -> float:
    """Speed q1' (rad/s) at x s past knot k, of z' = w."""
    return float(w - p[A12] / p[A11] * course_at(courses, k, SPEED, x))


@njit_inlined
def until_reversal(x: float, h: float, s: int, courses: Array, k: int, p: Array, stages: Array) -> float:
    """Length (s) of the step after which the speed has only just left side s; `stages` hold that step. Illinois."""
    low, high = 0.0, h
    at_low = s * axis_speed(stages[0, 1], courses, k, x, p)
    at_high = s * axis_speed(stages[4, 1], courses, k, x + h, p)
    last = 0
    for trial in range(100):
        if high - low <= RESOLUTION:
            break
        middle = 0.5 * (low + high)
        if at_low > 0.0 and trial % 4 != 3:
            middle = (low * at_high - high * at_low) / (at_high - at_low)
            middle = min(max(middle, low + 0.25 * RESOLUTION), high - 0.25 * RESOLUTION)
        one_step(x, middle, s, courses, k, p, stages)
        at_middle = s * axis_speed(stages[4, 1], courses, k, x + middle, p)
        if at_middle < 0.0:
            high, at_high = middle, at_middle
            at_low *= 0.5 if last > 0 else 1.0
            last = 1
        else:
            low, at_low = middle, at_middle
            at_high *= 0.5 if last < 0 else 1.0
            last = -1
    one_step(x, high, s, courses, k, p, stages)
    return high


@njit_inlined
def side_from_rest(q: float, courses: Array, k: int, x: float, p: Array) -> int:
    """Side to which an axis without speed goes, 0 where friction holds it."""
    load = held_load(q, course_at(courses, k, TORQUE, x), p) - p[A12] * turning_at(courses, k, x)
    if p[AXIS_STICKS] != 0.0 and release_margin(load, q, p) >= 0.0:
        return 0
    return 1 if load > 0.0 else -1


@njit_inlined
def until_release(q: float, left: float, courses: Array, k: int, x: float, p: Array) -> float:
    """Time (s) into the rest of a knot's interval at which a resting axis is released; `left` if it is not."""
    if side_from_rest(q, courses, k, x + left, p) == 0:
        return left
    low, high = 0.0, left
    while high - low > 1e-9 * left:
        middle = 0.5 * (low + high)
        if side_from_rest(q, courses, k, x + middle, p) == 0:
            low = middle
        else:
            high = middle
    return high


@njit_inlined
def step_length(
    left: float, longest: float, z: float, w: float, s: int, courses: Array, k: int, x: float, p: Array
) -> float:
    """Length (s) of the next step: at most `longest`, and short where Stribeck's peak is passed."""
    h = min(left, longest)
    if p[STRIBECK_SPEED] > 0.0:
        v = abs(axis_speed(w, courses, k, x, p))
        if v < 4.0 * p[STRIBECK_SPEED]:
            pull = abs(acceleration(z, w, s, courses, k, x, p) - p[A12] / p[A11] * turning_at(courses, k, x))
            h = min(h, max(PEAK_SHARE * p[STRIBECK_SPEED] / max(pull, 1e-300), 1e-5))
    return left / math.ceil(left / h)


@njit_inlined
def _slopes_at(
    at: int,
    z: float,
    w: float,
    s: int,
    courses: Array,
    k: int,
    x: float,
    p: Array,
    row: Array,
    entries: tuple[Ints, Ints, Array],
    ratio: Array,
    slopes: tuple[Array, Array],
) -> None:
    """∂z''/∂(z, z') into jacobian[at] (2,) and ∂z''/∂θ into known[at] (m,); ratio (m,) is ∂κ/∂θ."""
    jacobian, known = slopes
    kappa, wheel, turn = p[A12] / p[A11], course_at(courses, k, WHEEL, x), course_at(courses, k, SPEED, x)
    q, v = z - kappa * wheel, w - kappa * turn
    torque = course_at(courses, k, TORQUE, x)
    axis_row(q, v, s, p, row)
    row[A11] = -(sliding_load(q, v, s, 0.0, torque, p)) / p[A11]
    row[GAIN] = torque
    by_angle, by_speed = axis_slopes(q, v, s, p)
    swing, drag = -by_angle / p[A11], -by_speed / p[A11]
    jacobian[at, 0], jacobian[at, 1] = swing, drag
    for c in range(known.shape[1]):
        known[at, c] = -(swing * wheel + drag * turn) * ratio[c]
    places, columns, weights = entries
    for e in range(len(places)):
        known[at, columns[e]] += weights[e] * row[places[e]] / p[A11]


@njit_inlined
def _carry(h: float, sensitivity: Array, slopes: tuple[Array, Array]) -> None:
    """S (2, m) over a step of h (s): the derivative of the step itself, from its four stages."""
    jacobian, known = slopes
    for c in range(sensitivity.shape[1]):
        z, w = sensitivity[0, c], sensitivity[1, c]
        k1 = jacobian[0, 0] * z + jacobian[0, 1] * w + known[0, c]
        w2 = w + 0.5 * h * k1
        k2 = jacobian[1, 0] * (z + 0.5 * h * w) + jacobian[1, 1] * w2 + known[1, c]
        w3 = w + 0.5 * h * k2
        k3 = jacobian[2, 0] * (z + 0.5 * h * w2) + jacobian[2, 1] * w3 + known[2, c]
        w4 = w + h * k3
        k4 = jacobian[3, 0] * (z + h * w3) + jacobian[3, 1] * w4 + known[3, c]
        sensitivity[0, c] = z + h / 6.0 * (w + 2.0 * w2 + 2.0 * w3 + w4)
        sensitivity[1, c] = w + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)


@njit_inlined
def _fill_ratio(p: Array, entries: tuple[Ints, Ints, Array], ratio: Array) -> None:
    """∂κ/∂θ (m,) of κ = a12/a11."""
    places, columns, weights = entries
    for e in range(len(places)):
        if places[e] == A12:
            ratio[columns[e]] += weights[e] / p[A11]
        elif places[e] == A11:
            ratio[columns[e]] -= weights[e] * p[A12] / p[A11] / p[A11]


@njit_inlined
def _freed(
    q: float, courses: Array, k: int, x: float, p: Array, rest: Array, ratio: Array, sensitivity: Array
) -> tuple[float, float]:
    """State (z, z') of an axis that has rested at q, and its S from that of q, `rest` (m,)."""
    wheel, turn = course_at(courses, k, WHEEL, x), course_at(courses, k, SPEED, x)
    for c in range(len(rest)):
        sensitivity[0, c], sensitivity[1, c] = rest[c] + ratio[c] * wheel, ratio[c] * turn
    return q + p[A12] / p[A11] * wheel, p[A12] / p[A11] * turn


@njit_inlined
def _reversed(
    z: float,
    w: float,
    s: int,
    courses: Array,
    k: int,
    x: float,
    p: Array,
    rest: Array,
    ratio: Array,
    sensitivity: Array,
) -> tuple[float, float, int]:
    """Angle, z' and new side where the speed has passed zero; S jumps with z'', and `rest` (m,) becomes that of q1."""
    kappa, wheel, turn = p[A12] / p[A11], course_at(courses, k, WHEEL, x), course_at(courses, k, SPEED, x)
    before = acceleration(z, w, s, courses, k, x, p)
    q, w = z - kappa * wheel, kappa * turn
    s = side_from_rest(q, courses, k, x, p)
    after = before if s == 0 else acceleration(z, w, s, courses, k, x, p)
    slowing = before - kappa * turning_at(courses, k, x)
    for c in range(len(rest)):
        rest[c] = sensitivity[0, c] - ratio[c] * wheel
        if slowing != 0.0:
            sensitivity[1, c] += (after - before) / slowing * (sensitivity[1, c] - ratio[c] * turn)
    return q, w, s


@njit
def axis_motion(
    knots: Array,
    courses: Array,
    flags: Ints,
    bounds: Ints,
    states: Array,
    p: Array,
    entries: tuple[Ints, Ints, Array],
    longest: float,
    found: tuple[Array, Array, Array],
) -> bool:
    """Angle of the axis, segment by segment, and its derivatives.

    knots (n,): instants, s. courses (n, 3, 4): from each knot on, coefficients of rising powers of the time since; see
    `COURSES`. flags (n,): 1 where the angle is read. bounds (k + 1,): first knot of each segment. states (k, 2):
    (q1, q1') at a segment's first knot. p (SIZE,), entries: as in `motor_motion.py`, with the place `GAIN`. longest:
    longest step, s. found: outputs (r,), rates (r,), slopes (r, m): derivatives by the two initial values, then by the
    unknowns. Returns whether the motion stayed finite.
    """
    outputs, rates, derivatives = found
    m = derivatives.shape[1]
    stages, sensitivity, rest = np.zeros((5, 2)), np.zeros((2, m)), np.zeros(m)
    row, slopes, ratio = np.zeros(SIZE + 1), (np.zeros((4, 2)), np.zeros((4, m))), np.zeros(m)
    kappa = p[A12] / p[A11]
    _fill_ratio(p, entries, ratio)
    r = 0
    for segment in range(len(bounds) - 1):
        k = bounds[segment]
        z, w = states[segment, 0], states[segment, 1] + kappa * courses[k, SPEED, 0]
        z += kappa * courses[k, WHEEL, 0]
        for c in range(m):
            sensitivity[0, c] = ratio[c] * courses[k, WHEEL, 0] + (1.0 if c == 0 else 0.0)
            sensitivity[1, c] = ratio[c] * courses[k, SPEED, 0] + (1.0 if c == 1 else 0.0)
        speed = states[segment, 1]
        s = 1 if speed > 0.0 else (-1 if speed < 0.0 else side_from_rest(states[segment, 0], courses, k, 0.0, p))
        q = states[segment, 0]
        if s == 0:
            for c in range(m):
                rest[c] = 1.0 if c == 0 else 0.0
        for k in range(bounds[segment], bounds[segment + 1]):
            wheel, turn = courses[k, WHEEL, 0], courses[k, SPEED, 0]
            if flags[k] != 0:
                outputs[r], rates[r] = (q, 0.0) if s == 0 else (z - kappa * wheel, w - kappa * turn)
                for c in range(m):
                    derivatives[r, c] = rest[c] if s == 0 else sensitivity[0, c] - ratio[c] * wheel
                r += 1
            if k + 1 == bounds[segment + 1]:
                break
            left, x, steps = knots[k + 1] - knots[k], 0.0, 0
            while left > 0.0:
                steps += 1
                if s == 0:
                    h = until_release(q, left, courses, k, x, p)
                    x, left = x + h, left - h
                    if left > 0.0:
                        s = side_from_rest(q, courses, k, x, p)
                        z, w = _freed(q, courses, k, x, p, rest, ratio, sensitivity)
                    if steps > MOST_STEPS:
                        return False
                    continue
                stages[0, 0], stages[0, 1] = z, w
                h = step_length(left, longest, z, w, s, courses, k, x, p)
                one_step(x, h, s, courses, k, p, stages)
                reversed_ = s * axis_speed(stages[4, 1], courses, k, x + h, p) < 0.0
                if reversed_:
                    h = until_reversal(x, h, s, courses, k, p, stages)
                for i in range(4):
                    at = x + (0.0 if i == 0 else (h if i == 3 else 0.5 * h))
                    _slopes_at(i, stages[i, 0], stages[i, 1], s, courses, k, at, p, row, entries, ratio, slopes)
                _carry(h, sensitivity, slopes)
                x, left = x + h, (left - h if left - h > 1e-15 else 0.0)
                z, w = stages[4, 0], stages[4, 1]
                if reversed_:
                    q, w, s = _reversed(z, w, s, courses, k, x, p, rest, ratio, sensitivity)
                if steps > MOST_STEPS or not abs(w) < 1e6:
                    return False
    return True
