"""`inspect_log`: what a file holds, how much of it is usable, and whether it fits the rig."""

from __future__ import annotations

import hashlib
import json
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from swingid.errors import SwingidError, require_rig
from swingid.identification import identify
from swingid.model.rig import Rig
from swingid.model.rig.drive import CHANNELS
from swingid.model.rig.fields import SECONDS, seconds
from swingid.preparation.noise import channel_noise
from swingid.preparation.push import without_pushes
from swingid.preparation.reference import in_units
from swingid.recording.conventions import Conventions
from swingid.recording.formats import read_table
from swingid.recording.formats.csv import without_lines
from swingid.recording.formats.table import Table
from swingid.recording.header import with_header_units
from swingid.recording.inspect import Check, Column, Roles, describe, guess_roles, log_table, read_clock
from swingid.recording.inspect.check import Clock, check_clock
from swingid.recording.inspect.rig_text import trial_rig
from swingid.recording.large import first_rows, is_large, opened
from swingid.recording.load import FEWEST_ROWS, read_bytes
from swingid.recording.points import with_angle
from swingid.recording.recording import Recording, Source
from swingid.spellings import canonical
from swingid.study.inspect.channels import Channel, check_channels
from swingid.study.inspect.corrections import physics, read, without_path
from swingid.study.inspect.motion import Service, Swings, not_checked, read_motion, services
from swingid.study.inspect.verdict import Verdict, verdict_of
from swingid.study.output import Study
from swingid.system import sha256_of

SCHEMA = "swingid.inspect/1"

WITH_CLOCK = ("backwards", "unsorted", "repeated-times", "absurd-time")
"""Refusals of the reader that a fault of the clock contains already."""

MARKS = {"ok": "ok  ", "note": "note", "unknown": "?   ", "advice": "tip ", "repair": "MEND", "fault": "BAD "}

WIDTH = 118


@dataclass(frozen=True, eq=False)
class Inspection(Study):
    """All that was found. log: the channels as the rig, or the guess, reads them; None where they cannot be read.

    table: the text of a [log] table as guessed. rig: None where none was given; `log` is then in guessed units.
    tried: changes of the rig file under which the rest was checked.
    """

    path: str
    sha256: str
    rows: int
    columns: tuple[Column, ...]
    roles: Roles
    table: str
    clock: Clock | None
    checks: tuple[Check, ...]
    services: tuple[Service, ...] = ()
    rig: Rig | None = None
    log: Recording | None = None
    swings: Swings | None = None
    tried: Mapping[str, object] = field(default_factory=dict)

    @cached_property
    def verdict(self) -> Verdict:
        """Return whether the log is usable, from all checks."""
        return verdict_of(self.checks, with_rig=self.rig is not None)

    def check(self, code: str) -> Check | None:
        """The check with this code, None where it was not made."""
        return next((check for check in self.checks if check.code == code), None)

    @property
    def linear(self) -> bool:
        """Return whether the axis is a linear one, as the rig states it or the guess."""
        return self.roles.linear if self.rig is None else self.rig.axis.kind == "linear"

    def to_dict(self) -> dict[str, Any]:
        """Plain data, schema "swingid.inspect/1"."""
        return {
            "schema": SCHEMA,
            "verdict": self.verdict,
            "log": self.path,
            "sha256": self.sha256,
            "rows": self.rows,
            "rig": None if self.rig is None else self.rig.name,
            "columns": [column.to_dict() for column in self.columns],
            "roles": {
                name: {"column": role.column, "unit": role.unit, "why": role.why, "sure": role.sure}
                for name, role in self.roles.found.items()
            },
            "other_columns": self.roles.others,
            "log_table": self.table,
            "checks": [check.to_dict() for check in self.checks],
            "methods": [vars(service) for service in self.services],
            "changes_tried": self.tried,
        }

    def summary(self) -> str:
        """Verdict, columns, checks, methods and, without a rig, the guessed [log] table, for a terminal."""
        lines = [f"{self.path}: {self.verdict.line}"]
        lines += [f"advice: {self.verdict.advice}."] if self.verdict.advice else []
        lines += ["", "columns", *_columns(self)]
        lines += ["", "checks" if self.rig is None else f"checks against rig {self.rig.name}"]
        for check in self.checks:
            lines += wrapped(check)
        if self.services:
            lines += ["", "how much of it serves each method"]
            wide = max(len(service.method) for service in self.services)
            for service in self.services:
                lines.append(f"  {service.method:<{wide}}  {service.seconds:8.4g} s  {service.why}")
        if self.rig is None and self.roles.found:
            lines += ["", "guessed for rig.toml (swingid init --from LOG DIR writes it)", ""]
            lines += [f"  {line}" for line in self.table.splitlines()]
        return "\n".join(lines)


