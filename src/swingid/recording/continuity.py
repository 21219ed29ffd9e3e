"""Angles made continuous over turns, and what interrupts them: isolated spikes and jumps.

A spike is a single sample that fits neither neighbour while the neighbours fit each other; a jump is an angle that goes
on elsewhere from one row to the next, as of an encoder that slipped or lost counts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from swingid.numerics.arrays import median, quantile

if TYPE_CHECKING:
    from swingid.numerics.arrays import Array, Bools


@dataclass(frozen=True, slots=True)
class Unwrapped:
    """Continuous values (n,), logged units; rows that are spikes (n,); rows at which the count of turns was a guess."""

    values: Array
    spikes: Bools
    ambiguous: int


def is_wrapped(values: Array, turn: float) -> bool:
    """Return whether an angle (n,), in units of which `turn` make one turn, is logged within one turn and jumps at its
    edges.

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
    # rows that jump away and back at once, whole turns disregarded: spikes of a motion of few degrees per row
    jump = np.abs(_remainder(np.diff(values), turn)) > turn / 6
    spikes = np.concatenate(([False], jump[:-1] & jump[1:], [False]))
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
    """The sequential search of `unwrap`: spikes, continuous values, number of ambiguous rows.

    A row is stepped over when it misses the prediction and the row after it, predicted without it, does not.
    """
    t, q = time.tolist(), values.tolist()
    rows = len(q)
    turns = [0.0] * rows
    spikes = np.zeros(rows, dtype=bool)
    ambiguous = 0
    known: list[tuple[float, float]] = [(t[0], q[0])]  # the last three good rows: time, continuous value
    for k in range(1, rows):
        predicted, curved = _predict(known, t[k])
        turns[k] = round((predicted - q[k]) / turn)
        miss = abs(q[k] + turn * turns[k] - predicted)
        if miss > turn / 8 and len(known) == 3 and k + 1 < rows:
            ahead, _ = _predict(known, t[k + 1])
            apart = q[k + 1] - ahead
            if abs(apart - turn * round(apart / turn)) < 0.5 * miss and known[-1][0] == t[k - 1]:
                spikes[k] = True
                continue
        ambiguous += max(miss, curved) > turn / 4
        known = [*known[-2:], (t[k], q[k] + turn * turns[k])]
    return spikes, values + turn * np.array(turns), ambiguous


