"""Encoders of one block of runs, read on time, or late or early by latency and jitter.

The instant of a reading is kept in steps of the motion from the start. A step leaves its series (`motion.keep`), by
which every reading that falls into it is known to rounding, in all columns at once. What the controller is given is
the reading of its own sample if that has been taken by then, else one of the sample's instant, as in the single run.
"""

from __future__ import annotations

import numpy as np

from swingid.numerics.arrays import Array
from swingid.numerics.vectors import njit_lane, sine_cosine, widest
from swingid.simulation.ensemble import lanes as at
from swingid.simulation.ensemble import series
from swingid.simulation.ensemble.lanes import LANES

Late = tuple[Array, Array, int, int]
"""(instants (rows, 2, LANES) of the readings of axis and wheel, in steps; their angles (rad), filled in as they become
known; by how many steps an instant is after its row's, at least and at most)."""


@njit_lane
def rounded(value: float, step: float, inverse: float) -> float:
    """A multiple of `step` nearest to `value`; inverse = 1/step.

    The quotient is that of a division, corrected by what is left: where two multiples are as near, it is the same one.
    """
    ratio = value * inverse
    ratio += (value - ratio * step) * inverse
    return float(step * np.rint(ratio))


@njit_lane
def read(lane: Array, i: int, angle: int, encoder: int, place: int, error: float) -> None:
    """Reading of run i's row `angle` by the encoder whose rows begin at `encoder`, into the row `place`."""
    value = lane[angle, i] + error
    step, inverse = lane[encoder, i], lane[encoder + 1, i]
    lane[place, i] = rounded(value, step, inverse)


@njit_lane
def bend(lane: Array, i: int, angle: int, encoder: int) -> float:
    """What a nonlinear encoder adds to run i's row `angle` (rad)."""
    sine, cosine = sine_cosine(lane[angle, i])
    return float(lane[encoder + 2, i] * cosine + lane[encoder + 3, i] * sine)


@njit_lane
def read_all(lane: Array, angle: int, wheel: int, bent: int, noise: Array, row: int) -> None:
    """Readings of the rows `angle` and `wheel` of all runs, with the `row` of the noise (2, rows or none, LANES)."""
    widest()
    if noise.shape[1] > row:
        for i in range(LANES):
            lane[at.ANGLE_NOISE, i] = lane[at.ANGLE_ZERO, i] + noise[0, row, i]
            lane[at.WHEEL_NOISE, i] = lane[at.WHEEL_ZERO, i] + noise[1, row, i]
    if bent:
        for i in range(LANES):
            error = lane[at.ANGLE_NOISE, i] + bend(lane, i, angle, at.ANGLE_STEP)
            read(lane, i, angle, at.ANGLE_STEP, at.ANGLE_READING, error)
        for i in range(LANES):
            error = lane[at.WHEEL_NOISE, i] + bend(lane, i, wheel, at.WHEEL_STEP)
            read(lane, i, wheel, at.WHEEL_STEP, at.WHEEL_READING, error)
    else:
        for i in range(LANES):
            read(lane, i, angle, at.ANGLE_STEP, at.ANGLE_READING, lane[at.ANGLE_NOISE, i])
        for i in range(LANES):
            read(lane, i, wheel, at.WHEEL_STEP, at.WHEEL_READING, lane[at.WHEEL_NOISE, i])


@njit_lane
def known(lane: Array, late: Late, row: int, steps: int) -> None:
    """Angles that the controllers read at `row` into THERE; steps: of a sample."""
    widest()
    when, seen, _, _ = late
    for e in range(2):
        for i in range(LANES):
            lane[at.THERE + e, i] = lane[at.Q1 + 2 * e, i]
        if row < len(when):
            instants, angles = when[row, e], seen[row, e]
            for i in range(LANES):
                there = lane[at.THERE + e, i]
                lane[at.THERE + e, i] = angles[i] if instants[i] < row * steps else there


@njit_lane
def rows_in(late: Late, step: int, steps: int) -> tuple[int, int]:
    """First and last row, and one more, of which a reading may fall into a step; steps: of a sample."""
    when, _, least, most = late
    return max((step - most) // steps, 0), min((step - least) // steps + 1, len(when))


@njit_lane
def fill(lane: Array, late: Late, step: int, steps: int) -> None:
    """Angles at the readings that fall into the step that has been taken, from BEGIN on, by its series."""
    widest()
    when, seen, _, _ = late
    first, last = rows_in(late, step, steps)
    for row in range(first, last):
        for e in range(2):
            instants, angles = when[row, e], seen[row, e]
            for i in range(LANES):
                lane[at.WHEN, i] = instants[i] - step
                lane[at.THERE, i] = angles[i]
            for i in range(LANES):
                x, begin, k = lane[at.WHEN, i], lane[at.BEGIN, i], series.of(lane, i, at.SERIES1 + 5 * e)
                start = at.START + 2 * e
                angle = lane[start, i] + series.turned(lane[start + 1, i], k, x - begin)
                inside = (x >= begin) & (x < 1.0)
                lane[at.THERE, i] = angle if inside else lane[at.THERE, i]
            for i in range(LANES):
                angles[i] = lane[at.THERE, i]