def inspect_log(path: str | Path, rig: Rig | None = None) -> Inspection:
    """Look at a log: what it holds, how much of it is usable, whether it fits the rig.

    Parameters
    ----------
    path : text or Path
        The file; of a large one the first rows are read.
    rig : Rig
        Against which the log is checked too, if given.

    Raises
    ------
    InputError
        The file is no table.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> import swingid as sw
    >>> rig = sw.Rig.load("paper")
    >>> log = sw.simulate(rig, sw.parse_reference("sine 0.8 rad 8.5 rad/s"), duration=25, seed=1)
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "run.csv"
    >>> _ = log.save(file)
    >>> found = sw.inspect(file, rig)
    >>> found.verdict.status
    'ready'
    """
    if rig is not None:
        require_rig(rig)
    if is_large(path):
        inspection = inspect_table(first_rows(path), rig, Source(str(path), sha256_of(path)), whole=False)
        text = f"the log has {opened(path).rows} rows, of which the first {inspection.rows} were looked at."
        return replace(inspection, checks=(Check("first-rows", "rows", "note", text), *inspection.checks))
    content = read_bytes(path)
    skipped = (0, None) if rig is None else (rig.log.skip_rows, rig.log.comment)
    table = read_table(without_lines(content, *skipped, str(path)), str(path))
    return inspect_table(table, rig, Source(str(path), hashlib.sha256(content).hexdigest()))


def inspect_table(
    table: Table, rig: Rig | None = None, source: Source | None = None, *, whole: bool = True
) -> Inspection:
    """Look at a table of named columns; what cannot be read as a log is a fault of the verdict, not an error.

    whole: whether these are all rows of the log, so that `identify` has the last word on whether it is ready.
    """
    source = source or Source()
    columns = describe(table)
    roles = guess_roles(columns)
    by_name = {column.name: column for column in columns}
    clock, checks = _clock(table, rig, roles, by_name)
    text = log_table(roles)
    reader = in_units(rig) if rig is not None else trial_rig(roles, by_name, text)
    tried: dict[str, object] = {}
    log = None
    rows = max((len(column.values) for column in columns), default=0)
    if rows < FEWEST_ROWS:
        words = "1 row of numbers" if rows == 1 else f"{rows} rows of numbers"
        few = f"the log has {words}, too few for a motion"
        checks = [Check("too-short", "rows", "fault", few, "log some swings")]
    elif reader is not None:
        log, reader, tried, more = read(table, reader, source, by_name if rig is not None else None)
        if any(check.level == "fault" for check in checks):
            more = [check for check in more if check.code not in WITH_CLOCK]
        if "log.time_unit" in tried:
            clock, checks = _clock(table, reader, roles, by_name)
        units = [check for check in more if check.title == "units"]  # first: the rest is in these units
        checks = [*units, *checks, *(_with_guess(check, roles) for check in more if check not in units)]
    elif not roles.has_motion:  # else the clock is missing, which its check reports
        checks.append(_no_angle(roles))
    inspection = Inspection(
        path=source.path or "the table",
        sha256=source.sha256 or "",
        rows=rows,
        columns=tuple(columns),
        roles=roles,
        table=text,
        clock=clock,
        checks=tuple(checks),
        rig=None if rig is None else reader,
        log=log,
        tried=tried,
    )
    if reader is None or rows < FEWEST_ROWS:
        return inspection
    inspection = _with_motion(inspection, table, reader, source, by_name)
    return _as_identified(inspection, table, rig, source) if rig is not None and whole else inspection