def _settle_start(time: Array, values: Array, turn: float) -> tuple[Array, int]:
    """Choose between speeds that differ by one turn per row, which evenly spaced rows cannot distinguish.

    A log that starts at rest determines it. Otherwise the smallest median speed is taken, and counted as a guess at
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
    """The value at `time` on the parabola (line, constant) through the known rows, and the share of its curvature."""
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


NOISE_FACTOR = 8.0  # robust standard deviations: a Gaussian sample goes so far once in 10^15
QUANTA = 4.0  # counts: rounding alone reaches 4/3, in a step 1.3
SMALLEST = 1e-4  # of the range of the motion: smaller spikes do no harm
SMOOTH = 0.2  # of the spike: what may be left at its neighbours without it (a kink leaves 0.3)
WINDOW = 24  # samples (steps) on each side from which the local noise is estimated
REACH = 2  # samples on each side whose misfit the spike itself causes
ROBUST = 1.4826  # standard deviation per median absolute value, Gaussian
ROUNDING = 1e-9  # of the range of the motion: steps below are the computer's
SIDES = np.array([-2, -1, 1, 2])

# Of jumps:
SIDE = 3  # steps on either side that give the speed
SMALLEST_JUMP = 5e-3  # of the range of the motion: smaller jumps do little harm
LEFT_OVER = 0.3  # of the jump: what may remain around it once it is taken back (a bump leaves more)
LONGEST_STEP = 2.6  # median steps: across a gap no jump can be seen


def find_spikes(time: Array, values: Array, rows: int = 1) -> Bools:
    """True at the rows whose value is an isolated spike; time (s) may be uneven. Shape as `values`.

    rows: of the log that each value is the mean of; a grid then shows this many times finer than it rounds.

    A spike's misfit against the cubic through two neighbours on each side stands out of the log's noise, of
    the noise within 24 samples on either side, of rounding, and is gone from the neighbours' misfit when the
    sample is left out. The last separates it from a kink or a step of the motion. Bursts of faulty samples, and
    faults in the first and last three rows, are not found.
    """
    spikes = np.zeros(values.size, dtype=bool)
    if values.size < 4 * REACH + 1:
        return spikes
    degree = _degree(time)
    misfit = np.abs(misfits(time, values))
    threshold = NOISE_FACTOR * ROBUST * median(misfit[REACH:-REACH])
    candidates = np.flatnonzero(misfit > threshold)
    if candidates.size:
        threshold = max(threshold, *_floors(values, rows, SMALLEST))
        candidates = candidates[misfit[candidates] > threshold]
    candidates = candidates[(candidates >= 3) & (candidates < values.size - 3)]
    for k in (-2, -1, 1, 2):  # a spike makes misfits around it; its own is the largest, or nearly so beside a gap
        candidates = candidates[misfit[candidates] >= 0.6 * misfit[candidates + k]]
    for side in (-1, 1):
        around = candidates[:, None] + side * np.arange(REACH + 1, REACH + 1 + WINDOW)
        level = np.median(misfit[np.clip(around, REACH, values.size - 1 - REACH)], axis=1)
        candidates = candidates[misfit[candidates] > NOISE_FACTOR * ROBUST * level]
    for side, others in ((-1, [-3, -2, 1, 2]), (1, [-2, -1, 2, 3])):
        neighbour, near = candidates + side, candidates[:, None] + (others if degree == 3 else others[1:3])
        rest = np.abs(values[neighbour] - _through(time[near], values[near], time[neighbour]))
        candidates = candidates[rest < SMOOTH * misfit[candidates]]
    spikes[candidates] = True
    return spikes


def _degree(time: Array) -> int:
    """A cubic through neighbours that lie too close together would be wild: then a line."""
    steps = np.diff(time)
    least = float(steps.min())
    return 3 if least > 0.5 * steps.max() or least > 0.5 * median(steps) else 1  # the median is below the maximum


def misfits(time: Array, values: Array) -> Array:
    """Each value minus the cubic (or line) through two (one) neighbours on each side; 0 in the two rows at each end."""
    misfit, degree = np.zeros(values.size), _degree(time)
    steps = np.diff(time)
    inner = slice(REACH, -REACH)
    if degree == 3 and steps.max() - steps.min() < 0.01 * steps.max():
        between = (4.0 * (values[1:-3] + values[3:-1]) - (values[:-4] + values[4:])) / 6.0
    else:
        near = np.arange(REACH, values.size - REACH)[:, None] + (SIDES if degree == 3 else SIDES[1:3])
        between = _through(time[near], values[near], time[inner])
    misfit[inner] = values[inner] - between
    return misfit


def _through(times: Array, values: Array, at: Array) -> Array:
    """Lagrange's polynomial through the points in each row (times, values: n x points), at one time each."""
    result = np.zeros(at.size)
    for i in range(times.shape[1]):
        weight = np.ones(at.size)
        for j in range(times.shape[1]):
            if j != i:
                weight *= (at - times[:, j]) / (times[:, i] - times[:, j])
        result += weight * values[:, i]
    return result


def _floors(values: Array, rows: int, share: float) -> tuple[float, float]:
    """Misfits below these are no faults: some counts of the encoder, a small share of the motion's range."""
    steps = np.abs(np.diff(values))
    low, high = quantile(values, 0.01), quantile(values, 0.99)
    # means of the same counts in another order differ by rounding
    quantum = rows * float(steps[steps > ROUNDING * (high - low)].min(initial=np.inf))
    return (QUANTA * quantum if np.isfinite(quantum) else 0.0), share * (high - low)


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
    level = ROBUST * median(size[known])
    if size.max() <= NOISE_FACTOR * level:
        return []
    least = max(NOISE_FACTOR * level, *_floors(values, rows, SMALLEST_JUMP))
    jumps: list[tuple[int, float]] = []
    for k in np.flatnonzero(size > least).tolist():
        near = slice(max(k - SIDE, 0), k + SIDE + 1)
        if size[k] < size[near].max() or size[k] < NOISE_FACTOR * ROBUST * _local(size, known, k):
            continue
        begin = max(k - 2 * SIDE, 0)
        around = slice(begin, k + 2 * SIDE + 2)
        taken_back = values[around].copy()
        taken_back[k + 1 - begin :] -= gap[k]
        remaining = np.abs(_gaps(time[around], taken_back)[0])
        if remaining.max() < max(LEFT_OVER * size[k], 3 * level):
            jumps.append((k + 1, float(gap[k])))
    return jumps


def _gaps(time: Array, values: Array) -> tuple[Array, Bools]:
    """Return by how much each step differs from what the mean speeds on both sides make of it, and where that is known.

    Mean speeds over some rows, for stamps may lie close together. 0 near the ends and where rows are missing.
    """
    steps = np.diff(time)
    gaps = np.zeros(values.size - 1)
    known = np.ones(values.size - 1, dtype=bool)
    known[:SIDE] = known[-SIDE:] = False
    uneven = steps.max() > LONGEST_STEP * steps.min()  # else no step can be so much longer than the median
    for row in np.flatnonzero(steps > LONGEST_STEP * np.median(steps)) if uneven else ():
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
