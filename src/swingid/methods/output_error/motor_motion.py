"""The rig under its held voltage, with exact sensitivities: equations (I) and (II), every stop, release and reversal.

The state moves as in the digital twin (`swingid.model.motion`), step by step, each within one mode. Its sensitivities
S obey S' = (∂f/∂x) S + ∂f/∂θ along the step. Where a step ends because a speed passes zero, the slope f jumps, and
with it S (the saltation): at the reversal of a speed v at t*, ∂t*/∂θ = −S_v/v'⁻, so S⁺ = S⁻ + (f⁺ − f⁻) S_v/v'⁻. At the
edge of the dead zone and at a release f is continuous, and so is S.
"""

from __future__ import annotations

import numpy as np

from swingid.methods.output_error.partials import axis_row, axis_slopes, mass_rows, motor_row
from swingid.model.integrator import FIRST, LAST, NEW, NOW, Q1, Q2, ROWS, STATES, V1, V2, Mode, derivative, quintic
from swingid.model.motion import COUNTS, next_step
from swingid.model.parameters import A11, A12, A22, C2, ETA, F2, GEAR, SIZE
from swingid.model.sticking import choose_mode, stop_reversed
from swingid.numerics.arrays import Array, Ints
from swingid.numerics.compiled import njit, njit_inlined

READ_ANGLE, READ_WHEEL = 1, 2
"""Bits of `flags`: the angle, the wheel's angle is read at this knot."""

MOST_STEPS = 5_000
"""Steps between two knots beyond which the simulation is abandoned as divergent (constants far off)."""


@njit_inlined
def _slopes_at(
    at: int,
    state: tuple[float, float, float, float],
    slope: tuple[float, float],
    mode: Mode,
    u: float,
    p: Array,
    rows: Array,
    entries: tuple[Ints, Ints, Array],
    jacobian: Array,
    known: Array,
) -> None:
    """∂q''/∂(q1, q1', q2') into jacobian[at] (6,), ∂q''/∂θ into known[at] (2, m), at a state within `mode`."""
    q1, v1, _, v2 = state
    s1, s2, branch = mode
    axis_row(q1, v1, s1, p, rows[0])
    motor_row(u, v2, s2, branch, p, rows[1])
    mass_rows(slope[0], slope[1], rows[0], rows[1])
    i11 = i12 = i22 = 0.0
    if s1 != 0 and s2 != 0:
        determinant = p[A11] * p[A22] - p[A12] * p[A12]
        i11, i12, i22 = p[A22] / determinant, -p[A12] / determinant, p[A11] / determinant
    elif s1 != 0:
        i11 = 1.0 / p[A11]
    elif s2 != 0:
        i22 = 1.0 / p[A22]
    by_angle, by_speed = axis_slopes(q1, v1, s1, p)
    swing, drag = -by_angle, -by_speed
    loss = -p[GEAR] * (p[F2] * p[GEAR] + (p[ETA] * p[C2] if branch != 0 else 0.0))
    jacobian[at, 0], jacobian[at, 1], jacobian[at, 2] = i11 * swing, i11 * drag, i12 * loss
    jacobian[at, 3], jacobian[at, 4], jacobian[at, 5] = i12 * swing, i12 * drag, i22 * loss
    known[at] = 0.0
    places, columns, weights = entries
    for e in range(len(places)):
        r1, r2 = weights[e] * rows[0, places[e]], weights[e] * rows[1, places[e]]
        known[at, 0, columns[e]] += i11 * r1 + i12 * r2
        known[at, 1, columns[e]] += i12 * r1 + i22 * r2


@njit_inlined
def _carry(h: float, sensitivity: Array, jacobian: Array, known: Array) -> None:
    """S (4, m) over a step of h (s) by the classical Runge–Kutta method, f's slopes given at its begin, middle, end."""
    for c in range(sensitivity.shape[1]):
        x1, w1, x2, w2 = sensitivity[0, c], sensitivity[1, c], sensitivity[2, c], sensitivity[3, c]
        # stage values of (q1, q1', q2') and sums of the slopes; q2 itself acts on nothing
        t1, s1, s2 = x1, w1, w2
        d1 = e1 = d2 = e2 = 0.0
        for stage in range(4):
            at = (stage + 1) // 2
            k1 = jacobian[at, 0] * t1 + jacobian[at, 1] * s1 + jacobian[at, 2] * s2 + known[at, 0, c]
            k2 = jacobian[at, 3] * t1 + jacobian[at, 4] * s1 + jacobian[at, 5] * s2 + known[at, 1, c]
            weight = h / 6.0 if stage in (0, 3) else h / 3.0
            d1 += weight * s1
            d2 += weight * s2
            e1 += weight * k1
            e2 += weight * k2
            reach = h if stage == 2 else 0.5 * h
            t1, s1, s2 = x1 + reach * s1, w1 + reach * k1, w2 + reach * k2
        sensitivity[0, c], sensitivity[1, c] = x1 + d1, w1 + e1
        sensitivity[2, c], sensitivity[3, c] = x2 + d2, w2 + e2


