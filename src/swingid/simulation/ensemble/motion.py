"""The motion of one block of runs, a step at a time: what the loop over the columns computes for each run.

A run whose mode may end in the step, or whose series is too short for it, stays where it is and is flagged; `events`
takes its step again. The sine and the cosine of q1 are turned on with the angle, and computed afresh now and then.
"""

from __future__ import annotations

import numpy as np

from swingid.numerics.arrays import Array
from swingid.numerics.vectors import njit_lane, sine_cosine, widest
from swingid.simulation.ensemble import lanes as at
from swingid.simulation.ensemble import series
from swingid.simulation.ensemble.lanes import LANES

ERROR, PEAKED_ERROR = 1e-14, 1e-13
"""rad per step: what a step may leave out of its series, without and with Stribeck's peak, else it is taken again."""

PARTS, NEAR = 2.0, 2.5
"""Stribeck's peak is passed in so many steps per Stribeck speed, where the speed is below so many changes of a step."""

FIFTH, PEAKED_FIFTH, FOURTH = 1e-13, 1e-13, 1e-10
"""rad per step: terms below which what follows is negligible."""

LARGEST_TURN = 0.15
"""rad per step: up to here `turn` is exact to 1e-15."""


@njit_lane
def too_long(k: series.Derivatives, rich: int | None) -> bool:
    """Whether a step is too long for a series with these derivatives: the next term is the last squared, divided."""
    error, least = ERROR, FIFTH
    if rich is not None:
        error, least = PEAKED_ERROR, PEAKED_FIFTH
    flagged = (abs(k[4]) > 120.0 * least) & (k[4] * k[4] > 600.0 * error * abs(k[3]))
    return bool(flagged)


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
def turn(lane: Array, i: int, x: float, stays: bool) -> None:
    """Sine and cosine of run i's q1 turned on by x (rad, at most `LARGEST_TURN`), unless it stays where it is."""
    z = x * x
    odd = x + x * z * ((-1 / 6 + z * (1 / 120)) + z * z * (-1 / 5040 + z * (1 / 362880)))
    even = z * ((-1 / 2 + z * (1 / 24)) + z * z * (-1 / 720 + z * (1 / 40320)))
    sine, cosine = lane[at.SINE * LANES + i], lane[at.COSINE * LANES + i]
    lane[at.SINE * LANES + i] = sine if stays else sine + (sine * even + cosine * odd)
    lane[at.COSINE * LANES + i] = cosine if stays else cosine + (cosine * even - sine * odd)


@njit_lane
def afresh(lane: Array) -> None:
    """Sine and cosine of q1 of all runs, computed from the angle."""
    widest()
    for i in range(LANES):
        lane[at.SINE * LANES + i], lane[at.COSINE * LANES + i] = sine_cosine(lane[at.Q1 * LANES + i])


@njit_lane
def keep(lane: Array, i: int, cu: series.Derivatives, cy: series.Derivatives) -> None:
    """Start and series of run i's step, for readings within it."""
    lane[at.START * LANES + i] = lane[at.Q1 * LANES + i]
    lane[(at.START + 1) * LANES + i] = lane[at.U * LANES + i]
    lane[(at.START + 2) * LANES + i] = lane[at.Q2 * LANES + i]
    lane[(at.START + 3) * LANES + i] = lane[at.Y * LANES + i]
    lane[at.SERIES1 * LANES + i], lane[(at.SERIES1 + 1) * LANES + i] = cu[0], cu[1]
    lane[(at.SERIES1 + 2) * LANES + i], lane[(at.SERIES1 + 3) * LANES + i] = cu[2], cu[3]
    lane[(at.SERIES1 + 4) * LANES + i] = cu[4]
    lane[at.SERIES2 * LANES + i], lane[(at.SERIES2 + 1) * LANES + i] = cy[0], cy[1]
    lane[(at.SERIES2 + 2) * LANES + i], lane[(at.SERIES2 + 3) * LANES + i] = cy[2], cy[3]
    lane[(at.SERIES2 + 4) * LANES + i] = cy[4]


