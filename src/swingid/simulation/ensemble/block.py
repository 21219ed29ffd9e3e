"""The closed loops of one block of runs, sample by sample: read, control, move, and again what needs a closer look.

Control is the consecutive compensator (14)-(20), `control.law.compensator_step` for relative degree 2.
"""

from __future__ import annotations

import numpy as np

from swingid.numerics.arrays import Array, Ints
from swingid.numerics.vectors import decay, njit_lane, njit_threads, sine_cosine, widest
from swingid.simulation.ensemble import lanes as at
from swingid.simulation.ensemble import series
from swingid.simulation.ensemble.events import redo
from swingid.simulation.ensemble.lanes import LANES


@njit_lane
def control(lane: Array, i: int, h: float) -> None:
    """Command of run i of a block from its readings, and its controller moved on by a sample of h (s), in place."""
    e = lane[at.REFERENCE * LANES + i] - lane[at.ANGLE_READING * LANES + i]
    wheel = lane[at.WHEEL_READING * LANES + i]
    k = lane[at.K_TILDE * LANES + i]
    xi, memory, seen = lane[at.XI * LANES + i], lane[at.WHEEL_MEMORY * LANES + i], lane[at.WHEEL_SEEN * LANES + i]
    held, fading = lane[at.FILTERED * LANES + i], lane[at.ERROR_DECAY * LANES + i]
    sigma0, k1 = lane[at.SIGMA0 * LANES + i], lane[at.K1 * LANES + i]

    filtered = held if fading > 0.0 else e
    grown = k + lane[at.LAMBDA_H * LANES + i]
    most = lane[at.K_MAX * LANES + i]
    grown = grown if grown < most else most
    grown = grown if grown > k else k
    k_next = grown if abs(filtered) > lane[at.DELTA0 * LANES + i] else k
    rate = sigma0 * k * k * k1 * (e - xi)
    gain_term = lane[at.DIFFERENTIATE * LANES + i] * ((k_next - k) / h) * xi
    u = lane[at.ALPHA1 * LANES + i] * (gain_term + k * rate) + lane[at.ALPHA0 * LANES + i] * k * xi
    u = lane[at.PLANT_SIGN * LANES + i] * u

    memory = memory if seen != 0.0 else wheel
    change = (wheel - memory) * (1.0 - lane[at.WHEEL_DECAY * LANES + i])
    speed = change / h
    dry = lane[at.COULOMB * LANES + i]
    u += dry if speed > 0.0 else (-dry if speed < 0.0 else 0.0)
    switch = u - lane[at.EMF_RATIO * LANES + i] * speed
    positive, negative = lane[at.DEAD_POSITIVE * LANES + i], lane[at.DEAD_NEGATIVE * LANES + i]
    u += positive if switch > 0.0 else (negative if switch < 0.0 else 0.0)

    turn = sigma0 * h * (k * k + k * k_next + k_next * k_next) * (1 / 3)
    limit = lane[at.LIMIT * LANES + i]
    u = u if u > -limit else -limit
    lane[at.COMMAND * LANES + i] = u if u < limit else limit
    lane[at.XI * LANES + i] = e + (xi - e) * decay(k1 * turn)
    lane[at.FILTERED * LANES + i] = e + (held - e) * fading
    lane[at.K_TILDE * LANES + i] = k_next
    lane[at.WHEEL_MEMORY * LANES + i] = memory + change
    lane[at.WHEEL_SEEN * LANES + i] = 1.0


ERROR, PEAKED_ERROR = 1e-14, 1e-14
"""rad per step: what a step may leave out of its series, without and with Stribeck's peak, else it is taken again."""

PARTS, NEAR = 2.0, 2.5
"""Stribeck's peak is passed in so many steps per Stribeck speed, where the speed is below so many changes of a step."""

FIFTH, PEAKED_FIFTH, FOURTH = 1e-13, 1e-14, 1e-11
"""rad per step: terms below which what follows is negligible."""


