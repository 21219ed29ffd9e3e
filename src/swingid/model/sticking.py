"""Which of axis and wheel rests and which slides: a discrete state with a release torque.

Rest ends where the torque that friction would have to supply passes the static level; sliding ends where
the speed passes zero. At rest the mode is the candidate that is consistent with itself:
what rests needs no more than its static level, what slides accelerates towards its own side. For Coulomb
friction there is exactly one such mode (the mass matrix is positive definite); where static friction
exceeds sliding friction there can be two, and rest goes first.

Arguments as in `dynamics`; `work` (10, 5) is the integrator's array, whose rows `integrator` names.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from swingid.model.dynamics import accelerations, holding_torques
from swingid.model.friction import release_margin
from swingid.model.integrator import FIRST, LAST, NEW, NOW, Q1, V1, V2, Mode, Step, Z, derivative
from swingid.model.motor import branch_margin, motor_branch
from swingid.model.parameters import AXIS_STICKS, WHEEL_STATIC
from swingid.numerics.arrays import Array
from swingid.numerics.compiled import (
    FLOAT,
    INT,
    MATRIX,
    VECTOR,
    KernelPointer,
    njit,
    njit_called,
    njit_inlined,
    tuple_of,
)

ROUNDING = 1e-9  # rad/s^2: an acceleration of the wrong side, but below this, is rounding
RESOLUTION = 1e-14  # s: reversals and releases are located to this
MOST_TRIALS = 200


@njit_inlined
def wheel_margin(hold: float, p: Array) -> float:
    """How far (N m) a resting wheel is from release when friction must supply `hold` (N m)."""
    return float(p[WHEEL_STATIC] - abs(hold))


@njit_inlined
def margin(
    work: Array,
    state: int,
    slope: int,
    mode: Mode,
    u: float,
    p: Array,
) -> float:
    """Smallest of the quantities that must not be negative for `mode` to hold at row `state`, y' in `slope`.

    Speeds times their side, distances to release, distance to the edge of the dead zone.
    """
    v1, v2 = work[state, V1], work[state, V2]
    s1, s2, branch = mode
    least = branch_margin(u, v2, branch, p)
    if s1 != 0:
        least = min(least, s1 * v1)
    if s2 != 0:
        least = min(least, s2 * v2)
    if s1 == 0 or s2 == 0:
        hold1, hold2 = holding_torques(work[state, Q1], v2, work[slope, V1], work[slope, V2], s2, branch, u, p)
        if s1 == 0:
            least = min(least, release_margin(hold1, work[state, Q1], p))
        if s2 == 0:
            least = min(least, wheel_margin(hold2, p))
    return float(least)


@njit_called
def agrees(
    q1: float, v1: float, v2: float, z: float, s1: int, s2: int, branch: int, u: float, p: Array, slack: float
) -> bool:
    """Return whether the mode (s1, s2, branch) agrees with itself, for those of axis and wheel whose speed is exactly
    0.

    slack (rad/s²): an acceleration of the wrong side up to this counts as 0.
    """
    a1, a2 = accelerations(q1, v1, v2, z, s1, s2, branch, u, p)
    hold1, hold2 = holding_torques(q1, v2, a1, a2, s2, branch, u, p)
    if v1 == 0.0:
        if s1 == 0 and (p[AXIS_STICKS] == 0.0 or release_margin(hold1, q1, p) < 0.0):
            return False
        if s1 != 0 and s1 * a1 < -slack:
            return False
    if v2 == 0.0:
        if s2 == 0 and (p[WHEEL_STATIC] == 0.0 or wheel_margin(hold2, p) < 0.0):
            return False
        if s2 != 0 and s2 * a2 < -slack:
            return False
    return True


@njit_called
def mode_at_rest(q1: float, v1: float, v2: float, z: float, moving: Mode, u: float, p: Array) -> Mode:
    """The mode in which what has no speed rests, or goes to a side; `moving` has a 0 for each such side.

    A mode that agrees exactly comes first: the accelerations of a decay that has nearly ended are as small as
    `ROUNDING`, and the wrong side would end at once, over and over. Should no mode agree, what has no speed rests, or
    goes where its load points.
    """
    side1, side2, branch = moving
    for slack in (0.0, ROUNDING):
        for i in range(3 if side1 == 0 else 1):
            s1 = side1 if side1 != 0 else (i if i < 2 else -1)
            for j in range(3 if side2 == 0 and p[WHEEL_STATIC] < math.inf else 1):
                s2 = side2 if side2 != 0 else (j if j < 2 else -1)
                if agrees(q1, v1, v2, z, s1, s2, branch, u, p, slack):
                    return s1, s2, branch
    hold1, hold2 = holding_torques(q1, v2, 0.0, 0.0, side2, branch, u, p)
    if side1 == 0 and (p[AXIS_STICKS] == 0.0 or release_margin(hold1, q1, p) < 0.0):
        side1 = 1 if hold1 > 0.0 else -1
    if side2 == 0 and wheel_margin(hold2, p) < 0.0:
        side2 = 1 if hold2 > 0.0 else -1
    return side1, side2, branch


@njit_inlined
def choose_mode(work: Array, u: float, p: Array) -> Mode:
    """The mode of row NOW under the command u: sides of what moves, rest or side of what has no speed."""
    v1, v2 = work[NOW, V1], work[NOW, V2]
    moving = (side(v1), side(v2), motor_branch(u, v2, p))
    if v1 == 0.0 or v2 == 0.0:
        return mode_at_rest(work[NOW, Q1], v1, v2, work[NOW, Z], moving, u, p)
    return moving


@njit
def begin_mode(work: Array, u: float, p: Array) -> Mode:
    """The mode of row NOW under the command u, as of `choose_mode`; row FIRST becomes y' in it."""
    mode = choose_mode(work, u, p)
    derivative(work, NOW, FIRST, mode, u, p)
    return mode


