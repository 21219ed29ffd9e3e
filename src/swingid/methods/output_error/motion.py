"""Axis and wheel with exact sensitivities: equations (I) and (II), every stop, release and reversal.

The state moves as in the digital twin (`swingid.model.motion`), step by step, each within one mode: under the held
voltage by the twin's own step, with another input by that of `axis_motion`; a wheel on a measured axis is kicked by it.
These steps are noted, and the sensitivities S follow along them: S' = (∂f/∂x) S + ∂f/∂θ. Where a step ends because a
speed passes zero, the slope f jumps, and with it S (the saltation): at the reversal of a speed v at t*, ∂t*/∂θ =
−S_v/v'⁻, so S⁺ = S⁻ + (f⁺ − f⁻) S_v/v'⁻. At the edge of the dead zone and at a release f is continuous, and so is S.

The steps do not depend on the unknowns, so further sensitivities of the same motion need no second simulation.
"""

from __future__ import annotations

import math

import numpy as np

from swingid.methods.output_error.partials import (
    mass_rows,
    motor_row,
    sliding_row,
    sliding_slopes,
)
from swingid.model import motion as noted
from swingid.model.integrator import NOW, Q1, Q2, ROWS, STATES, V1, V2, Step, Z
from swingid.model.motion import COUNTS, LONGEST, NOTES, advanced
from swingid.model.parameters import A11, A12, A22, C2, ETA, F2, GEAR, SIZE
from swingid.model.sticking import Begin
from swingid.numerics.arrays import Array, Ints
from swingid.numerics.compiled import njit, njit_inlined, place

READ_ANGLE, READ_WHEEL = 1, 2
"""Bits of `flags`: the angle, the wheel's angle is read at this knot."""

PLAIN = 2
"""Columns of `inputs` that every motion has: the command, and the change of the axis' speed (rad/s) by a kick."""

WIDEST, BLOCK = 64, 10
"""Most columns of sensitivities at a time. They lie in ten rows of this length: S (4, m) of (q1, q1', q2, q2'), then
∂r/∂θ of equations (I) and (II) at begin, middle and end of a step; a fixed length lets the compiler use vectors."""

PASSED_PEAK = 40.0
"""Square of the speed over that of a peak from which nothing of it is left."""

NEAR = 0.1
"""Turn (rad) up to which these series of sine and cosine are exact."""

NONE = place(0)
"""A number of the type that the kernels compute, so that they are compiled for one type only."""


@njit
def motion_steps(
    step: Step,
    begin: Begin,
    knots: Array,
    inputs: Array,
    flags: Ints,
    bounds: Ints,
    states: Array,
    p: Array,
    nodes: Array,
    begins: Ints,
) -> float:
    """The steps of a motion, segment by segment, into the rows of `nodes` (n, FIELDS) of `model.motion`.

    step, begin: `STEP_KERNEL` and `BEGIN_KERNEL` of the model, or those of `axis_motion`.
    knots (n,): instants at which a voltage begins or an angle is read, s. inputs (n, c): voltage from each knot on, V,
    and kick at it; what follows becomes the tail of p. flags (n,): READ_ANGLE | READ_WHEEL. bounds (k + 1,): first knot
    of each segment. states (k, 4): (q1, q1', q2, q2') at a segment's first knot. p (SIZE + c − 2,): the rig's
    constants. begins (k + 1,) becomes the first row of each segment and the number of rows. Returns `DIVERGED`, `FULL`,
    or a positive number.
    """
    work, counts, tried = np.zeros((ROWS, STATES)), np.zeros(COUNTS, dtype=np.int64), LONGEST
    instants, seen, tail = np.zeros(0), np.zeros((0, STATES)), inputs.shape[1] - PLAIN
    for segment in range(len(bounds) - 1):
        work[NOW, Q1], work[NOW, V1] = states[segment, 0], states[segment, 1]
        work[NOW, Q2], work[NOW, V2], work[NOW, Z] = states[segment, 2], states[segment, 3], 0.0
        tried, begins[segment] = LONGEST, counts[NOTES]
        for k in range(bounds[segment], bounds[segment + 1]):
            if tail > 0:
                work[NOW, Z] = 0.0
            for i in range(tail):
                p[SIZE + i] = inputs[k, PLAIN + i]
            work[NOW, V2] -= p[A12] / p[A22] * inputs[k, 1]
            row, length = counts[NOTES], knots[k + 1] - knots[k] if k + 1 < bounds[segment + 1] else 0.0
            tried = advanced(step, begin, 0.0, length, inputs[k, 0], work, tried, p, instants, seen, nodes, counts)
            if tried <= 0.0:
                return tried
            nodes[row, noted.FLAG], nodes[row, noted.KICK] = flags[k], inputs[k, 1]
    begins[len(bounds) - 1] = counts[NOTES]
    return tried


