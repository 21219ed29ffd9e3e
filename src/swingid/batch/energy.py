"""The energy method for many logs at once, with one smoothing and one part of the log for all, chosen once.

Blocks of mirrored nodes, basis of friction, fit and covariance are those of `energy`. The balance holds at any instant,
so the nodes may be the samples nearest to the mirrored angles: nothing is interpolated. But there the wheel's speed has
its corners, as the voltage steps: between two samples the wheel turns by the trapezoid of its speeds f, so a smooth
curve through the angles has the slope f + h^2 f''/12, not f. `u` contains the scatter of the blocks alone.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np

from swingid.batch.kernels import slopes, smoothing
from swingid.batch.plan import Batch, Plan, at_stamps, channels_of, require_batch
from swingid.errors import InputError, UnanswerableError
from swingid.methods.energy.fit import SMALLEST
from swingid.methods.energy.method import FEWEST_BLOCKS, LEVELS
from swingid.model.equation import Equation
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array, Ints
from swingid.numerics.regression import fit_linear
from swingid.numerics.vectors import njit_sums, njit_sums_threads, widest
from swingid.preparation.scale import equation_of
from swingid.processes import cores

INERTIA, COULOMB, VISCOUS, QUADRATIC, OFFSET, EVEN, KNOWN, COLUMNS = range(8)
"""Places of the columns: q1'^2/2, running integrals of f(q1') q1' of the terms of friction, and the known side."""

ETA, C1, C2, LOW, HIGH, F2, F3, GEAR, A12, A22, GRAVITY, CONSTANTS = range(12)
"""Places of the constants: the motor's, dead zone from LOW to HIGH, and a12, a22, b of the balance."""

CORNER = 8
"""Samples over which the second difference of the wheel's speed is taken."""

SMALLEST_SWING = 0.05
"""Reversals that are nearer to each other than this share of the motion's range are noise."""


TOGETHER = 32
"""Logs whose nodes are in memory at once, per thread."""


@njit_sums
def running(v1: Array, v2: Array, wheel: Array, voltage: Array, step: float, constants: Array, sums: Array) -> None:
    """Running integrals (5, rows): the drive's work (the voltage held), |v|, v^2, |v| v^2, |v| v (trapezoids).

    What each step adds is computed first, for many steps at once, then summed up.
    """
    widest()
    rows, half = len(v1), 0.5 * step
    work, path, square, cube, signed = sums[0], sums[1], sums[2], sums[3], sums[4]
    for j in range(rows - 1):
        work[j + 1] = 0.0
    if len(wheel) > 0:
        eta, gear, f2, f3 = constants[ETA], constants[GEAR], constants[F2], constants[F3]
        c1, c2, low, high = constants[C1], constants[C2], constants[LOW], constants[HIGH]
        for j in range(rows - 1):
            v = 0.5 * (v2[j] + v2[j + 1])
            ideal = eta * (c1 * voltage[j] - c2 * v)
            torque = max(ideal - high, 0.0) + min(ideal - low, 0.0)
            side = 1.0 if v > 0.0 else (-1.0 if v < 0.0 else 0.0)
            drive = gear * (torque - f2 * gear * v - f3 * side) * (wheel[j + 1] - wheel[j])
            # v^2 has a larger mean over the step than v has squared
            loss = f2 * gear + (eta * c2 if torque != 0.0 else 0.0)
            work[j + 1] = drive - gear * loss * step * (v2[j + 1] - v2[j]) ** 2 * (1 / 12)
    for j in range(rows - 1):
        a, b = v1[j], v1[j + 1]
        path[j + 1] = half * (abs(a) + abs(b))
        square[j + 1] = half * (a * a + b * b)
    for j in range(rows - 1):
        a, b = v1[j], v1[j + 1]
        cube[j + 1] = half * (abs(a) * a * a + abs(b) * b * b)
        signed[j + 1] = half * (abs(a) * a + abs(b) * b)
    total = (0.0, 0.0, 0.0, 0.0, 0.0)
    work[0], path[0], square[0], cube[0], signed[0] = total
    for j in range(1, rows):
        total = (total[0] + work[j], total[1] + path[j], total[2] + square[j], total[3] + cube[j], total[4] + signed[j])
        work[j], path[j], square[j], cube[j], signed[j] = total


