"""The rig file with what a calibration found in the place of what it said before."""

from __future__ import annotations

import math
from collections.abc import Mapping

from swingid.calibration.motor.separation import Separation
from swingid.errors import InputError
from swingid.model.parameters import FRICTION_KEYS
from swingid.model.rig import Rig
from swingid.model.rig.edit import edited
from swingid.result.result import Message, Parameter
from swingid.units import Quantity

MOTOR = ("torque_per_volt", "back_emf", "viscous", "coulomb")


def calibrated_rig(
    rig: Rig, found: Mapping[str, Parameter], split: Separation | None, *, coupled: bool
) -> tuple[Rig, list[Message]]:
    """The rig with the constants of `found` (names of a calibration, also those held) and their uncertainties.

    Values keep two digits more than their uncertainty shows. efficiency loses its uncertainty, for it is known only
    with torque_per_volt and back_emf, which carry that of the products.
    """
    values: dict[str, object] = {}
    notes = []
    if split is not None:
        values |= _motor(rig, found, split, coupled=coupled)
        assert rig.drive.motor is not None
        eta = rig.drive.motor.efficiency
        if eta.std is not None:
            values["drive.motor.efficiency"] = eta.value
            text = "efficiency is written without uncertainty: it acts only with torque_per_volt and back_emf."
            notes.append(Message("efficiency-fixed", text))
    text, kept = edited(rig.text, values | _axis(rig, found))
    try:
        Rig.from_text(text, rig.source, default_name=rig.name)
    except InputError as error:
        text, kept = edited(rig.text, values)
        notes.append(Message("friction-not-written", f"friction and inertia of the axis were not written: {error}"))
    if not kept:
        message = "the rig file is written in a way whose comments could not be kept; its tables were written anew."
        notes.append(Message("comments-lost", message))
    return Rig.from_text(text, rig.source, default_name=rig.name), notes


def _axis(rig: Rig, found: Mapping[str, Parameter]) -> dict[str, object]:
    """Inertia and friction of a free swing in the place of what the rig said of them; nothing without a swing."""
    if "axis.inertia" not in found:
        return {}
    values: dict[str, object] = {"axis.inertia": _quantity(found["axis.inertia"], least=0.0)}
    for key in (*FRICTION_KEYS, "lugre"):
        name = f"axis.friction.{key}"
        if name in found:
            values[name] = _quantity(found[name], least=None if key == "offset" else 0.0)
        elif getattr(rig.axis.friction, key) is not None:
            values[name] = None
    return values


def _motor(rig: Rig, found: Mapping[str, Parameter], split: Separation, *, coupled: bool) -> dict[str, object]:
    values: dict[str, object] = {}
    for key in MOTOR:
        if key == "back_emf" and not split.emf:
            continue
        if key == "coulomb" and not split.coulomb:
            values["drive.motor.coulomb"] = _held(rig, found["motor.coulomb"])
            continue
        values[f"drive.motor.{key}"] = _quantity(found[f"motor.{key}"], least=0.0)
    low, high = found["motor.dead_zone.negative"], found["motor.dead_zone.positive"]
    values["drive.motor.dead_zone"] = [rounded(low), rounded(high)]
    if coupled:
        values["drive.motor.rotor_inertia"] = _quantity(found["motor.rotor_inertia"], least=0.0)
    return values


def _held(rig: Rig, found: Parameter) -> Quantity | float:
    """Coulomb friction that the logs do not tell from the dead zone: as the rig states it, where that is possible."""
    assert rig.drive.motor is not None
    stated = rig.drive.motor.coulomb
    if abs(stated.value - found.value) <= 1e-9 * abs(stated.value):
        return stated if stated.std is not None else stated.value
    return rounded(found)


def _quantity(parameter: Parameter, *, least: float | None) -> Quantity:
    u = parameter.standard_uncertainty
    value = rounded(parameter)
    if least is not None:
        value = max(value, least)
    return Quantity(value, None if u is None else float(f"{u:.3g}"))


def rounded(parameter: Parameter) -> float:
    """The value to two digits more than the first of its uncertainty, at most to fifteen."""
    u = parameter.standard_uncertainty
    if not u or not parameter.value:
        return float(f"{parameter.value:.10g}")
    digits = math.floor(math.log10(abs(parameter.value))) - math.floor(math.log10(u)) + 4
    return float(f"{parameter.value:.{min(max(digits, 3), 15)}g}")
