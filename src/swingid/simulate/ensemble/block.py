"""The closed loops of one block of runs, sample by sample: read, control, move, and again what needs a closer look."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from swingid.simulate.ensemble.control_lanes import control
from swingid.simulate.ensemble.events import redo
from swingid.simulate.ensemble.lane_functions import njit_lane, njit_threads, sine_cosine
from swingid.simulate.ensemble.lanes import (
    A12,
    ALONE1,
    ALONE2,
    ANGLE_READING,
    ANGLE_STEP,
    ANGLE_ZERO,
    AXIS_KINK,
    AXIS_STICKS,
    BACK_EMF,
    COMMAND,
    COULOMB_N,
    COULOMB_P,
    D1,
    D2,
    DIRECT,
    EDGE_N,
    EDGE_P,
    FLAG,
    GAIN,
    GEAR,
    GRAVITY,
    K_TILDE,
    LANES,
    M11,
    M12,
    M22,
    MOTOR_COULOMB,
    MOTOR_DRAG,
    OFFSET,
    PEAK,
    Q1,
    Q2,
    QUADRATIC,
    REFERENCE,
    RIG_LIMIT,
    STATIC_N,
    STATIC_P,
    VISCOUS_N,
    VISCOUS_P,
    WHEEL_KINK,
    WHEEL_READING,
    WHEEL_STATIC,
    WHEEL_STEP,
    WHEEL_ZERO,
    U,
    Y,
)  # fmt: skip
from swingid.simulate.ensemble.series import coefficients, coefficients_with_peak, moved, slope, turned

Array = NDArray[np.float64]

SMALL = 1e-13
"""rad per step: a fifth coefficient beyond this shows that the step is too long for the series."""


@njit_lane
def reading(q: float, zero: float, noise: float, resolution: float) -> float:
    """Reading (rad) of an encoder without nonlinearity: `model.sensors.encoder_reading`."""
    value = q + zero + noise
    step = resolution if resolution > 0.0 else 1.0
    return step * np.rint(value / step) if resolution > 0.0 else value


@njit_lane
def move(lane: Array, i: int, peaked: int) -> int:
    """Run i of a block one step on; 1 and nothing moved where its mode may end in the step, else 0.

    The mode is that of the start: sides and branch by sign and edges; what has no speed and can stick rests.
    """
    q1, u, y = lane[Q1 * LANES + i], lane[U * LANES + i], lane[Y * LANES + i]
    command, gear = lane[COMMAND * LANES + i], lane[GEAR * LANES + i]
    sticks, kink1, kink2 = lane[AXIS_STICKS * LANES + i], lane[AXIS_KINK * LANES + i], lane[WHEEL_KINK * LANES + i]
    gravity, a12 = lane[GRAVITY * LANES + i], lane[A12 * LANES + i]
    rest1, rest2 = (u == 0.0) & (sticks != 0.0), (y == 0.0) & (kink2 != 0.0)
    side1, side2 = (1.0 if u >= 0.0 else -1.0), (1.0 if y >= 0.0 else -1.0)

    volts, emf = lane[GAIN * LANES + i] * command, lane[BACK_EMF * LANES + i]
    edge_p, edge_n = lane[EDGE_P * LANES + i], lane[EDGE_N * LANES + i]
    torque = volts - emf * y
    above = torque > edge_p
    below = (torque < edge_n) & (not above)
    dead = not (above | below)
    d1, d2 = lane[D1 * LANES + i], lane[D2 * LANES + i]
    edge = d1 if above else d2
    drive = 0.0 if dead else gear * (volts - edge)
    drag, dry2 = lane[MOTOR_DRAG * LANES + i], lane[MOTOR_COULOMB * LANES + i]
    drag += 0.0 if dead else gear * emf
    load2 = drive - (0.0 if rest2 else side2 * dry2)

    positive = side1 > 0.0
    viscous_p, viscous_n = lane[VISCOUS_P * LANES + i], lane[VISCOUS_N * LANES + i]
    coulomb_p, coulomb_n = lane[COULOMB_P * LANES + i], lane[COULOMB_N * LANES + i]
    viscous = viscous_p if positive else viscous_n
    coulomb = coulomb_p if positive else coulomb_n
    static_p, static_n = lane[STATIC_P * LANES + i], lane[STATIC_N * LANES + i]
    quadratic = side1 * lane[QUADRATIC * LANES + i]
    outer = lane[DIRECT * LANES + i] * command - lane[OFFSET * LANES + i]
    load1 = outer - (0.0 if rest1 else side1 * coulomb)

    m11, m12, m22 = lane[M11 * LANES + i], lane[M12 * LANES + i], lane[M22 * LANES + i]
    alone1, alone2 = lane[ALONE1 * LANES + i], lane[ALONE2 * LANES + i]
    both = not (rest1 | rest2)
    m12 = m12 if both else 0.0
    m11 = m11 if both else (0.0 if rest1 else alone1)
    m22 = m22 if both else (0.0 if rest2 else alone2)

    sine, cosine = sine_cosine(q1)
    mobility = (m11, m12, m22)
    if peaked:
        spike = lane[PEAK * LANES + i]
        height = side1 * ((static_p if positive else static_n) - coulomb)
        height = 0.0 if spike == 0.0 else height
        cu, cy = coefficients_with_peak(
            sine, cosine, u, y, gravity, viscous, quadratic, load1, load2, drag, mobility, height, spike
        )
    else:
        cu, cy = coefficients(sine, cosine, u, y, gravity, viscous, quadratic, load1, load2, drag, mobility)
    u_end, y_end = moved(u, cu, 1.0), moved(y, cy, 1.0)
    slope_u, slope_y = slope(cu, 1.0), slope(cy, 1.0)

    # what must hold at the end, and for what rests also at the start
    hold = outer - gravity * sine
    hold_start, hold_end = hold - a12 * cy[0], hold - a12 * slope_y
    held = (hold_start <= static_p) & (hold_start >= -static_n) & (hold_end <= static_p) & (hold_end >= -static_n)
    flagged = rest1 & (not held)
    wheel_static = lane[WHEEL_STATIC * LANES + i]
    hold_start, hold_end = drive - a12 * cu[0], drive - a12 * slope_u
    flagged |= rest2 & ((abs(hold_start) > wheel_static) | (abs(hold_end) > wheel_static))
    # a speed that has passed zero, or may have been beyond it and back
    s_u, s_y = side1 * u, side2 * y
    start_u, start_y = side1 * cu[0], side2 * cy[0]
    passed = (side1 * u_end < 0.0) | ((start_u < 0.0) & (side1 * slope_u > 0.0) & (s_u + start_u < 0.0))
    flagged |= (kink1 != 0.0) & passed
    passed = (side2 * y_end < 0.0) | ((start_y < 0.0) & (side2 * slope_y > 0.0) & (s_y + start_y < 0.0))
    flagged |= (kink2 != 0.0) & passed
    torque = volts - emf * y_end
    flagged |= (
        (above & (torque < edge_p)) | (below & (torque > edge_n)) | (dead & ((torque > edge_p) | (torque < edge_n)))
    )
    flagged |= (abs(cu[4]) > SMALL) | (abs(cy[4]) > SMALL)

    lane[Q1 * LANES + i] = q1 if flagged else q1 + turned(u, cu, 1.0)
    lane[U * LANES + i] = u if flagged else u_end
    lane[Q2 * LANES + i] += 0.0 if flagged else turned(y, cy, 1.0)
    lane[Y * LANES + i] = y if flagged else y_end
    lane[FLAG * LANES + i] = 1.0 if flagged else 0.0
    return 1 if flagged else 0


@njit_lane
def move_all(lane: Array, peaked: int) -> int:
    """All runs of a block one step on; how many are left for `redo`."""
    count = 0
    for i in range(LANES):
        count += move(lane, i, peaked)
    return count


@njit_threads
def run_block(
    lane: Array,
    p: Array,
    inputs: Array,
    which: NDArray[np.int64],
    closed: int,
    peaked: int,
    steps: int,
    h: float,
    noise: Array,
    log: Array,
) -> int:
    """Run a block for all rows of `inputs`, moving `lane` in place to the last row; returns how many steps were redone.

    lane (ROWS * LANES,): as `lanes` says. p (LANES, SIZE): constants once more, for what is done by itself. inputs
    (rows, references): rad; V or N m where the loop is open. which (LANES,): each run's column of them. steps of a
    sample, each of h (s). noise (2, rows or 1, LANES) (rad). log (channels, runs <= LANES, rows) receives angle, wheel
    angle, command and k tilde of every row, as many as it has channels.
    """
    rows, channels, noisy = len(inputs), len(log), noise.shape[1] > 1
    sample = h * steps
    work, nothing, nowhere, counts = np.zeros((10, 5)), np.zeros(0), np.zeros((0, 5)), np.zeros(4, np.int64)
    redone = 0
    for k in range(rows):
        for i in range(LANES):
            lane[REFERENCE * LANES + i] = inputs[k, which[i]]
        row = k if noisy else 0
        for i in range(LANES):
            lane[ANGLE_READING * LANES + i] = reading(
                lane[Q1 * LANES + i], lane[ANGLE_ZERO * LANES + i], noise[0, row, i], lane[ANGLE_STEP * LANES + i]
            )
            lane[WHEEL_READING * LANES + i] = reading(
                lane[Q2 * LANES + i], lane[WHEEL_ZERO * LANES + i], noise[1, row, i], lane[WHEEL_STEP * LANES + i]
            )
        if closed:
            for i in range(LANES):
                control(lane, i, sample)
        else:
            for i in range(LANES):
                lane[COMMAND * LANES + i] = lane[REFERENCE * LANES + i]
        for i in range(LANES):
            limit = lane[RIG_LIMIT * LANES + i]
            command = lane[COMMAND * LANES + i]
            command = command if command > -limit else -limit
            lane[COMMAND * LANES + i] = command if command < limit else limit
        for channel in range(channels):
            first = (ANGLE_READING + channel) * LANES if channel < 3 else K_TILDE * LANES
            for i in range(log.shape[1]):
                log[channel, i, k] = lane[first + i]
        if k == rows - 1:
            break
        for _ in range(steps):
            count = move_all(lane, 1) if peaked else move_all(lane, 0)
            if count > 0:
                redone += count
                redo(lane, p, h, work, nothing, nowhere, counts)
    return redone
