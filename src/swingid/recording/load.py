"""From a file to the channels of a Recording: read, gather the rig's columns, repair, convert, check the motion."""

from __future__ import annotations

import hashlib
import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from swingid.errors import InputError, UnanswerableError, require_rig
from swingid.recording.conventions import TURN, Conventions, Reading, gather
from swingid.recording.findings import OFF, Finding, Kind, Source, notes_of, switched_off
from swingid.recording.formats import parquet, read_table
from swingid.recording.formats.csv import TABLE_NEEDS, without_lines
from swingid.recording.grid import check_grids
from swingid.recording.header import FACTORS, from_first_row, with_header_units
from swingid.recording.live import is_live, live
from swingid.recording.points import with_angle
from swingid.recording.rate_checks import check_beside
from swingid.recording.repair import repaired
from swingid.recording.rows import LARGEST, MANY
from swingid.spellings import canonical
from swingid.system import LARGEST_FILE, is_file, read_input

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from swingid.model.rig import Rig
    from swingid.numerics.arrays import Array
    from swingid.recording.conventions import Channels
    from swingid.recording.formats.table import Table


MOST_ROWS = 4_000_000


def read_log(path: str | Path, rig: Rig, repairs: Mapping[str, bool] | None) -> tuple[Table, Source]:
    """The table in a file, and where it is from; raises as `Recording.load`."""
    require_rig(rig)
    switched_off(repairs)  # raises for a name that is none before anything is read
    content = read_bytes(path)
    name = str(path)
    table = read_table(without_lines(content, rig.log.skip_rows, rig.log.comment, name), name)
    return table, Source(name, hashlib.sha256(content).hexdigest())


def contents_of(
    table: Table, rig: Rig, source: Source, *, still_axis: bool = False, repairs: Mapping[str, bool] | None = None
) -> dict[str, Any]:
    """The fields of the Recording in a table of named columns, by name; raises as `Recording.load`."""
    require_rig(rig)
    name = source.path or "the table"
    table, of_point = with_angle(table, rig, name)
    reading = reading_of(table, table, rig, name, repairs)
    reading.findings += of_point
    reading.findings += unreadable_rows(table, reading)
    if is_live(table):
        table, reading = live(table, reading)
    logged = gather(table, reading)
    with np.errstate(over="ignore", invalid="ignore"):  # absurd numbers are spikes or refused, and no cause to print
        channels = reading.conventions.to_model(repaired(logged, reading))
        check_beside(channels, reading)
        check_motion(channels, reading, still_axis=still_axis)
    saved, run = table.metadata.get("metadata"), table.metadata.get("run")
    metadata = dict(saved) if isinstance(saved, dict) else {}
    if isinstance(run, dict):  # of a journal
        metadata["run"] = {key: run[key] for key in ("device", "firmware") if key in run}
    off = {finding.repair for finding in reading.findings if finding.code == OFF and finding.repair}
    return {
        **channels,
        "drive_held": reading.held,
        "metadata": metadata,
        "findings": tuple(reading.findings),
        "repairs_off": reading.off | off,
        "source": replace(source, read=True),
    }


def reading_of(header: Table, first: Table | None, rig: Rig, name: str, repairs: Mapping[str, bool] | None) -> Reading:
    """How a table is to be read, and the findings on that; its names, units and metadata are looked at.

    first: its first rows with the time, from which an epoch is found. Raises InputError where the table was written in
    other conventions than the rig's, UsageError for an unknown repair.
    """
    off = switched_off(repairs)
    conventions, units = with_header_units(header, rig, name)
    _check_origin(header, conventions, name)
    findings = [*_saved_findings(header), *notes_of(off), *units, *_assumed(header, conventions)]
    if first is not None:
        conventions, epoch = from_first_row(first, conventions)
        findings += [*epoch, *check_grids(first, conventions, rig)]
    written = header.metadata.get("log")
    held = written.get("drive_held") if isinstance(written, dict) else None
    held = held if isinstance(held, bool) else conventions.drive_held
    return Reading(rig, conventions, name, off, held, findings)


