"""Which of axis and wheel rests and which slides: a discrete state with a release torque.

Rest ends where the torque that friction would have to supply passes the static level; sliding ends where
the speed passes zero. At rest the mode is found by asking every candidate whether it agrees with itself:
what rests needs no more than its static level, what slides accelerates towards its own side. For Coulomb
friction there is exactly one such mode (the mass matrix is positive definite); where static friction
exceeds sliding friction there can be two, and rest goes first.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from swingid.model.dynamics import accelerations, holding_torques
from swingid.model.friction import release_margin
from swingid.model.integrator import BRANCH, FIRST, LAST, NEW, Q1, S1, S2, V1, V2, Z, step
from swingid.model.motor import branch_margin, motor_branch
from swingid.model.parameters import AXIS_STICKS, WHEEL_STATIC
from swingid.numerics.compiled import njit

ROUNDING = 1e-9  # rad/s^2: an acceleration of the wrong side, but below this, is rounding
RESOLUTION = 1e-14  # s: reversals and releases are located to this
MOST_TRIALS = 200


@njit
def wheel_margin(hold: float, p: NDArray[np.float64]) -> float:
    """How far (N m) a resting wheel is from release when friction must supply `hold` (N m)."""
    return float(p[WHEEL_STATIC] - abs(hold))


@njit
def margin(
    y: NDArray[np.float64],
    slope: NDArray[np.float64],
    mode: NDArray[np.int64],
    u: float,
    p: NDArray[np.float64],
) -> float:
    """Smallest of the quantities that must not be negative for `mode` to hold at y with y' = `slope`.

    Speeds times their side, distances to release, distance to the edge of the dead zone.
    """
    least = branch_margin(u, y[V2], mode[BRANCH], p)
    if mode[S1] != 0:
        least = min(least, mode[S1] * y[V1])
    if mode[S2] != 0:
        least = min(least, mode[S2] * y[V2])
    if mode[S1] == 0 or mode[S2] == 0:
        hold1, hold2 = holding_torques(y[Q1], y[V2], slope[V1], slope[V2], mode[S2], mode[BRANCH], u, p)
        if mode[S1] == 0:
            least = min(least, release_margin(hold1, p))
        if mode[S2] == 0:
            least = min(least, wheel_margin(hold2, p))
    return float(least)


@njit
def agrees(y: NDArray[np.float64], s1: int, s2: int, branch: int, u: float, p: NDArray[np.float64]) -> bool:
    """Whether a mode agrees with itself at y, for those of axis and wheel that have no speed."""
    a1, a2 = accelerations(y[Q1], y[V1], y[V2], y[Z], s1, s2, branch, u, p)
    hold1, hold2 = holding_torques(y[Q1], y[V2], a1, a2, s2, branch, u, p)
    if y[V1] == 0.0:
        if s1 == 0 and (p[AXIS_STICKS] == 0.0 or release_margin(hold1, p) < 0.0):
            return False
        if s1 != 0 and s1 * a1 < -ROUNDING:
            return False
    if y[V2] == 0.0:
        if s2 == 0 and (p[WHEEL_STATIC] == 0.0 or wheel_margin(hold2, p) < 0.0):
            return False
        if s2 != 0 and s2 * a2 < -ROUNDING:
            return False
    return True


@njit
def choose_mode(y: NDArray[np.float64], mode: NDArray[np.int64], u: float, p: NDArray[np.float64]) -> None:
    """Set `mode` for the state y under the command u: sides of what moves, rest or side of what has no speed.

    Should no mode agree (rounding), what has no speed is taken to rest, or to go where its load points.
    """
    branch = motor_branch(u, y[V2], p)
    side1, side2 = int(np.sign(y[V1])), int(np.sign(y[V2]))
    mode[S1], mode[S2], mode[BRANCH] = side1, side2, branch
    if side1 != 0 and side2 != 0:
        return
    for i in range(3 if side1 == 0 else 1):
        s1 = side1 if side1 != 0 else (i if i < 2 else -1)
        for j in range(3 if side2 == 0 and p[WHEEL_STATIC] < math.inf else 1):
            s2 = side2 if side2 != 0 else (j if j < 2 else -1)
            if agrees(y, s1, s2, branch, u, p):
                mode[S1], mode[S2] = s1, s2
                return
    hold1, hold2 = holding_torques(y[Q1], y[V2], 0.0, 0.0, side2, branch, u, p)
    if side1 == 0 and (p[AXIS_STICKS] == 0.0 or release_margin(hold1, p) < 0.0):
        mode[S1] = 1 if hold1 > 0.0 else -1
    if side2 == 0 and wheel_margin(hold2, p) < 0.0:
        mode[S2] = 1 if hold2 > 0.0 else -1


@njit
def stop_reversed(y: NDArray[np.float64], mode: NDArray[np.int64]) -> None:
    """Set speeds that have passed zero against their side to exactly zero."""
    if mode[S1] * y[V1] < 0.0:
        y[V1] = 0.0
    if mode[S2] * y[V2] < 0.0:
        y[V2] = 0.0


@njit
def dip(v: float, a: float, vh: float, ah: float, h: float) -> float:
    """Where in a step of h (s) a speed that is positive at both ends is lowest, if below zero there; else h.

    From the cubic through speed and acceleration at both ends: a reversal there and back again.
    """
    if a >= 0.0 or ah <= 0.0:
        return h
    # v + a t + c2 t^2 + c3 t^3; its slope has one root in the step, as the ends' slopes differ in sign.
    c2 = (3.0 * (vh - v) / h - 2.0 * a - ah) / h
    c3 = (2.0 * (v - vh) / h + a + ah) / (h * h)
    low = -a / (c2 + math.sqrt(max(c2 * c2 - 3.0 * c3 * a, 0.0)))
    if 0.0 < low < h and v + low * (a + low * (c2 + low * c3)) < 0.0:
        return low
    return h


@njit
def first_dip(y: NDArray[np.float64], h: float, mode: NDArray[np.int64], work: NDArray[np.float64]) -> float:
    """Time into the step (s) at which a speed has gone against its side unseen at the ends; h if none has."""
    s1, s2, k, kh, new = mode[S1], mode[S2], work[FIRST], work[LAST], work[NEW]
    low = h
    if s1 != 0:
        low = min(low, dip(s1 * y[V1], s1 * k[V1], s1 * new[V1], s1 * kh[V1], h))
    if s2 != 0:
        low = min(low, dip(s2 * y[V2], s2 * k[V2], s2 * new[V2], s2 * kh[V2], h))
    return low


@njit
def locate(
    y: NDArray[np.float64],
    h: float,
    mode: NDArray[np.int64],
    u: float,
    p: NDArray[np.float64],
    work: NDArray[np.float64],
) -> float:
    """Length (s) of the step from y after which `mode` has only just ceased to hold; the state in work[NEW].

    `h` is a length after which it does not hold. Regula falsi (Illinois) on the length of a whole step, so
    the located state is as accurate as any; bisection while the margin at the near end is not yet positive.
    """
    low, high = 0.0, h
    at_low, at_high = margin(y, work[FIRST], mode, u, p), margin(work[NEW], work[LAST], mode, u, p)
    last = 0
    for trial in range(MOST_TRIALS):
        if high - low <= RESOLUTION:
            break
        middle = 0.5 * (low + high)
        if at_low > 0.0 and trial % 4 != 3:
            middle = (low * at_high - high * at_low) / (at_high - at_low)
            middle = min(max(middle, low + 0.25 * RESOLUTION), high - 0.25 * RESOLUTION)
        step(y, middle, mode, u, p, work)
        at_middle = margin(work[NEW], work[LAST], mode, u, p)
        if at_middle < 0.0:
            high, at_high = middle, at_middle
            at_low *= 0.5 if last > 0 else 1.0
            last = 1
        else:
            low, at_low = middle, at_middle
            at_high *= 0.5 if last < 0 else 1.0
            last = -1
    step(y, high, mode, u, p, work)
    return high
