"""A step of one run that holds a stop, a release or an edge of the dead zone: the changes are located in the series.

Between two changes the motion is the same Taylor series as in the lanes; where a speed passes zero, or the motor's
torque an edge of its dead zone, is a root of its polynomial. What goes on from there, `model.sticking` decides. What is
rarer, a release within the step or a turn there and back, is left to `advance` of the single run.
"""

from __future__ import annotations

import numpy as np

from swingid.model import parameters as at
from swingid.model.integrator import NOW, V1, V2, Mode
from swingid.model.integrator import Q1 as ANGLE
from swingid.model.integrator import Q2 as WHEEL_ANGLE
from swingid.model.motor import motor_branch
from swingid.model.sticking import mode_at_rest, side
from swingid.numerics.arrays import Array
from swingid.numerics.vectors import decay, njit_lane, njit_threads, sine_cosine
from swingid.simulation.ensemble import series
from swingid.simulation.ensemble.lanes import COMMAND, COSINE, FLAG, LANES, LEFT, Q1, Q2, SINE, U, Y
from swingid.simulation.ensemble.readings import Late, fill_alone
from swingid.simulation.ensemble.series import COS, CUBE, INVERSES, PEAK, SIN, SPEED, SQUARE, TERMS, WHEEL_SPEED

LAST = 1e-13
"""rad per step: what the last term of a series may be, so that the next is well below it."""

EASY = 1e-3
"""Share of LAST below which a part is far from too long."""

MOST_STEPS = 30
BEYOND = 1e-11
"""Of a step: how far behind an edge of the dead zone the motion goes on, so that it is on the other side for sure."""

SHORTEST = 1e-13
"""s: a part this short is left out."""

NONE, AXIS, WHEEL, EDGE, UNSURE = 0, 1, 2, 3, 4


@njit_lane
def mode_constants(
    mode: Mode, h: float, u: float, p: Array
) -> tuple[series.Axis, tuple[float, float], series.Mobility]:
    """What `expand` takes for a step of h (s) in a mode under the command u (V; N m), from p (SIZE,)."""
    s1, s2, branch = mode
    viscous, coulomb, static = p[at.VISCOUS_N], p[at.COULOMB_N], p[at.STATIC_N]
    if s1 > 0:
        viscous, coulomb, static = p[at.VISCOUS_P], p[at.COULOMB_P], p[at.STATIC_P]
    height, peak = 0.0, 0.0
    if p[at.STRIBECK_SPEED] > 0.0:
        height, peak = s1 * (static - coulomb), 1.0 / (p[at.STRIBECK_SPEED] * h) ** 2
    load = p[at.DIRECT] * u - p[at.OFFSET] - s1 * coulomb
    drive, drag = 0.0, p[at.GEAR] * p[at.GEAR] * p[at.F2] / h
    if branch != 0:
        drive = p[at.GEAR] * (p[at.ETA] * p[at.C1] * u - (p[at.D1] if branch > 0 else p[at.D2]))
        drag += p[at.GEAR] * p[at.ETA] * p[at.C2] / h
    m11, m12, m22 = 0.0, 0.0, 0.0
    if s1 != 0 and s2 != 0:
        scale = h * h / (p[at.A11] * p[at.A22] - p[at.A12] * p[at.A12])
        m11, m12, m22 = scale * p[at.A22], scale * p[at.A12], scale * p[at.A11]
    elif s1 != 0:
        m11 = h * h / p[at.A11]
    elif s2 != 0:
        m22 = h * h / p[at.A22]
    cubic = p[at.CUBIC] / (h * h * h)
    axis = (p[at.B], viscous / h, s1 * p[at.QUADRATIC] / (h * h), load, cubic, height, peak)
    return axis, (drive - s2 * p[at.GEAR] * p[at.F3], drag), (m11, m12, m22)