@njit_inlined
def _along_step(
    h: float,
    work: Array,
    mode: Mode,
    u: float,
    p: Array,
    rows: Array,
    entries: tuple[Ints, Ints, Array],
    jacobian: Array,
    known: Array,
    sensitivity: Array,
) -> None:
    """S over the step of h (s) from row NOW to row NEW of `work`; angles and speeds between by the quintic."""
    begin = (work[NOW, Q1], work[NOW, V1], work[NOW, Q2], work[NOW, V2])
    end = (work[NEW, Q1], work[NEW, V1], work[NEW, Q2], work[NEW, V2])
    a1, a2 = (work[FIRST, V1], work[LAST, V1]), (work[FIRST, V2], work[LAST, V2])
    q1, v1 = quintic(0.5, h, (begin[0], begin[1], a1[0]), (end[0], end[1], a1[1]))
    q2, v2 = quintic(0.5, h, (begin[2], begin[3], a2[0]), (end[2], end[3], a2[1]))
    # slope of the quintic's speed at its middle
    m1 = 1.5 * (end[1] - begin[1]) / h - 0.25 * (a1[0] + a1[1])
    m2 = 1.5 * (end[3] - begin[3]) / h - 0.25 * (a2[0] + a2[1])
    _slopes_at(0, begin, (a1[0], a2[0]), mode, u, p, rows, entries, jacobian, known)
    _slopes_at(1, (q1, v1, q2, v2), (m1, m2), mode, u, p, rows, entries, jacobian, known)
    _slopes_at(2, end, (a1[1], a2[1]), mode, u, p, rows, entries, jacobian, known)
    _carry(h, sensitivity, jacobian, known)


@njit_inlined
def _leap(speed: int, before: tuple[float, float], work: Array, sensitivity: Array) -> None:
    """The jump of S where `speed` (V1 or V2) has passed zero; `before`: (q1'', q2'') until then, after: row FIRST."""
    rate = before[0] if speed == V1 else before[1]
    if rate == 0.0:
        return
    jump1, jump2 = (work[FIRST, V1] - before[0]) / rate, (work[FIRST, V2] - before[1]) / rate
    for c in range(sensitivity.shape[1]):
        passed = sensitivity[speed, c]
        sensitivity[V1, c] += jump1 * passed
        sensitivity[V2, c] += jump2 * passed


@njit_inlined
def _read(flag: int, r: int, work: Array, sensitivity: Array, found: tuple[Array, Array, Array]) -> int:
    """Write what is read at a knot to the arrays from row r on; returns the next row."""
    outputs, rates, slopes = found
    for bit, angle, speed in ((READ_ANGLE, Q1, V1), (READ_WHEEL, Q2, V2)):
        if flag & bit:
            outputs[r], rates[r] = work[NOW, angle], work[NOW, speed]
            for c in range(sensitivity.shape[1]):
                slopes[r, c] = sensitivity[angle, c]
            r += 1
    return r


@njit
def motor_motion(
    knots: Array,
    commands: Array,
    flags: Ints,
    bounds: Ints,
    states: Array,
    p: Array,
    entries: tuple[Ints, Ints, Array],
    found: tuple[Array, Array, Array],
) -> bool:
    """Angles of the rig under held voltages, segment by segment, and their derivatives.

    knots (n,): instants at which a voltage begins or an angle is read, s. commands (n,): voltage from each knot on, V.
    flags (n,): READ_ANGLE | READ_WHEEL. bounds (k + 1,): first knot of each segment. states (k, 4): (q1, q1', q2, q2')
    at a segment's first knot. p (SIZE,): the rig's constants. entries: (place, column, weight), each constant of p that
    moves with an unknown. found: outputs (r,) in rad, their rates (r,) in rad/s and slopes (r, m): derivatives by the
    four initial values of the row's segment, then by the unknowns. Returns whether the motion stayed finite.
    """
    m = found[2].shape[1]
    work, sensitivity = np.zeros((ROWS, STATES)), np.zeros((4, m))
    rows, jacobian, known = np.zeros((2, SIZE)), np.zeros((3, 6)), np.zeros((3, 2, m))
    counts = np.zeros(COUNTS, dtype=np.int64)
    r = 0
    for segment in range(len(bounds) - 1):
        work[NOW] = 0.0
        sensitivity[:] = 0.0
        for i in range(4):
            work[NOW, i] = states[segment, i]
            sensitivity[i, i] = 1.0
        tried = 1e-3
        r = _read(flags[bounds[segment]], r, work, sensitivity, found)
        for k in range(bounds[segment], bounds[segment + 1] - 1):
            left, u, events, steps = knots[k + 1] - knots[k], commands[k], 0, 0
            mode = choose_mode(work, u, p)
            derivative(work, NOW, FIRST, mode, u, p)
            while left > 0.0:
                h, tried, ended = next_step(left, tried, work, mode, u, p, events, counts)
                _along_step(h, work, mode, u, p, rows, entries, jacobian, known, sensitivity)
                left = 0.0 if not ended and h >= left else left - h
                steps += 1
                for i in range(STATES):
                    work[NOW, i], work[FIRST, i] = work[NEW, i], work[LAST, i]
                if ended:
                    events += 1
                    before = (work[FIRST, V1], work[FIRST, V2])
                    passed1, passed2 = mode[0] * work[NOW, V1] < 0.0, mode[1] * work[NOW, V2] < 0.0
                    stop_reversed(work, mode)
                    mode = choose_mode(work, u, p)
                    derivative(work, NOW, FIRST, mode, u, p)
                    if passed1:
                        _leap(V1, before, work, sensitivity)
                    elif passed2:
                        _leap(V2, before, work, sensitivity)
                if steps > MOST_STEPS or not abs(work[NOW, V1]) + abs(work[NOW, V2]) < 1e6:
                    return False
            r = _read(flags[k + 1], r, work, sensitivity, found)
    return True
