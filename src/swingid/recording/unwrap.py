"""Angles that were logged within one turn, made continuous, also with more than half a turn between rows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from swingid.numerics.arrays import Array, Bools


@dataclass(frozen=True, slots=True)
class Unwrapped:
    """Continuous values (n,), logged units; rows that are spikes (n,); rows at which the count of turns was a guess."""

    values: Array
    spikes: Bools
    ambiguous: int


def is_wrapped(values: Array, turn: float) -> bool:
    """Whether an angle (n,), in units of which `turn` make one turn, is logged within one turn and jumps at its edges.

    True when it stays within one turn (a few spikes apart) and steps by more than half a turn occur, either
    at more rows than spikes would, or such that the motion goes on evenly if whole turns are disregarded. An
    angle that never crosses an edge gives False: it needs nothing.
    """
    steps = np.diff(values)
    jumps = np.flatnonzero(np.abs(steps) > 0.5 * turn)
    jumps = jumps[(jumps > 0) & (jumps < steps.size - 1)]
    if jumps.size == 0:
        return False
    low, high = np.quantile(values, (0.005, 0.995))
    if high - low > turn:
        return False
    if jumps.size > max(10, 0.1 * values.size):
        return True
    before = np.abs(_remainder(steps[jumps] - steps[jumps - 1], turn))
    after = np.abs(_remainder(steps[jumps + 1] - steps[jumps], turn))
    return bool(np.mean(np.maximum(before, after) < turn / 6) > 0.5)


def unwrap(time: Array, values: Array, turn: float) -> Unwrapped:
    """The wrapped `values` (in units of which `turn` make one turn) plus the turns that continue the motion.

    Slow motion (at most a quarter turn per row): each row takes the turn nearest to the row before. Fast
    motion: the turn nearest to what speed and acceleration of the rows before predict; the count starts at
    the smallest speed. Spikes are stepped over; small ones may remain, which do not disturb the count.
    """
    spikes = _slow_spikes(values, turn)
    kept = values[~spikes]
    if np.abs(_remainder(np.diff(kept), turn)).max() <= 0.25 * turn:
        turns = np.concatenate(([0.0], np.cumsum(np.round(np.diff(kept) / turn))))
        continuous, ambiguous = kept - turn * turns, 0
    else:
        spikes = _even_spikes(time, values, turn)
        more, continuous, ambiguous = _follow(time[~spikes], values[~spikes], turn)
        spikes[~spikes] = more
        continuous = continuous[~more]
        continuous, guessed = _settle_start(time[~spikes], continuous, turn)
        ambiguous += guessed
    result = values.copy()
    result[~spikes] = continuous
    return Unwrapped(result, spikes, ambiguous)


def _slow_spikes(values: Array, turn: float) -> Bools:
    """Rows that jump away and back at once, whole turns disregarded; for motion of few degrees per row."""
    jump = np.abs(_remainder(np.diff(values), turn)) > turn / 6
    return np.concatenate(([False], jump[:-1] & jump[1:], [False]))


def _even_spikes(time: Array, values: Array, turn: float) -> Bools:
    """Spikes among evenly spaced rows of any speed, by fourth differences, which whole turns leave untouched.

    A spike d leaves (d, -4 d, 6 d, -4 d, d) in them, a smooth motion almost nothing.
    """
    spikes = np.zeros(values.size, dtype=bool)
    steps = np.diff(time)
    if values.size < 9:
        return spikes
    usual = np.median(steps)
    odd = np.concatenate(([0], np.cumsum(np.abs(steps - usual) > 0.02 * usual)))
    fourth = np.diff(values, 4)  # fourth[j] belongs to row j + 2
    first, last = fourth[:-4], fourth[4:]
    size = np.abs(_remainder(first, turn))
    fits = odd[8:] == odd[:-8]
    for coefficient, part in ((-4.0, fourth[1:-3]), (6.0, fourth[2:-2]), (-4.0, fourth[3:-1]), (1.0, last)):
        fits &= np.abs(_remainder(part - coefficient * first, turn)) < np.minimum(size, turn / 8)
    spikes[4:-4] = fits & (size > turn / 16)
    return spikes


def _follow(time: Array, values: Array, turn: float) -> tuple[Bools, Array, int]:
    """The sequential search of `unwrap`: spikes, continuous values, number of doubtful rows.

    A row is stepped over when it misses the prediction and the row after it, predicted without it, does not.
    """
    t, q = time.tolist(), values.tolist()
    rows = len(q)
    turns = [0.0] * rows
    spikes = np.zeros(rows, dtype=bool)
    ambiguous = 0
    known: list[tuple[float, float]] = [(t[0], q[0])]  # the last three good rows: time, continuous value
    for k in range(1, rows):
        predicted, doubt = _predict(known, t[k])
        turns[k] = round((predicted - q[k]) / turn)
        miss = abs(q[k] + turn * turns[k] - predicted)
        if miss > turn / 8 and len(known) == 3 and k + 1 < rows:
            ahead, _ = _predict(known, t[k + 1])
            apart = q[k + 1] - ahead
            if abs(apart - turn * round(apart / turn)) < 0.5 * miss and known[-1][0] == t[k - 1]:
                spikes[k] = True
                continue
        ambiguous += max(miss, doubt) > turn / 4
        known = [*known[-2:], (t[k], q[k] + turn * turns[k])]
    return spikes, values + turn * np.array(turns), ambiguous


def _settle_start(time: Array, values: Array, turn: float) -> tuple[Array, int]:
    """Choose between speeds that differ by one turn per row, which evenly spaced rows cannot tell apart.

    A log that starts at rest has told it. Otherwise the smallest median speed is taken, and called a guess at
    all rows.
    """
    steps = np.diff(values)
    starts_at_rest = np.abs(np.median(steps[:5])) < turn / 8
    if starts_at_rest or np.abs(steps).max() < 0.5 * turn:
        return values, 0
    if np.ptp(np.diff(time)) < 0.1 * np.median(np.diff(time)):
        values = values - turn * np.round(np.median(steps) / turn) * np.arange(values.size)
    return values, values.size


def _predict(known: list[tuple[float, float]], time: float) -> tuple[float, float]:
    """The value at `time` on the parabola (line, constant) through the known rows, and its bend's share."""
    if len(known) == 1:
        return known[0][1], 0.0
    (tb, qb), (ta, qa) = known[-2:]
    speed, ahead = (qa - qb) / (ta - tb), time - ta
    if len(known) == 2:
        return qa + speed * ahead, 0.0
    tc, qc = known[-3]
    bend = (speed - (qb - qc) / (tb - tc)) / (ta - tc) * ahead * (time - tb)
    return qa + speed * ahead + bend, abs(bend)


def _remainder(values: Array, turn: float) -> Array:
    return values - turn * np.round(values / turn)
