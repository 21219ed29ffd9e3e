"""First in `repair.repaired`: rows with numbers, one for each time, in order of time, on the clock behind them.

Rows taken evenly by a timer and stamped late by a busy computer look like rows taken at odd instants and stamped
rightly. The motion decides between them: it is smooth in the right time only (`even_clock`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from swingid.errors import InputError
from swingid.numerics.arrays import median, quantile
from swingid.recording.continuity import misfits

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from swingid.numerics.arrays import Array, Bools
    from swingid.recording.conventions import Channels, Reading


FEWEST = 64  # rows
FEWEST_BLOCKS = 4
BLOCK = 16  # rows, at least, whose median stamp separates a lasting shift, as of a missing row, from single late stamps
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
    """The constant rate behind rising stamps, where the angles (n,) show that the rows were taken at it; else None.

    Rows may be missing; their number follows from the stamps. None also where the stamps are even as they are.
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


def even_places(time: Array, rate: float | None) -> Array | None:
    """The place of each row on the even clock that rising stamps (s) show, by which no row is missing; else None.

    rate: at which stamps were made of the row number; rows of those may have been left out since.
    """
    if rate is not None:
        return np.asarray(np.round((time - time[0]) * rate))
    places = np.arange(time.size, dtype=np.float64)
    if time.size < FEWEST or np.ptp(time) > ABSURD:
        return None
    clock = _fitted(time, places)
    return places if np.abs(time - clock.time).max() < LASTING * clock.step else None


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
    """The clock of rows of which some may be missing: each row's place on it follows from its stamp.

    A line through the first rows gives the places of twice as many, and so on. None where two rows would share a place,
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
    usual, since = median(np.diff(time)), time - time[0]
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
    sizes = np.abs(misfits(time, values))
    kept = sizes[sizes <= quantile(sizes, TRIMMED)]
    return float(np.sqrt(np.mean(kept**2)))


#: Largest values that a rig may log: a clock that counts seconds from any epoch, angles of years of turning.
LARGEST = {
    "time": 1e11,
    "angle": 1e9,
    "wheel_angle": 1e12,
    "angle_speed": 1e9,
    "wheel_speed": 1e9,
    "voltage": 1e6,
    "torque": 1e9,
}

MANY = 0.01  # of all rows: what is a slip below, and a log that may not be what it seems above
NEARLY_ALL = 0.9  # of the steps: a clock that runs backwards
OPTIONAL = ("reference", "adaptive_gain")  # for pictures only: a gap in them costs no row


def few(count: int, rows: int) -> bool:
    """Return whether faults in so many of the rows are slips of a logger."""
    return count <= max(3, MANY * rows)


def rows_in_order(channels: Channels, reading: Reading) -> Channels:
    """Rows with numbers, one for each time, in order of time; see `repair.repaired`.

    Raises InputError where a repair that is switched off would have to be made.
    """
    for fault, repair in FAULTS:
        known = len(reading.findings)
        channels = fault(channels, reading)
        made = [finding for finding in reading.findings[known:] if finding.repair == repair]
        if repair in reading.off and made:
            message = f"{reading.name} cannot be used without the repair {repair!r}, which is switched off, for with it"
            raise InputError(f"{message} {made[0].message.removeprefix(reading.name + ': ')}", code=made[0].code)
    return channels


def _drop_absurd_rows(channels: Channels, reading: Reading) -> Channels:
    """The rows without few numbers that no rig gives (1e300), as a logger's fault leaves them; many are refused."""
    good = np.ones(len(channels["time"]), dtype=bool)
    worst = None
    for channel, largest in LARGEST.items():
        values = channels.get(channel)
        limit = largest if channel == "time" else largest / abs(reading.conventions.scale(channel).factor)
        if values is None or not values.size or max(-values.min(), values.max()) <= limit:
            continue
        absurd = np.isfinite(values) & (np.abs(values) > limit)
        if absurd.any():
            worst = worst or (channel, int(np.argmax(absurd)))
            good &= ~absurd
    rows, dropped = len(good), int(np.count_nonzero(~good))
    if worst is None or not few(dropped, rows):
        return channels
    channel, first = worst
    message = f"{dropped} of {rows} rows left out: {reading.column(channel)} holds"
    message += f" {channels[channel][first]:.3g} in row {first + 1}, which no rig does."
    reading.found("absurd-numbers", message, "warning", "blanks")
    return take(channels, good)


def _drop_rows_without_numbers(channels: Channels, reading: Reading) -> Channels:
    """The rows with a number in every channel; where most have none, another column is meant."""
    needed = [channel for channel in channels if channel not in OPTIONAL]
    good = np.isfinite(channels[needed[0]])
    for channel in needed[1:]:
        good &= np.isfinite(channels[channel])
    if good.all():
        return channels
    rows = len(good)
    faults = {channel: rows - int(np.isfinite(channels[channel]).sum()) for channel in needed}
    worst = max(faults, key=lambda channel: faults[channel])
    first = reading.before + int(np.argmin(np.isfinite(channels[worst]))) + 1
    sample = f", such as {reading.texts[worst]!r}" if worst in reading.texts else ""
    where = f"{reading.column(worst)} in {faults[worst]} of {rows} rows (the first is row {first}{sample})"
    if faults[worst] > rows / 2:
        message = f"{reading.name} has no number in {where}; give [log] {worst} a column of numbers."
        raise InputError(message, code="no-numbers")
    dropped = rows - int(good.sum())
    message = f"{dropped} of {rows} rows left out: no number in {where}."
    reading.found("rows-without-numbers", message, "warning" if dropped > MANY * rows else "note", "blanks")
    return take(channels, good)


