"""A log under other conventions than [log] states: which sign, zero or unit would make log and rig agree."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from swingid.checks.closure import CLOSES
from swingid.errors import SwingidError
from swingid.format import percent
from swingid.model.rig import Rig
from swingid.model.rig.fields import SECONDS
from swingid.preparation.noise import channel_noise
from swingid.recording.formats.table import Table
from swingid.recording.grid import TURN
from swingid.recording.inspect import Check, Column
from swingid.recording.inspect.candidates import counts_ticks
from swingid.recording.inspect.columns import steps_seen, unit_of_steps
from swingid.recording.inspect.roles import FASTEST, SLOWEST
from swingid.recording.recording import Recording, Source
from swingid.study.inspect.motion import Swings, read_motion
from swingid.study.inspect.physics import balance_of, check_physics

SAME_STEP = 5e-3
"""How well (share) steps agree with those of an encoder in the right unit."""

UNIT_WORDS = {"rad": "radians", "deg": "degrees", "turns": "turns"}

USUAL = 500.0
"""Rows per second, about."""

GRAVITY = "gravity-torque-disagrees"


def read(
    table: Table, rig: Rig, source: Source, columns: Mapping[str, Column] | None
) -> tuple[Recording | None, Rig, dict[str, object], list[Check]]:
    """The Recording as `rig` reads it; where it refuses and another unit heals that, as that reads it.

    columns: of the table by name, whose steps show units; None where the rig is a guess that is not to be changed.
    """
    tried: dict[str, object] = {}
    mended_by: list[Check] = []
    if columns is not None:
        for changes, checks in (unit_of_clock(table, rig, columns), units_by_steps(table, rig, columns)):
            tried |= changes
            mended_by += checks
        rig = rig.changed(tried) if tried else rig
    try:
        return Recording.from_table(table, rig, source), rig, tried, mended_by
    except SwingidError as error:
        failed = error
    mended = columns is not None and failed.code == "implausible-angle"
    for changes in _other_units(rig, "angle") if mended else ():
        try:
            other = rig.changed(changes)
            log = Recording.from_table(table, other, source)
        except SwingidError:
            continue
        remedy = f"set {words(changes)} under [log]"
        check = Check(failed.code, "on reading", "repair", without_path(failed, source), remedy)
        return log, other, tried | changes, [*mended_by, check]
    return None, rig, tried, [*mended_by, Check(failed.code, "on reading", "fault", without_path(failed, source), "")]


def unit_of_clock(table: Table, rig: Rig, columns: Mapping[str, Column]) -> tuple[dict[str, object], list[Check]]:
    """The change of [log] where rows come at a rate that a rig may have in another unit of the time than stated."""
    name = table.find(rig.log.time) if rig.log.rate is None else None
    if name is None or table.unit(name) or columns[name].kind not in ("numbers", "whole numbers"):
        return {}, []
    if counts_ticks(name) or rig.log.time_unit not in SECONDS:
        return {}, []  # a tick is any time: what its rig file states holds
    steps = np.diff(columns[name].values)
    steps = steps[steps > 0]
    rates = {unit: 1 / (float(np.median(steps)) * factor) for unit, factor in SECONDS.items()} if steps.size else {}
    used = rig.log.time_unit
    fitting = [unit for unit, rate in rates.items() if SLOWEST <= rate <= FASTEST]
    if used in fitting or not fitting:
        return {}, []
    unit = min(fitting, key=lambda unit: abs(np.log(rates[unit] / USUAL)))
    text = f"column {name!r} (time) looks like {unit}: rows come {rates[unit]:.4g} times a second in {unit}"
    text += f", and {rates[used]:.4g} times in {used}."
    change: dict[str, object] = {"log.time_unit": unit}
    remedy = f'set time_unit = "{unit}" under [log]'
    return change, [Check("time-unit", "units", "repair", text, remedy, {"changes": change})]


def units_by_steps(table: Table, rig: Rig, columns: Mapping[str, Column]) -> tuple[dict[str, object], list[Check]]:
    """Changes of [log] where the steps of an angle are those of the rig's encoder in another unit than stated."""
    changes: dict[str, object] = {}
    units = []
    if rig.axis.kind == "linear":
        return {}, []
    for channel, word in (("angle", "angle"), ("wheel_angle", "wheel angle")):
        name = table.find(getattr(rig.log, channel))
        used = getattr(rig.log, f"{channel}_unit")
        read = (channel == "angle" and not rig.log.has_rate_alone) or (
            rig.drive.wheel is not None and rig.log.wheel_speed is None
        )
        if name is None or not read or used not in TURN or table.unit(name) or not steps_seen(columns[name]):
            continue
        counts = {unit: turn / columns[name].step for unit, turn in TURN.items()}
        declared = rig.sensors.of("angle" if channel == "angle" else "wheel").resolution
        expected = TURN["rad"] / declared if declared else float(unit_of_steps(columns[name])[1])
        fitting = [unit for unit, count in counts.items() if expected and abs(count / expected - 1) < SAME_STEP]
        if len(fitting) != 1 or fitting[0] == used:
            continue
        whose = "as the rig file states" if declared else "as encoders have"
        text = f"column {name!r} ({word}) looks like {UNIT_WORDS[fitting[0]]}: in {fitting[0]} its steps are"
        text += f" {expected:.0f} in a turn, {whose}, and {counts[used]:.6g} in {used}."
        remedy = f'set {channel}_unit = "{fitting[0]}" under [log]'
        change: dict[str, object] = {f"log.{channel}_unit": fitting[0]}
        units.append(Check("units", "units", "repair", text, remedy, {"changes": change}))
        changes |= change
    return changes, units


