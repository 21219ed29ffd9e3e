"""Steps that hold a stop, a release or an edge of the dead zone, or pass Stribeck's peak: taken in parts, in columns.

A part has the same Taylor series as a step. It ends where the series is no longer exact, or where a speed passes zero
or the motor's torque an edge of its dead zone: a root of the polynomial. A run at rest goes on in the mode of
`model.sticking`. The runs go on side by side, each with its own parts, until all have taken the step. What is rarer,
 a release within the step or a turn there and back, is left to `advance` of the single run.
"""

from __future__ import annotations

import numpy as np

from swingid.numerics.arrays import Array
from swingid.numerics.vectors import njit_lane, njit_part, widest
from swingid.simulation.ensemble import lanes as at
from swingid.simulation.ensemble import series
from swingid.simulation.ensemble.lanes import LANES
from swingid.simulation.ensemble.motion import (
    ERROR,
    LARGEST_TURN,
    PEAKED_ERROR,
    climb,
    held,
    keep,
    motor,
    start,
    turn,
)
from swingid.simulation.ensemble.readings import Late, fill

NOTHING, AXIS, WHEEL, EDGE = 0.0, 1.0, 2.0, 3.0
"""What changes at the end of a part: the axis or the wheel stops, the torque passes an edge of the dead zone."""

MOST_PARTS = 100
NEWTON = 8
"""Steps of Newton's method, which begins where a straight line would pass the level."""

CLOSE = 1e-9
"""Of a step: where Newton's method has moved by less, its error is the square of that."""

BEYOND = 1e-11
"""Of a step: how far behind an edge of the dead zone the motion goes on, so that it is on the other side for sure."""

SHORTEST = 1e-10
"""Of a step: a part this short is left out."""

ROUNDING = 1e-15
"""rad per step^2: an acceleration of the wrong side, but below this, is rounding."""

WIDTH = 0.7
"""Ratio of the terms of Stribeck's peak where a step crosses one Stribeck speed."""


@njit_lane
def unsupported(lane: Array, i: int) -> float:
    """Torque (N m) that friction would have to hold for run i's axis to rest, without the wheel's."""
    return float(held(lane, i) - lane[at.GRAVITY, i] * lane[at.SINE, i])


@njit_lane
def sleeps(lane: Array, i: int) -> bool:
    """Return whether all of run i rests, and nothing would move it within the step."""
    u, y, hold = lane[at.U, i], lane[at.Y, i], unsupported(lane, i)
    _, _, drive, _, _, _ = motor(lane, i, y)
    moves = (hold > lane[at.STATIC_P, i]) | (hold < -lane[at.STATIC_N, i])
    moves |= abs(drive) > lane[at.WHEEL_STATIC, i]
    return bool((u == 0.0) & (y == 0.0) & (not moves))


@njit_lane
def all_sleep(lane: Array) -> bool:
    """Return whether all runs rest throughout the step."""
    widest()
    count = 0
    for i in range(LANES):
        count += 1 if sleeps(lane, i) else 0
    return count == LANES


@njit_lane
def begin(lane: Array, is_late: int | None) -> tuple[int, int]:
    """What the runs begin the flagged steps with; how many have something to do, how many sides are undecided."""
    widest()
    count, undecided = 0, 0
    for i in range(LANES):
        u, y, sticks = lane[at.U, i], lane[at.Y, i], lane[at.AXIS_STICKS, i] != 0.0
        flagged, even = lane[at.FLAG, i] != 0.0, lane[at.AXIS_KINK, i] != 0.0
        if is_late is None:
            flagged &= not sleeps(lane, i)
        still = 1.0 if even & (not sticks) else 0.0
        lane[at.SIDE1, i] = 1.0 if u > 0.0 else (-1.0 if u < 0.0 else still)
        still = 1.0 if lane[at.WHEEL_STATIC, i] == 0.0 else 0.0
        lane[at.SIDE2, i] = 1.0 if y > 0.0 else (-1.0 if y < 0.0 else still)
        deciding = flagged & (u == 0.0) & (not sticks) & (not even)
        lane[at.UNDECIDED, i] = 1.0 if deciding else 0.0
        lane[at.REMAINING, i] = 1.0 if flagged else 0.0
        lane[at.BEGIN, i] = 0.0 if flagged else 1.0
        lane[at.LEFT, i] = 0.0
        count += 1 if flagged else 0
        undecided += 1 if deciding else 0
    return count, undecided