def _sort(channels: Channels, reading: Reading) -> Channels:
    """Rows in order of time. A few rows may stand in the wrong place; then sorting makes the motion smoother.

    Where many do, or the sorted motion is rougher (two runs in one file, a clock that was reset), the order
    of the rows means something else than a late row, and no guess is made.
    """
    time = channels["time"]
    steps_back = np.flatnonzero(np.diff(time) < 0)
    if steps_back.size == 0:
        return channels
    rows, name, column = len(time), reading.name, reading.column("time")
    if steps_back.size > NEARLY_ALL * (rows - 1):
        message = f"{name}: the time in {column} runs backwards, from {time[0]:.6g} to {time[-1]:.6g} s"
        advice = "if the rows are stored newest first, turn their order around, else correct the clock"
        raise InputError(f"{message}; {advice}.", code="backwards")
    where = f"{name}: {column} runs backwards after {steps_back.size} of {rows} rows"
    where += f" (the first is row {reading.before + steps_back[0] + 1})"
    order = np.argsort(time, kind="stable")
    angle = channels["angle" if "angle" in channels else "angle_speed"]
    smoother = np.abs(np.diff(angle[order])).sum() <= np.abs(np.diff(angle)).sum()
    wrong = _wrong_stamps(time, steps_back)
    slips = few(steps_back.size, rows)
    if slips and not smoother and (np.diff(time[~wrong]) > 0).all():
        message = f"{int(wrong.sum())} of {rows} rows left out: their time in {column} fits neither"
        first = int(np.argmax(wrong))
        message += f" neighbour (the first is row {reading.before + first + 1}, {time[first]:.6g} s)."
        reading.found("wrong-stamps", message, "warning", "sort")
        return take(channels, ~wrong)
    if not slips or not smoother:
        message = f"{where} and sorting does not make one run of it; give one run per file, or another [log] time."
        raise InputError(message, code="unsorted")
    reading.found("unsorted", f"{where}; the rows were sorted by time.", "warning", "sort")
    return take(channels, order)


def _wrong_stamps(time: Array, steps_back: NDArray[np.intp]) -> Bools:
    """Rows beside a step back without which the time rises there: the one before it, else the one behind."""
    wrong = np.zeros(len(time), dtype=bool)
    for k in steps_back:
        before = k == 0 or time[k - 1] < time[k + 1]
        wrong[k if before else k + 1] = True
    return wrong


def _drop_repeated(channels: Channels, reading: Reading) -> Channels:
    """One row per stamp: exact copies of a row go, and of few that contradict each other the first stays."""
    time = channels["time"]
    repeated = np.concatenate(([False], np.diff(time) == 0))
    if not repeated.any():
        return channels
    copy = repeated.copy()
    for values in channels.values():
        copy[1:] &= (values[1:] == values[:-1]) | (np.isnan(values[1:]) & np.isnan(values[:-1]))
    conflicting = repeated & ~copy
    rows, conflicts = len(time), int(conflicting.sum())
    if not few(conflicts, rows):
        message = f"{reading.name}: {conflicts} of {rows} rows have the time of the row before"
        message += f" in {reading.column('time')} but other values; log the time with more digits, or set [log] rate."
        raise InputError(message, code="repeated-times")
    if copy.any():
        message = f"{int(copy.sum())} of {rows} rows left out: exact copies of the row before."
        reading.found("repeated-rows", message, "note", "repeats")
    if conflicts:
        first = reading.before + int(np.argmax(conflicting)) + 1
        message = f"{conflicts} of {rows} rows left out: their time is that of the row before, their values differ"
        reading.found("repeated-times", f"{message} (the first is row {first}).", "warning", "repeats")
    return take(channels, ~repeated)


def _round_off(channels: Channels, reading: Reading) -> Channels:
    """Stamps of too few digits, of which several rows share one, as the constant rate behind them."""
    time = channels["time"]
    repeated = int(np.count_nonzero(np.diff(time) == 0))
    is_stamped = reading.conventions.rate is None and "clock" not in reading.off
    clock = rounded_clock(time) if is_stamped and not few(repeated, len(time)) else None
    if clock is None:
        return channels
    where = f"the stamp of the row before in {reading.column('time')}"
    message = f"{repeated} of {len(time)} rows share {where}, which has too"
    message += f" few digits; the rows were taken as {1 / clock.step:.6g} a second, as which no row is missing."
    reading.found("clock-fitted", message, "note", "clock")
    return {**channels, "time": clock.time}


FAULTS = (
    (_drop_absurd_rows, "blanks"),
    (_drop_rows_without_numbers, "blanks"),
    (_sort, "sort"),
    (_round_off, "clock"),
    (_drop_repeated, "repeats"),
)
"""Faults of rows, in the order in which they are looked for: what takes them away, and the repair that it is."""


def take(channels: Channels, rows: Bools | NDArray[np.intp]) -> Channels:
    """These rows of all channels."""
    return {channel: values[rows] for channel, values in channels.items()}