Begin = Callable[[Array, float, Array], Mode]
BEGIN_KERNEL = KernelPointer(begin_mode, tuple_of(INT, 3)(MATRIX, FLOAT, VECTOR))


@njit_inlined
def side(v: float) -> int:
    """Sign of a speed v (any unit): 1, -1 or 0, where 0 is exactly zero."""
    if v > 0.0:
        return 1
    return -1 if v < 0.0 else 0


@njit_inlined
def stop_reversed(work: Array, mode: Mode) -> float:
    """Set speeds of row NOW that have passed zero against their side to exactly zero.

    Returns the first that has: 1 the axis', 2 the wheel's, 0 none.
    """
    passed = 0.0
    if mode[1] * work[NOW, V2] < 0.0:
        work[NOW, V2], passed = 0.0, 2.0
    if mode[0] * work[NOW, V1] < 0.0:
        work[NOW, V1], passed = 0.0, 1.0
    return passed


@njit_inlined
def dip(v: float, a: float, vh: float, ah: float, h: float) -> float:
    """Return where in a step of h (s) a speed that is positive at both ends is lowest, if below zero; else h.

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


@njit_inlined
def first_dip(work: Array, h: float, mode: Mode) -> float:
    """Time into the step (s) at which a speed has gone against its side unseen at the ends; h if none has."""
    s1, s2, low = mode[0], mode[1], h
    if s1 != 0:
        low = min(low, dip(s1 * work[NOW, V1], s1 * work[FIRST, V1], s1 * work[NEW, V1], s1 * work[LAST, V1], h))
    if s2 != 0:
        low = min(low, dip(s2 * work[NOW, V2], s2 * work[FIRST, V2], s2 * work[NEW, V2], s2 * work[LAST, V2], h))
    return low


@njit_called
def locate(step: Step, work: Array, h: float, mode: Mode, u: float, p: Array) -> float:
    """Length (s) of the step from row NOW after which `mode` has only just ceased to hold; leaves row NEW there.

    `h` is a length after which it does not hold, already in row NEW. Regula falsi (Illinois) on the length of
    a whole step, so the located state is as accurate as any; bisection while the near end is on the brink.
    """
    low, high = 0.0, h
    at_low, at_high = margin(work, NOW, FIRST, mode, u, p), margin(work, NEW, LAST, mode, u, p)
    last = 0
    for trial in range(MOST_TRIALS):
        if high - low <= RESOLUTION:
            break
        middle = 0.5 * (low + high)
        if at_low > 0.0 and trial % 4 != 3:
            middle = (low * at_high - high * at_low) / (at_high - at_low)
            middle = min(max(middle, low + 0.25 * RESOLUTION), high - 0.25 * RESOLUTION)
        step(work, middle, mode, u, p)
        at_middle = margin(work, NEW, LAST, mode, u, p)
        if at_middle < 0.0:
            high, at_high = middle, at_middle
            at_low *= 0.5 if last > 0 else 1.0
            last = 1
        else:
            low, at_low = middle, at_middle
            at_high *= 0.5 if last < 0 else 1.0
            last = -1
    step(work, high, mode, u, p)
    return high