@njit_lane
def mobility(lane: Array, i: int, rest1: bool, rest2: bool) -> tuple[float, float, float]:
    """Run i's mobilities where axis or wheel may rest."""
    both = not (rest1 | rest2)
    m11, m12, m22 = lane[at.M11, i], lane[at.M12, i], lane[at.M22, i]
    alone1, alone2 = lane[at.ALONE1, i], lane[at.ALONE2, i]
    m11 = m11 if both else (0.0 if rest1 else alone1)
    return m11, (m12 if both else 0.0), (m22 if both else (0.0 if rest2 else alone2))


@njit_lane
def pulls(lane: Array, i: int, mobile: tuple[float, float, float]) -> series.Pair:
    """Gravity's part of run i's U' and Y' with these mobilities, per sine."""
    gravity = lane[at.GRAVITY, i]
    return -mobile[0] * gravity, mobile[1] * gravity


@njit_lane
def beyond(lane: Array, i: int, hold1: float, hold2: float, rest1: bool, rest2: bool) -> bool:
    """Return whether what rests of run i would be released by these torques (N m)."""
    positive, negative = lane[at.STATIC_P, i], lane[at.STATIC_N, i]
    axis = rest1 & ((hold1 > positive) | (hold1 < -negative))
    return bool(axis | (rest2 & (abs(hold2) > lane[at.WHEEL_STATIC, i])))


@njit_lane
def leave(lane: Array, i: int, leaves: bool) -> None:
    """Leave what is still to be taken of run i's step to the single run, if so."""
    remaining, outside, undecided = lane[at.REMAINING, i], lane[at.LEFT, i], lane[at.UNDECIDED, i]
    lane[at.LEFT, i] = remaining if leaves else outside
    lane[at.REMAINING, i] = 0.0 if leaves else remaining
    lane[at.UNDECIDED, i] = 0.0 if leaves else undecided


@njit_lane
def try_mode(lane: Array, i: int, interval: tuple[float, float], both: bool, last: bool, rich: int | None) -> int:
    """Decide for the sides `one` (0: rest) of what stands still of run i, if they agree, as of `sticking.agrees`.

    both: for runs whose axis and wheel stand still, else for the others. Where none agrees, after the `last` what is
    still to be taken of the step is left. 1 where the run is still undecided.
    """
    u, y, side1, side2 = lane[at.U, i], lane[at.Y, i], lane[at.SIDE1, i], lane[at.SIDE2, i]
    still1, still2, undecided = u == 0.0, y == 0.0, lane[at.UNDECIDED, i] != 0.0
    side1, side2 = (interval[0] if still1 else side1), (interval[1] if still2 else side2)
    rest1, rest2, hold = side1 == 0.0, side2 == 0.0, unsupported(lane, i)
    _, _, drive, _, _, _ = motor(lane, i, y)
    mobile = mobility(lane, i, rest1, rest2)
    k1, k2 = start(lane, i, (side1, side2), mobile, pulls(lane, i, mobile), rich)
    a12, sticks = lane[at.A12, i], lane[at.AXIS_STICKS, i] != 0.0
    mine = undecided & ((still1 & still2) == both)
    agrees = mine & (not beyond(lane, i, hold - a12 * k2, drive - a12 * k1, rest1 & still1, rest2 & still2))
    agrees &= (sticks | (not rest1)) & ((lane[at.WHEEL_STATIC, i] > 0.0) | (not rest2))
    agrees &= ((not still1) | (side1 * k1 >= -ROUNDING)) & ((not still2) | (side2 * k2 >= -ROUNDING))
    was1, was2 = lane[at.SIDE1, i], lane[at.SIDE2, i]
    lane[at.SIDE1, i], lane[at.SIDE2, i] = (side1 if agrees else was1), (side2 if agrees else was2)
    undecided &= not agrees
    lane[at.UNDECIDED, i] = 1.0 if undecided else 0.0
    leave(lane, i, undecided & mine & last)
    return 1 if undecided else 0


