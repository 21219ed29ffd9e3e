"""A step of one run that holds a stop, a release or an edge of the dead zone: the changes are located in the series.

Between two changes the motion is the same Taylor series as in the lanes; where a speed passes zero, or the motor's
torque an edge of its dead zone, is a root of its polynomial. What goes on from there, `model.sticking` decides. What is
rarer, a release within the step or a turn there and back, goes to `advance` of the single run.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from swingid.model.integrator import NOW, V1, V2, Mode, Z
from swingid.model.integrator import Q1 as ANGLE
from swingid.model.integrator import Q2 as WHEEL_ANGLE
from swingid.model.motion import LONGEST, advance
from swingid.model.motor import motor_branch
from swingid.model.parameters import (
    A11,
    A12,
    A22,
    C1,
    C2,
    COULOMB_N,
    COULOMB_P,
    D1,
    D2,
    DIRECT,
    ETA,
    F2,
    F3,
    GEAR,
    OFFSET,
    QUADRATIC,
    STATIC_N,
    STATIC_P,
    STRIBECK_SPEED,
    VISCOUS_N,
    VISCOUS_P,
    WHEEL_STATIC,
    B,
)  # fmt: skip
from swingid.model.sticking import mode_at_rest, side
from swingid.simulate.ensemble.lane_functions import njit_lane, njit_threads, sine_cosine
from swingid.simulate.ensemble.lanes import COMMAND, FLAG, LANES, Q1, Q2, U, Y
from swingid.simulate.ensemble.series import Axis, Coefficients, Mobility, coefficients, moved, slope, turned

Array = NDArray[np.float64]

SMALL = 1e-13
"""rad per step: a fifth coefficient beyond this shows that the step is too long for the series."""

MOST_STEPS, MOST_TRIALS = 30, 60
BEYOND = 1e-11
"""Of a step: how far behind an edge of the dead zone the motion goes on, so that it is on the other side for sure."""

NONE, AXIS, WHEEL, EDGE, UNSURE = 0, 1, 2, 3, 4


@njit_lane
def mode_constants(mode: Mode, h: float, u: float, p: Array) -> tuple[Axis, tuple[float, float], Mobility]:
    """What `coefficients` takes for a step of h (s) in a mode under the command u (V; N m), from p (SIZE,)."""
    s1, s2, branch = mode
    viscous, coulomb, static = p[VISCOUS_N], p[COULOMB_N], p[STATIC_N]
    if s1 > 0:
        viscous, coulomb, static = p[VISCOUS_P], p[COULOMB_P], p[STATIC_P]
    height, peak = 0.0, 0.0
    if p[STRIBECK_SPEED] > 0.0:
        height, peak = s1 * (static - coulomb), 1.0 / (p[STRIBECK_SPEED] * h) ** 2
    load = p[DIRECT] * u - p[OFFSET] - s1 * coulomb
    drive, drag = 0.0, p[GEAR] * p[GEAR] * p[F2] / h
    if branch != 0:
        drive = p[GEAR] * (p[ETA] * p[C1] * u - (p[D1] if branch > 0 else p[D2]))
        drag += p[GEAR] * p[ETA] * p[C2] / h
    m11, m12, m22 = 0.0, 0.0, 0.0
    if s1 != 0 and s2 != 0:
        scale = h * h / (p[A11] * p[A22] - p[A12] * p[A12])
        m11, m12, m22 = scale * p[A22], scale * p[A12], scale * p[A11]
    elif s1 != 0:
        m11 = h * h / p[A11]
    elif s2 != 0:
        m22 = h * h / p[A22]
    axis = (p[B], viscous / h, s1 * p[QUADRATIC] / (h * h), load, height, peak)
    return axis, (drive - s2 * p[GEAR] * p[F3], drag), (m11, m12, m22)


@njit_lane
def root(v: float, k: Coefficients, level: float) -> float:
    """Fraction of a step at which the speed v + k1 x + ... passes `level`, which lies between its ends' values."""
    low, high, at_low = 0.0, 1.0, v - level
    x = at_low / (v - moved(v, k, 1.0))
    for _ in range(MOST_TRIALS):
        value = moved(v, k, x) - level
        if value * at_low > 0.0:
            low = x
        else:
            high = x
        grade = slope(k, x)
        following = x - value / grade if grade != 0.0 else 0.5 * (low + high)
        if not low < following < high:
            following = 0.5 * (low + high)
        if abs(following - x) < 1e-14:
            return following
        x = following
    return x