def _as_identified(inspection: Inspection, table: Table, rig: Rig, source: Source) -> Inspection:
    """The inspection of a log that seems ready, or lacks swings only, with the verdict that `identify` comes to."""
    faults = [check for check in inspection.checks if check.level == "fault"]
    if (
        inspection.verdict.status == "repairs"
        or inspection.log is None
        or any(check.title != "motion" for check in faults)
    ):
        return inspection
    try:
        identify(Recording.from_table(table, rig, source), rig)
    except SwingidError as error:
        refused = Check(error.code, "identify", "fault", without_path(error, source), "")
        return inspection if faults else replace(inspection, checks=(*inspection.checks, refused))
    checks = (replace(check, level="advice") if check in faults else check for check in inspection.checks)
    return replace(inspection, checks=tuple(checks))


def _with_motion(
    inspection: Inspection, table: Table, reader: Rig, source: Source, columns: Mapping[str, Column]
) -> Inspection:
    """The inspection with the checks of channels, motion and balance as `reader` reads them."""
    rig, log = inspection.rig, inspection.log
    if log is None:
        return replace(
            inspection, checks=(*inspection.checks, *_seen(table, reader, columns, None, declared=rig is not None))
        )
    if rig is not None:
        log = without_pushes(log, reader)
    seen = _seen(table, reader, columns, log, declared=rig is not None)
    drive = CHANNELS.get(inspection.roles.drive) if rig is None else reader.drive.channel
    swings, moves = read_motion(log, channel_noise(log, reader), drive, linear=reader.axis.kind == "linear", rig=rig)
    served = tuple(services(log, swings, drive, rig))
    tried = dict(inspection.tried)
    wrong = any(check.level == "fault" or check.code == "slow-rows" for check in (*inspection.checks, *seen))
    if rig is not None and rig.drive.channel == "voltage":
        moves.append(not_checked(rig))
    elif rig is not None and swings is not None and not wrong:
        more, changed, log, changes = physics(table, log, reader, swings, source)
        tried |= changes
        if changed is not reader:
            log = without_pushes(log, changed)
            rig, seen = changed, _seen(table, changed, columns, log, declared=True)
        moves += more
    checks = (*inspection.checks, *seen, *moves)
    return replace(inspection, checks=checks, services=served, rig=rig, log=log, swings=swings, tried=tried)


def _no_angle(roles: Roles) -> Check:
    """The fault of a log without an angle: places in a picture are none."""
    if "a place in a picture" in roles.others.values():
        text = "pixels are no angle, and no pair of columns goes along a circle that shows the pivot."
        remedy = "log x and y of a mark on the body over wider swings, or state [log] point and pivot in a rig file"
        return Check("no-pivot", "columns", "fault", text, remedy)
    remedy = "name the column of the angle in a rig file"
    return Check("no-angle", "columns", "fault", "no column looks like the angle of a swing.", remedy)


def _clock(
    table: Table, rig: Rig | None, roles: Roles, columns: Mapping[str, Column]
) -> tuple[Clock | None, list[Check]]:
    """The clock by the rig's convention or the guess, and its checks."""
    rate, name, factor = None, roles.column("time"), 1.0
    if rig is not None:
        rate, name = rig.log.rate, table.find(rig.log.time)
        stated = canonical(table.unit(name)) if name is not None else ""
        factor = SECONDS[stated] if stated in SECONDS else seconds(rig.log.time_unit)
    elif name is not None:
        factor = SECONDS[roles.found["time"].unit]
    rows = max((len(column.values) for column in columns.values()), default=0)
    if rate is not None:
        stamps, name = np.arange(rows) / rate, "the row number"
    elif name is not None and name in columns and columns[name].kind in ("numbers", "whole numbers"):
        stamps = columns[name].values * factor
    else:
        if rig is not None:
            return None, []  # the check of reading names the missing column
        text = "no column of times: none rises from row to row"
        return None, [Check("no-time", "rate", "fault", text, "state [log] rate, rows per second", {"rows": rows})]
    whole = [column for column in columns.values() if len(column.values) == len(stamps)]
    clock = read_clock(stamps, whole)
    return clock, check_clock(clock, f"column {name!r}" if rate is None else name)


