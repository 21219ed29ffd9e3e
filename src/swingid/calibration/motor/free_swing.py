"""Free swings of a motor calibration: b/a11, and the axis' inertia and friction, by the momentum method."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from swingid.calibration.outcome import Found, shifts_of
from swingid.checks.momentum import MomentumCheck
from swingid.methods.momentum.method import momentum
from swingid.model.parameters import AXIS_TILT
from swingid.model.rig import Rig
from swingid.preparation.prepared import prepare
from swingid.recording.findings import Kind
from swingid.recording.recording import Recording
from swingid.result.result import Message, Result
from swingid.uncertainty.budget import (
    BudgetEntry,
    Evaluated,
    Parameter,
    combined,
    correlation_of,
    freedom_of,
    stated,
)

RATIO = "gravity_per_inertia"
"""b/a11 in 1/s², which requires no constant."""

GRAVITY = "axis.gravity_torque"


def free_swing(log: Recording, rig: Rig) -> Found:
    """`RATIO`; with b known also ``axis.inertia`` (J1, without wheel and rotor) and ``axis.friction.NAME``.

    Errors as `momentum`.
    """
    alone = _without_drive(rig)
    found, b = MomentumCheck(prepare(log, alone), momentum).result(), alone.axis.acting_gravity
    inertia = found.inertia.value
    ratio = (1.0 if b is None else b.value) / inertia
    own = [e for e in found.budget if e.parameter == "inertia" and e.shared_id not in (GRAVITY, AXIS_TILT)]
    slopes = [None if e.sensitivity is None else -e.sensitivity * ratio / inertia for e in own]
    budget = [
        BudgetEntry(e.origin, RATIO, e.standard_uncertainty * ratio / inertia, slope)
        for e, slope in zip(own, slopes, strict=True)
    ]
    parameters = {RATIO: Parameter.of(ratio, combined(budget, RATIO), "1/s^2", freedom_of(budget, RATIO))}
    evaluated = Evaluated(parameters, budget)
    if rig.axis.acting_gravity is not None:
        evaluated = _with_torques(evaluated, found, rig)
    name = log.source.path or "the log"
    rests = "" if rig.drive.wheel is None else " and the wheel rests on the rod"
    text = f"{name}: nothing drives the axis{rests}: a free swing."
    notes = [note for note in found.notes if not alone.reference or note.code != "scale-from-gravity"]
    # in a free swing the wheel is to rest on the rod
    warnings = tuple(w for w in found.warnings if w.kind is not Kind.WHEEL_STILL)
    return Found(name, evaluated, warnings, (Message("log-kind", text), *notes))


def _without_drive(rig: Rig) -> Rig:
    """The rig as it swings when nothing drives it and the wheel rests on the rod; b = 1 where it is unknown."""
    changes: dict[str, object] = {"drive": {"kind": "none"}, "sensors.wheel": None, "axis.inertia": None}
    for key in rig.log.model_fields_set:
        if key.startswith(("wheel", "voltage", "torque")):
            changes[f"log.{key}"] = None
    unknown = isinstance(rig.axis.gravity_torque, str)
    return rig.in_units_of(GRAVITY, changes) if unknown else rig.changed(changes)


def _with_torques(ratio: Evaluated, found: Result, rig: Rig) -> Evaluated:
    """`ratio` with J1 and the friction of the axis, by the keys of rig.toml: wheel and rotor rest on the rod."""
    wheel, motor = rig.drive.wheel, rig.drive.motor
    names = {name: f"axis.friction.{name}" for name in found.parameters} | {"inertia": "axis.inertia"}
    budget = [replace(entry, parameter=names[entry.parameter]) for entry in found.budget]
    carried = spread = 0.0
    if wheel is not None and motor is not None:
        for key, mass in (("drive.wheel.inertia", wheel.inertia), ("drive.motor.rotor_inertia", motor.rotor_inertia)):
            carried += mass.value
            if mass.std:
                spread += mass.std**2
                budget.append(BudgetEntry(stated(key, key), "axis.inertia", mass.std, -1.0))
    parameters = ratio.parameters | {names[name]: parameter for name, parameter in found.parameters.items()}
    u, freedom = combined(budget, "axis.inertia"), freedom_of(budget, "axis.inertia")
    parameters["axis.inertia"] = Parameter.of(found.inertia.value - carried, u, found.inertia.unit, freedom)
    slope = -ratio.parameters[RATIO].value / found.inertia.value
    correlation = _correlation(found, names, slope, spread)
    return Evaluated(parameters, [*ratio.budget, *budget], correlation)


def _correlation(found: Result, names: dict[str, str], slope: float, carried: float) -> dict[str, dict[str, float]]:
    """Of `RATIO`, whose derivative to a11 is `slope` and which b does not enter, and of the parameters `names`.

    carried: variance of what the axis carries, which is subtracted from a11.
    """
    table = found.correlation or {"inertia": {"inertia": 1.0}}
    known = {name: found.parameters[name].standard_uncertainty for name in table}
    if "inertia" not in known or None in known.values():
        return {}
    keys, u = list(known), np.array(list(known.values()), dtype=np.float64)
    whole = np.array([[table[one][other] for other in keys] for one in keys]) * np.outer(u, u)
    shifts = np.array([shifts_of(found.budget, key).get(GRAVITY, 0.0) for key in keys])
    at = keys.index("inertia")
    own = slope * (whole - np.outer(shifts, shifts))[at]
    matrix = np.block([[np.atleast_2d(slope * own[at]), own[None, :]], [own[:, None], whole]])
    matrix[1 + at, 1 + at] += carried
    return correlation_of([RATIO, *(names[key] for key in keys)], matrix)
