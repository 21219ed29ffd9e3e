"""The motion of one block of runs, a step at a time: what the loop over the columns computes for each run.

A run whose mode may end in the step, that rests, or whose series is too short for the step, stays where it is and is
flagged; `events` takes its step in parts. The sine and the cosine of q1 are turned on with the angle, and computed
afresh now and then.
"""

from __future__ import annotations

from swingid.numerics.arrays import Array
from swingid.numerics.vectors import decay, njit_lane, sine_cosine, widest
from swingid.simulation.ensemble import lanes as at
from swingid.simulation.ensemble import series
from swingid.simulation.ensemble.lanes import LANES

ERROR, PEAKED_ERROR = 1e-14, 1e-13
"""rad per step: what a series of a step may leave out, without and with Stribeck's peak; else parts are taken."""

NEGLIGIBLE = (120.0 * 1e-13) ** 2
"""Square of the fifth derivative (rad per step) below which what follows is negligible."""

FOURTH = 1.44e8
"""By which a cube of fourth terms is beyond its limit where a square of fifth ones is: both by 1e-10 of them."""

LARGEST_TURN = 0.05
"""rad per step: up to here `turn` is exact to 1e-15."""

Motor = tuple[float, float, float, float, bool, bool]
"""η c1 u (N m) and the back-EMF's part of the torque (N m per Y), load and drag on the wheel, above, below the dead
zone."""


@njit_lane
def motor(lane: Array, i: int, y: float) -> Motor:
    """Run i's motor at the wheel's speed Y."""
    gear, volts, emf = lane[at.GEAR, i], lane[at.GAIN, i], lane[at.BACK_EMF, i]
    edge_p, edge_n = lane[at.EDGE_P, i], lane[at.EDGE_N, i]
    volts *= lane[at.COMMAND, i]
    torque = volts - emf * y
    above, below = torque > edge_p, torque < edge_n
    live = above | below
    drive = gear * (volts - (edge_p if above else edge_n))
    drive = drive if live else 0.0
    drag = lane[at.MOTOR_DRAG, i] + (gear * emf if live else 0.0)
    return volts, emf, drive, drag, above, below


@njit_lane
def held(lane: Array, i: int) -> float:
    """Load (N m) on run i's axis, without friction: what friction holds where the axis rests."""
    outer = lane[at.DIRECT, i] * lane[at.COMMAND, i] - lane[at.OFFSET, i]
    return float(outer)


@njit_lane
def start(
    lane: Array, i: int, sides: series.Pair, mobility: tuple[float, float, float], pull: series.Pair, rich: int | None
) -> series.Pair:
    """Run i's U1 and Y1 in a mode (sides: 0 at rest); they, and what `climb` takes beside them, into their rows.

    mobility: h^2 M^-1 as (11, 12, 22), where 12 is taken off. pull: gravity's part of U' and Y', per sine.
    """
    u, y, sine = lane[at.U, i], lane[at.Y, i], lane[at.SINE, i]
    (side1, side2), (m11, m12, m22), positive = sides, mobility, sides[0] >= 0.0
    viscous_p, viscous_n = lane[at.VISCOUS_P, i], lane[at.VISCOUS_N, i]
    coulomb_p, coulomb_n = lane[at.COULOMB_P, i], lane[at.COULOMB_N, i]
    viscous, dry = (viscous_p if positive else viscous_n), (coulomb_p if positive else -coulomb_n)
    _, _, drive, drag, _, _ = motor(lane, i, y)
    load1, load2 = held(lane, i), drive - side2 * lane[at.MOTOR_COULOMB, i]
    load1 = load1 if side1 == 0.0 else load1 - dry
    vu, vy, du, dy = -m11 * viscous, m12 * viscous, m12 * drag, -m22 * drag
    u1 = (((m11 * load1 - m12 * load2) + pull[0] * sine) + vu * u) + du * y
    y1 = (((m22 * load2 - m12 * load1) + pull[1] * sine) + vy * u) + dy * y
    if rich is not None:
        static_p, static_n = lane[at.STATIC_P, i], lane[at.STATIC_N, i]
        spike, quadratic = lane[at.PEAK, i], side1 * lane[at.QUADRATIC, i]
        height = (static_p if positive else -static_n) - dry
        height = height if (spike > 0.0) & (side1 != 0.0) else 0.0
        square = u * u
        g = height * decay(spike * square)
        f = g + square * (quadratic + lane[at.CUBIC, i] * u)
        u1, y1 = u1 - m11 * f, y1 + m12 * f
        lane[at.PRESENT, i], lane[at.PRESENT + 1, i] = g, quadratic
    lane[at.SLOPES, i], lane[at.SLOPES + 1, i] = u1, y1
    lane[at.RATES, i], lane[at.RATES + 1, i] = vu, vy
    lane[at.RATES + 2, i], lane[at.RATES + 3, i] = du, dy
    return u1, y1


