"""The constants of rig.toml: places in the rig's vector, values and uncertainties, names as unknowns."""

from __future__ import annotations

from swingid.model import parameters as at
from swingid.model.equation import Equation
from swingid.model.rig import Rig
from swingid.model.terms import TERMS, stated_at
from swingid.numerics.arrays import Array
from swingid.units import Quantity

Places = tuple[tuple[int, float], ...]

INERTIAS = ("drive.wheel.inertia", "drive.motor.rotor_inertia", "drive.motor.gear_ratio")
"""Constants of the drive that act on the motion also where the measured wheel is the input."""

TORQUES = ("drive.motor.torque_per_volt", "drive.motor.back_emf", "drive.motor.viscous", "drive.motor.coulomb")
"""The motor's torques beside its dead zone."""

SCALE = "motor_scale"
"""Common relative deviation of all torques of the motor from what is stated."""


def constant_places(rig: Rig, equation: Equation) -> dict[str, Places]:
    """Places of every constant of rig.toml that acts on the motion, by its key; derivatives at the stated values."""
    places: dict[str, Places] = {}
    if not equation.linear:
        places["axis.gravity_torque"] = ((at.B, rig.axis.along.value),)
    for term, place in zip(equation.slots, slots(equation), strict=True):
        if term.value is not None:
            places[term.term.key] = ((place + at.COEFFICIENT, 1.0),)
            places |= {term.term.shift: ((place + at.SHIFT, 1.0),)} if term.shift.std else {}
    if "torque" in equation.coefficients:
        # a torque acts as a12 q2'' does, see `axis_motion`
        places["log.torque_gain"] = ((at.A12, -1.0 / rig.log.torque_gain.value),)
    if "wheel" not in equation.coefficients or rig.drive.motor is None:
        return places
    motor = rig.drive.motor
    gear, rotor = motor.gear_ratio.value, motor.rotor_inertia.value
    along = 1.0 if rig.drive.wheel is None else rig.drive.wheel.along.value
    places |= {
        "drive.wheel.inertia": ((at.A11, along), (at.A12, along), (at.A22, 1.0)),
        "drive.motor.rotor_inertia": ((at.A11, along), (at.A12, along * gear), (at.A22, gear**2)),
        "drive.motor.gear_ratio": ((at.A12, along * rotor), (at.A22, 2 * gear * rotor), (at.GEAR, 1.0)),
        "drive.motor.torque_per_volt": ((at.C1, 1.0),),
        "drive.motor.back_emf": ((at.C2, 1.0),),
        "drive.motor.viscous": ((at.F2, 1.0),),
        "drive.motor.coulomb": ((at.F3, 1.0), (at.WHEEL_STATIC, abs(gear))),
        "drive.motor.efficiency": ((at.ETA, 1.0),),
    }
    return places


def tilt_places(equation: Equation) -> Places:
    """Places that a relative deviation of the cosine of the wheel's tilt moves."""
    return (at.A11, equation.carried), (at.A12, equation.value("wheel"))


def slots(equation: Equation) -> list[int]:
    """First place of the slot of every one of `Equation.slots`."""
    return [at.FIRST_SLOT + at.SLOT * k for k in range(len(equation.slots))]


def constant_value(rig: Rig, key: str) -> tuple[float, float | None]:
    """Value and standard uncertainty of a constant by its key."""
    constant = stated_at(rig, key)
    return (constant.value, constant.std) if isinstance(constant, Quantity) else (0.0, None)


def scaled_places(p: Array) -> Places:
    """Places of the motor's torques that a common scale of them moves, with those of the rig's vector as weights."""
    return tuple((place, float(p[place])) for place in (at.C1, at.C2, at.F2, at.F3, at.WHEEL_STATIC, at.D1, at.D2))


def is_felt(key: str, input: str) -> bool:
    """Return whether a constant enters the simulation: most of the motor's do not where the measured wheel is the
    input.
    """
    return input == "voltage" or not key.startswith("drive.") or key in INERTIAS


def uncertain_constants(rig: Rig, equation: Equation, input: str) -> tuple[str, ...]:
    """Keys of the constants that enter and that rig.toml states with an uncertainty; `SCALE` beside any of them.

    A motor's constants come from a test against the inertia of its wheel and share its error. They must not determine
    that inertia or another scale reference, so a common scale of the torques is an unknown too.
    """
    known = [key for key in constant_places(rig, equation) if is_felt(key, input)]
    uncertain = tuple(key for key in known if constant_value(rig, key)[1])
    return (*uncertain, SCALE) if uncertain and input == "voltage" else uncertain


def free_key(name: str) -> str:
    """Key in rig.toml of a constant that may be free; a name that is no term is its own key."""
    return TERMS[name].key if name in TERMS else name


def free_name(key: str) -> str:
    """The name as an unknown of a constant by its key."""
    return next(name for name, term in TERMS.items() if term.key == key)


def unit_of(key: str, equation: Equation) -> str:
    """The unit of a constant by its key; what is no coefficient of a term is an angle or a position."""
    units = {term.key: term.unit_on(linear=equation.linear) or "1" for term in TERMS.values()}
    return units.get(key, "m" if equation.linear else "rad")