@njit_lane
def reading(q: float, zero: float, noise: float, resolution: float) -> float:
    """Reading (rad) of an encoder without nonlinearity: `model.sensors.encoder_reading`."""
    value = q + zero + noise
    step = resolution if resolution > 0.0 else 1.0
    return step * np.rint(value / step) if resolution > 0.0 else value


@njit_lane
def read_bent(lane: Array, i: int, angle: int, encoder: int, place: int, noise: float) -> None:
    """Reading of run i's row `angle` by the nonlinear encoder whose rows begin at `encoder`, into the row `place`."""
    q, step = lane[angle * LANES + i], lane[encoder * LANES + i]
    alpha, beta = lane[(encoder + 1) * LANES + i], lane[(encoder + 2) * LANES + i]
    sine, cosine = sine_cosine(q)
    bend = alpha * cosine + beta * sine
    lane[place * LANES + i] = reading(q, lane[(encoder + 3) * LANES + i], noise + bend, step)


@njit_lane
def too_long(fourth: float, fifth: float, peaked: int) -> bool:
    """Whether a step is too long for a series with these last terms: the next is theirs squared, divided."""
    error, least = (PEAKED_ERROR, PEAKED_FIFTH) if peaked else (ERROR, FIFTH)
    return (abs(fifth) > least) & (fifth * fifth > error * abs(fourth))


@njit_lane
def motor(lane: Array, i: int, command: float, gear: float, y: float) -> tuple[float, float, float, float, bool, bool]:
    """Run i's motor: torque η c1 u, back-EMF, load and drag on the wheel; whether above or below the dead zone."""
    volts, emf = lane[at.GAIN * LANES + i] * command, lane[at.BACK_EMF * LANES + i]
    edge_p, edge_n = lane[at.EDGE_P * LANES + i], lane[at.EDGE_N * LANES + i]
    torque = volts - emf * y
    above, below = torque > edge_p, torque < edge_n
    live = above | below
    drive = gear * (volts - (edge_p if above else edge_n))
    drive = drive if live else 0.0
    drag = lane[at.MOTOR_DRAG * LANES + i] + (gear * emf if live else 0.0)
    return volts, emf, drive, drag, above, below