@njit_lane
def decide(lane: Array, rich: int | None) -> None:
    """Sides of the undecided runs, as of `sticking.mode_at_rest`: rest first; axis and wheel together in nine ways."""
    widest()
    for k in range(12):
        event = k if k < 3 else (k - 3) // 3
        other = k % 3
        sides = float(event if event < 2 else -1), float(other if other < 2 else -1)
        undecided = 0
        for i in range(LANES):
            undecided += try_mode(lane, i, sides, k >= 3, (k == 2) | (k == 11), rich)
        if undecided == 0:
            break


@njit_lane
def longest(cu: series.Derivatives, cy: series.Derivatives, spike: float, rich: int | None) -> float:
    """Share of a step up to which series with these derivatives are exact, by an estimate of the next term."""
    fifth, fourth = max(abs(cu[4]), abs(cy[4])) * (1 / 120), max(abs(cu[3]), abs(cy[3])) * (1 / 24)
    ratio, error = fifth / (fourth + 1e-30), ERROR
    following = fifth * min(ratio, 1.0)
    if rich is not None:
        width, error = WIDTH * np.sqrt(spike) * abs(cu[0]), PEAKED_ERROR
        following = max(following, width * max(fifth, width * max(fourth, width * abs(cu[2]) * (1 / 6))))
    return 0.95 * series.sixth_root(min(max(error / following, 1e-10), 1.0)) if following > error else 1.0


@njit_lane
def begin_part(lane: Array, i: int, rich: int | None) -> None:
    """Run i's `start` for its next part, where axis or wheel may rest."""
    sides = lane[at.SIDE1, i], lane[at.SIDE2, i]
    mobile = mobility(lane, i, sides[0] == 0.0, sides[1] == 0.0)
    pull = pulls(lane, i, mobile)
    lane[at.PULLS, i], lane[at.PULLS + 1, i] = pull
    lane[at.MOBILE, i], lane[at.MOBILE + 1, i] = mobile[0], mobile[1]
    start(lane, i, sides, mobile, pull, rich)


@njit_lane
def expand(lane: Array, i: int, rich: int | None) -> None:
    """Run i's series, and how long the part may be by it."""
    cu, cy = climb(lane, i, at.PULLS, at.MOBILE, rich)
    keep(lane, i, cu, cy)
    u, remaining = lane[at.U, i], lane[at.REMAINING, i]
    x = min(remaining, longest(cu, cy, lane[at.PEAK, i], rich))
    far = abs(u) + abs(cu[0])
    lane[at.PART, i] = x if x * far < LARGEST_TURN else LARGEST_TURN / far


@njit_lane
def passes(lane: Array, i: int, u_end: float, y_end: float) -> tuple[bool, bool, bool, float]:
    """Return whether run i's axis or wheel stops, or its torque passes an edge, before a part ends; which edge (N
    m).
    """
    y, edge_p, edge_n = lane[at.Y, i], lane[at.EDGE_P, i], lane[at.EDGE_N, i]
    volts, emf, _, _, above, below = motor(lane, i, y)
    torque = volts - emf * y_end
    over, under = torque > edge_p, torque < edge_n
    stops1 = lane[at.SIDE1, i] * u_end < lane[at.AXIS_KINK, i]
    stops2 = lane[at.SIDE2, i] * y_end < lane[at.WHEEL_KINK, i]
    return stops1, stops2, (above ^ over) | (below ^ under), (edge_p if above | (over & (not below)) else edge_n)


