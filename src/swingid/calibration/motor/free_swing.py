"""Free swings of a motor calibration: b/a11, and the axis' inertia and friction, by the momentum method."""

from __future__ import annotations

from swingid.calibration.outcome import Found
from swingid.checks.momentum import MomentumCheck
from swingid.methods.momentum.method import momentum
from swingid.model.parameters import AXIS_TILT
from swingid.model.rig import Rig
from swingid.preparation.prepared import prepare
from swingid.recording.findings import Kind
from swingid.recording.recording import Recording
from swingid.result.result import Message
from swingid.result.sources import values_of
from swingid.uncertainty.uncertain import Uncertain, evaluated

RATIO = "gravity_per_inertia"
"""b/a11 in 1/s², which requires no constant."""

GRAVITY = "axis.gravity_torque"


def free_swing(log: Recording, rig: Rig) -> Found:
    """`RATIO`; with b known also ``axis.inertia`` (J1, without wheel and rotor) and ``axis.friction.NAME``.

    Errors as `momentum`.
    """
    alone = _without_drive(rig)
    result, b = MomentumCheck(prepare(log, alone), momentum).result(), alone.axis.acting_gravity
    old = values_of(result, result.parameters)
    ratio = (1.0 if b is None else b.value) / old["inertia"]
    values = {RATIO: (ratio.only(lambda key: key not in (GRAVITY, AXIS_TILT)), "1/s^2")}
    if rig.axis.acting_gravity is not None:
        carried = _carried(rig)
        for key, parameter in result.parameters.items():
            name = "axis.inertia" if key == "inertia" else f"axis.friction.{key}"
            values[name] = old[key] - carried if key == "inertia" else old[key], parameter.unit
    name = log.source.path or "the log"
    rests = "" if rig.drive.wheel is None else " and the wheel rests on the rod"
    text = f"{name}: nothing drives the axis{rests}: a free swing."
    notes = [note for note in result.notes if not alone.reference or note.code != "scale-from-gravity"]
    # in a free swing the wheel is to rest on the rod
    warnings = tuple(w for w in result.warnings if w.kind is not Kind.WHEEL_STILL)
    return Found(name, evaluated(values), warnings, (Message("log-kind", text), *notes))


def _without_drive(rig: Rig) -> Rig:
    """The rig as it swings when nothing drives it and the wheel rests on the rod; b = 1 where it is unknown."""
    changes: dict[str, object] = {"drive": {"kind": "none"}, "sensors.wheel": None, "axis.inertia": None}
    for key in rig.log.model_fields_set:
        if key.startswith(("wheel", "voltage", "torque")):
            changes[f"log.{key}"] = None
    unknown = isinstance(rig.axis.gravity_torque, str)
    return rig.in_units_of(GRAVITY, changes) if unknown else rig.changed(changes)


def _carried(rig: Rig) -> Uncertain:
    """Inertia of wheel and rotor, which rest on the rod."""
    wheel, motor = rig.drive.wheel, rig.drive.motor
    if wheel is None or motor is None:
        return Uncertain(0.0)
    inertia = wheel.inertia.uncertain("drive.wheel.inertia")
    return inertia + motor.rotor_inertia.uncertain("drive.motor.rotor_inertia")
