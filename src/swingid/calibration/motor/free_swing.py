"""Free swings with the wheel at rest on the rod: b/a11 and the axis' friction, by the momentum method."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from swingid.methods.momentum.method import momentum
from swingid.model.rig import Rig
from swingid.recording.recording import Recording
from swingid.result.result import BudgetEntry, Message, Parameter, Result, combined

RATIO = "gravity_per_inertia"


@dataclass(frozen=True)
class FreeSwing:
    """What a free swing tells: parameters with their budget, warnings, notes; the rest of momentum's result.

    ``gravity_per_inertia`` = b/a11 in 1/s² needs no constant. With b known, ``axis.inertia`` (J1, the wheel and the
    rotor taken off) and ``axis.friction.NAME`` follow.
    """

    name: str
    parameters: dict[str, Parameter]
    budget: tuple[BudgetEntry, ...]
    warnings: tuple[Message, ...]
    notes: tuple[Message, ...]
    result: Result


def without_drive(rig: Rig) -> Rig:
    """The rig as it swings when nothing drives it and the wheel rests on the rod; b = 1 where it is unknown."""
    changes: dict[str, object] = {"drive": {"kind": "none"}, "sensors.wheel": None, "axis.inertia": None}
    for key in rig.log.model_fields_set:
        if key.startswith(("wheel", "voltage", "torque")):
            changes[f"log.{key}"] = None
    if isinstance(rig.axis.gravity_torque, str):
        changes["axis.gravity_torque"] = 1.0
    return rig.changed(changes)


def free_swing(log: Recording, rig: Rig) -> FreeSwing:
    """Identify a free swing; errors as `momentum`."""
    found = momentum(log, without_drive(rig))
    known = not isinstance(rig.axis.gravity_torque, str)
    b = rig.axis.gravity_torque.value if not isinstance(rig.axis.gravity_torque, str) else 1.0
    inertia = found.parameters["inertia"]
    own = [e for e in found.budget if e.parameter == "inertia" and e.shared_id != "axis.gravity_torque"]
    ratio = b / inertia.value
    budget = [
        BudgetEntry(
            e.source,
            e.type,
            RATIO,
            e.standard_uncertainty * ratio / inertia.value,
            None if e.sensitivity is None else -e.sensitivity * ratio / inertia.value,
            e.shared_id,
        )
        for e in own
    ]
    u = math.sqrt(sum(e.standard_uncertainty**2 for e in budget))
    parameters = {RATIO: Parameter.of(ratio, u, "1/s^2")}
    if known:
        own_parameters, own_budget = _with_torques(found, rig)
        parameters |= own_parameters
        budget += own_budget
    name = log.source.path or "the log"
    text = f"{name}: nothing drives the axis and the wheel rests on the rod: a free swing."
    wheel = {"wheel-still"}  # that the wheel rests on the rod is as it should be
    warnings = tuple(w for w in found.warnings if w.code not in wheel)
    return FreeSwing(name, parameters, tuple(budget), warnings, (Message("log-kind", text), *found.notes), found)


def _with_torques(found: Result, rig: Rig) -> tuple[dict[str, Parameter], list[BudgetEntry]]:
    """J1 and the friction of the axis, as rig.toml names them: the wheel and the rotor ride on the rod."""
    wheel, motor = rig.drive.wheel, rig.drive.motor
    names = {name: f"axis.friction.{name}" for name in found.parameters} | {"inertia": "axis.inertia"}
    budget = [replace(entry, parameter=names[entry.parameter]) for entry in found.budget]
    carried = 0.0
    if wheel is not None and motor is not None:
        for key, mass in (("drive.wheel.inertia", wheel.inertia), ("drive.motor.rotor_inertia", motor.rotor_inertia)):
            carried += mass.value
            if mass.std:
                budget.append(BudgetEntry(key, "B", "axis.inertia", mass.std, -1.0, key))
    parameters = {names[name]: parameter for name, parameter in found.parameters.items()}
    inertia = found.parameters["inertia"]
    u = combined(budget, "axis.inertia")
    parameters["axis.inertia"] = Parameter.of(inertia.value - carried, u, inertia.unit)
    return parameters, budget