def _other_units(rig: Rig, channel: str) -> list[dict[str, object]]:
    """Changes of [log] to the other units of an angle."""
    key, units = f"{channel}_unit", ("deg", "rad") if channel == "angle" else ("rad", "deg", "turns")
    return [{f"log.{key}": unit} for unit in units if unit != getattr(rig.log, key)]


def physics(
    table: Table, log: Recording, rig: Rig, swings: Swings, source: Source
) -> tuple[list[Check], Rig, Recording, dict[str, object]]:
    """Checks of the log against the rig; where a sign, the zero or a unit is wrong, once more with it set right.

    Returns the checks, the rig as changed, the log as that reads it, and the changes.
    """
    try:
        balance = balance_of(log, rig, swings, channel_noise(log, rig))
    except SwingidError as error:
        turned = _attempts(table, rig, _other_signs(rig), source) if error.code == "wrong-sign" else []
        if not turned:
            title = "signs" if error.code == "wrong-sign" else "balance"
            return [Check(error.code, title, "fault", without_path(error, source), "")], rig, log, {}
        return _set_right(turned, "signs", without_path(error, source))
    checks = check_physics(balance, rig)
    off = any(check.code == GRAVITY for check in checks)  # a wheel in another unit is a scale that is off
    wheel = rig.drive.wheel is not None and rig.log.wheel_speed is None
    if not wheel or (balance.left < CLOSES and not off):
        return checks, rig, log, {}
    most = max(balance.left, CLOSES) if off else balance.left / 4
    better = [
        attempt
        for attempt in _attempts(table, rig, _other_units(rig, "wheel_angle"), source)
        if attempt.left <= most and not (off and any(check.code == GRAVITY for check in attempt.checks))
    ]
    if not better:
        return checks, rig, log, {}
    text = f" as [log] reads it{', with a gravity torque that contradicts the rig file' if off else ''}."
    return _set_right(better, "units", f"{percent(balance.left)}{text}")


@dataclass(frozen=True)
class _Attempt:
    """The checks under other conventions, and what share of the inertia's term the balance then leaves."""

    changes: dict[str, object]
    rig: Rig
    log: Recording
    checks: list[Check]
    left: float


def _attempts(table: Table, rig: Rig, several: list[dict[str, object]], source: Source) -> list[_Attempt]:
    """The checks under changed conventions, but for those that the balance refuses too."""
    attempts = []
    for changes in several:
        with suppress(SwingidError):
            other = rig.changed(changes)
            log = Recording.from_table(table, other, source)
            noise = channel_noise(log, other)
            swings, _ = read_motion(log, noise, other.drive.channel, linear=other.axis.kind == "linear")
            if swings is not None:
                balance = balance_of(log, other, swings, noise)
                attempts.append(_Attempt(changes, other, log, check_physics(balance, other), balance.left))
    return attempts


def _set_right(attempts: list[_Attempt], code: str, text: str) -> tuple[list[Check], Rig, Recording, dict[str, object]]:
    """What `physics` returns, by the attempt with the fewest repairs."""
    best = min(attempts, key=lambda attempt: sum(check.level == "repair" for check in attempt.checks))
    if code == "units":
        unit = UNIT_WORDS[str(best.changes["log.wheel_angle_unit"])]
        head = f"the wheel angle looks like {unit}: with {words(best.changes)} the balance leaves {percent(best.left)}"
        text = f"{head}, and {text}"
    wrong = Check(code, code, "repair", text, f"set {words(best.changes)} under [log]", {"changes": best.changes})
    return [wrong, *(check for check in best.checks if check.code != code)], best.rig, best.log, best.changes


def _other_signs(rig: Rig) -> list[dict[str, object]]:
    """Changes of [log] to try where signs are wrong, the simplest first.

    Equation (I) does not distinguish a turned angle from a turned drive; equation (II) does, by the voltage.
    """
    key = {"wheel_angle": "wheel_angle_sign", "torque": "torque_sign"}.get(rig.drive.channel or "")
    turned: list[dict[str, object]] = [{"log.angle_sign": -rig.log.angle_sign}]
    if key is not None:
        turned.insert(0, {f"log.{key}": -getattr(rig.log, key)})
    if rig.drive.channel is None:
        turned = []
    if rig.axis.kind == "linear" or not isinstance(rig.log.angle_zero, str):
        return turned
    other: dict[str, object] = {"log.angle_zero": "down" if rig.log.angle_zero == "up" else "up"}
    return [*turned, other, *({**changes, **other} for changes in turned)]


def words(changes: Mapping[str, object]) -> str:
    """Changes of [log] as they stand in a rig file."""
    return " and ".join(f"{key.removeprefix('log.')} = {json.dumps(value)}" for key, value in changes.items())


def without_path(error: SwingidError, source: Source) -> str:
    """The sentence without the file's name at its beginning, which the head of an inspection names."""
    message = error.message.removeprefix(f"{source.path}: ")
    return message.replace(f"{source.path} has", "the file has", 1)