def read_bytes(path: str | Path) -> bytes:
    """The file's bytes; InputError where the path is wrong, or the file too large.

    A file of more than `LARGEST_FILE` bytes, or Parquet of more than `MOST_ROWS` rows, is not read whole.
    """
    _refuse_large(path)
    folder = "is-a-folder", "give the path of one log in it"
    content = read_input(path, missing="give the path of a log", folder=folder)
    if not content.strip():
        raise InputError(f"{path} is empty; {TABLE_NEEDS}.", code="empty-file")
    return content


def _refuse_large(path: str | Path) -> None:
    """Raise InputError for a file that would need too much memory as a whole."""
    if not is_file(path):
        return
    try:
        size = Path(path).stat().st_size
        with Path(path).open("rb") as stream:
            is_parquet = size > MOST_ROWS / 100 and stream.read(4) == parquet.MAGIC
    except (OSError, ValueError):
        return  # reading raises with the reason
    if size > LARGEST_FILE:
        what = f"has {size / 1e9:.2g} GB"
    elif is_parquet and (rows := parquet.File.open(str(path)).rows) > MOST_ROWS:
        what = f"has {rows / 1e6:.3g} million rows"
    else:
        return
    message = f"{path} {what}, too much to be read whole; swingid identify reads Parquet, CSV, MCAP and HDF5 of any "
    raise InputError(
        f"{message}length in parts (momentum, energy), and --part FROM:TO takes a part of it.", code="too-large"
    )


def _check_origin(table: Table, conventions: Conventions, name: str) -> None:
    """Refuse a file that swingid wrote in other conventions than those it is now to be read in."""
    kind = table.metadata.get("drive")
    if kind is not None and kind != conventions.drive_kind:
        message = f'{name} was written for [drive] kind "{kind}", this rig has "{conventions.drive_kind}"'
        raise InputError(f"{message}; use the rig that belongs to the log.", code="other-drive")
    written = table.metadata.get("log")
    for key, value in conventions.keys.items():
        if isinstance(written, dict) and key in written and written[key] != value:
            message = (
                f"{name} was written with [log] {key} = {json.dumps(written[key])}, this rig has {json.dumps(value)}"
            )
            raise InputError(f"{message}; use the rig that it was written with.", code="other-conventions")


def unreadable_rows(table: Table, reading: Reading) -> tuple[Finding, ...]:
    """The finding on rows that do not split into the table's columns; InputError when most do not."""
    lost, name = table.unreadable_rows, reading.name
    if lost == 0:
        return ()
    rows = lost + max(map(len, table.columns.values()), default=0)
    if "blanks" in reading.off:
        message = f"{name}: {lost} of {rows} rows do not have the cells that the header names"
        raise InputError(f"{message}; switch the repair 'blanks' on to leave them out.", code="unreadable-rows")
    if lost > rows / 2:
        message = f"{name} is not a table: {lost} of {rows} lines do not have the cells that its header names."
        raise InputError(message, code="not-a-table")
    message = f"{lost} of {rows} rows left out: they do not have the cells that the header names."
    return (Finding("unreadable-rows", message, "warning" if lost > MANY * rows else "note", "blanks"),)


READINGS = {
    "instant": "the rate at its row",
    "mean": "the mean since the row before",
    "held": "held until the next row",
}


def _assumed(table: Table, conventions: Conventions) -> Iterator[Finding]:
    """Notes of a reference that the log lacks and of angles by their rates; a warning of a torque without a unit."""
    column, columns = conventions.columns["reference"], conventions.columns
    if table.find(column) is None and "reference" in conventions.stated and not table.metadata:
        text = f"the log has no column {column!r} (the reference); nothing needs it."
        yield Finding("no-reference", text, "note")
    if "wheel_speed" in conventions.channels:
        rate_is = conventions.wheel_rate_is
        text = f"the wheel's angle is the integral of its speed (column {columns['wheel_speed']!r}, taken as "
        text += f"{READINGS[rate_is]}); where that is otherwise, set wheel_speed_is = "
        text += '"mean".' if rate_is == "instant" else '"instant".'
        yield Finding("wheel-angle-integrated", text, "note")
    if conventions.axis == ("angle_speed",):
        text = f"the angle is the integral of its rate (column {columns['angle_speed']!r}, taken as "
        text += f"{READINGS[conventions.axis_rate_is]}), of which bias and start are unknown and were estimated."
        yield Finding("angle-integrated", text, "note")
    torque = table.find(columns["torque"]) if conventions.drive_kind == "direct" else None
    if torque is None or "torque_gain" in conventions.stated or table.metadata:
        return
    if canonical(table.unit(torque)) not in FACTORS["torque"]:
        text = f"neither rig file nor log states the unit of column {torque!r} (torque), which sets the scale; set "
        text += 'torque_gain under [log], N m (N) per unit of the column, such as 1 or "1 ± 0.1", or "unknown".'
        yield Finding("torque-gain-missing", text, "warning", kind=Kind.NO_SCALE)