@njit_lane
def move(lane: Array, i: int, rich: int | None, resting: int | None, late: int | None) -> int:
    """Run i of a block one step on; 1 and nothing moved where its mode may end in the step, else 0.

    The mode is that of the start: sides and branch by sign and edges. `rich`: some run of the block has Stribeck's peak
    or cubic friction; `resting`: some axis or wheel rests; `late`: some encoder is not read on time. What is None is
    not compiled.
    """
    q1, u, q2, y = lane[at.Q1 * LANES + i], lane[at.U * LANES + i], lane[at.Q2 * LANES + i], lane[at.Y * LANES + i]
    command, gear = lane[at.COMMAND * LANES + i], lane[at.GEAR * LANES + i]
    kink1, kink2 = lane[at.AXIS_KINK * LANES + i], lane[at.WHEEL_KINK * LANES + i]
    gravity = lane[at.GRAVITY * LANES + i]
    side1, side2 = (1.0 if u >= 0.0 else -1.0), (1.0 if y >= 0.0 else -1.0)
    sine, cosine = lane[at.SINE * LANES + i], lane[at.COSINE * LANES + i]

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
    cubic, spike, height = 0.0, 0.0, 0.0
    if rich is not None:
        cubic, spike = lane[at.CUBIC * LANES + i], lane[at.PEAK * LANES + i]
        height = (static_p if positive else -static_n) - dry1
        height = height if spike > 0.0 else 0.0
    rest1, rest2 = False, False
    if resting is not None:
        rest1, rest2 = (u == 0.0) & (lane[at.AXIS_STICKS * LANES + i] != 0.0), (y == 0.0) & (kink2 != 0.0)
        alone1, alone2 = lane[at.ALONE1 * LANES + i], lane[at.ALONE2 * LANES + i]
        both = not (rest1 | rest2)
        m12 = m12 if both else 0.0
        m11 = m11 if both else (0.0 if rest1 else alone1)
        m22 = m22 if both else (0.0 if rest2 else alone2)
        dry1 = 0.0 if rest1 else dry1
        height = 0.0 if rest1 else height
        dry2 = 0.0 if rest2 else dry2

    axis = (gravity, viscous, side1 * lane[at.QUADRATIC * LANES + i], outer - dry1, cubic, height, spike)
    cu, cy = series.derivatives(sine, cosine, u, y, axis, (drive - dry2, drag), (m11, m12, m22), rich)
    u_end, y_end = series.at_end(u, cu), series.at_end(y, cy)
    x1 = series.turned_at_end(u, cu)
    if late is not None:
        keep(lane, i, cu, cy)

    # a speed that passes zero, or that its first slope would take there: it may have been beyond and back
    passed1, passed2 = u_end * side1 < 0.0, y_end * side2 < 0.0
    passed1 |= (u + cu[0]) * side1 < 0.0
    passed2 |= (y + cy[0]) * side2 < 0.0
    if resting is not None:
        passed1, passed2 = passed1 & (not rest1), passed2 & (not rest2)
    torque = volts - emf * y_end
    flagged = (passed1 & (kink1 != 0.0)) | (passed2 & (kink2 != 0.0))
    flagged |= (above ^ (torque > edge_p)) | (below ^ (torque < edge_n))
    flagged |= too_long(cu, rich) | too_long(cy, rich) | (abs(x1) > LARGEST_TURN)
    if rich is not None:  # the fifth may be small by chance
        fourth, third = abs(cu[3]) * (1 / 24), cu[2] * (1 / 6)
        flagged |= (fourth > FOURTH) & (fourth * fourth * fourth > PEAKED_ERROR * third * third)
    if resting is not None:
        a12, released = lane[at.A12 * LANES + i], lane[at.WHEEL_STATIC * LANES + i]
        hold = outer - gravity * sine
        start, end = hold - a12 * cy[0], hold - a12 * series.slope_at_end(cy)
        flagged |= rest1 & ((start > static_p) | (start < -static_n) | (end > static_p) | (end < -static_n))
        start, end = drive - a12 * cu[0], drive - a12 * series.slope_at_end(cu)
        flagged |= rest2 & ((abs(start) > released) | (abs(end) > released))

    lane[at.Q1 * LANES + i] = q1 if flagged else q1 + x1
    lane[at.U * LANES + i] = u if flagged else u_end
    lane[at.Q2 * LANES + i] = q2 if flagged else q2 + series.turned_at_end(y, cy)
    lane[at.Y * LANES + i] = y if flagged else y_end
    turn(lane, i, x1, flagged)
    parts = 1.0
    if rich is not None:  # each passes through a part of the peak, if the step goes through it
        parts = max(1.0, PARTS * np.sqrt(spike) * abs(cu[0])) if abs(u) < abs(cu[0]) * NEAR else 1.0
    lane[at.FLAG * LANES + i] = parts if flagged else 0.0
    return 1 if flagged else 0


@njit_lane
def move_all(lane: Array, rich: int | None, resting: int | None, late: int | None) -> int:
    """All runs of a block one step on; how many are left for `redo`."""
    widest()
    count = 0
    for i in range(LANES):
        count += move(lane, i, rich, resting, late)
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
