"""The motion of one block of runs, a step at a time: what the loop over the columns computes for each run.

A run whose mode may end in the step, that rests, or whose series is too short for the step, stays where it is and is
flagged; `events` takes its step in parts. The sine and the cosine of q1 are turned on with the angle, and computed
afresh now and then.
"""

from __future__ import annotations

from swingid.numerics.arrays import Array
from swingid.numerics.vectors import njit_lane, sine_cosine, widest
from swingid.simulation.ensemble import lanes as at
from swingid.simulation.ensemble import series
from swingid.simulation.ensemble.lanes import LANES

ERROR, PEAKED_ERROR = 1e-14, 1e-13
"""rad per step: what a series of a step may leave out, without and with Stribeck's peak; else parts are taken."""

FIFTH, FOURTH = 1e-13, 1e-10
"""rad per step: terms below which what follows is negligible."""

LARGEST_TURN = 0.15
"""rad per step: up to here `turn` is exact to 1e-15."""

Motor = tuple[float, float, float, float, bool, bool]
"""η c1 u (N m) and the back-EMF's part of the torque (N m per Y), load and drag on the wheel, above, below the dead
zone."""


@njit_lane
def too_long(k: series.Derivatives, rich: int | None) -> bool:
    """Whether a step is too long for a series with these derivatives: the next term is the last squared, divided."""
    error = ERROR if rich is None else PEAKED_ERROR
    flagged = (abs(k[4]) > 120.0 * FIFTH) & (k[4] * k[4] > 600.0 * error * abs(k[3]))
    return bool(flagged)


@njit_lane
def motor(lane: Array, i: int, y: float) -> Motor:
    """Run i's motor at the wheel's speed Y."""
    gear, volts, emf = lane[at.GEAR * LANES + i], lane[at.GAIN * LANES + i], lane[at.BACK_EMF * LANES + i]
    edge_p, edge_n = lane[at.EDGE_P * LANES + i], lane[at.EDGE_N * LANES + i]
    volts *= lane[at.COMMAND * LANES + i]
    torque = volts - emf * y
    above, below = torque > edge_p, torque < edge_n
    live = above | below
    drive = gear * (volts - (edge_p if above else edge_n))
    drive = drive if live else 0.0
    drag = lane[at.MOTOR_DRAG * LANES + i] + (gear * emf if live else 0.0)
    return volts, emf, drive, drag, above, below


@njit_lane
def held(lane: Array, i: int) -> float:
    """Load (N m) on run i's axis, without friction: what friction holds where the axis rests."""
    outer = lane[at.DIRECT * LANES + i] * lane[at.COMMAND * LANES + i] - lane[at.OFFSET * LANES + i]
    return float(outer)


@njit_lane
def friction(lane: Array, i: int, positive: bool, rich: int | None) -> tuple[float, float, float, float, float]:
    """Run i's friction in one direction: viscous, dry, cubic, and height and narrowness of Stribeck's peak."""
    viscous_p, viscous_n = lane[at.VISCOUS_P * LANES + i], lane[at.VISCOUS_N * LANES + i]
    coulomb_p, coulomb_n = lane[at.COULOMB_P * LANES + i], lane[at.COULOMB_N * LANES + i]
    viscous, dry, cubic, height, spike = (viscous_p if positive else viscous_n), coulomb_p, 0.0, 0.0, 0.0
    dry = coulomb_p if positive else -coulomb_n
    if rich is not None:
        cubic, spike = lane[at.CUBIC * LANES + i], lane[at.PEAK * LANES + i]
        static_p, static_n = lane[at.STATIC_P * LANES + i], lane[at.STATIC_N * LANES + i]
        height = (static_p if positive else -static_n) - dry
        height = height if spike > 0.0 else 0.0
    return viscous, dry, cubic, height, spike


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
    """Start and series of run i's step or part."""
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
def move(lane: Array, i: int, rich: int | None, late: int | None) -> int:
    """Run i of a block one step on; 1 and nothing moved where its mode may end in the step, else 0.

    The mode is that of the start: sides and branch by sign and edges. `rich`: some run of the block has Stribeck's peak
    or cubic friction; `late`: some encoder is not read on time. What is None is not compiled.
    """
    q1, u, q2, y = lane[at.Q1 * LANES + i], lane[at.U * LANES + i], lane[at.Q2 * LANES + i], lane[at.Y * LANES + i]
    positive = u >= 0.0
    side1, side2 = (1.0 if positive else -1.0), (1.0 if y >= 0.0 else -1.0)
    sine, cosine = lane[at.SINE * LANES + i], lane[at.COSINE * LANES + i]
    volts, emf, drive, drag, above, below = motor(lane, i, y)
    viscous, dry, cubic, height, spike = friction(lane, i, positive, rich)
    quadratic = side1 * lane[at.QUADRATIC * LANES + i]
    mobility = (lane[at.M11 * LANES + i], lane[at.M12 * LANES + i], lane[at.M22 * LANES + i])
    axis = (lane[at.GRAVITY * LANES + i], viscous, quadratic, held(lane, i) - dry, cubic, height, spike)
    wheel = (drive - side2 * lane[at.MOTOR_COULOMB * LANES + i], drag)
    cu, cy = series.derivatives(sine, cosine, u, y, axis, wheel, mobility, rich)
    u_end, y_end = series.at_end(u, cu), series.at_end(y, cy)
    x1 = series.turned_at_end(u, cu)
    if late is not None:
        keep(lane, i, cu, cy)

    # a speed that is or passes zero, or that its first slope would take there: it may have been beyond and back
    flagged = min(u * u_end, u * (u + cu[0])) <= lane[at.AXIS_KINK * LANES + i]
    flagged |= min(y * y_end, y * (y + cy[0])) <= lane[at.WHEEL_KINK * LANES + i]
    torque = volts - emf * y_end
    flagged |= above ^ (torque > lane[at.EDGE_P * LANES + i])
    flagged |= below ^ (torque < lane[at.EDGE_N * LANES + i])
    flagged |= too_long(cu, rich) | too_long(cy, rich) | (abs(x1) > LARGEST_TURN)
    if rich is not None:  # the fifth may be small by chance
        fourth, third = abs(cu[3]) * (1 / 24), cu[2] * (1 / 6)
        flagged |= (fourth > FOURTH) & (fourth * fourth * fourth > PEAKED_ERROR * third * third)

    lane[at.Q1 * LANES + i] = q1 if flagged else q1 + x1
    lane[at.U * LANES + i] = u if flagged else u_end
    lane[at.Q2 * LANES + i] = q2 if flagged else q2 + series.turned_at_end(y, cy)
    lane[at.Y * LANES + i] = y if flagged else y_end
    turn(lane, i, x1, flagged)
    lane[at.FLAG * LANES + i] = 1.0 if flagged else 0.0
    return 1 if flagged else 0


@njit_lane
def move_all(lane: Array, rich: int | None, late: int | None) -> int:
    """All runs of a block one step on; how many are left for `redo`."""
    widest()
    count = 0
    for i in range(LANES):
        count += move(lane, i, rich, late)
    return count