def _seen(
    table: Table, rig: Rig, columns: Mapping[str, Column], log: Recording | None, *, declared: bool
) -> list[Check]:
    """The checks of the channels as `rig` reads them; declared: whether its sensors are the user's words."""
    steps = {"angle": rig.sensors.of("angle").resolution, "wheel_angle": rig.sensors.of("wheel").resolution}
    return check_channels(_channels(table, rig, columns), log, steps if declared else {})


def _with_guess(check: Check, roles: Roles) -> Check:
    """A missing column with what the others look like."""
    if check.code != "missing-column" or not roles.found:
        return check
    guess = ", ".join(f"{name} = {json.dumps(role.column)}" for name, role in roles.found.items())
    return replace(check, evidence=f"{check.evidence} The columns look like {guess}.")


def _channels(table: Table, rig: Rig, columns: Mapping[str, Column]) -> list[Channel]:
    """The rig's channels that the file has, with what turns their columns into SI units."""
    try:
        table, _ = with_angle(table, rig, "the log")
        conventions, _ = with_header_units(table, rig, "the log")
    except SwingidError:
        conventions = Conventions.of(rig)
    channels = []
    linear = rig.axis.kind == "linear"
    for role in conventions.channels:
        name = table.find(conventions.columns.get(role, ""))
        if role == "adaptive_gain" or name is None:
            continue
        column = columns.get(name) or describe(replace(table, columns={name: table.columns[name]}))[0]
        if column.kind not in ("numbers", "whole numbers"):
            continue
        units = {"angle": "m" if linear else "rad", "wheel_angle": "rad", "wheel_speed": "rad/s", "voltage": "V"}
        units |= {"torque": "N" if linear else "N m", "reference": "m" if linear else "rad"}
        units |= {"supply": "V", "bridge": "", "angle_speed": "m/s" if linear else "rad/s"}
        scale = conventions.scales.get(role)
        factor = scale.factor if scale is not None else 1.0
        if role == "wheel_angle":
            factor /= rig.log.wheel_scale.value  # of the encoder, whose steps are looked at
        channels.append(Channel(role, column, factor, units[role]))
    return channels


def wrapped(check: Check) -> list[str]:
    """One check as lines: mark, title, evidence, and what to do."""
    shown = check.remedy and check.remedy not in check.evidence and check.level in ("advice", "repair", "fault")
    text = check.evidence + (f" → {check.remedy}" if shown else "")
    head = f"  {MARKS[check.level]} {check.title:<20} "
    body = textwrap.wrap(text, WIDTH - len(head)) or [""]
    return [head + body[0], *(" " * len(head) + line for line in body[1:])]


def columns_table(inspection: Inspection) -> list[tuple[str, str, str, str, str, str]]:
    """Cells per column: name, what it seems to be, type, unit, range, first values."""
    named = {role.column: name for name, role in inspection.roles.found.items()}
    return [
        (
            column.name,
            named.get(column.name, inspection.roles.others.get(column.name, "")).replace("_", " "),
            column.kind,
            column.unit,
            range_of(column),
            ", ".join(column.first),
        )
        for column in inspection.columns
    ]


def range_of(column: Column) -> str:
    """Return the lowest to the highest value, and cells without a number."""
    if column.kind in ("text", "empty"):
        return ""
    low, high = f"{column.low:.5g}", f"{column.high:.5g}"
    if low == high and column.low != column.high:  # seconds since 1970
        low, high = f"{column.low:.14g}", f"{column.high:.14g}"
    text = f"{low} … {high}"
    text += f", {column.missing} missing" if column.missing else ""
    return text + (f", {column.outliers} far outside" if column.outliers else "")


def _columns(inspection: Inspection) -> list[str]:
    rows = [("column", "seems to be", "type", "unit", "range", "first values"), *columns_table(inspection)]
    widths = [min(max(len(row[k]) for row in rows), 34) for k in range(6)]
    return [("  " + "  ".join(f"{cell:<{w}}" for cell, w in zip(row, widths, strict=True))).rstrip() for row in rows]
