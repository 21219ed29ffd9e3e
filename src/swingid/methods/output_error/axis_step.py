"""One step of the axis alone under a measured wheel, a torque or nothing; where it stops, is held and is released."""

from __future__ import annotations

import math

from swingid.model.dynamics import held_load, sliding_load
from swingid.model.friction import release_margin
from swingid.model.parameters import A11, A12, AXIS_STICKS, STRIBECK_SPEED
from swingid.numerics.arrays import Array
from swingid.numerics.compiled import njit_inlined

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
