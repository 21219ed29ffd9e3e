"""What takes the place of a scale where a rig states none: the unit in which everything else is identified.

Equation (I) is homogeneous in its constants. With one of them as the unit, which is 1 then, every method runs as it
does with a known one; ratios to the inertia (`result.ratios`) do not depend on the choice.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from swingid.errors import UnanswerableError
from swingid.model.equation import Equation
from swingid.model.rig import Rig
from swingid.model.terms import is_spring, rig_terms
from swingid.units import Quantity, UnknownScale

WHEEL, GAIN, GRAVITY, STIFFNESS = "drive.wheel.inertia", "log.torque_gain", "axis.gravity_torque", "axis.stiffness"
SUSPENSION = "axis.suspension.stiffness"
PER_VOLT = "drive.motor.torque_per_volt"

REMEDIES = {
    GRAVITY: (
        "weigh the body and measure the distance of its centre of mass from the axis (axis.mass and axis.lever), or "
        "add a body of known inertia with its centre on the axis and give both results to swingid difference --known; "
        "of a body on a wire or strings state axis.stiffness or axis.bifilar in the place of the gravity torque"
    ),
    STIFFNESS: (
        "state axis.stiffness, or add a body of known inertia and give both results to swingid difference --known"
    ),
    SUSPENSION: ("weigh what hangs on the strings (mass under axis.bifilar or axis.trifilar)"),
    WHEEL: (
        "weigh and measure the wheel (drive.wheel.inertia), or weigh the body and measure the distance of its centre "
        "of mass from the axis (axis.mass and axis.lever) and move it at two frequencies, or add a body of known "
        "inertia and give both results to swingid difference --known"
    ),
    PER_VOLT: (
        "state drive.motor.torque_per_volt (or torque_constant and resistance), or log it with and without a known "
        "body (a ring, a disc) and give both logs to swingid identify with --added"
    ),
    GAIN: (
        "calibrate the torque (log.torque_gain, such as by a weight on a lever), or weigh the body and measure the "
        "distance of its centre of mass from the axis (axis.mass and axis.lever)"
    ),
}
"""What to measure for a result in kg m², by the key of the unit."""

FRICTION = "axis.friction."
"""Where the keys of the friction are, of which one is the unit of a free body without gravity and spring."""

KNOWN_BODY = (
    "log a second coast-down with a known body on the axis (a ring, a disc) and give both logs to swingid identify "
    "with --added, or state a drive whose torque is known"
)


@dataclass(frozen=True)
class Reference:
    """The constant that is the unit: its key and its name as an unknown; the rig in which it is 1.

    scaled_by: name and value of an unknown that the rig file states, by which the result is scaled after all; None:
    it stays one of ratios.
    """

    key: str
    name: str
    rig: Rig
    scaled_by: tuple[str, str, Quantity] | None = None

    @property
    def remedy(self) -> str:
        """What to measure for a result in kg m²."""
        return KNOWN_BODY if self.key.startswith(FRICTION) else REMEDIES.get(self.key, REMEDIES[STIFFNESS])


def reference_of(rig: Rig) -> Reference | None:
    """The unit for a rig that states no scale reference; None where it states one.

    Raises UnanswerableError where nothing acts that could be one.
    """
    wheel = rig.drive.wheel
    if wheel is not None and isinstance(wheel.inertia, UnknownScale):
        # the motor's constants are in N m, of which nothing else is; the unit is wheel and rotor
        motor = {"rotor_inertia": 0.0}
        if rig.drive.motor is not None:
            motor["gear_ratio"] = rig.drive.motor.gear_ratio.value
        return _driven(rig, WHEEL, "wheel_inertia", {"drive.motor": motor})
    if rig.drive.channel == "torque" and isinstance(rig.log.torque_gain, UnknownScale):
        return _driven(rig, GAIN, "torque_gain", {})
    b, held = rig.axis.gravity_torque, [term for term in rig_terms(rig) if term.term.is_conservative]
    acts = any(term.value is not None and term.value.value for term in held) or (isinstance(b, Quantity) and b.value)
    if rig.drive.channel == "voltage" and not acts and "torque_per_volt" in Equation.of(rig).sought:
        return _motor_on_axis(rig)
    if rig.drive.channel is not None or acts:
        return None
    forgotten = {"axis.inertia": None}  # not in these units
    spring = next((term for term in held if is_spring(term.term) and term.value is None), None)
    if spring is not None:
        changes = {**forgotten, **_strings(rig)} if spring.term.key == SUSPENSION else forgotten
        return Reference(spring.term.key, spring.name, rig.in_units_of(spring.term.key, changes))
    if isinstance(b, str):
        return Reference(GRAVITY, "gravity_torque", rig.in_units_of(GRAVITY, forgotten))
    return None


def _motor_on_axis(rig: Rig) -> Reference:
    """The torque per volt as the unit; what else is stated of the motor is in N m, of which nothing else is."""
    motor = rig.drive.motor
    gear = None if motor is None or motor.gear_friction is None else motor.gear_friction
    changes = {"axis.inertia": None, "drive.motor": {"gear_friction": gear} if gear else {}}
    return Reference(PER_VOLT, "torque_per_volt", rig.in_units_of(PER_VOLT, changes))


def _strings(rig: Rig) -> dict[str, object]:
    """Changes by which the strings are stated by what acts, not by their geometry."""
    suspension = rig.axis.suspension
    assert suspension is not None
    table = {"stiffness": 1.0, "shape": suspension.shape, "height": suspension.height}
    return {"axis.bifilar": None, "axis.trifilar": None, "axis.suspension": table}


def _driven(rig: Rig, key: str, name: str, changes: dict[str, object]) -> Reference:
    """The unit of a driven axis; a gravity torque or spring that the rig states scales the result afterwards."""
    changes = {"axis.inertia": None, **changes}
    b = rig.axis.acting_gravity
    if b is not None and b.value:
        along = rig.axis.along
        std = math.hypot(b.std or 0.0, b.value * (along.std or 0.0) / along.value)
        unit = rig.in_units_of(key, {**changes, GRAVITY: "unknown"})
        return Reference(key, name, unit, ("gravity_torque", GRAVITY, Quantity(b.value, std or None)))
    spring = next((term for term in rig_terms(rig) if term.name == "stiffness" and term.value is not None), None)
    if spring is not None and spring.value is not None and spring.value.value:
        unit = rig.in_units_of(key, {**changes, STIFFNESS: "unknown"})
        return Reference(key, name, unit, ("stiffness", STIFFNESS, spring.value))
    return Reference(key, name, rig.in_units_of(key, changes))


def turns_freely(rig: Rig) -> bool:
    """Return whether nothing but friction acts on the axis: a body that spins down, whose friction over inertia is
    found.
    """
    return rig.drive.channel is None and rig.axis.gravity_torque == Quantity(0.0) and not rig_terms(rig)


def in_units(rig: Rig) -> Rig:
    """The rig, with a constant as unit where nothing sets the scale: for what looks at ratios and shares only."""
    reference = reference_of(rig)
    return rig if reference is None else reference.rig


def refuse_without_scale(rig: Rig) -> None:
    """Raise UnanswerableError where the rig states no scale reference, for what gives no ratios."""
    reference = None if rig.reference else reference_of(rig)
    if reference is not None and reference.scaled_by is None:
        raise UnanswerableError(
            f"rig {rig.name}: nothing sets the scale ({reference.key} is unknown), so only ratios to the inertia are "
            f"identifiable, which swingid identify gives; for more {reference.remedy}.",
            code="no-scale",
        )
    if reference is not None:
        raise UnanswerableError(
            f"rig {rig.name}: {reference.key} is unknown, which only swingid identify takes; state it.", code="no-scale"
        )