def _saved_findings(table: Table) -> tuple[Finding, ...]:
    """What had been found in the log before swingid wrote this file."""
    saved = table.metadata.get("findings")
    findings = []
    for entry in saved if isinstance(saved, list) else []:
        if isinstance(entry, dict) and entry.get("level") in ("note", "warning"):
            named = entry.get("repair")
            named = named if isinstance(named, str) else None
            code, message, spans = str(entry.get("code")), str(entry.get("message")), _spans(entry.get("spans"))
            of_time, of_zero = _size(entry.get("of_time")), _size(entry.get("of_zero"))
            pivot = entry.get("of_pivot")
            of_pivot = (_size(pivot[0]), _size(pivot[1])) if isinstance(pivot, list) and len(pivot) == 2 else None
            findings.append(Finding(code, message, entry["level"], named, None, spans, of_time, of_zero, of_pivot))
    return tuple(findings)


def _size(saved: object) -> float:
    """An uncertainty in a file; 0 where it is none."""
    return float(saved) if isinstance(saved, int | float) and 0 < saved < 1 else 0.0


def _spans(saved: object) -> tuple[tuple[float, float], ...]:
    """Spans of a finding in a file; none where they are not pairs of numbers."""
    try:
        pairs = np.array(saved if isinstance(saved, list) else [], dtype=np.float64).reshape(-1, 2)
    except (TypeError, ValueError):
        return ()
    return tuple((float(begin), float(end)) for begin, end in pairs)


FEWEST_ROWS = 10
SLOWEST_STEP = 0.5  # s: with less than two rows a second a swing of a pendulum cannot be seen
NO_STEP = 60.0  # s: no swing at all
LONG_REST = 0.1  # of the log: a wheel that rests so long while the axis swings is an encoder that died
TO_AND_FRO = 3  # passes between the outer quarters of the range: a body that swings, not one that spins down
SPARSEST = 30.0  # times what the rows take one after the other: two runs in one file, or a clock that was set
SHORTEST_STEP = 1e-7  # s

#: Range of a to-and-fro motion, in turns, that gravity does not allow: a free body swings over less than one turn,
#: a reaction wheel is too weak to throw it over the top and back time and again, a strong motor is not.
WIDEST_SWING = {"none": 1.5, "reaction-wheel": 2.0, "direct": 10.0, "motor": 10.0}


def check_motion(channels: Channels, reading: Reading, *, still_axis: bool = False) -> None:
    """Add findings on what is implausible about the channels (model units and signs).

    still_axis: the angle may stand still. Raises UnanswerableError for too few rows and for an angle that does not
    move, InputError for a motion that the axis cannot make (degrees taken for radians).
    """
    rig, name = reading.rig, reading.name
    _refuse_absurd_numbers(channels, rig, name)
    time, angle = channels["time"], channels["angle"]
    if time.size < FEWEST_ROWS:
        rows = "1 usable row" if time.size == 1 else f"{time.size} usable rows"
        message = f"{name} has {rows}, too few to show a motion; log some swings."
        raise UnanswerableError(message, code="too-short")
    alone = rig.log.has_rate_alone
    column = f"column {rig.log.angle_speed!r} (the rate)" if alone else reading.column("angle") + " (the angle)"
    if np.ptp(angle) == 0.0 and not still_axis:
        message = f"{name}: {column} does not change; log a motion, or set [log] angle to the right column."
        raise UnanswerableError(message, code="no-motion")
    _refuse_impossible_swings(angle, rig, f"{name}: {column}")
    wheel = channels.get("wheel_angle")
    still = None if wheel is None else _longest_rest(time, wheel)
    if still is not None and time[-1] - time[0] > 0:
        first, last = still
        swings = np.ptp(angle[first : last + 1]) > 0.5 * np.ptp(angle)
        if swings and time[last] - time[first] > LONG_REST * (time[-1] - time[0]):
            part = "" if last - first == time.size - 1 else f" from {time[first]:.4g} to {time[last]:.4g} s"
            message = f"column {rig.log.wheel_angle!r} (wheel angle) does not change{part} while the axis swings"
            text = f"{message}; is the wheel's encoder connected?"
            reading.found("wheel-still", text, "warning", kind=Kind.WHEEL_STILL)
    steps = np.diff(time)
    step = float(steps.max())
    step = step if step <= SLOWEST_STEP else float(np.median(steps))
    if step > NO_STEP:
        message = f"{name}: one row in {step:g} s is too slow for a swing; if column {rig.log.time!r} is in us or ns"
        raise InputError(f"{message}, set [log] time_unit.", code="absurd-time")
    if step > SLOWEST_STEP:
        message = f"one row in {step:g} s is too slow for a swing; if the time is in ms, set [log] time_unit."
        reading.found("slow-rows", message, "warning")