@njit_sums
def turning_points(angle: Array, v: Array, first: int, last: int, turns: Ints) -> int:
    """Samples nearest to the reversals of v between first and last into `turns`; returns how many were found."""
    used, count = angle[first:last], 0
    threshold = SMALLEST_SWING * (used.max() - used.min())
    for j in range(first, last - 1):
        if v[j] * v[j + 1] > 0.0 or v[j + 1] == 0.0:
            continue
        at = j if abs(v[j]) < abs(v[j + 1]) else j + 1
        if count < len(turns) and (count == 0 or abs(angle[at] - angle[turns[count - 1]]) > threshold):
            turns[count] = at
            count += 1
    return count


@njit_sums_threads
def energy_run(
    angle: Array,
    wheel: Array,
    voltage: Array,
    step: float,
    span: tuple[int, int],
    levels: Array,
    weights: tuple[Array, Array],
    constants: Array,
    work: Array,
    turns: Ints,
    result: Array,
) -> int:
    """Columns (blocks, nodes, COLUMNS) of one log, 0 in blocks that it has not; returns how many it has.

    angle, wheel, voltage (rows,) (wheel empty: no wheel). span: first and last sample used. levels: depths of the nodes
    in shares of the smaller swing. weights: `smoothing` of angle and wheel angle. work (7, rows), turns (blocks + 2,).
    """
    reach, deep, filled = weights[0].shape[1] - 1, len(levels), 0
    v1, v2, sums = work[0], work[1], work[2:7]
    slopes(angle, weights[0][1], v1)
    for j in range(len(v2)):
        v2[j] = 0.0
    if len(wheel) > 0:
        slopes(wheel, weights[1][1], v2)
        reach = max(reach, weights[1].shape[1] - 1)
    running(v1, v2, wheel, voltage, step, constants, sums)
    first, last = max(span[0], reach), min(span[1], len(angle) - 1 - reach)
    count = turning_points(angle, v1, first, last, turns)
    flat = result.ravel()
    for j in range(len(flat)):
        flat[j] = 0.0
    for i in range(1, count - 1):
        top = angle[turns[i]]
        size = min(abs(top - angle[turns[i - 1]]), abs(top - angle[turns[i + 1]]))
        complete = filled < len(result)
        for direction in (-1, 1):
            j, end = turns[i], turns[i + direction]
            for level in range(deep):
                while j != end and abs(top - angle[j]) < levels[level] * size:
                    j += direction
                complete = complete and j != end
                if complete:
                    fill_node(
                        result[filled, deep + direction * (level + 1)], angle, v1, v2, sums, j, weights[0][0], constants
                    )
        if complete:
            fill_node(result[filled, deep], angle, v1, v2, sums, turns[i], weights[0][0], constants)
            filled += 1
        elif filled < len(result):
            result[filled] = 0.0
    return filled


@njit_sums
def fill_node(
    row: Array, angle: Array, v1: Array, v2: Array, sums: Array, j: int, weights: Array, constants: Array
) -> None:
    """The columns at sample j into `row` (COLUMNS,); weights: of the angle."""
    q = weights[0] * angle[j]
    for i in range(1, len(weights)):
        q += weights[i] * (angle[j + i] + angle[j - i])
    row[INERTIA], row[OFFSET] = 0.5 * v1[j] * v1[j], q
    row[COULOMB], row[VISCOUS], row[QUADRATIC], row[EVEN] = sums[1, j], sums[2, j], sums[3, j], sums[4, j]
    apart = min(CORNER, j, len(v2) - 1 - j)
    turn = v2[j] - (v2[j + apart] - 2.0 * v2[j] + v2[j - apart]) / (12.0 * apart * apart)
    kinetic = constants[A12] * v1[j] * turn + 0.5 * constants[A22] * turn * turn
    row[KNOWN] = sums[0, j] + constants[GRAVITY] * np.cos(q) - kinetic