@njit_lane
def part(lane: Array, i: int) -> int:
    """1 where something changes in run i's part; whether its sides are undecided; leaves what is rare."""
    u, y, remaining = lane[at.U, i], lane[at.Y, i], lane[at.REMAINING, i]
    side1, side2, x = lane[at.SIDE1, i], lane[at.SIDE2, i], lane[at.PART, i]
    rest1, rest2, active = side1 == 0.0, side2 == 0.0, remaining > 0.0
    cu, cy = series.of(lane, i, at.SERIES1), series.of(lane, i, at.SERIES2)
    _, _, drive, _, _, _ = motor(lane, i, y)
    slope1, slope2 = series.slope(cu, x), series.slope(cy, x)
    stops1, stops2, passed, _ = passes(lane, i, series.speed(u, cu, x), series.speed(y, cy, x))
    hold, a12 = unsupported(lane, i), lane[at.A12, i]
    undecided = active & beyond(lane, i, hold - a12 * cy[0], drive - a12 * cu[0], rest1, rest2)
    # a release, a stop at once, or a turn there and back
    kink1, kink2 = lane[at.AXIS_KINK, i], lane[at.WHEEL_KINK, i]
    leaves = beyond(lane, i, hold - a12 * slope2, drive - a12 * slope1, rest1, rest2)
    leaves |= (stops1 & (u == 0.0)) | (stops2 & (y == 0.0))
    leaves |= (not stops1) & (side1 * (u + x * cu[0]) < kink1) & (side1 * slope1 > 0.0)
    leaves |= (not stops2) & (side2 * (y + x * cy[0]) < kink2) & (side2 * slope2 > 0.0)
    leave(lane, i, active & leaves & (not undecided))
    lane[at.UNDECIDED, i] = 1.0 if undecided else 0.0
    lane[at.CHANGE, i] = NOTHING
    return 1 if active & (stops1 | stops2 | passed) else 0


@njit_lane
def part_all(lane: Array, rich: int | None) -> int:
    """All runs' next part; in how many of them something changes."""
    for i in range(LANES):
        begin_part(lane, i, rich)
    for i in range(LANES):
        expand(lane, i, rich)
    changes = 0
    for i in range(LANES):
        changes += part(lane, i)
    return changes


@njit_lane
def choose(lane: Array, i: int) -> None:
    """What changes first in run i's part, as far as straight lines show it, and where; its series, less the level."""
    u, y, x, row = lane[at.U, i], lane[at.Y, i], lane[at.PART, i], at.CHANGING
    cu, cy = series.of(lane, i, at.SERIES1), series.of(lane, i, at.SERIES2)
    u_end, y_end = series.speed(u, cu, x), series.speed(y, cy, x)
    stops1, stops2, passed, edge = passes(lane, i, u_end, y_end)
    volts = lane[at.GAIN, i] * lane[at.COMMAND, i]
    edge = (volts - edge) / lane[at.BACK_EMF, i]
    first1, first2, there = x * u / (u - u_end), x * y / (y - y_end), x * (y - edge) / (y - y_end)
    first, change, level = (first1 if stops1 else x), (AXIS if stops1 else NOTHING), 0.0
    sooner = stops2 & ((not stops1) | (first2 < first))
    change, first = (WHEEL if sooner else change), (first2 if sooner else first)
    sooner = passed & ((change == NOTHING) | (there < first))
    change, first, level = (EDGE if sooner else change), (there if sooner else first), (edge if sooner else level)
    active, is_axis = lane[at.REMAINING, i] > 0.0, change == AXIS
    lane[at.CHANGE, i], lane[at.PART, i] = (change if active else NOTHING), first
    lane[row, i] = (u if is_axis else y) - level
    lane[row + 1, i], lane[row + 2, i] = (cu[0] if is_axis else cy[0]), (cu[1] if is_axis else cy[1])
    lane[row + 3, i], lane[row + 4, i] = (cu[2] if is_axis else cy[2]), (cu[3] if is_axis else cy[3])
    lane[row + 5, i] = cu[4] if is_axis else cy[4]


@njit_lane
def near(lane: Array, i: int) -> int:
    """A step of Newton's method from run i's PART to where the speed passes the level; 1 where it was not close."""
    x, changes, k = lane[at.PART, i], lane[at.CHANGE, i] != NOTHING, series.of(lane, i, at.CHANGING + 1)
    moved = series.speed(lane[at.CHANGING, i], k, x) / series.slope(k, x)
    far = changes & (not (abs(moved) < CLOSE))
    lane[at.PART, i] = x - moved if changes else x
    lane[at.FAR, i] = 1.0 if far else 0.0
    return 1 if far else 0