@njit_lane
def expand(a: Array, axis: series.Axis, wheel: tuple[float, float], mobility: series.Mobility) -> None:
    """Taylor's coefficients up to `TERMS`, of the speeds, into a from its first column.

    That has sine and cosine of q1, U and Y. Time counts in steps; axis, wheel and mobility as there.
    """
    gravity, viscous, quadratic, load1, cubic, height, peak = axis
    load2, drag = wheel
    m11, m12, m22 = mobility
    a[SQUARE, 0] = a[SPEED, 0] * a[SPEED, 0]
    if height != 0.0:
        a[PEAK, 0] = height * decay(peak * a[SQUARE, 0])
    a[CUBE, 0] = a[SPEED, 0] * a[SQUARE, 0]
    for k in range(TERMS):
        if k > 0:
            # what is newest comes last into each sum, so that the older products need not wait for it
            s, c, w, g = 0.0, 0.0, 0.0, 0.0
            for i in range(1, k):
                s += a[SPEED, i] * a[COS, k - 1 - i]
                c -= a[SPEED, i] * a[SIN, k - 1 - i]
                w += a[SPEED, i] * a[SPEED, k - i]
            a[SIN, k] = (s + a[SPEED, 0] * a[COS, k - 1]) * INVERSES[k]
            a[COS, k] = (c - a[SPEED, 0] * a[SIN, k - 1]) * INVERSES[k]
            a[SQUARE, k] = w + 2.0 * a[SPEED, 0] * a[SPEED, k]
            if height != 0.0:
                for i in range(k - 1, 0, -1):
                    g -= (k - i) * a[SQUARE, k - i] * a[PEAK, i]
                a[PEAK, k] = (g - k * a[SQUARE, k] * a[PEAK, 0]) * (peak * INVERSES[k])
            if cubic != 0.0:
                a[CUBE, k] = 0.0
                for i in range(k + 1):
                    a[CUBE, k] += a[SPEED, i] * a[SQUARE, k - i]
            load1, load2 = 0.0, 0.0
        r1 = load1 - gravity * a[SIN, k] - viscous * a[SPEED, k] - quadratic * a[SQUARE, k]
        if height != 0.0:
            r1 -= a[PEAK, k]
        if cubic != 0.0:
            r1 -= cubic * a[CUBE, k]
        r2 = load2 - drag * a[WHEEL_SPEED, k]
        a[SPEED, k + 1] = (m11 * r1 - m12 * r2) * INVERSES[k + 1]
        a[WHEEL_SPEED, k + 1] = (m22 * r2 - m12 * r1) * INVERSES[k + 1]


@njit_lane
def first_change(
    mode: Mode, u: Array, y: Array, ends: tuple[float, float], edges: tuple[float, float]
) -> tuple[int, float]:
    """(What changes first in a step, at which fraction of it): NONE at 1 where nothing does.

    u, y: series of the speeds, which are `ends` at the end. edges: speeds Y of the wheel between which the motor stays
    in its branch (rad per step).
    """
    s1, s2, _ = mode
    what, x = NONE, 1.0
    if s1 != 0:
        end = ends[0]
        if s1 * end < 0.0:
            if u[0] == 0.0:
                return UNSURE, 0.0
            what, x = AXIS, series.root(u, end, 0.0)
        elif s1 * (u[0] + u[1]) < 0.0:
            return UNSURE, 0.0
    end = ends[1]
    if s2 != 0:
        if s2 * end < 0.0:
            if y[0] == 0.0:
                return UNSURE, 0.0
            there = series.root(y, end, 0.0)
            if there < x:
                what, x = WHEEL, there
        elif s2 * (y[0] + y[1]) < 0.0:
            return UNSURE, 0.0
    for edge in edges:
        if (end - edge) * (y[0] - edge) < 0.0:
            there = series.root(y, end, edge)
            if there < x:
                what, x = EDGE, there
    return what, x


@njit_lane
def branch_edges(branch: int, h: float, u: float, p: Array) -> tuple[float, float]:
    """Speeds Y of the wheel (rad per step of h) at which the torque is at the edges of the motor's branch."""
    if p[at.C2] == 0.0 or (p[at.D1] == 0.0 and p[at.D2] == 0.0):
        return np.inf, np.inf
    upper = (p[at.C1] * u - p[at.D1] / p[at.ETA]) / p[at.C2] * h
    lower = (p[at.C1] * u - p[at.D2] / p[at.ETA]) / p[at.C2] * h
    if branch > 0:
        return upper, np.inf
    if branch < 0:
        return lower, np.inf
    return upper, lower


@njit_lane
def released(mode: Mode, a: Array, h: float, u: float, drive: float, p: Array) -> bool:
    """Whether what rests in a mode may be released within a step, by what friction must hold at its ends."""
    s1, s2, _ = mode
    a12 = p[at.A12] / (h * h)
    if s1 == 0:
        for k in range(2):
            dry = p[at.DIRECT] * u - p[at.B] * a[SIN, 0] - p[at.OFFSET] - a12 * series.grade(a[WHEEL_SPEED], float(k))
            if dry > p[at.STATIC_P] or dry < -p[at.STATIC_N]:
                return True
    if s2 == 0:
        for k in range(2):
            if abs(drive - a12 * series.grade(a[SPEED], float(k))) > p[at.WHEEL_STATIC]:
                return True
    return False