@njit_lane
def move(lane: Array, i: int, peaked: int, resting: int) -> int:
    """Run i of a block one step on; 1 and nothing moved where its mode may end in the step, else 0.

    The mode is that of the start: sides and branch by sign and edges. `peaked`: some run of the block has Stribeck's
    peak; `resting`: some axis or wheel rests. Both are plain numbers where this is called, so that what is not needed
    is not compiled.
    """
    q1, u, q2, y = lane[at.Q1 * LANES + i], lane[at.U * LANES + i], lane[at.Q2 * LANES + i], lane[at.Y * LANES + i]
    command, gear = lane[at.COMMAND * LANES + i], lane[at.GEAR * LANES + i]
    kink1, kink2 = lane[at.AXIS_KINK * LANES + i], lane[at.WHEEL_KINK * LANES + i]
    gravity = lane[at.GRAVITY * LANES + i]
    side1, side2 = (1.0 if u >= 0.0 else -1.0), (1.0 if y >= 0.0 else -1.0)
    sine, cosine = sine_cosine(q1)

    volts, emf, drive, drag, above, below = motor(lane, i, command, gear, y)
    edge_p, edge_n = lane[at.EDGE_P * LANES + i], lane[at.EDGE_N * LANES + i]
    dry2 = side2 * lane[at.MOTOR_COULOMB * LANES + i]

    viscous_p, viscous_n = lane[at.VISCOUS_P * LANES + i], lane[at.VISCOUS_N * LANES + i]
    coulomb_p, coulomb_n = lane[at.COULOMB_P * LANES + i], lane[at.COULOMB_N * LANES + i]
    static_p, static_n = lane[at.STATIC_P * LANES + i], lane[at.STATIC_N * LANES + i]
    positive = u >= 0.0
    viscous = viscous_p if positive else viscous_n
    dry1 = coulomb_p if positive else -coulomb_n
    outer = lane[at.DIRECT * LANES + i] * command - lane[at.OFFSET * LANES + i]

    m11, m12, m22 = lane[at.M11 * LANES + i], lane[at.M12 * LANES + i], lane[at.M22 * LANES + i]
    spike, height = 0.0, 0.0
    if peaked:
        spike = lane[at.PEAK * LANES + i]
        height = (static_p if positive else -static_n) - dry1
        height = height if spike > 0.0 else 0.0
    rest1, rest2 = False, False
    if resting:
        rest1, rest2 = (u == 0.0) & (lane[at.AXIS_STICKS * LANES + i] != 0.0), (y == 0.0) & (kink2 != 0.0)
        alone1, alone2 = lane[at.ALONE1 * LANES + i], lane[at.ALONE2 * LANES + i]
        both = not (rest1 | rest2)
        m12 = m12 if both else 0.0
        m11 = m11 if both else (0.0 if rest1 else alone1)
        m22 = m22 if both else (0.0 if rest2 else alone2)
        dry1 = 0.0 if rest1 else dry1
        height = 0.0 if rest1 else height
        dry2 = 0.0 if rest2 else dry2

    axis = (gravity, viscous, side1 * lane[at.QUADRATIC * LANES + i], outer - dry1, height, spike)
    cu, cy = series.coefficients(sine, cosine, u, y, axis, (drive - dry2, drag), (m11, m12, m22), peaked)
    u_end, y_end = series.moved(u, cu, 1.0), series.moved(y, cy, 1.0)

    # a speed that passes zero, or that its first slope would take there: it may have been beyond and back
    passed1, passed2 = u_end * side1 < 0.0, y_end * side2 < 0.0
    passed1 |= (u + cu[0]) * side1 < 0.0
    passed2 |= (y + cy[0]) * side2 < 0.0
    if resting:
        passed1, passed2 = passed1 & (not rest1), passed2 & (not rest2)
    torque = volts - emf * y_end
    flagged = (passed1 & (kink1 != 0.0)) | (passed2 & (kink2 != 0.0))
    flagged |= (above ^ (torque > edge_p)) | (below ^ (torque < edge_n))
    flagged |= too_long(cu[3], cu[4], peaked) | too_long(cy[3], cy[4], peaked)
    if peaked:  # the fifth may be small by chance
        flagged |= (abs(cu[3]) > FOURTH) & (abs(cu[3]) ** 3 > PEAKED_ERROR * cu[2] * cu[2])
    if resting:
        a12, released = lane[at.A12 * LANES + i], lane[at.WHEEL_STATIC * LANES + i]
        hold = outer - gravity * sine
        start, end = hold - a12 * cy[0], hold - a12 * series.slope(cy, 1.0)
        flagged |= rest1 & ((start > static_p) | (start < -static_n) | (end > static_p) | (end < -static_n))
        start, end = drive - a12 * cu[0], drive - a12 * series.slope(cu, 1.0)
        flagged |= rest2 & ((abs(start) > released) | (abs(end) > released))

    lane[at.Q1 * LANES + i] = q1 if flagged else q1 + series.turned(u, cu, 1.0)
    lane[at.U * LANES + i] = u if flagged else u_end
    lane[at.Q2 * LANES + i] = q2 if flagged else q2 + series.turned(y, cy, 1.0)
    lane[at.Y * LANES + i] = y if flagged else y_end
    parts = 1.0
    if peaked:  # each passes through a part of the peak, if the step goes through it
        parts = max(1.0, PARTS * np.sqrt(spike) * abs(cu[0])) if abs(u) < abs(cu[0]) * NEAR else 1.0
    lane[at.FLAG * LANES + i] = parts if flagged else 0.0
    return 1 if flagged else 0


@njit_lane
def move_all(lane: Array, peaked: int, resting: int) -> int:
    """All runs of a block one step on; how many are left for `redo`."""
    widest()
    count = 0
    for i in range(LANES):
        count += move(lane, i, peaked, resting)
    return count


@njit_lane
def any_rests(lane: Array) -> int:
    """How many runs of a block have an axis or a wheel at rest, where it can stick."""
    widest()
    count = 0
    for i in range(LANES):
        rests = (lane[at.U * LANES + i] == 0.0) & (lane[at.AXIS_STICKS * LANES + i] != 0.0)
        rests |= (lane[at.Y * LANES + i] == 0.0) & (lane[at.WHEEL_KINK * LANES + i] != 0.0)
        count += 1 if rests else 0
    return count


