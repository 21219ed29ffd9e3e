"""Units that a log states in its header, and a clock that counts from an epoch.

Units as in "theta [deg]" are taken where rig.toml has none, and must agree where it has one. A clock that counts from
an epoch (1970, ns of a ROS stamp) is counted from the first row.
"""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from swingid.errors import InputError
from swingid.model.rig.fields import SECONDS
from swingid.recording.conventions import Conventions, Scale
from swingid.recording.findings import Finding
from swingid.spellings import canonical

if TYPE_CHECKING:
    from collections.abc import Iterator

    from swingid.model.rig import Rig
    from swingid.recording.formats.table import Table

TIMES = frozenset(SECONDS)
ANGLES = frozenset({"rad", "deg", "turns", "counts", "m", "mm"})
SPEEDS = frozenset({"rad/s", "deg/s", "turns/s", "rpm", "counts/s"})
FACTORS = {"voltage": {"V": 1.0, "mV": 1e-3}, "torque": {"N m": 1.0, "mN m": 1e-3, "N": 1.0}}


def with_header_units(table: Table, rig: Rig, name: str) -> tuple[Conventions, list[Finding]]:
    """The rig's conventions with the units of the header, and a note for each that changes numbers.

    Raises InputError where [log] states a unit that is not the header's.
    """
    if table.metadata.get("live"):
        return Conventions.live(rig), []
    conventions = Conventions.of(rig)
    if table.metadata:  # swingid wrote it, in the rig's own conventions
        return conventions, []
    changes: dict[str, object] = {}
    findings = list(_rate_as_angle(table, conventions, name))
    _check_quantity(table, rig, conventions, name)
    for channel, key, known in (
        ("time", "time_unit", TIMES),
        ("angle", "angle_unit", ANGLES),
        ("wheel_angle", "wheel_angle_unit", ANGLES),
        ("angle_speed", "angle_speed_unit", SPEEDS),
        ("wheel_speed", "wheel_speed_unit", SPEEDS),
    ):
        read = conventions.rate is None if channel == "time" else channel in conventions.channels
        column, unit = _stated_unit(table, conventions, channel)
        stated = canonical(unit)
        if not read or stated not in known:
            continue
        used = str(getattr(rig.log, key))
        if stated != used and key in conventions.stated:
            text = f'{name}: the header of column {column!r} states {unit}, but [log] {key} = "{used}"'
            raise InputError(f"{text}; make them agree, or rename the column.", code="unit-conflict")
        if stated != used:
            changes[f"log.{key}"] = stated
            findings.append(_unit_note(column, unit, key))
    if changes:
        conventions = Conventions.of(rig.changed(changes))
    for channel, factors in FACTORS.items():
        column, unit = _stated_unit(table, conventions, channel)
        factor = factors.get(canonical(unit), 1.0)
        if factor != 1.0 and channel in conventions.channels:
            old = conventions.scale(channel)
            scaled = replace(old, factor=old.factor * factor)
            conventions = replace(conventions, scales=conventions.scales | {channel: scaled})
            findings.append(_unit_note(column, unit, None))
    return conventions, findings


RATE = re.compile(r"gyro|angular[ _.]*(velocity|rate|speed)|omega", re.IGNORECASE)
"""Names of rates."""


def _rate_as_angle(table: Table, conventions: Conventions, name: str) -> Iterator[Finding]:
    """A warning where the column of the angle is called a rate; InputError where its header states the unit of one."""
    if "angle" not in conventions.axis:
        return
    column, unit = _stated_unit(table, conventions, "angle")
    if canonical(unit) in SPEEDS:
        text = f"{name}: the header of column {column!r} states {unit}, a rate, but [log] angle names it"
        raise InputError(f"{text} as an angle; name it as angle_speed.", code="rate-as-angle")
    if RATE.search(column):
        text = f"column {column!r} is called a rate, but [log] angle reads it as an angle; name it as angle_speed."
        yield Finding("rate-as-angle", text, "warning")


OTHERS = (
    *("px", "V", "mV", "A", "mA", "N m", "mN m", "N", "Hz", "m/s^2", "m/s²", "m/s2", "g", "µT", "μT", "uT"),
    *("kg", "W", "kW", "J", "Pa", "hPa", "K", "°C", "degC", "ohm", "Ω", "dB"),
)
"""Units of no angle and of no rate."""

LINEAR_RATES = frozenset(("m/s", "mm/s"))

PIXELS = re.compile(r"[ _.-](px|pixels?)$", re.IGNORECASE)
"""Names of columns that end in the unit of a place in a picture."""


def _check_quantity(table: Table, rig: Rig, conventions: Conventions, name: str) -> None:
    """InputError where the header states the unit of another quantity for an angle without a scale, or for a rate."""
    for channel in ("angle", "wheel_angle", "angle_speed", "wheel_speed"):
        key = "wheel_scale" if channel.startswith("wheel") else f"{channel}_scale"
        if channel not in conventions.channels or key in conventions.stated:
            continue
        column, unit = _stated_unit(table, conventions, channel)
        unit = unit or ("px" if PIXELS.search(column) else "")
        if canonical(unit) in OTHERS or (canonical(unit) in LINEAR_RATES and channel.endswith("angle")):
            what = "a rate" if channel.endswith("speed") else "an angle or position"
            remedy = "name another column"
            if canonical(unit) == "px":
                remedy = 'name the columns of x and y of the mark as point = ["x", "y"]'
            elif channel == "angle":
                example = "12.5 ± 0.1 mm" if rig.axis.kind == "linear" else "60 ± 0.2 deg"
                remedy += f', or state [log] angle_scale, such as "{example}" per {unit}'
            text = f"{name}: the header of column {column!r} states {unit}, no unit of {what}, but [log] {channel}"
            raise InputError(f"{text} names it; {remedy}.", code="unit-conflict")


def _stated_unit(table: Table, conventions: Conventions, channel: str) -> tuple[str, str]:
    column = table.find(conventions.columns[channel])
    return ("", "") if column is None else (column, table.unit(column))


def _unit_note(column: str, unit: str, key: str | None) -> Finding:
    stated = f"; [log] {key} may state it" if key else ""
    return Finding("unit-of-header", f"column {column!r} is read in {unit}, as its header states{stated}.", "note")


EPOCH = 1e8
"""Three years in s: no clock that was started with the rig has run so long."""

LAST = 1e11
"""No clock in s: one that counts ms, us or ns."""


def from_first_row(table: Table, conventions: Conventions) -> tuple[Conventions, list[Finding]]:
    """The conventions with times (s) from the first row of `table` where they count from an epoch, and a note of it."""
    column = None if conventions.rate is not None else table.find(conventions.columns["time"])
    if column is None:
        return conventions, []
    stamps, _ = table.numbers(column)
    scale = conventions.scale("time")
    stamps = stamps[np.isfinite(stamps)][:1]
    begin = float(stamps[0]) * scale.factor if stamps.size else 0.0
    if not EPOCH < abs(begin) < LAST:
        return conventions, []
    text = f"the times in column {column!r} count from an epoch; here they count from the first row, at {begin:.3f} s."
    moved = Scale(scale.factor, -begin)
    return replace(conventions, scales=conventions.scales | {"time": moved}), [Finding("from-epoch", text, "note")]