@njit_lane
def climb(
    lane: Array, i: int, pull: int, mobility: int, rich: int | None
) -> tuple[series.Derivatives, series.Derivatives]:
    """Run i's series from what `start` left; pull, mobility: the first rows of what that took."""
    sine, cosine, u = lane[at.SINE, i], lane[at.COSINE, i], lane[at.U, i]
    slopes = lane[at.SLOPES, i], lane[at.SLOPES + 1, i]
    gravity = lane[pull, i], lane[pull + 1, i]
    viscous = lane[at.RATES, i], lane[at.RATES + 1, i]
    drag = lane[at.RATES + 2, i], lane[at.RATES + 3, i]
    bent = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    if rich is not None:
        m11, m12, cubic = lane[mobility, i], lane[mobility + 1, i], lane[at.CUBIC, i]
        g, quadratic = lane[at.PRESENT, i], lane[at.PRESENT + 1, i]
        bent = (m11, m12, quadratic, cubic, lane[at.PEAK, i], g)
    return series.derivatives(sine, cosine, u, slopes, gravity, viscous, drag, bent, rich)


@njit_lane
def turn(lane: Array, i: int, x: float, stays: bool) -> None:
    """Sine and cosine of run i's q1 turned on by x (rad, at most `LARGEST_TURN`), unless it stays where it is."""
    z = x * x
    odd = x + x * z * (-1 / 6 + z * (1 / 120 - z * (1 / 5040)))
    even = z * (-1 / 2 + z * (1 / 24 - z * (1 / 720)))
    sine, cosine = lane[at.SINE, i], lane[at.COSINE, i]
    lane[at.SINE, i] = sine if stays else (sine + sine * even) + cosine * odd
    lane[at.COSINE, i] = cosine if stays else (cosine + cosine * even) - sine * odd


@njit_lane
def afresh(lane: Array) -> None:
    """Sine and cosine of q1 of all runs, computed from the angle."""
    widest()
    for i in range(LANES):
        lane[at.SINE, i], lane[at.COSINE, i] = sine_cosine(lane[at.Q1, i])


@njit_lane
def keep(lane: Array, i: int, cu: series.Derivatives, cy: series.Derivatives) -> None:
    """Start and series of run i's step or part."""
    lane[at.START, i] = lane[at.Q1, i]
    lane[at.START + 1, i] = lane[at.U, i]
    lane[at.START + 2, i] = lane[at.Q2, i]
    lane[at.START + 3, i] = lane[at.Y, i]
    lane[at.SERIES1, i], lane[at.SERIES1 + 1, i] = cu[0], cu[1]
    lane[at.SERIES1 + 2, i], lane[at.SERIES1 + 3, i] = cu[2], cu[3]
    lane[at.SERIES1 + 4, i] = cu[4]
    lane[at.SERIES2, i], lane[at.SERIES2 + 1, i] = cy[0], cy[1]
    lane[at.SERIES2 + 2, i], lane[at.SERIES2 + 3, i] = cy[2], cy[3]
    lane[at.SERIES2 + 4, i] = cy[4]


