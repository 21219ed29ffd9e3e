"""Where a result comes from: file and its hash, rig, versions, method and options; and what was taken as exact."""

from __future__ import annotations

import hashlib
import math
import platform
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from importlib.metadata import version

from swingid.format import number
from swingid.model.rig import Rig
from swingid.model.rig.fields import Table, stated
from swingid.model.rig.gravity import UNKNOWN_PLACE
from swingid.model.terms import further_terms, rig_terms
from swingid.recording.findings import OFF, Kind, notes_of
from swingid.recording.recording import Recording
from swingid.result.encoders import encoder_defaults
from swingid.result.result import Message
from swingid.uncertainty.budget import BudgetEntry, outweighed
from swingid.units import Quantity, UnknownScale


@cache
def versions() -> dict[str, str]:
    """Versions of swingid and of what computes for it."""
    return {"swingid": version("swingid"), "numpy": version("numpy"), "python": platform.python_version()}


def provenance(log: Recording, rig: Rig, options: dict[str, object] | None = None) -> dict[str, object]:
    """File, hashes, rig and versions, as plain data."""
    return {
        "log": log.source.path,
        "log_sha256": log.source.sha256,
        "rows": len(log),
        **of_rig(rig),
        "options": options or {},
        "repairs": [
            {"repair": finding.repair, "done": finding.code != OFF, "what": finding.message}
            for finding in dict.fromkeys((*log.findings, *notes_of(log.repairs_off)))
            if finding.repair is not None
        ],
        "constants": constants(rig),
        **made_of(rig),
        "versions": versions(),
    }


def of_several(first: Mapping[str, object], each: Iterable[Mapping[str, object]]) -> dict[str, object]:
    """Return the provenance of the first log, with all logs in the place of one."""
    logs = list(each)
    shared = {name: value for name, value in first.items() if name not in ("log", "log_sha256", "rows")}
    return {f"logs{more}": [log.get(f"log{more}") for log in logs] for more in ("", "_sha256")} | shared


def of_rig(rig: Rig) -> dict[str, object]:
    """What identifies a rig: name, source, hash."""
    digest = hashlib.sha256(rig.text.encode()).hexdigest()
    return {"rig": rig.name, "rig_source": rig.source, "rig_sha256": digest}


def constants(rig: Rig) -> dict[str, dict[str, float | None]]:
    """Value and standard uncertainty (None: exact) of every constant that results of one rig have in common."""
    return {key: {"value": q.value, "std": q.std} for key, q in shared_constants(rig).items()}


def made_of(rig: Rig) -> dict[str, dict[str, dict[str, float]]]:
    """The contributions to constants that the rig file states by others, as a torque by mass and lever.

    Under the key "made_of", which is not there where there are none.
    """
    parts = {key: dict(q.parts) for key, q in shared_constants(rig).items() if q.parts}
    return {"made_of": parts} if parts else {}


def shared_constants(rig: Rig) -> dict[str, Quantity]:
    """Every constant that results of one rig have in common."""
    by_key: dict[str, object] = {"axis.gravity_torque": rig.axis.gravity_torque}
    for term in rig_terms(rig):
        by_key |= {term.term.key: term.value} | ({term.term.shift: term.shift} if term.shift.std else {})
    if rig.drive.wheel is not None:
        by_key["drive.wheel.inertia"] = rig.drive.wheel.inertia
    if rig.drive.motor is not None:
        motor = rig.drive.motor
        by_key |= {f"drive.motor.{name}": getattr(motor, name) for name in type(motor).model_fields}
    if rig.drive.channel == "torque":
        by_key["log.torque_gain"] = rig.log.torque_gain
    scales = ("angle_scale", "angle_offset", "angle_speed_scale", "wheel_scale", "voltage_scale")
    by_key |= {f"log.{key}": getattr(rig.log, key) for key in scales if stated(rig.log, key)}
    return {key: q for key, q in by_key.items() if isinstance(q, Quantity) and not isinstance(q, UnknownScale)}


def add_findings(
    log: Recording,
    warnings: list[Message],
    notes: list[Message],
    *,
    leave_out: Kind | None = None,
    used: tuple[float, float] | None = None,
    budget: Sequence[BudgetEntry] = (),
) -> None:
    """Add what was found in the log when it was read to the warnings and the notes of a result, each to its kind.

    used: from when to when (s) rows were used, by default all of the log; what happened outside is a note. budget: of
    the result; an effect that it has and that its other entries outweigh is a note.
    """
    start, stop = used or (float(log.time[0]), float(log.time[-1]))
    for finding in log.findings:
        counted = finding.within(start, stop)
        if leave_out is None or counted.kind is not leave_out:
            is_note = counted.level == "note" or outweighed(budget, "inertia", counted.source)
            (notes if is_note else warnings).append(Message(counted.code, counted.message, counted.kind))


ROW_ONE = (
    "axis.gravity_torque",
    "drive.wheel.inertia",
    "drive.motor.rotor_inertia",
    "drive.motor.gear_ratio",
    "log.torque_gain",
    "log.angle_scale",
)
"""Constants of equation (I), which a method needs that does without the motor."""


def exact_in_row_one(rig: Rig) -> list[Message]:
    """The note that names the constants of equation (I) without a stated uncertainty."""
    keys, motor = {*ROW_ONE, *(term.key for term in further_terms())}, rig.drive.motor
    if motor is not None and motor.rotor_inertia == Quantity(0.0):  # a gear without a rotor does nothing
        keys -= {"drive.motor.rotor_inertia", "drive.motor.gear_ratio"}
    return exact_constants([key for key in rig.constants_without_uncertainty() if key in keys])


def exact_constants(keys: list[str], why: str = "the rig states no uncertainty") -> list[Message]:
    """The note that names the constants used without a stated uncertainty."""
    text = f"taken as exact, because {why}: {', '.join(keys)}."
    return [Message("exact-constants", text)] if keys else []


def defaults_taken(rig: Rig) -> list[Message]:
    """The note that names what the rig does not state of itself and what that is taken as."""
    taken: dict[str, tuple[Table, str]] = {"log.clock": (rig.log, f"0 ± {1e6 * (rig.log.clock.std or 0.0):g} ppm")}
    b, wheel = rig.axis.gravity_torque, rig.drive.wheel
    if isinstance(b, Quantity) and b.value:
        taken["axis.tilt"] = rig.axis, _tilt(rig.axis.tilt)
    if wheel is not None:
        taken["drive.wheel.tilt"] = wheel, _tilt(wheel.tilt)
        if rig.drive.motor is not None and (std := rig.drive.motor.rotor_inertia.std):
            taken["drive.motor.rotor_inertia"] = rig.drive.motor, f"0 ± {number(std, 'kg m^2', 2)}"
    if rig.axis.mass is not None and not (stated(rig.axis, "g") or stated(rig.axis, "latitude")):
        taken["axis.g"] = rig.axis, str(UNKNOWN_PLACE) + " m/s^2"
    taken["axis.model_uncertainty"] = rig.axis, f"{100 * rig.axis.model_uncertainty:g} %"
    texts = [f"{key} = {text}" for key, (table, text) in taken.items() if not stated(table, key.rpartition(".")[2])]
    texts += [f"{key} = {text}" for key, text in encoder_defaults(rig).items()]
    return [Message("defaults-taken", f"not stated, taken as: {', '.join(texts)}.")] if texts else []


def _tilt(tilt: Quantity) -> str:
    return f"0 ± {math.degrees(tilt.std or 0.0):g} deg"
