"""Plain faults of a log's rows: no number, out of order, stamped twice. What is done is counted and told.

Nothing is resampled; uneven steps and missing rows are no fault, and stamps are kept as they are unless the motion
shows that rows taken at a constant rate were stamped unevenly (`clock`). Each repair has a switch (`repairs`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from swingid.errors import InputError
from swingid.recording.clock import even_clock, rounded_clock
from swingid.recording.jumps import find_jumps
from swingid.recording.recording import Finding
from swingid.recording.spikes import find_spikes
from swingid.recording.unwrap import is_wrapped, unwrap

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from swingid.recording.conventions import Channels, Conventions

MANY = 0.01  # of all rows: what is a slip below, and a log that may not be what it seems above
OPTIONAL = ("reference", "adaptive_gain")  # for pictures only: a gap in them costs no row
ANGLES = ("angle", "wheel_angle")
SMOOTH = (*ANGLES, "wheel_speed")  # channels in which a single odd sample is a fault
PASSES = 3  # a spike beside another shows when the first one is gone


def repair(
    logged: Channels,
    conventions: Conventions,
    texts: Mapping[str, str],
    name: str,
    off: frozenset[str] = frozenset(),
) -> tuple[Channels, list[Finding]]:
    """The channels (logged units, with "time") without faulty rows, angles continuous, and what was found.

    `texts` holds, by channel, the first text that stood in the place of a number; `name` is the file's, for
    messages; `off` holds the repairs that are switched off. Raises InputError where a log is not one run of rows in
    time with a few slips, but something else, and where it cannot be used without a repair that is off.
    """
    channels, findings = rows_in_order(logged, conventions, texts, name, off)
    channels, clock = on_even_clock(channels, conventions, off)
    channels, spikes, unwrapped = made_continuous(channels, conventions, off)
    channels, rest = without_spikes(channels, conventions, spikes, off)
    return channels, [*findings, *clock, *unwrapped, *rest]


def rows_in_order(
    logged: Channels, conventions: Conventions, texts: Mapping[str, str], name: str, off: frozenset[str] = frozenset()
) -> tuple[Channels, list[Finding]]:
    """The first part of `repair`: rows with numbers, one for each time, in order of time. Raises as `repair`."""
    columns = conventions.columns
    findings: list[Finding] = []
    channels = _drop_rows_without_numbers(logged, columns, texts, name, findings)
    _refuse(findings, "blanks", off, name)
    channels = _sort(channels, columns, name, findings)
    _refuse(findings, "sort", off, name)
    if conventions.rate is None and "clock" not in off:
        channels = _round_off(channels, columns, findings)
    channels = _drop_repeated(channels, columns, name, findings)
    _refuse(findings, "repeats", off, name)
    return channels, findings


def on_even_clock(
    channels: Channels, conventions: Conventions, off: frozenset[str] = frozenset()
) -> tuple[Channels, list[Finding]]:
    """The second part of `repair`: stamps that scatter about a constant rate as that rate, where the motion says so."""
    findings: list[Finding] = []
    if conventions.rate is None and "clock" not in off:
        channels = _even_out(channels, conventions.columns, findings)
    return channels, findings


def made_continuous(
    channels: Channels, conventions: Conventions, off: frozenset[str] = frozenset()
) -> tuple[Channels, NDArray[np.bool_], list[Finding]]:
    """The third part of `repair`: angles that go on over turns; the rows (n,) that were spikes on the way."""
    turns = {channel: scale.turn for channel, scale in conventions.scales.items()}
    findings: list[Finding] = []
    channels, spikes = _make_continuous(channels, turns, conventions.columns, findings, keep="unwrap" in off)
    return channels, spikes, findings


def without_spikes(
    channels: Channels,
    conventions: Conventions,
    spikes: NDArray[np.bool_],
    off: frozenset[str] = frozenset(),
    rows: int = 1,
) -> tuple[Channels, list[Finding]]:
    """The last part of `repair`: single samples that fit neither neighbour; jumps and gaps are told.

    rows: of the log that each row is the mean of.
    """
    findings: list[Finding] = []
    channels = _drop_spikes(channels, spikes, findings, keep="spikes" in off, mean_of=rows)
    _warn_of_jumps(channels, conventions.columns, findings, rows)
    _note_gaps(channels["time"], conventions.columns["time"], findings)
    return channels, findings


def _drop_rows_without_numbers(
    channels: Channels,
    columns: Mapping[str, str],
    texts: Mapping[str, str],
    name: str,
    findings: list[Finding],
) -> Channels:
    needed = [channel for channel in channels if channel not in OPTIONAL]
    good = np.isfinite(channels[needed[0]])
    for channel in needed[1:]:
        good &= np.isfinite(channels[channel])
    if good.all():
        return channels
    rows = len(good)
    faults = {channel: rows - int(np.isfinite(channels[channel]).sum()) for channel in needed}
    worst = max(faults, key=lambda channel: faults[channel])
    first = int(np.argmin(np.isfinite(channels[worst])))
    sample = f", such as {texts[worst]!r}" if worst in texts else ""
    where = f"column {columns[worst]!r} in {faults[worst]} of {rows} rows (the first is row {first + 1}{sample})"
    if faults[worst] > rows / 2:
        raise InputError(f"{name} has no number in {where}; give [log] {worst} a column of numbers.", code="no-numbers")
    dropped = rows - int(good.sum())
    level = _level(dropped, rows)
    findings.append(Finding("rows-without-numbers", f"{dropped} rows left out: no number in {where}.", level, "blanks"))
    return _take(channels, good)


def _sort(channels: Channels, columns: Mapping[str, str], name: str, findings: list[Finding]) -> Channels:
    """Rows in order of time. A few rows may stand in the wrong place; then sorting makes the motion smoother.

    Where many do, or the sorted motion is rougher (two runs in one file, a clock that was reset), the order
    of the rows means something else than a late row, and no guess is made.
    """
    time = channels["time"]
    steps_back = np.flatnonzero(np.diff(time) < 0)
    if steps_back.size == 0:
        return channels
    rows = len(time)
    where = f"{name}: column {columns['time']!r} runs backwards after {steps_back.size} of {rows} rows"
    where += f" (the first is row {steps_back[0] + 1})"
    order = np.argsort(time, kind="stable")
    angle = channels["angle"]
    smoother = np.abs(np.diff(angle[order])).sum() <= np.abs(np.diff(angle)).sum()
    if steps_back.size > max(3, MANY * rows) or not smoother:
        message = f"{where} and sorting does not make one run of it; give one run per file, or another [log] time."
        raise InputError(message, code="unsorted")
    findings.append(Finding("unsorted", f"{where}; the rows were sorted by time.", "warning", "sort"))
    return _take(channels, order)


def _drop_repeated(channels: Channels, columns: Mapping[str, str], name: str, findings: list[Finding]) -> Channels:
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
    column = columns["time"]
    if conflicts > max(3, MANY * rows):
        message = f"{name}: {conflicts} of {rows} rows have the time of the row before in column {column!r}"
        message += " but other values; log the time with more digits, or set [log] rate."
        raise InputError(message, code="repeated-times")
    if copy.any():
        message = f"{int(copy.sum())} of {rows} rows left out: exact copies of the row before."
        findings.append(Finding("repeated-rows", message, "note", "repeats"))
    if conflicts:
        first = int(np.argmax(conflicting)) + 1
        message = f"{conflicts} of {rows} rows left out: their time is that of the row before, their values differ"
        findings.append(Finding("repeated-times", f"{message} (the first is row {first}).", "warning", "repeats"))
    return _take(channels, ~repeated)


def _refuse(findings: list[Finding], repair: str, off: frozenset[str], name: str) -> None:
    """Raise InputError where a log cannot be used without a repair that is switched off."""
    if repair in off and (made := [finding for finding in findings if finding.repair == repair]):
        message = f"{name} cannot be used without the repair {repair!r}, which is switched off, for with it"
        raise InputError(f"{message} {made[0].message.removeprefix(name + ': ')}", code=made[0].code)


def _round_off(channels: Channels, columns: Mapping[str, str], findings: list[Finding]) -> Channels:
    """Stamps of too few digits, of which several rows share one, as the constant rate behind them."""
    time = channels["time"]
    repeated = np.count_nonzero(np.diff(time) == 0)
    clock = rounded_clock(time) if repeated > max(3, MANY * len(time)) else None
    if clock is None:
        return channels
    message = (
        f"{repeated} of {len(time)} rows share the stamp of the row before in column {columns['time']!r}, which has too"
    )
    message += f" few digits; the rows were taken as {1 / clock.step:.6g} a second, as which no row is missing."
    findings.append(Finding("clock-fitted", message, "note", "clock"))
    return {**channels, "time": clock.time}


def _even_out(channels: Channels, columns: Mapping[str, str], findings: list[Finding]) -> Channels:
    """Stamps that scatter about a constant rate as that rate, where the motion is smoother so."""
    clock = even_clock(channels["time"], [channels[name] for name in ANGLES if name in channels])
    if clock is None:
        return channels
    message = (
        f"the stamps in column {columns['time']!r} scatter by {clock.scatter:.3g} about {1 / clock.step:.6g} rows a"
    )
    message += " second, and the motion is smoother at that rate; it was taken in their place."
    findings.append(Finding("clock-fitted", message, "note", "clock"))
    return {**channels, "time": clock.time}


def _make_continuous(
    channels: Channels,
    turns: Mapping[str, float | None],
    columns: Mapping[str, str],
    findings: list[Finding],
    *,
    keep: bool,
) -> tuple[Channels, NDArray[np.bool_]]:
    """Angles that were logged within one turn as angles that go on over turns, and the spikes met on the way."""
    spikes = np.zeros(len(channels["time"]), dtype=bool)
    for channel in ANGLES:
        turn = turns.get(channel)
        if channel not in channels or turn is None or not is_wrapped(channels[channel], turn):
            continue
        if keep:
            message = f"column {columns[channel]!r} seems to be logged within one turn, and was left so."
            findings.append(Finding("wrapped", message, "warning"))
            continue
        result = unwrap(channels["time"], channels[channel], turn)
        channels = {**channels, channel: result.values}
        spikes |= result.spikes
        if channel == "angle" and "reference" in channels:
            apart = channels["reference"] - result.values
            channels["reference"] = result.values + apart - turn * np.round(apart / turn)
        message = f"column {columns[channel]!r} was logged within one turn and was made continuous."
        findings.append(Finding("unwrapped", message, "note", "unwrap"))
        if result.ambiguous:
            message = f"column {columns[channel]!r} moves too far between rows to count its turns with certainty"
            message += f" (at {result.ambiguous} rows); log it faster, or continuous over turns."
            findings.append(Finding("ambiguous-turns", message, "warning"))
    return channels, spikes


def _drop_spikes(
    channels: Channels, spikes: NDArray[np.bool_], findings: list[Finding], *, keep: bool, mean_of: int = 1
) -> Channels:
    """The rows without single samples that fit neither neighbour; `spikes` are those that are known already.

    keep: leave them in, and warn.
    """
    rows = len(spikes)
    times = []
    everything = channels
    for again in range(PASSES + 1):
        if spikes.any():
            times.append(channels["time"][spikes])
            channels = _take(channels, ~spikes)
        elif again:
            break
        spikes = np.zeros(len(channels["time"]), dtype=bool)
        for channel in SMOOTH:
            if channel in channels:
                spikes |= find_spikes(channels["time"], channels[channel], mean_of)
    if times:
        found = np.sort(np.concatenate(times))
        shown = ", ".join(f"{time:g}" for time in found[:5]) + (", ..." if found.size > 5 else "")
        if keep:
            message = f"{found.size} of {rows} rows hold isolated spikes of an angle, left in as wanted, at {shown} s."
            findings.append(Finding("spikes-left", message, "warning"))
            return everything
        message = f"{found.size} of {rows} rows left out: isolated spikes of an angle at {shown} s."
        findings.append(Finding("spikes", message, "warning", "spikes"))
    return channels


def _warn_of_jumps(channels: Channels, columns: Mapping[str, str], findings: list[Finding], rows: int = 1) -> None:
    for channel in ANGLES:
        jumps = find_jumps(channels["time"], channels[channel], rows) if channel in channels else []
        if not jumps:
            continue
        shown = ", ".join(f"{size:.3g} at {channels['time'][row]:g} s" for row, size in jumps[:3])
        message = f"column {columns[channel]!r} jumps by {shown}{', ...' if len(jumps) > 3 else ''}"
        message += "; if the encoder slipped or lost counts there, use a log of one side of it."
        findings.append(Finding("jumps", message, "warning"))


def _note_gaps(time: NDArray[np.float64], column: str, findings: list[Finding]) -> None:
    steps = np.diff(time)
    if steps.size == 0:
        return
    usual = float(np.median(steps))
    gaps = int(np.count_nonzero(steps > 1.5 * usual))
    if gaps:
        message = f"{gaps} steps of column {column!r} are longer than 1.5 times the usual {usual:.6g} s"
        message += f" (the longest {steps.max():.6g} s); the stamps were used as they are."
        findings.append(Finding("gaps", message, "note"))


def _level(count: int, rows: int) -> Literal["note", "warning"]:
    return "warning" if count > MANY * rows else "note"


def _take(channels: Channels, rows: NDArray[np.bool_] | NDArray[np.intp]) -> Channels:
    return {channel: values[rows] for channel, values in channels.items()}