@njit
def motion_readings(
    nodes: Array,
    begins: Ints,
    initial: Ints,
    p: Array,
    places: Ints,
    columns: Ints,
    weights: Array,
    peaks: Array,
    slopes: Array,
    block: Array,
    points: Array,
    mode: Array,
    rows: Array,
    jacobian: Array,
) -> None:
    """Derivatives of what is read along the steps of `motion_steps`.

    initial (4,): columns of the initial values of (q1, q1', q2, q2'), −1 of those that are no unknowns. p (SIZE,): the
    constants of these steps. places, columns, weights: each constant of p that moves with an unknown; place SIZE + k is
    the height of a Stribeck's peak of the speed peaks[k] (rad/s), which the motion has not. slopes (r, m), m ≤ WIDEST:
    derivatives by the initial values of the row's segment, then by the unknowns. block and what follows it: room, of
    zeros.
    """
    m, r = slopes.shape[1], NONE
    wide = (m + 7) // 8 * 8
    for segment in range(len(begins) - 1):
        for i in range(4 * WIDEST):
            block[i] = 1.0 if i % WIDEST == initial[i // WIDEST] else 0.0
        for i in range(2):  # the speed of what rests has no effect
            if nodes[begins[segment], noted.SIDE1 + i] == 0.0 and initial[2 * i + 1] >= 0:
                block[(2 * i + 1) * WIDEST + initial[2 * i + 1]] = 0.0
        for n in range(begins[segment], begins[segment + 1]):
            if nodes[n, noted.KICK] != 0.0:
                for e in range(len(places)):
                    if places[e] == A12:
                        block[3 * WIDEST + columns[e]] -= weights[e] * nodes[n, noted.KICK] / p[A22]
            if nodes[n, noted.PASSED] != 0.0:
                _leap(nodes, n, block)
            flag = nodes[n, noted.FLAG]
            if flag >= READ_ANGLE and flag != READ_WHEEL:
                for c in range(m):
                    slopes[r, c] = block[c]
                r += 1
            if flag >= READ_WHEEL:
                for c in range(m):
                    slopes[r, c] = block[2 * WIDEST + c]
                r += 1
            if nodes[n, noted.STEP] > 0.0:
                _points(nodes, n, p, points, mode)
                for i in range(4, BLOCK):
                    for c in range(wide):
                        block[i * WIDEST + c] = 0.0
                for at in range(3):
                    _slopes_at(at, points, mode, p, rows, places, columns, weights, peaks, jacobian, block)
                _carry(nodes[n, noted.STEP], block, jacobian, wide)


@njit_inlined
def _leap(nodes: Array, n: int, block: Array) -> None:
    """The jump of S where a speed has passed zero; (q1'', q2'') until then are at the end of the step before."""
    before1, before2 = nodes[n - 1, noted.END1], nodes[n - 1, noted.END2]
    speed, rate = (WIDEST, before1) if nodes[n, noted.PASSED] == 1.0 else (3 * WIDEST, before2)
    if rate == 0.0:
        return
    jump1, jump2 = (nodes[n, noted.RATE1] - before1) / rate, (nodes[n, noted.RATE2] - before2) / rate
    for c in range(WIDEST):
        passed = block[speed + c]
        block[WIDEST + c] += jump1 * passed
        block[3 * WIDEST + c] += jump2 * passed


@njit_inlined
def _points(nodes: Array, n: int, p: Array, points: Array, mode: Array) -> None:
    """(q1, q1', q2', q1'', q2'', sin q1, cos q1) at begin, middle and end of a step into `points` (3, 7).

    The middle is that of the quintic, its speed that of the cubic: a measured wheel's angle and speed differ a little.
    """
    h, end = nodes[n, noted.STEP], n + 1
    if mode[0] != nodes[n, noted.SIDE1] or mode[1] != nodes[n, noted.SIDE2]:
        _free(nodes[n, noted.SIDE1] != 0.0, nodes[n, noted.SIDE2] != 0.0, p, mode)
    mode[0], mode[1] = nodes[n, noted.SIDE1], nodes[n, noted.SIDE2]
    mode[2], mode[3] = nodes[n, noted.BRANCH], nodes[n, noted.COMMAND]
    points[0, 0], points[0, 1], points[0, 2] = nodes[n, noted.ANGLE], nodes[n, noted.SPEED], nodes[n, noted.WHEEL]
    points[2, 0], points[2, 1], points[2, 2] = nodes[end, noted.ANGLE], nodes[end, noted.SPEED], nodes[end, noted.WHEEL]
    for i in range(2):
        begin, last = nodes[n, noted.RATE1 + i], nodes[n, noted.END1 + i]
        points[0, 3 + i], points[2, 3 + i] = begin, last
        first, second = points[0, 1 + i], points[2, 1 + i]
        points[1, 1 + i] = 0.5 * (first + second) + 0.125 * h * (begin - last)
        points[1, 3 + i] = 1.5 * (second - first) / h - 0.25 * (begin + last)
    middle = 0.5 * (points[0, 0] + points[2, 0]) + 0.15625 * h * (points[0, 1] - points[2, 1])
    points[1, 0] = middle + h * h / 64.0 * (points[0, 3] + points[2, 3])
    points[0, 5], points[0, 6] = math.sin(points[0, 0]), math.cos(points[0, 0])
    for at in range(1, 3):
        _turn(points, at)


@njit_inlined
def _free(first: bool, second: bool, p: Array, mode: Array) -> None:
    """Places 4 … 6 of `mode`: the inverse of M, of those of both degrees of freedom that are free."""
    mode[4] = mode[5] = mode[6] = 0.0
    if first and second:
        determinant = p[A11] * p[A22] - p[A12] * p[A12]
        mode[4], mode[5], mode[6] = p[A22] / determinant, -p[A12] / determinant, p[A11] / determinant
    elif first:
        mode[4] = 1.0 / p[A11]
    elif second:
        mode[6] = 1.0 / p[A22]


@njit_inlined
def _turn(points: Array, at: int) -> None:
    """Sine and cosine at a point from those at the begin of the step, by series where it is as near as it mostly is."""
    turn = points[at, 0] - points[0, 0]
    x, sine, cosine = turn * turn, points[0, 5], points[0, 6]
    if x > NEAR * NEAR:
        points[at, 5], points[at, 6] = math.sin(points[at, 0]), math.cos(points[at, 0])
        return
    up = turn * (1.0 - x / 6.0 * (1.0 - x / 20.0 * (1.0 - x / 42.0 * (1.0 - x / 72.0))))
    along = 1.0 - x / 2.0 * (1.0 - x / 12.0 * (1.0 - x / 30.0 * (1.0 - x / 56.0)))
    points[at, 5], points[at, 6] = sine * along + cosine * up, cosine * along - sine * up


@njit_inlined
def _slopes_at(
    at: int,
    points: Array,
    mode: Array,
    p: Array,
    rows: Array,
    places: Ints,
    columns: Ints,
    weights: Array,
    peaks: Array,
    jacobian: Array,
    block: Array,
) -> None:
    """Evaluate at a point within `mode` ∂q''/∂(q1, q1', q2') and M⁻¹ into jacobian[at] (9,), ∂r/∂θ into `block`."""
    q1, v1, v2 = points[at, 0], points[at, 1], points[at, 2]
    s1, s2, branch = int(mode[0]), int(mode[1]), int(mode[2])
    sliding_row(q1, points[at, 5], v1, s1, p, rows[0])
    motor_row(mode[3], v2, s2, branch, p, rows[1])
    mass_rows(points[at, 3], points[at, 4], rows[0], rows[1])
    for k in range(len(peaks)):
        x = v1 / peaks[k]
        rows[0, SIZE + k] = -s1 * math.exp(-x * x) if x * x < PASSED_PEAK else 0.0
    i11, i12, i22 = mode[4], mode[5], mode[6]
    by_angle, by_speed = sliding_slopes(q1, points[at, 6], v1, s1, p)
    loss = -p[GEAR] * (p[F2] * p[GEAR] + (p[ETA] * p[C2] if branch != 0 else 0.0))
    jacobian[at, 0], jacobian[at, 1], jacobian[at, 2] = -i11 * by_angle, -i11 * by_speed, i12 * loss
    jacobian[at, 3], jacobian[at, 4], jacobian[at, 5] = -i12 * by_angle, -i12 * by_speed, i22 * loss
    jacobian[at, 6], jacobian[at, 7], jacobian[at, 8] = i11, i12, i22
    first = (4 + 2 * at) * WIDEST
    for e in range(len(places)):
        block[first + columns[e]] += weights[e] * rows[0, places[e]]
        block[first + WIDEST + columns[e]] += weights[e] * rows[1, places[e]]


@njit_inlined
def _carry(h: float, block: Array, jacobian: Array, wide: int) -> None:
    """S over a step of h (s) by the classical Runge–Kutta method, f's slopes given at its begin, middle, end."""
    i11, i12, i22 = jacobian[0, 6], jacobian[0, 7], jacobian[0, 8]
    a1, a2, a3 = jacobian[0, 0], jacobian[0, 1], jacobian[0, 2]
    a4, a5, a6 = jacobian[0, 3], jacobian[0, 4], jacobian[0, 5]
    b1, b2, b3 = jacobian[1, 0], jacobian[1, 1], jacobian[1, 2]
    b4, b5, b6 = jacobian[1, 3], jacobian[1, 4], jacobian[1, 5]
    c1, c2, c3 = jacobian[2, 0], jacobian[2, 1], jacobian[2, 2]
    c4, c5, c6 = jacobian[2, 3], jacobian[2, 4], jacobian[2, 5]
    half, third, sixth = h / 2.0, h / 3.0, h / 6.0
    for c in range(wide):
        x1, w1, x2, w2 = block[c], block[WIDEST + c], block[2 * WIDEST + c], block[3 * WIDEST + c]
        r1, r2 = block[4 * WIDEST + c], block[5 * WIDEST + c]
        f1 = a1 * x1 + a2 * w1 + a3 * w2 + i11 * r1 + i12 * r2
        f2 = a4 * x1 + a5 * w1 + a6 * w2 + i12 * r1 + i22 * r2
        r1, r2 = block[6 * WIDEST + c], block[7 * WIDEST + c]
        known1, known2 = i11 * r1 + i12 * r2, i12 * r1 + i22 * r2
        t, u1, u2 = x1 + half * w1, w1 + half * f1, w2 + half * f2
        g1, g2 = b1 * t + b2 * u1 + b3 * u2 + known1, b4 * t + b5 * u1 + b6 * u2 + known2
        t, v1, v2 = x1 + half * u1, w1 + half * g1, w2 + half * g2
        h1, h2 = b1 * t + b2 * v1 + b3 * v2 + known1, b4 * t + b5 * v1 + b6 * v2 + known2
        r1, r2 = block[8 * WIDEST + c], block[9 * WIDEST + c]
        t, y1, y2 = x1 + h * v1, w1 + h * h1, w2 + h * h2
        k1 = c1 * t + c2 * y1 + c3 * y2 + i11 * r1 + i12 * r2
        k2 = c4 * t + c5 * y1 + c6 * y2 + i12 * r1 + i22 * r2
        block[c] = x1 + sixth * (w1 + y1) + third * (u1 + v1)
        block[WIDEST + c] = w1 + sixth * (f1 + k1) + third * (g1 + h1)
        block[2 * WIDEST + c] = x2 + sixth * (w2 + y2) + third * (u2 + v2)
        block[3 * WIDEST + c] = w2 + sixth * (f2 + k2) + third * (g2 + h2)
