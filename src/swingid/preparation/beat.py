"""A wheel's angle that is polled by a clock of its own, in beat with the rows of the log.

A row holds the last value that was polled. Its age a grows or falls from row to row and starts anew once per beat: a
sawtooth of the height of a row, of which the delay between the channels is the mean. Where it starts anew a row repeats
the value before it (polled more slowly than logged), or shows the turn of two rows (faster). A beat near twice the
frequency of the motion looks like inertia, for q2' a then has a part in phase with q2'': at 1 kHz and 7 to 10 rad/s
0.5 to 0.9 %. As the instants of these rows are known, so is a.
"""

from __future__ import annotations

import numpy as np

from swingid.numerics.arrays import Array, Ints, median
from swingid.numerics.regression import fit_linear

CLEAR = 8
"""Steps of the encoder, and standard deviations of a row's turn by noise, that a row must turn for a repeated or a
doubled one to be neither rounding nor noise: 1 − `NEAR` of it is 5.6 standard deviations."""

NEAR = 0.3
"""Distance from 0 or 2 rows of turn within which a row counts as repeated or doubled: rounding is at most 1/8."""

FEW = 20_000
"""Rows of the log in which the period is searched; all of them then refine it."""

BEATS = 8
"""Rows that start a beat, at least: of a random share of rows the resultant below exceeds `REGULAR` with 8 of them for
the best of a thousand periods in 1000 exp(−8·0.9²) = 1.5 % of logs that have so many such rows at all."""

REGULAR = 0.95
"""Resultant of the phases of these rows in the beat, from which they count as regular; 1 if they are exactly so."""

SPREAD = 10
"""Rows on each side over which the speed of the wheel is taken, so that one start of a beat is 5 % of it."""


def ages(angle: Array, count: float) -> Array | None:
    """Age (n,) of each value of a wheel's angle in rows, less its mean; None where it was not polled in beat.

    angle (n,): rad, rows at equal steps; count: step of the encoder (rad).
    """
    if count <= 0 or len(angle) < 100:
        return None
    turn = np.diff(angle)
    usual = (angle[2 * SPREAD :] - angle[: -2 * SPREAD]) / (2 * SPREAD)
    rows = np.arange(len(usual)) + SPREAD
    noise = 1.4826 * float(median(np.abs(turn[rows - 1] - usual)))
    clear = np.abs(usual) > CLEAR * max(count, noise)
    share = turn[rows[clear] - 1] / usual[clear]
    at = rows[clear]
    repeated, doubled = at[np.abs(share) < NEAR], at[np.abs(share - 2) < NEAR]
    starts, slower = (repeated, True) if len(repeated) > len(doubled) else (doubled, False)
    beat = _period(starts)
    if beat is None:
        return None
    first, period = beat
    phase = np.mod((np.arange(len(angle)) - first) / period, 1.0)
    age: Array = 0.5 - phase if slower else phase - 0.5
    return age


def on_rows(angle: Array, age: Array) -> Array:
    """A wheel's angle (n,) that is `age` (n,) rows old, at its rows: the second round has the speed of the first."""
    read = angle
    for _ in range(2):
        usual = (read[2 * SPREAD :] - read[: -2 * SPREAD]) / (2 * SPREAD)
        read = angle + np.pad(usual, SPREAD, mode="edge") * age
    return read


def _period(starts: Ints) -> tuple[float, float] | None:
    """Row at which a beat starts, and its period (rows), of beats of which some may be missing; None where irregular.

    The lowest frequency at which the starts are in phase, for they are at its multiples, too; then a straight line.
    """
    few = starts[starts < starts[0] + FEW] if len(starts) else starts
    if len(few) < BEATS:
        return None
    span = float(few[-1] - few[0])
    frequencies = np.arange(2 / span, 0.5 / SPREAD, 0.1 / span)
    seen = np.array([_resultant(few, frequency) for frequency in frequencies])
    if not np.any(seen > REGULAR):
        return None
    k = int(np.argmax(seen > REGULAR))
    k += int(np.argmax(seen[k : k + 10]))
    period = 1 / float(frequencies[k])
    number = np.cumsum(np.append(0, np.rint(np.diff(starts) / period)))
    first, period = fit_linear(np.column_stack([np.ones_like(number), number]), starts.astype(float)).values
    return (float(first), float(period)) if _resultant(starts, 1 / period) > REGULAR else None


def _resultant(starts: Ints, frequency: float) -> float:
    return float(np.abs(np.mean(np.exp(2j * np.pi * frequency * starts))))