@njit_lane
def read_all(lane: Array, bent: int, noise: Array, row: int) -> None:
    """Readings of both encoders of all runs, with the `row` of the noise (2, rows or 1, LANES)."""
    widest()
    if bent:
        for i in range(LANES):
            read_bent(lane, i, at.Q1, at.ANGLE_STEP, at.ANGLE_READING, noise[0, row, i])
            read_bent(lane, i, at.Q2, at.WHEEL_STEP, at.WHEEL_READING, noise[1, row, i])
    for i in range(0 if bent else LANES):
        zero, step = lane[at.ANGLE_ZERO * LANES + i], lane[at.ANGLE_STEP * LANES + i]
        lane[at.ANGLE_READING * LANES + i] = reading(lane[at.Q1 * LANES + i], zero, noise[0, row, i], step)
        zero, step = lane[at.WHEEL_ZERO * LANES + i], lane[at.WHEEL_STEP * LANES + i]
        lane[at.WHEEL_READING * LANES + i] = reading(lane[at.Q2 * LANES + i], zero, noise[1, row, i], step)


@njit_lane
def command_all(lane: Array, closed: int, sample: float) -> None:
    """Commands of all runs, of the controllers or as given, within each rig's own limit."""
    widest()
    if closed:
        for i in range(LANES):
            control(lane, i, sample)
    else:
        for i in range(LANES):
            lane[at.COMMAND * LANES + i] = lane[at.REFERENCE * LANES + i]
    for i in range(LANES):
        limit = lane[at.RIG_LIMIT * LANES + i]
        command = lane[at.COMMAND * LANES + i]
        command = command if command > -limit else -limit
        lane[at.COMMAND * LANES + i] = command if command < limit else limit


@njit_threads
def run_block(
    lane: Array,
    p: Array,
    inputs: Array,
    which: Ints,
    kinds: tuple[int, int, int],
    steps: int,
    h: float,
    noise: Array,
    log: Array,
) -> int:
    """Run a block for all rows of `inputs`, moving `lane` in place to the last row; returns how many steps were redone.

    lane (ROWS * LANES,): as `lanes` says. p (LANES, SIZE): constants once more, for what is done by itself. inputs
    (rows, references): rad; V or N m where the loop is open. which (LANES,): each run's column of them. kinds: whether
    the loop is closed, some friction has Stribeck's peak, some encoder is nonlinear. steps of a sample, each of h (s).
    noise (2, rows or 1, LANES) (rad). log (channels, runs <= LANES, rows) receives angle, wheel angle, command and
    k tilde of every row, as many as it has channels.
    """
    widest()
    closed, peaked, bent = kinds
    rows, channels, noisy = len(inputs), len(log), noise.shape[1] > 1
    sample = h * steps
    work, nothing, nowhere, counts = np.zeros((10, 5)), np.zeros(0), np.zeros((0, 5)), np.zeros(4, np.int64)
    taylor, redone, resting = np.zeros((6, series.TERMS + 1)), 0, any_rests(lane)
    for k in range(rows):
        for i in range(LANES):
            lane[at.REFERENCE * LANES + i] = inputs[k, which[i]]
        read_all(lane, bent, noise, k if noisy else 0)
        command_all(lane, closed, sample)
        for channel in range(channels):
            first = (at.ANGLE_READING + channel) * LANES if channel < 3 else at.K_TILDE * LANES
            for i in range(log.shape[1]):
                log[channel, i, k] = lane[first + i]
        if k == rows - 1:
            break
        for _ in range(steps):
            if resting:
                count = move_all(lane, 1, 1)
            elif peaked:
                count = move_all(lane, 1, 0)
            else:
                count = move_all(lane, 0, 0)
            if count > 0:
                redone += count
                redo(lane, p, h, work, taylor, nothing, nowhere, counts)
            if resting or count > 0:
                resting = any_rests(lane)
    return redone
