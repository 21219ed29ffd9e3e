"""Units that a log states in its header, as "theta [deg]": taken where rig.toml is silent, compared where it speaks."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from swingid.errors import InputError
from swingid.recording.conventions import Conventions, Scale
from swingid.recording.recording import Finding
from swingid.recording.unit_names import canonical

if TYPE_CHECKING:
    from swingid.model.rig import Rig
    from swingid.recording.formats.table import Table

TIMES = frozenset({"s", "ms", "us", "ns"})
ANGLES = frozenset({"rad", "deg", "turns", "counts", "m", "mm"})
SPEEDS = frozenset({"rad/s", "deg/s", "turns/s", "rpm", "counts/s"})
FACTORS = {"voltage": {"V": 1.0, "mV": 1e-3}, "torque": {"N m": 1.0, "mN m": 1e-3, "N": 1.0}}


def with_header_units(table: Table, rig: Rig, name: str) -> tuple[Conventions, list[Finding]]:
    """The rig's conventions with the units of the header, and a note for each that changes numbers.

    Raises InputError where [log] states a unit that is not the header's.
    """
    conventions = Conventions.of(rig)
    if table.metadata:  # swingid wrote it, in the rig's own conventions
        return conventions, []
    changes: dict[str, object] = {}
    findings = []
    for channel, key, known in (
        ("time", "time_unit", TIMES),
        ("angle", "angle_unit", ANGLES),
        ("wheel_angle", "wheel_angle_unit", ANGLES),
        ("wheel_speed", "wheel_speed_unit", SPEEDS),
    ):
        read = conventions.rate is None if channel == "time" else channel in conventions.channels
        column, unit = _unit_of(table, conventions, channel)
        stated = canonical(unit)
        if not read or stated not in known:
            continue
        used = str(getattr(rig.log, key))
        if stated != used and key in conventions.stated:
            raise _conflict(name, column, unit, key, used)
        if stated != used:
            changes[f"log.{key}"] = stated
            findings.append(_note(column, unit, key))
    if changes:
        conventions = Conventions.of(rig.changed(changes))
    for channel, factors in FACTORS.items():
        column, unit = _unit_of(table, conventions, channel)
        factor = factors.get(canonical(unit), 1.0)
        if factor != 1.0 and channel in conventions.channels:
            old = conventions.scales.get(channel, Scale())
            scaled = replace(old, factor=old.factor * factor)
            conventions = replace(conventions, scales=conventions.scales | {channel: scaled})
            findings.append(_note(column, unit, None))
    return conventions, findings


def _unit_of(table: Table, conventions: Conventions, channel: str) -> tuple[str, str]:
    column = table.find(conventions.columns[channel])
    return ("", "") if column is None else (column, table.unit(column))


def _note(column: str, unit: str, key: str | None) -> Finding:
    stated = f"; [log] {key} may state it" if key else ""
    return Finding("unit-of-header", f"column {column!r} is read in {unit}, as its header says{stated}.", "note")


def _conflict(name: str, column: str, unit: str, key: str, used: str) -> InputError:
    message = f'{name}: the header of column {column!r} says {unit}, but [log] {key} = "{used}"; make them agree'
    return InputError(f"{message}, or rename the column.", code="unit-conflict")
