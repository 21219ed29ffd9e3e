"""Equation (I) alone, its input given as cubics from knot to knot: the measured wheel, a torque or nothing.

With κ = a12/a11 and z = q1 + κ q2, (I) reads a11 z'' = −a12 τ − b sin q1 − F(q1'), q1 = z − κ q2, q1' = z' − κ q2': the
measured wheel enters by its angle, not by its acceleration (except while the axis rests). A torque τ acts as the
acceleration of a wheel with a12 = −1 does. One classical Runge–Kutta step, and the mode that it is in, in the place of
those of the twin (`model.integrator.step`, `model.sticking.begin_mode`): a state has in the place of q2' the integral
of q2'' + τ, in that of z the time since the knot.
"""

from __future__ import annotations

from swingid.model.dynamics import axis_load, sliding_load
from swingid.model.friction import release_margin
from swingid.model.integrator import FIRST, LAST, NEW, NOW, Q1, Q2, STATES, STEP_KERNEL, V1, V2, Mode, Z
from swingid.model.parameters import A11, A12, AXIS_STICKS, SIZE, STRIBECK_SPEED
from swingid.model.sticking import BEGIN_KERNEL, side
from swingid.numerics.arrays import Array
from swingid.numerics.compiled import KernelPointer, njit, njit_inlined, place

COURSES = 3
WHEEL, SPEED, TORQUE = SIZE, SIZE + 4, SIZE + 8
"""Places after the rig's constants of the cubics from a knot on, coefficients of rising powers of the time since: of
the wheel's angle (from the segment's start, rad), of its speed, and of the torque (N m)."""

NONE = place(0)
"""Side and branch of a wheel that is not simulated."""

PEAK_SHARE = 0.25
"""Change of speed in one step, in Stribeck speeds, while the speed is below four of them."""


@njit_inlined
def course_at(which: int, x: float, p: Array) -> float:
    """A cubic at x s past the knot."""
    return float(p[which] + x * (p[which + 1] + x * (p[which + 2] + x * p[which + 3])))


@njit_inlined
def pull_at(x: float, p: Array) -> float:
    """What multiplies a12 in (I): q2'' of the wheel's speed course, or the torque."""
    turning = p[SPEED + 1] + x * (2.0 * p[SPEED + 2] + 3.0 * x * p[SPEED + 3])
    return float(turning + course_at(TORQUE, x, p))


@njit
def axis_step(work: Array, h: float, mode: Mode, u: float, p: Array) -> float:
    """Step as `integrator.step`; the error estimate allows a step to pass a good part of Stribeck's peak, or any
    length.
    """
    error, s = 0.0, mode[0]
    if p[STRIBECK_SPEED] > 0.0 and abs(work[NOW, V1]) < 4.0 * p[STRIBECK_SPEED]:
        change = h * abs(work[FIRST, V1]) / (PEAK_SHARE * p[STRIBECK_SPEED])
        error = change**5 if h > 1e-5 else 0.0
    x, kappa = work[NOW, Z], p[A12] / p[A11]
    z = work[NOW, Q1] + kappa * course_at(WHEEL, x, p)
    w = work[NOW, V1] + kappa * course_at(SPEED, x, p)
    angle, speed, rate, gained, risen, t = z, w, 0.0, 0.0, 0.0, x
    for stage in range(5 if s != 0 else 0):
        torque = -p[A12] * course_at(TORQUE, t, p)
        q, v = angle - kappa * course_at(WHEEL, t, p), speed - kappa * course_at(SPEED, t, p)
        rate = sliding_load(q, v, s, 0.0, torque, p) / p[A11]
        weight = 2.0 if stage == 1 or stage == 2 else 1.0
        gained, risen = gained + weight * speed, risen + weight * rate
        if stage < 3:
            ahead = 0.5 * h if stage < 2 else h
            angle, speed, t = z + ahead * speed, w + ahead * rate, x + ahead
        elif stage == 3:
            angle, speed = z + h / 6.0 * gained, w + h / 6.0 * risen
    for i in range(STATES):
        work[NEW, i], work[LAST, i] = work[NOW, i], 0.0
    work[NEW, Z] = x + h
    work[NEW, V2] += h / 6.0 * (pull_at(x, p) + 4.0 * pull_at(x + 0.5 * h, p) + pull_at(x + h, p))
    work[LAST, V2] = pull_at(x + h, p)
    if s != 0:
        work[NEW, Q1] = angle - kappa * course_at(WHEEL, x + h, p)
        work[NEW, V1] = speed - kappa * course_at(SPEED, x + h, p)
        work[LAST, V1] = rate + kappa * (course_at(TORQUE, x + h, p) - work[LAST, V2])
    return error


@njit
def axis_begin(work: Array, u: float, p: Array) -> Mode:
    """Begin as `sticking.begin_mode`: the side to which the axis goes, 0 where friction holds it."""
    q, v, pull = work[NOW, Q1], work[NOW, V1], pull_at(work[NOW, Z], p)
    s = side(v)
    if s == 0:
        load = axis_load(q, 0.0, p) - p[A12] * pull
        if p[AXIS_STICKS] == 0.0 or release_margin(load, q, p) < 0.0:
            s = 1 if load > 0.0 else -1
    work[FIRST, Q1], work[FIRST, Q2], work[FIRST, Z], work[FIRST, V2] = v, 0.0, 0.0, pull
    work[FIRST, V1] = sliding_load(q, v, s, 0.0, -p[A12] * pull, p) / p[A11] if s != 0 else 0.0
    return s, NONE, NONE


AXIS_STEP = KernelPointer(axis_step, STEP_KERNEL.signature())
AXIS_BEGIN = KernelPointer(axis_begin, BEGIN_KERNEL.signature())
