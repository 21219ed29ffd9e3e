"""The constants of rig.toml: where each stands in the rig's vector, its value and uncertainty, its name when free."""

from __future__ import annotations

from swingid.methods.output_error.axis_motion import GAIN
from swingid.model.parameters import (
    A11,
    A12,
    A22,
    C1,
    C2,
    COEFFICIENT,
    D1,
    D2,
    ETA,
    F2,
    F3,
    FIRST_SLOT,
    GEAR,
    SHIFT,
    SLOT,
    WHEEL_STATIC,
    B,
)
from swingid.model.rig import Rig
from swingid.model.terms import TERMS
from swingid.preparation.scale import Scale

Places = tuple[tuple[int, float], ...]

INERTIAS = ("drive.wheel.inertia", "drive.motor.rotor_inertia", "drive.motor.gear_ratio")
"""Constants of the drive that the motion feels also where the measured wheel is its input."""

TORQUES = ("drive.motor.torque_per_volt", "drive.motor.back_emf", "drive.motor.viscous", "drive.motor.coulomb")
"""The motor's torques beside its dead zone."""

SCALE = "motor_scale"
"""Relative deviation of all torques of the motor alike from what is stated."""


def constant_places(rig: Rig, scale: Scale) -> dict[str, Places]:
    """Places of every constant of rig.toml that the motion feels, by its key; derivatives at the stated values."""
    found: dict[str, Places] = {}
    if not scale.linear:
        found["axis.gravity_torque"] = ((B, 1.0),)
    for term, place in zip(scale.further, slots(scale), strict=True):
        if term.value is not None:
            found[term.term.key] = ((place + COEFFICIENT, 1.0),)
            found |= {term.term.shift: ((place + SHIFT, 1.0),)} if term.shift.std else {}
    if scale.drive == "direct":
        found["log.torque_gain"] = ((GAIN, 1.0 / rig.log.torque_gain.value),)
    if scale.drive != "reaction-wheel" or rig.drive.motor is None:
        return found
    motor = rig.drive.motor
    gear, rotor = motor.gear_ratio.value, motor.rotor_inertia.value
    found |= {
        "drive.wheel.inertia": ((A11, 1.0), (A12, 1.0), (A22, 1.0)),
        "drive.motor.rotor_inertia": ((A11, 1.0), (A12, gear), (A22, gear**2)),
        "drive.motor.gear_ratio": ((A12, rotor), (A22, 2 * gear * rotor), (GEAR, 1.0)),
        "drive.motor.torque_per_volt": ((C1, 1.0),),
        "drive.motor.back_emf": ((C2, 1.0),),
        "drive.motor.viscous": ((F2, 1.0),),
        "drive.motor.coulomb": ((F3, 1.0), (WHEEL_STATIC, abs(gear))),
        "drive.motor.efficiency": ((ETA, 1.0),),
    }
    return found


def slots(scale: Scale) -> list[int]:
    """First place of the slot of every further term of the rig."""
    return [FIRST_SLOT + SLOT * k for k in range(len(scale.further))]


def constant_value(rig: Rig, key: str) -> tuple[float, float | None]:
    """Value and standard uncertainty of a constant by its key."""
    holder: object = rig
    for part in key.split("."):
        holder = getattr(holder, part)
    return float(getattr(holder, "value", 0.0)), getattr(holder, "std", None)


def scaled_places(rig: Rig) -> Places:
    """Places of the motor's torques, with what is stated as weights: what a common scale of them moves."""
    motor = rig.drive.motor
    assert motor is not None
    low, high = motor.dead_zone
    stated = {C1: motor.torque_per_volt, C2: motor.back_emf, F2: motor.viscous, F3: motor.coulomb}
    held = abs(motor.gear_ratio.value) * motor.coulomb.value
    values = {place: quantity.value for place, quantity in stated.items()} | {WHEEL_STATIC: held, D1: high, D2: low}
    return tuple(values.items())


def is_felt(key: str, input: str) -> bool:
    """Whether a constant enters the simulation: most of the motor's do not where the measured wheel is the input."""
    return input == "voltage" or not key.startswith("drive.") or key in INERTIAS


def uncertain_constants(rig: Rig, scale: Scale, input: str) -> tuple[str, ...]:
    """Keys of the constants that enter and that rig.toml states with an uncertainty; `SCALE` beside any of them.

    A motor's constants come from a test against the inertia of its wheel, and are off with it. So they may not tell
    that inertia, nor what else sets the scale: a common scale of its torques is left open.
    """
    known = [key for key in constant_places(rig, scale) if is_felt(key, input)]
    unsure = tuple(key for key in known if constant_value(rig, key)[1])
    return (*unsure, SCALE) if unsure and input == "voltage" else unsure


def free_key(name: str) -> str:
    """rig.toml's key of a constant that may be free; a name that is no term stands for itself."""
    return TERMS[name].key if name in TERMS else name


def free_name(key: str) -> str:
    """The name as an unknown of a constant by its key."""
    return next(name for name, term in TERMS.items() if term.key == key)


def unit_of(key: str, scale: Scale) -> str:
    """The unit of a constant by its key; what is no coefficient of a term is an angle or a place."""
    units = {term.key: term.unit_on(linear=scale.linear) or "1" for term in TERMS.values()}
    return units.get(key, "m" if scale.linear else "rad")


def free_start(rig: Rig, name: str) -> float:
    """Where the search for a free constant begins: at its stated value, 0 where none is."""
    return constant_value(rig, free_key(name))[0]