def energy_batch(
    angle: Array,
    wheel_angle: Array | None,
    voltage: Array | None,
    rate: float,
    rig: Rig,
    plan: Plan,
    *,
    threads: int | None = None,
) -> Batch:
    """Inertias from angles, wheel angles (rad) and voltages (V), each (n, rows), logged at `rate` (1/s).

    The rig's motor constants are used, and the voltage is held from row to row. A log with fewer than three turning
    points has NaN. Raises InputError for a direct drive, an unknown gravity torque, or a channel that is missing or of
    another shape.
    """
    equation = equation_of(rig)
    require_batch(rig, equation)
    encoders = plan.encoders(rig)
    if "wheel" in equation.coefficients and (wheel_angle is None or voltage is None):
        raise InputError(
            "the energy method needs the wheel angle and the voltage; record them.", code="missing-voltage"
        )
    angle, (wheel_angle, voltage) = channels_of(equation, angle, wheel_angle=wheel_angle, voltage=voltage)
    step = 1.0 / rate
    weights = (smoothing(plan.width, step), smoothing(plan.wheel_width, step))
    span = (round(plan.start * rate), min(angle.shape[1] - 1, round(plan.stop * rate)))
    constants = _constants(rig, equation)
    nothing = np.empty((len(angle), 0))
    wheel = nothing if wheel_angle is None or not equation.driven else wheel_angle
    volts = nothing if voltage is None else voltage
    blocks = plan.turns + plan.turns // 4 + 2

    def part(begin: int) -> tuple[Array, Array]:
        logs = slice(begin, begin + TOGETHER)
        columns = np.empty((len(angle[logs]), blocks, 2 * len(LEVELS) + 1, COLUMNS))
        q1 = at_stamps(angle[logs], rate, encoders.angle.latency.value)
        q2 = at_stamps(wheel[logs], rate, encoders.wheel.latency.value)
        work, turns = np.empty((7, angle.shape[1])), np.empty(blocks + 2, np.int64)
        channels = zip(q1, q2, volts[logs], columns, strict=True)
        counts = [
            energy_run(angles, wheels, volt, step, span, LEVELS, weights, constants, work, turns, rows)
            for angles, wheels, volt, rows in channels
        ]
        return _fitted(columns, np.array(counts))

    with ThreadPoolExecutor(threads or cores()) as pool:
        fits = list(pool.map(part, range(0, len(angle), TOGETHER)))
    a11, variance = np.concatenate([v for v, _ in fits]), np.concatenate([c for _, c in fits])
    if np.isnan(a11).all():
        raise UnanswerableError("no log holds three turning points with their passes; record longer.", code="too-short")
    return Batch(a11 - equation.carried, np.sqrt(variance))


def _constants(rig: Rig, equation: Equation) -> Array:
    """Constants of the balance at their places."""
    constants = np.zeros(CONSTANTS)
    constants[GRAVITY] = equation.value("gravity_torque")
    motor = rig.drive.motor
    if "wheel" in equation.coefficients and motor is not None:
        constants[ETA], constants[C1] = motor.efficiency.value, motor.torque_per_volt.value
        constants[C2], constants[GEAR] = motor.back_emf.value, motor.gear_ratio.value
        constants[LOW], constants[HIGH] = motor.dead_zone
        constants[F2], constants[F3] = motor.viscous.value, motor.coulomb.value
        constants[A12], constants[A22] = rig.drive.a12, rig.drive.a22
    return constants


def _fitted(columns: Array, counts: Ints) -> tuple[Array, Array]:
    """a11 (n,) and its variance as of `fit_passes`, for columns (n, blocks, nodes, COLUMNS)."""
    n, blocks = columns.shape[:2]
    within = (columns - columns.mean(axis=2, keepdims=True)).reshape(n, -1, COLUMNS)
    matrix, known = within[:, :, :KNOWN], within[:, :, KNOWN]
    fit = fit_linear(matrix, known, smallest=SMALLEST)
    values, scores = fit.values, fit.influence[:, 0] * fit.residuals
    scores = scores.reshape(n, blocks, -1).sum(axis=2)
    variance = (scores * scores).sum(axis=1) + (scores[:, 1:] * scores[:, :-1]).sum(axis=1)
    variance *= counts / np.maximum(counts - KNOWN, 1)
    a11 = values[:, 0]
    a11[counts < FEWEST_BLOCKS], variance[counts < FEWEST_BLOCKS] = np.nan, np.nan
    return a11, variance
