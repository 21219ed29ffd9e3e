"""Jumps: an angle that goes on elsewhere from one row to the next, as of an encoder that slipped or lost counts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from swingid.recording.spikes import ROBUST, ROUNDING

if TYPE_CHECKING:
    from swingid.numerics.arrays import Array, Bools


SIDE = 3  # steps on either side that tell the speed
NOISE_FACTOR = 8.0  # robust standard deviations of what the other steps have beyond the speeds around them
QUANTA = 4.0  # counts: rounding alone reaches 1.3
SMALLEST = 5e-3  # of the range of the motion: smaller jumps do little harm
LEFT_OVER = 0.3  # of the jump: what may remain around it once it is taken back (a bump leaves more)
WINDOW = 24  # steps on either side that tell the local noise
LONGEST_STEP = 2.6  # median steps: across a gap nothing can be told


def find_jumps(time: Array, values: Array, rows: int = 1) -> list[tuple[int, float]]:
    """Rows before which `values` jump, and by how much; time (s) strictly increasing, spikes already out.

    rows: of the log that each value is the mean of.

    A jump is what a step has beyond the speeds on both sides; it stands out of noise and rounding, and once it is taken
    back nothing is left around it.
    """
    if values.size < 2 * (SIDE + WINDOW):
        return []
    gap, known = _gaps(time, values)
    size = np.abs(gap)
    if not known.any():
        return []
    level = ROBUST * float(np.median(size[known]))
    steps = np.abs(np.diff(values))
    low, high = np.quantile(values, (0.01, 0.99))
    quantum = float(steps[steps > ROUNDING * float(high - low)].min(initial=np.inf))
    least = max(
        NOISE_FACTOR * level, SMALLEST * float(high - low), rows * QUANTA * quantum if np.isfinite(quantum) else 0.0
    )
    found: list[tuple[int, float]] = []
    for k in np.flatnonzero(size > least).tolist():
        near = slice(max(k - SIDE, 0), k + SIDE + 1)
        if size[k] < size[near].max() or size[k] < NOISE_FACTOR * ROBUST * _local(size, known, k):
            continue
        begin = max(k - 2 * SIDE, 0)
        around = slice(begin, k + 2 * SIDE + 2)
        taken_back = values[around].copy()
        taken_back[k + 1 - begin :] -= gap[k]
        left = np.abs(_gaps(time[around], taken_back)[0])
        if left.max() < max(LEFT_OVER * size[k], 3 * level):
            found.append((k + 1, float(gap[k])))
    return found


def _gaps(time: Array, values: Array) -> tuple[Array, Bools]:
    """By how much each step differs from what the mean speeds on both sides make of it, and where that is known.

    Mean speeds over some rows, for stamps may lie close together. 0 near the ends and where rows are missing.
    """
    steps = np.diff(time)
    gaps = np.zeros(values.size - 1)
    known = np.ones(values.size - 1, dtype=bool)
    known[:SIDE] = known[-SIDE:] = False
    for row in np.flatnonzero(steps > LONGEST_STEP * np.median(steps)):
        known[max(row - SIDE, 0) : row + SIDE + 1] = False
    speed = (values[SIDE:] - values[:-SIDE]) / (time[SIDE:] - time[:-SIDE])  # of rows k to k + SIDE
    inner = slice(SIDE, values.size - 1 - SIDE)
    around = (speed[: inner.stop - SIDE] + speed[SIDE + 1 : inner.stop + 1]) / 2
    gaps[inner] = np.diff(values)[inner] - around * steps[inner]
    gaps[~known] = 0.0
    return gaps, known


def _local(size: Array, known: Bools, k: int) -> float:
    """The larger median of `size` on the two sides of step k, 0 where there is none."""
    sides = (slice(max(k - SIDE - WINDOW, 0), max(k - SIDE, 0)), slice(k + SIDE + 1, k + SIDE + 1 + WINDOW))
    return max((float(np.median(size[side][known[side]])) for side in sides if known[side].any()), default=0.0)
