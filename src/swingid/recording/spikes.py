"""Isolated spikes: single samples that fit neither neighbour while the neighbours fit each other."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from swingid.numerics.arrays import Array, Bools


NOISE_FACTOR = 8.0  # robust standard deviations: a Gaussian sample goes so far once in 10^15
QUANTA = 4.0  # counts: rounding alone reaches 4/3
SMALLEST = 1e-4  # of the range of the motion: smaller spikes do no harm
SMOOTH = 0.2  # of the spike: what may be left at its neighbours without it (a kink leaves 0.3)
WINDOW = 24  # samples on each side that tell the local noise
REACH = 2  # samples on each side whose misfit the spike itself causes
ROBUST = 1.4826  # standard deviation per median absolute value, Gaussian
ROUNDING = 1e-9  # of the range of the motion: steps below are the computer's
SIDES = np.array([-2, -1, 1, 2])


def find_spikes(time: Array, values: Array, rows: int = 1) -> Bools:
    """True at the rows whose value is an isolated spike; time (s) may be uneven. Shape as `values`.

    rows: of the log that each value is the mean of; a grid then shows this many times finer than it rounds.

    A spike's misfit against the cubic through two neighbours on each side stands out of the log's noise, of
    the noise within 24 samples on either side, of rounding, and is gone from the neighbours' misfit when the
    sample is left out. The last tells it from a kink or a step of the motion. Bursts of faulty samples, and
    faults in the first and last three rows, are not found.
    """
    spikes = np.zeros(values.size, dtype=bool)
    if values.size < 4 * REACH + 1:
        return spikes
    degree = _degree(time)
    misfit = np.abs(misfits(time, values))
    threshold = NOISE_FACTOR * ROBUST * float(np.median(misfit[REACH:-REACH]))
    candidates = np.flatnonzero(misfit > threshold)
    if candidates.size:
        threshold = max(threshold, *_floors(values, rows))
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
    return 3 if steps.min() > 0.5 * np.median(steps) else 1


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


def _floors(values: Array, rows: int) -> tuple[float, float]:
    """Misfits below these are no spikes: some counts of the encoder, a small part of the motion's range."""
    steps = np.abs(np.diff(values))
    low, high = np.quantile(values, (0.01, 0.99))
    # means of the same counts in another order differ by rounding
    quantum = rows * float(steps[steps > ROUNDING * float(high - low)].min(initial=np.inf))
    return (QUANTA * quantum if np.isfinite(quantum) else 0.0), SMALLEST * float(high - low)