@njit_lane
def locate(lane: Array) -> None:
    """Find where something changes in a part, into PART; left to the single run where Newton's method fails."""
    for i in range(LANES):
        choose(lane, i)
    for _ in range(NEWTON):
        far = 0
        for i in range(LANES):
            far += near(lane, i)
        if far == 0:
            break
    for i in range(LANES):
        x, remaining, change = lane[at.PART, i], lane[at.REMAINING, i], lane[at.CHANGE, i]
        fine = (lane[at.FAR, i] == 0.0) & (x >= 0.0) & (x <= remaining)
        lane[at.PART, i] = x + BEYOND if change == EDGE else x
        leave(lane, i, (change != NOTHING) & (not fine))


@njit_lane
def finish(lane: Array, i: int) -> tuple[int, int]:
    """Run i at the end of its part; whether some of the step is still to be taken, whether its side is undecided."""
    x, change, remaining = lane[at.PART, i], lane[at.CHANGE, i], lane[at.REMAINING, i]
    q1, u, q2, y = lane[at.Q1, i], lane[at.U, i], lane[at.Q2, i], lane[at.Y, i]
    side1, side2 = lane[at.SIDE1, i], lane[at.SIDE2, i]
    cu, cy = series.of(lane, i, at.SERIES1), series.of(lane, i, at.SERIES2)
    x1, u_end, y_end = series.turned(u, cu, x), series.speed(u, cu, x), series.speed(y, cy, x)
    u_end, y_end = (0.0 if change == AXIS else u_end), (0.0 if change == WHEEL else y_end)
    # what a straight line showed later came first
    missed = (side1 * u_end < lane[at.AXIS_KINK, i]) | (side2 * y_end < lane[at.WHEEL_KINK, i])
    waits = lane[at.UNDECIDED, i] != 0.0
    leave(lane, i, missed & (remaining > 0.0) & (not waits))
    stays = missed | waits | (remaining == 0.0)
    lane[at.Q1, i] = q1 if stays else q1 + x1
    lane[at.U, i] = u if stays else u_end
    lane[at.Q2, i] = q2 if stays else q2 + series.turned(y, cy, x)
    lane[at.Y, i] = y if stays else y_end
    turn(lane, i, x1, stays)
    remaining, after = lane[at.REMAINING, i], remaining - x
    after = after if after > SHORTEST else 0.0
    remaining = remaining if stays else after
    lane[at.BEGIN, i] = 1.0 - remaining if remaining > 0.0 else 1.0
    stops = (not stays) & ((change == AXIS) | (change == WHEEL)) & (remaining > 0.0)
    undecided = stops | (waits & (remaining > 0.0))
    lane[at.REMAINING, i], lane[at.UNDECIDED, i] = remaining, (1.0 if undecided else 0.0)
    side = 1.0 if u_end > 0.0 else (-1.0 if u_end < 0.0 else side1)
    lane[at.SIDE1, i] = side1 if stays else side
    side = 1.0 if y_end > 0.0 else (-1.0 if y_end < 0.0 else side2)
    lane[at.SIDE2, i] = side2 if stays else side
    return (1 if remaining > 0.0 else 0), (1 if undecided else 0)


@njit_part
def redo(block: Array, late: Late, step: int, steps: int, rich: int | None, is_late: int | None) -> bool:
    """Take the flagged steps of a block in parts; whether something is left in LEFT. Others as of `readings.fill`.

    It is given the block, not its rows, for these would have no fixed size in a function that is not inlined.
    """
    widest()
    lane = block[0]["rows"]
    count, undecided = begin(lane, is_late)
    for _ in range(MOST_PARTS):
        if count == 0:
            break
        if undecided > 0:
            decide(lane, rich)
        if part_all(lane, rich) > 0:
            locate(lane)
        if is_late is not None:
            fill(lane, late, step, steps)
        count, undecided = 0, 0
        for i in range(LANES):
            more, waits = finish(lane, i)
            count += more
            undecided += waits
    unfinished = 0
    for i in range(LANES):
        leave(lane, i, lane[at.REMAINING, i] > 0.0)
        unfinished += 1 if lane[at.LEFT, i] > 0.0 else 0
    if is_late is not None:
        for i in range(LANES):
            lane[at.BEGIN, i] = 0.0
    return unfinished > 0