def _longest_rest(time: Array, values: Array) -> tuple[int, int]:
    """First and last row of the longest time in which `values` do not change at all."""
    edges = np.concatenate(([0], np.flatnonzero(np.diff(values)) + 1, [len(values)]))
    first, last = edges[:-1], edges[1:] - 1
    longest = int(np.argmax(time[last] - time[first]))
    return int(first[longest]), int(last[longest])


def _refuse_absurd_numbers(channels: Channels, rig: Rig, name: str) -> None:
    """Numbers that no instrument writes: another unit, another column, or a fault of the logger."""
    for channel, largest in LARGEST.items():
        peak = float(np.abs(channels[channel]).max(initial=0.0)) if channel in channels else 0.0
        if peak <= largest:
            continue
        where = f"{name}: column {getattr(rig.log, channel)!r}"
        if channel == "time":
            message = f"{where} reaches {peak:.3g} s; if it is in ms, us or ns, set [log] time_unit"
            raise InputError(f"{message}, or [log] rate where rows are evenly spaced.", code="absurd-time")
        what = f"the {channel.replace('_', ' ')} reaches {peak:.3g}"
        raise InputError(f"{where}: {what}, which no rig does; set [log] {channel} and its unit.", code="absurd-number")
    steps = np.diff(channels["time"])
    if steps.size and steps.min() >= SHORTEST_STEP and steps.max() <= SPARSEST * steps.min():
        return  # whatever the median is
    if steps.size and float(steps.sum()) > SPARSEST * steps.size * float(np.median(steps)):
        longest = int(np.argmax(steps))
        message = f"{name}: column {rig.log.time!r} jumps by {steps[longest]:.3g} s after row {longest + 1}, and the"
        message += f" rows cover less than a {SPARSEST:.0f}th of the time"
        raise InputError(f"{message}; give one run per file, or correct the clock.", code="absurd-time")
    if steps.size and not float(np.median(steps)) >= SHORTEST_STEP:
        message = (
            f"{name}: column {rig.log.time!r} rises by {np.median(steps):.3g} from row to row, which is no time in s"
        )
        raise InputError(f"{message}; log seconds, or set [log] rate where rows are evenly spaced.", code="absurd-time")


def _refuse_impossible_swings(angle: Array, rig: Rig, column: str) -> None:
    gravity = rig.axis.gravity_torque
    if rig.axis.kind != "rotary" or (gravity != "unknown" and gravity.value == 0.0):
        return
    low, high = float(angle.min()), float(angle.max())
    turns = (high - low) / TURN
    if turns < WIDEST_SWING[rig.drive.kind]:
        return
    side = np.where(angle > high - (high - low) / 4, 1, np.where(angle < low + (high - low) / 4, -1, 0))
    passes = np.count_nonzero(np.diff(side[side != 0]))
    if passes >= TO_AND_FRO:
        message = f"{column} swings back and forth over {turns:.3g} turns, which gravity does not allow"
        fix = 'set [log] angle_unit = "deg" if it is in degrees, or check [log] angle'
        raise InputError(f"{message}; {fix}.", code="implausible-angle")