@njit_lane
def first_change(
    mode: Mode, u: float, y: float, cu: Coefficients, cy: Coefficients, edges: tuple[float, float]
) -> tuple[int, float]:
    """(What changes first in a step, at which fraction of it): NONE at 1 where nothing does.

    edges: speeds Y of the wheel between which the motor stays in its branch (rad per step).
    """
    s1, s2, _ = mode
    what, x = NONE, 1.0
    if s1 != 0:
        if s1 * moved(u, cu, 1.0) < 0.0:
            if u == 0.0:
                return UNSURE, 0.0
            what, x = AXIS, root(u, cu, 0.0)
        elif s1 * (u + cu[0]) < 0.0:
            return UNSURE, 0.0
    y_end = moved(y, cy, 1.0)
    if s2 != 0:
        if s2 * y_end < 0.0:
            if y == 0.0:
                return UNSURE, 0.0
            there = root(y, cy, 0.0)
            if there < x:
                what, x = WHEEL, there
        elif s2 * (y + cy[0]) < 0.0:
            return UNSURE, 0.0
    for edge in edges:
        if (y_end - edge) * (y - edge) < 0.0:
            there = root(y, cy, edge)
            if there < x:
                what, x = EDGE, there
    return what, x


@njit_lane
def branch_edges(branch: int, h: float, u: float, p: Array) -> tuple[float, float]:
    """Speeds Y of the wheel (rad per step of h) at which the torque is at the edges of the motor's branch."""
    if p[C2] == 0.0 or (p[D1] == 0.0 and p[D2] == 0.0):
        return np.inf, np.inf
    upper = (p[C1] * u - p[D1] / p[ETA]) / p[C2] * h
    lower = (p[C1] * u - p[D2] / p[ETA]) / p[C2] * h
    if branch > 0:
        return upper, np.inf
    if branch < 0:
        return lower, np.inf
    return upper, lower


@njit_lane
def released(
    mode: Mode, sine: float, cu: Coefficients, cy: Coefficients, h: float, u: float, drive: float, p: Array
) -> bool:
    """Whether what rests in a mode may be released within a step, by what friction must hold at its ends."""
    s1, s2, _ = mode
    a12 = p[A12] / (h * h)
    if s1 == 0:
        for k in range(2):
            dry = p[DIRECT] * u - p[B] * sine - p[OFFSET] - a12 * slope(cy, float(k))
            if dry > p[STATIC_P] or dry < -p[STATIC_N]:
                return True
    if s2 == 0:
        for k in range(2):
            if abs(drive - a12 * slope(cu, float(k))) > p[WHEEL_STATIC]:
                return True
    return False


@njit_threads
def through(work: Array, h: float, u: float, p: Array) -> float:
    """Move row NOW of `work` by up to h (s) under the command u through changes of mode; returns what is left (s)."""
    left = h
    for _ in range(MOST_STEPS):
        q1, v1, v2 = work[NOW, ANGLE], work[NOW, V1], work[NOW, V2]
        mode = (side(v1), side(v2), motor_branch(u, v2, p))
        if v1 == 0.0 or v2 == 0.0:
            mode = mode_at_rest(q1, v1, v2, 0.0, mode, u, p)
        sine, cosine = sine_cosine(q1)
        part = left
        for _ in range(MOST_TRIALS):
            axis, wheel, mobility = mode_constants(mode, part, u, p)
            x_u, x_y = v1 * part, v2 * part
            cu, cy = coefficients(sine, cosine, x_u, x_y, axis, wheel, mobility, 1)
            last = max(abs(cu[4]), abs(cy[4]))
            if last <= SMALL:
                break
            part *= min(0.9, 0.9 * (SMALL / last) ** (1 / 6))  # the fifth coefficient goes with the step's sixth power
        if last > SMALL or released(mode, sine, cu, cy, part, u, wheel[0], p):
            return left
        what, x = first_change(mode, x_u, x_y, cu, cy, branch_edges(mode[2], part, u, p))
        if what == UNSURE:
            return left
        if what == EDGE:
            x = min(x + BEYOND, 1.0)
        work[NOW, ANGLE] += turned(x_u, cu, x)
        work[NOW, WHEEL_ANGLE] += turned(x_y, cy, x)
        work[NOW, V1] = 0.0 if what == AXIS else moved(x_u, cu, x) / part
        work[NOW, V2] = 0.0 if what == WHEEL else moved(x_y, cy, x) / part
        if what == NONE and part == left:
            return 0.0
        left -= part * x
        if left < 1e-13:
            return left
    return left


@njit_threads
def redo(
    lane: Array, p: Array, h: float, work: Array, nothing: Array, nowhere: Array, counts: NDArray[np.int64]
) -> None:
    """Take the flagged steps of a block again, with each change located."""
    for i in range(LANES):
        if lane[FLAG * LANES + i] == 0.0:
            continue
        command = lane[COMMAND * LANES + i]
        work[NOW, ANGLE], work[NOW, V1] = lane[Q1 * LANES + i], lane[U * LANES + i] / h
        work[NOW, WHEEL_ANGLE], work[NOW, V2] = lane[Q2 * LANES + i], lane[Y * LANES + i] / h
        work[NOW, Z] = 0.0
        left = through(work, h, command, p[i])
        if left > 0.0:
            advance(0.0, left, command, work, min(left, LONGEST), p[i], nothing, nowhere, counts)
        lane[Q1 * LANES + i], lane[U * LANES + i] = work[NOW, ANGLE], work[NOW, V1] * h
        lane[Q2 * LANES + i], lane[Y * LANES + i] = work[NOW, WHEEL_ANGLE], work[NOW, V2] * h