@njit_threads
def through(
    work: Array, a: Array, h: float, u: float, p: Array, parts: float, late: Late, i: int, at_step: tuple[int, int]
) -> float:
    """Move row NOW of `work` by up to h (s) under the command u through changes of mode; returns what is left (s).

    a (7, TERMS + 1): place for the series. parts: into how many parts h may have to be cut. late, i, at_step: readings
    of run i within the step, as of `fill_alone`.
    """
    left, part = h, h / parts
    speed, wheel_speed = a[SPEED], a[WHEEL_SPEED]
    for _ in range(MOST_STEPS):
        q1, v1, v2 = work[NOW, ANGLE], work[NOW, V1], work[NOW, V2]
        mode = (side(v1), side(v2), motor_branch(u, v2, p))
        if v1 == 0.0 or v2 == 0.0:
            mode = mode_at_rest(q1, v1, v2, 0.0, mode, u, p)
        a[SIN, 0], a[COS, 0] = sine_cosine(q1)
        part, last, drive = min(part, left), 0.0, 0.0
        for _ in range(series.MOST_TRIALS):
            axis, wheel, mobility = mode_constants(mode, part, u, p)
            speed[0], wheel_speed[0], drive = v1 * part, v2 * part, wheel[0]
            expand(a, axis, wheel, mobility)
            last = max(series.last_terms(speed), series.last_terms(wheel_speed), 1e-300)
            if last <= LAST:
                break
            part *= min(0.9, 0.9 * (LAST / last) ** INVERSES[TERMS + 1])
        if last > LAST or released(mode, a, part, u, drive, p):
            return left
        ends = series.value(speed, 1.0), series.value(wheel_speed, 1.0)
        what, x = first_change(mode, speed, wheel_speed, ends, branch_edges(mode[2], part, u, p))
        if what == UNSURE:
            return left
        if what == EDGE:
            x = min(x + BEYOND, 1.0)
        fill_alone(late, i, at_step, (1.0 - left / h, part * x / h, part / h), (q1, work[NOW, WHEEL_ANGLE]), a)
        work[NOW, ANGLE] += series.passed(speed, x)
        work[NOW, WHEEL_ANGLE] += series.passed(wheel_speed, x)
        if what != NONE:
            ends = series.value(speed, x), series.value(wheel_speed, x)
        work[NOW, V1] = 0.0 if what == AXIS else ends[0] / part
        work[NOW, V2] = 0.0 if what == WHEEL else ends[1] / part
        if what == NONE and part == left:
            return 0.0
        left -= part * x
        if left < SHORTEST:
            return 0.0
        part = left if last < EASY * LAST else part * 0.9 * (LAST / last) ** INVERSES[TERMS + 1]
    return left


@njit_threads
def redo(lane: Array, p: Array, h: float, work: Array, a: Array, late: Late, step: int, steps: int) -> bool:
    """Take the flagged steps of a block again, with each change located; whether something is left in LEFT (s).

    work (10, 5), a (7, TERMS + 1): places; late, step, steps: as of `readings.fill`.
    """
    some = False
    for i in range(LANES):
        lane[LEFT * LANES + i] = 0.0
        if lane[FLAG * LANES + i] == 0.0:
            continue
        work[NOW, ANGLE], work[NOW, V1] = lane[Q1 * LANES + i], lane[U * LANES + i] / h
        work[NOW, WHEEL_ANGLE], work[NOW, V2] = lane[Q2 * LANES + i], lane[Y * LANES + i] / h
        parts = lane[FLAG * LANES + i]
        left = through(work, a, h, lane[COMMAND * LANES + i], p[i], parts, late, i, (step, steps))
        lane[Q1 * LANES + i], lane[U * LANES + i] = work[NOW, ANGLE], work[NOW, V1] * h
        lane[Q2 * LANES + i], lane[Y * LANES + i] = work[NOW, WHEEL_ANGLE], work[NOW, V2] * h
        lane[SINE * LANES + i], lane[COSINE * LANES + i] = sine_cosine(work[NOW, ANGLE])
        if left > 0.0:
            lane[LEFT * LANES + i] = left
            some = True
    return some
