"""From a file to a Recording: read, gather the rig's columns, repair, convert, judge."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from swingid.errors import InputError
from swingid.recording.conventions import Conventions, gather
from swingid.recording.epoch import from_first_row
from swingid.recording.formats import parquet, parquet_pieces, read_table
from swingid.recording.header_units import with_header_units
from swingid.recording.limiter import limited
from swingid.recording.plausibility import judge
from swingid.recording.recording import Finding, Recording, Source
from swingid.recording.repair import repair
from swingid.recording.repairs import notes_of, switched_off
from swingid.recording.row_order import MANY

if TYPE_CHECKING:
    from collections.abc import Mapping

    from swingid.model.rig import Rig
    from swingid.recording.formats.table import Table


MOST_ROWS = 4_000_000
LARGEST_FILE = 1 << 30


def load(
    path: str | Path, rig: Rig, *, still_axis: bool = False, repairs: Mapping[str, bool] | None = None
) -> Recording:
    """See `Recording.load`."""
    switched_off(repairs)  # a name that is none is said before anything is read
    content = read_bytes(path)
    name = str(path)
    table = read_table(content, name)
    source = Source(name, hashlib.sha256(content).hexdigest())
    return from_table(table, rig, source, still_axis=still_axis, repairs=repairs)


def from_table(
    table: Table, rig: Rig, source: Source, *, still_axis: bool = False, repairs: Mapping[str, bool] | None = None
) -> Recording:
    """The Recording in a table of named columns; raises as `Recording.load`."""
    name = source.path or "the table"
    off = switched_off(repairs)
    conventions, known = read_header(table, rig, name, off)
    conventions, epoch = from_first_row(table, conventions)
    unreadable = unreadable_rows(table, name, off)
    logged, texts = gather(table, conventions, name)
    with np.errstate(over="ignore", invalid="ignore"):  # absurd numbers are spikes or refused, and no cause to print
        logged, findings = repair(logged, conventions, texts, name, off)
        logged, more = limited(logged, conventions, rig, held=drive_held(table, conventions), off=off)
        findings += more
        channels = conventions.to_model(logged)
        findings += judge(channels, rig, name, still_axis=still_axis)
    metadata = table.metadata.get("metadata")
    return Recording(
        **channels,
        drive_held=drive_held(table, conventions),
        metadata=metadata if isinstance(metadata, dict) else {},
        findings=(*known, *epoch, *unreadable, *findings),
        source=source,
        averaged=1,
    )


def read_header(table: Table, rig: Rig, name: str, off: frozenset[str]) -> tuple[Conventions, list[Finding]]:
    """How a table is to be read, and what is said of that; its names, units and metadata are looked at, no rows.

    Raises InputError where the table was written in other conventions than the rig's.
    """
    conventions, units = with_header_units(table, rig, name)
    _check_origin(table, conventions, name)
    said = [*_saved_findings(table), *notes_of(off), *units]
    return conventions, [*said, *_no_reference(table, conventions), *_integrated(conventions)]


def read_bytes(path: str | Path) -> bytes:
    """The file's bytes; InputError that says which of the ways in which a path can be wrong it is, or that it is large.

    A file of more than `LARGEST_FILE` bytes, or Parquet of more than `MOST_ROWS` rows, is not read whole.
    """
    _refuse_large(path)
    try:
        content = Path(path).read_bytes()
    except FileNotFoundError:
        raise InputError(f"{path} does not exist; give the path of a log.", code="missing-file") from None
    except IsADirectoryError:
        raise InputError(f"{path} is a folder; give the path of one log in it.", code="is-a-folder") from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise InputError(f"{path} cannot be read: {reason}.", code="unreadable-file") from None
    if not content.strip():
        raise InputError(
            f"{path} is empty; a log needs a header line with column names and rows of numbers.",
            code="empty-file",
        )
    return content


def _refuse_large(path: str | Path) -> None:
    """Raise InputError for a file that would need too much memory as a whole."""
    try:
        size = Path(path).stat().st_size
        with Path(path).open("rb") as stream:
            is_parquet = size > MOST_ROWS / 100 and stream.read(4) == parquet.MAGIC
    except (OSError, ValueError):
        return  # reading will say why
    if size > LARGEST_FILE:
        what = f"has {size / 1e9:.2g} GB"
    elif is_parquet and (rows := parquet_pieces.File.open(str(path)).rows) > MOST_ROWS:
        what = f"has {rows / 1e6:.3g} million rows"
    else:
        return
    message = (
        f"{path} {what}, too much to be read whole; swingid identify reads Parquet and CSV of any length in parts "
    )
    raise InputError(f"{message}(momentum, energy), and --part FROM:TO takes a part of it.", code="too-large")


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


def unreadable_rows(table: Table, name: str, off: frozenset[str]) -> tuple[Finding, ...]:
    """What to say of rows that do not split into the table's columns; InputError when most do not."""
    lost = table.unreadable_rows
    if lost == 0:
        return ()
    rows = lost + max(map(len, table.columns.values()), default=0)
    if "blanks" in off:
        message = f"{name}: {lost} of {rows} rows do not have the cells that the header names"
        raise InputError(f"{message}; switch the repair 'blanks' on to leave them out.", code="unreadable-rows")
    if lost > rows / 2:
        message = f"{name} is not a table: {lost} of {rows} lines do not have the cells that its header names."
        raise InputError(message, code="not-a-table")
    message = f"{lost} of {rows} rows left out: they do not have the cells that the header names."
    return (Finding("unreadable-rows", message, "warning" if lost > MANY * rows else "note", "blanks"),)


def _integrated(conventions: Conventions) -> tuple[Finding, ...]:
    """A note where the wheel's angle is not measured but its speed."""
    if "wheel_speed" not in conventions.channels:
        return ()
    column = conventions.columns["wheel_speed"]
    reading = "the mean since the row before" if conventions.speed_is_mean else "the speed at its row"
    text = f"the wheel's angle is the integral of its speed (column {column!r}, taken as {reading}); where that is "
    other = "instant" if conventions.speed_is_mean else "mean"
    return (Finding("wheel-angle-integrated", f'{text}otherwise, set wheel_speed_is = "{other}".', "note"),)


def _no_reference(table: Table, conventions: Conventions) -> tuple[Finding, ...]:
    """A note where the rig file names a reference that the log lacks: nothing but pictures needs it."""
    column = conventions.columns["reference"]
    if table.find(column) is not None or "reference" not in conventions.stated or table.metadata:
        return ()
    return (Finding("no-reference", f"the log has no column {column!r} (the reference); nothing needs it.", "note"),)


def drive_held(table: Table, conventions: Conventions) -> bool:
    """Whether the drive was held: a file written by swingid knows, else the rig says."""
    written = table.metadata.get("log")
    held = written.get("drive_held") if isinstance(written, dict) else None
    return held if isinstance(held, bool) else conventions.drive_held


def _saved_findings(table: Table) -> tuple[Finding, ...]:
    """What had been found in the log before swingid wrote this file."""
    saved = table.metadata.get("findings")
    found = []
    for entry in saved if isinstance(saved, list) else []:
        if isinstance(entry, dict) and entry.get("level") in ("note", "warning"):
            named = entry.get("repair")
            named = named if isinstance(named, str) else None
            found.append(Finding(str(entry.get("code")), str(entry.get("message")), entry["level"], named))
    return tuple(found)