@njit_lane
def set_out(lane: Array, i: int, rich: int | None) -> None:
    """Run i's `start` in the mode of its speeds and torque: sides by sign, branch by edges."""
    sides = (1.0 if lane[at.U, i] >= 0.0 else -1.0), (1.0 if lane[at.Y, i] >= 0.0 else -1.0)
    mobility = (lane[at.M11, i], lane[at.M12, i], lane[at.M22, i])
    start(lane, i, sides, mobility, (lane[at.PULL, i], lane[at.PULL + 1, i]), rich)


@njit_lane
def reach(lane: Array, i: int, rich: int | None, late: int | None) -> None:
    """Return where run i's series leads in a step, and whether it is too long: the next term is the last squared,
    divided.
    """
    u, y = lane[at.U, i], lane[at.Y, i]
    cu, cy = climb(lane, i, at.PULL, at.M11, rich)
    x1, error = series.turned_at_end(u, cu), 600.0 * (ERROR if rich is None else PEAKED_ERROR)
    lane[at.ENDS, i], lane[at.ENDS + 1, i] = series.at_end(u, cu), series.at_end(y, cy)
    lane[at.ENDS + 2, i], lane[at.ENDS + 3, i] = x1, series.turned_at_end(y, cy)
    beyond = max(cu[4] * cu[4] - error * abs(cu[3]), cy[4] * cy[4] - error * abs(cy[3]))
    beyond = max(beyond, x1 * x1 - LARGEST_TURN * LARGEST_TURN)
    if rich is not None:  # the fifth may be small by chance
        fourth, third = abs(cu[3]) * (1 / 24), cu[2] * (1 / 6)
        beyond = max(beyond, FOURTH * (fourth * fourth * fourth - PEAKED_ERROR * third * third))
    lane[at.TOO_LONG, i] = beyond
    if late is not None:
        keep(lane, i, cu, cy)


@njit_lane
def arrive(lane: Array, i: int) -> int:
    """Run i at the end of its step; 1 and nothing moved where its mode may have ended in it, or it is too long."""
    q1, u, q2, y = lane[at.Q1, i], lane[at.U, i], lane[at.Q2, i], lane[at.Y, i]
    u_end, y_end = lane[at.ENDS, i], lane[at.ENDS + 1, i]
    x1, x2 = lane[at.ENDS + 2, i], lane[at.ENDS + 3, i]
    volts, emf, _, _, above, below = motor(lane, i, y)
    torque = volts - emf * y_end
    flagged = lane[at.TOO_LONG, i] > NEGLIGIBLE
    flagged |= above ^ (torque > lane[at.EDGE_P, i])
    flagged |= below ^ (torque < lane[at.EDGE_N, i])
    # a speed that is or passes zero, or that its first slope would take there: it may have been beyond and back
    first1, first2 = u + lane[at.SLOPES, i], y + lane[at.SLOPES + 1, i]
    flagged |= min(u * u_end, u * first1) <= lane[at.AXIS_KINK, i]
    flagged |= min(y * y_end, y * first2) <= lane[at.WHEEL_KINK, i]
    lane[at.Q1, i] = q1 if flagged else q1 + x1
    lane[at.U, i] = u if flagged else u_end
    lane[at.Q2, i] = q2 if flagged else q2 + x2
    lane[at.Y, i] = y if flagged else y_end
    turn(lane, i, x1, flagged)
    lane[at.FLAG, i] = 1.0 if flagged else 0.0
    return 1 if flagged else 0


@njit_lane
def move_all(lane: Array, rich: int | None, late: int | None) -> int:
    """All runs of a block one step on; how many are left for `redo`.

    `rich`: some run of the block has Stribeck's peak, quadratic or cubic friction; `late`: some encoder is not read on
    time. What is None is not compiled. Three loops, whose chains of operations are short enough that the processor
    works on several vectors at once.
    """
    widest()
    for i in range(LANES):
        set_out(lane, i, rich)
    for i in range(LANES):
        reach(lane, i, rich, late)
    count = 0
    for i in range(LANES):
        count += arrive(lane, i)
    return count
