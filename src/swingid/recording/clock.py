"""The clock of a log: stamps that scatter about a constant rate, and the rate.

Two logs look alike and are opposites: rows taken evenly by a timer and stamped late by a busy computer, and rows taken
at odd moments that are stamped rightly. The motion tells which: it is smooth in the right time only.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from swingid.recording.spikes import misfits

if TYPE_CHECKING:
    from collections.abc import Sequence

    from swingid.numerics.arrays import Array


FEWEST = 64  # rows
FEWEST_BLOCKS = 4
BLOCK = 16  # rows, at least, whose median stamp tells a lasting shift, as of a missing row, from single late stamps
LASTING = 0.3  # of a step
EVEN = 1e-3  # of a step: stamps that scatter less are even, or as good
SMOOTHER = 0.85  # of the roughness with the stamps as they are: the motion has to gain that much
NO_ROUGHER = 1.02  # and no channel may lose more
FARTHEST = 0.5  # of a step: a stamp farther from its place on the clock belongs to another place
ABSURD = 1e100  # from the first stamp to the last, in any unit: squares overflow; such numbers are refused later
TRIMMED = 0.98  # share of rows that the roughness looks at: spikes and wraps are not its business


@dataclass(frozen=True, slots=True)
class Clock:
    """A constant rate behind stamps: time (n,) at that rate, the step, standard deviation of the stamps about it."""

    time: Array
    step: float
    scatter: float


def even_clock(time: Array, angles: Sequence[Array]) -> Clock | None:
    """The constant rate behind rising stamps, where the angles (n,) say that the rows were taken at it; else None.

    Rows may be missing: the stamps tell how many. None also where the stamps are even as they are.
    """
    if time.size < FEWEST or np.ptp(time) > ABSURD:
        return None
    clock = _without_gaps(time) or _with_gaps(time)
    if clock is None or clock.scatter < EVEN * clock.step:
        return None
    gains = [_roughness(clock.time, angle) / rough for angle in angles if (rough := _roughness(time, angle)) > 0]
    if not gains or min(gains) > SMOOTHER or max(gains) > NO_ROUGHER:
        return None
    return clock


def rounded_clock(time: Array) -> Clock | None:
    """The constant rate behind stamps that were rounded so that some repeat, where no row is missing; else None.

    Rounding spreads the stamps evenly over one of its steps about the clock; a missing row, or a pause, over more.
    """
    steps = np.diff(time)
    rising = steps[steps > 0]
    if time.size < FEWEST or rising.size == 0 or (steps < 0).any() or np.ptp(time) > ABSURD:
        return None
    quantum = float(rising.min())
    if np.abs(steps / quantum - np.round(steps / quantum)).max() > 0.01:
        return None
    clock = _fitted(time, np.arange(time.size, dtype=np.float64))
    return clock if np.ptp(time - clock.time) < 1.05 * quantum else None


def _without_gaps(time: Array) -> Clock | None:
    """The clock of rows of which none is missing: single stamps may be off by more than a step, none lastingly."""
    clock = _fitted(time, np.arange(time.size, dtype=np.float64))
    off = (time - clock.time) / clock.step
    # so many that the median of their scatter stays below a fifth of what would be a lasting shift
    block = max(BLOCK, int((5 * 1.25 / LASTING) ** 2 * float(np.median(off**2)) / 0.45))
    if time.size < FEWEST_BLOCKS * block:
        return None
    blocks = off[: time.size // block * block].reshape(-1, block)
    return clock if np.abs(np.median(blocks, axis=1)).max() < LASTING else None


def _with_gaps(time: Array) -> Clock | None:
    """The clock of rows of which some may be missing: the stamps themselves tell each row's place on it.

    A line through the first rows tells the places of twice as many, and so on. None where two rows would share a place,
    or a stamp lies between two.
    """
    known = min(FEWEST, time.size)
    step, start = _first_guess(time[:known])
    while True:
        clock = _fitted(time[:known], np.round((time[:known] - start) / step))
        step, start = clock.step, float(clock.time[0])
        if known == time.size:
            break
        known = min(2 * known, time.size)
    places = np.round((time - start) / step)
    clock = _fitted(time, places)
    fits = (np.diff(places) >= 1).all() and np.abs(time - clock.time).max() < FARTHEST * clock.step
    return clock if fits else None


def _first_guess(time: Array) -> tuple[float, float]:
    """Step and start of the clock that some stamps follow best: where their phases agree most."""
    usual, since = float(np.median(np.diff(time))), time - time[0]
    steps = usual * np.linspace(0.9, 1.1, 8 * time.size)
    phases = np.exp(2j * np.pi * since / steps[:, None]).mean(axis=1)
    best = int(np.argmax(np.abs(phases)))
    return float(steps[best]), float(time[0] + steps[best] * np.angle(phases[best]) / (2 * np.pi))


def _fitted(time: Array, places: Array) -> Clock:
    middle, since = float(places.mean()), time - time[0]
    step = float((places - middle) @ since / ((places - middle) @ (places - middle)))
    even = time[0] + (float(since.mean()) + step * (places - middle))
    return Clock(even, step, float(np.std(time - even)))


def _roughness(time: Array, values: Array) -> float:
    """Root mean square of what each value misses the cubic through its neighbours by, the worst rows left out."""
    found = np.abs(misfits(time, values))
    kept = found[found <= np.quantile(found, TRIMMED)]
    return float(np.sqrt(np.mean(kept**2)))
