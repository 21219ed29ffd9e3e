"""Equation (I) of a rig as a sum of terms, Σ c f = 0: of each term the coefficient, and what is known of it.

    a11 q1'' + b sin q1 + a12 q2'' − τ + Σ_k c_k f_k(q1, q1') = 0

What differs between rigs is a coefficient, not a branch. One that is known is made of constants of the rig file, so it
states its derivative by each of them: an error δ of a constant is an error δ ∂c/∂constant of every coefficient that it
is in. A coefficient without a value is sought. The regressors f are those of `terms`; `wheel` is q2'', `torque` τ.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

from swingid.format import pretty_unit, time_power
from swingid.model.parameters import AXIS_TILT, WHEEL_TILT
from swingid.model.terms import NAMED, TERMS, RigTerm, gravity_term, motor_terms, name_of, rig_terms, stated_at
from swingid.units import Quantity

if TYPE_CHECKING:
    from swingid.model.rig import Rig

CLOCK = "log.clock"
"""Key of the deviation of the log's clock."""

VOLTAGE_SCALE = "log.voltage_scale"
"""Key of the volts per logged unit of the voltage."""

GRAVITY = "axis.gravity_torque"
"""Key of the gravity torque."""

TIME_POWERS = {
    key: power
    for key, power in (
        {term.key: time_power(term.unit) for term in TERMS.values() if term.key} | {"log.torque_gain": -2}
    ).items()
    if power
}
"""Constants whose unit has a power of the time, with it."""


@dataclass(frozen=True)
class Coefficient:
    """A term's coefficient: value, None where it is sought; derivative by each constant that it is made of, by key."""

    value: float | None = None
    sources: Mapping[str, float] = field(default_factory=dict)


SOUGHT = Coefficient()


@dataclass(frozen=True)
class Constant:
    """What coefficients are made of: its key, its standard uncertainty (0: exact or none stated).

    deviation: whether it is no constant of the model but a relative deviation of several, of the clock or a tilt.
    shared: whether it is a quantity of the rig, the same in all its results.
    """

    key: str
    std: float
    deviation: bool = False
    shared: bool = True


@dataclass(frozen=True)
class Equation:
    """The coefficients of equation (I) by the names of their terms, the inertia of the whole axis first.

    beside: what of that inertia is not the body's, J2 + Jr of a wheel, N² Jr of a motor on the axis. constants: those
    that the coefficients are made of. terms: by name those whose regressor is in the registry, gravity first: springs,
    cogging, the rig's own friction, a motor on the axis. channel: of a log, by which a drive acts; None of a free axis.
    reference: key of the constant that is 1 because nothing sets the scale, as of the Rig.
    """

    coefficients: Mapping[str, Coefficient]
    beside: Coefficient
    constants: tuple[Constant, ...]
    linear: bool
    channel: str | None
    terms: Mapping[str, RigTerm] = field(default_factory=dict)
    reference: str = ""

    @cached_property
    def sought(self) -> tuple[str, ...]:
        """Terms whose coefficients are sought."""
        return tuple(name for name, coefficient in self.coefficients.items() if coefficient.value is None)

    @cached_property
    def own_friction(self) -> tuple[str, ...]:
        """The rig's own terms of friction (drag, load), whose coefficients are sought: they are odd in the speed."""
        return tuple(name for name, term in self.terms.items() if term.term.odd and self.seeks(name))

    @cached_property
    def conservative(self) -> tuple[RigTerm, ...]:
        """Torques of the angle alone: gravity, springs, cogging."""
        return tuple(term for term in self.terms.values() if term.term.is_conservative)

    @cached_property
    def slots(self) -> tuple[RigTerm, ...]:
        """Terms that the equations of the compiled model do not name, in the order of its slots."""
        return tuple(term for term in self.terms.values() if term.name not in NAMED)

    @cached_property
    def stated(self) -> dict[str, float]:
        """Known coefficients by the names of their terms."""
        return {
            name: coefficient.value for name, coefficient in self.coefficients.items() if coefficient.value is not None
        }

    @property
    def driven(self) -> bool:
        """Return whether a drive acts on the axis."""
        return self.channel is not None

    def seeks(self, name: str) -> bool:
        """Return whether the coefficient of a term is sought."""
        return name in self.sought

    def but(self, **coefficients: Coefficient) -> Equation:
        """The equation with other coefficients, or with more of them."""
        return replace(self, coefficients={**self.coefficients, **coefficients})

    def without(self, names: set[str]) -> Equation:
        """The equation without these terms."""
        kept = {name: coefficient for name, coefficient in self.coefficients.items() if name not in names}
        terms = {name: term for name, term in self.terms.items() if name not in names}
        return replace(self, coefficients=kept, terms=terms)

    def slopes(self, key: str) -> dict[str, float]:
        """Derivatives of the coefficients by a constant, by the names of their terms."""
        return {
            name: coefficient.sources[key]
            for name, coefficient in self.coefficients.items()
            if key in coefficient.sources
        }

    def value(self, name: str) -> float:
        """A known coefficient; 0 where it is sought, and of a term that the rig does not have."""
        return self.stated.get(name, 0.0)

    @property
    def carried(self) -> float:
        """What of the inertia of the axis is not the body's (kg m² or kg)."""
        return self.beside.value or 0.0

    @property
    def unit(self) -> str:
        """Unit of the inertia."""
        return "kg" if self.linear else "kg m^2"

    @property
    def torque_unit(self) -> str:
        """Unit of friction torque or force."""
        return "N" if self.linear else "N m"

    def shown(self, unit: str) -> str:
        """A unit as sentences have it: a multiple of the constant that is 1, where nothing sets the scale."""
        if not self.reference or not unit.startswith(("N", "kg")) or unit.endswith("/V"):
            return unit
        power = time_power(unit) - TIME_POWERS.get(self.reference, 0)
        seconds = {0.0: "", 1.0: "s"}.get(power, f"s^{power:g}")
        return pretty_unit(f"{seconds} × {name_of(self.reference)}")

    @classmethod
    def of(cls, rig: Rig) -> Equation:
        """The equation of a rig, whether or not anything in it sets the scale (see `preparation.scale.equation_of`)."""
        building = _Building(rig)
        terms = {term.name: term for term in (gravity_term(rig), *rig_terms(rig), *motor_terms(rig))}
        return cls(
            building.coefficients,
            building.beside,
            tuple(building.constants),
            rig.axis.kind == "linear",
            rig.drive.channel,
            terms,
            rig.reference,
        )


class _Building:
    """The coefficients of a rig while they are collected, with the constants that they are made of."""

    def __init__(self, rig: Rig) -> None:
        self.coefficients: dict[str, Coefficient] = {"inertia": SOUGHT, "gravity_torque": SOUGHT}
        self.beside = Coefficient(0.0)
        self.constants: list[Constant] = []
        motor = motor_terms(rig)
        if rig.drive.wheel is not None:
            self._wheel(rig)
        elif rig.drive.channel == "torque":
            gain = rig.log.torque_gain
            self._made_of("log.torque_gain", gain)
            self.coefficients["torque"] = Coefficient(-1.0, {"log.torque_gain": -1.0 / gain.value})
        elif rig.drive.channel == "voltage":
            self._reflected(rig)
        for term in motor:
            self._stated(term)
        gravity, along = rig.axis.gravity_torque, rig.axis.along.value
        if not isinstance(gravity, str):
            self._made_of(GRAVITY, gravity)
            self.coefficients["gravity_torque"] = Coefficient(gravity.value * along, {GRAVITY: along})
        for term in rig_terms(rig):
            self._stated(term)
        self._deviations(rig)

    def _made_of(self, key: str, quantity: Quantity) -> None:
        self.constants.append(Constant(key, quantity.std or 0.0))

    def _wheel(self, rig: Rig) -> None:
        """a12 = (J2 + N Jr) cos of the wheel's tilt, and J2 + Jr beside the body."""
        assert rig.drive.wheel is not None
        along, motor = rig.drive.wheel.along, rig.drive.motor
        sources, beside = {"drive.wheel.inertia": along.value}, {"drive.wheel.inertia": along.value}
        self._made_of("drive.wheel.inertia", rig.drive.wheel.inertia)
        if motor is not None:
            sources["drive.motor.rotor_inertia"] = along.value * motor.gear_ratio.value
            sources["drive.motor.gear_ratio"] = along.value * motor.rotor_inertia.value
            beside["drive.motor.rotor_inertia"] = along.value
            self._made_of("drive.motor.rotor_inertia", motor.rotor_inertia)
            self._made_of("drive.motor.gear_ratio", motor.gear_ratio)
        sources[WHEEL_TILT], beside[WHEEL_TILT] = rig.drive.a12, rig.drive.carried
        self.constants.append(Constant(WHEEL_TILT, relative(along), deviation=True))
        self.coefficients["wheel"] = Coefficient(rig.drive.a12, sources)
        self.beside = Coefficient(rig.drive.carried, beside)

    def _reflected(self, rig: Rig) -> None:
        """N² Jr of a motor on the axis."""
        motor = rig.drive.motor
        assert motor is not None
        gear, rotor = motor.gear_ratio, motor.rotor_inertia
        self._made_of("drive.motor.rotor_inertia", rotor)
        self._made_of("drive.motor.gear_ratio", gear)
        sources = {"drive.motor.rotor_inertia": gear.value**2, "drive.motor.gear_ratio": 2 * gear.value * rotor.value}
        self.beside = Coefficient(rig.drive.reflected, sources)

    def _stated(self, term: RigTerm) -> None:
        """A term as it is stated or sought, and beside one whose shift is uncertain its derivative by the shift."""
        if term.value is None:
            self.coefficients[term.name] = SOUGHT
            return
        self._made_of(term.term.key, term.value)
        self.coefficients[term.name] = Coefficient(term.value.value, {term.term.key: 1.0})
        if term.shift.std:
            self._made_of(term.term.shift, term.shift)
            self.coefficients[shifted(term.name)] = Coefficient(0.0, {term.term.shift: term.value.value})

    def _deviations(self, rig: Rig) -> None:
        """What changes several constants alike: see `deviations`."""
        keys = {constant.key for constant in self.constants}
        for key, std, weights in deviations(rig, keys):
            self.constants.append(Constant(key, std, deviation=True))
            for name, coefficient in self.coefficients.items():
                if any(source in coefficient.sources for source in weights):
                    change = sum(weight * coefficient.sources.get(source, 0.0) for source, weight in weights.items())
                    self.coefficients[name] = replace(coefficient, sources={**coefficient.sources, key: change})
            beside = sum(weight * self.beside.sources.get(source, 0.0) for source, weight in weights.items())
            if beside:
                self.beside = replace(self.beside, sources={**self.beside.sources, key: beside})


def shifted(name: str) -> str:
    """Name of the term that is the derivative of another by its shift."""
    return name + "'"


def relative(quantity: Quantity) -> float:
    """Relative standard uncertainty."""
    return (quantity.std or 0.0) / quantity.value


def deviations(rig: Rig, keys: set[str]) -> Iterator[tuple[str, float, dict[str, float]]]:
    """Relative deviations of several constants: key, standard uncertainty, equivalent change of each of `keys`.

    None for no keys.

    A tilt is a relative change of the gravity torque. A clock that is fast by c makes all times too long by that share,
    which is the same as constants with the power n of the time in their unit larger by n c: the gravity torque by
    −2 c. What they cannot change is the unit of the parameters (`Declared.of_time`). The scale of the voltage is a
    relative change of the motor's torque per volt.
    """
    if not keys:
        return
    gravity = rig.axis.gravity_torque
    if isinstance(gravity, Quantity) and gravity.value:
        yield AXIS_TILT, relative(rig.axis.along), {GRAVITY: gravity.value} if GRAVITY in keys else {}
    values = {key: stated_at(rig, key) for key in TIME_POWERS if key in keys}
    weights = {key: TIME_POWERS[key] * value.value for key, value in values.items() if isinstance(value, Quantity)}
    yield CLOCK, rig.log.clock.std or 0.0, weights
    if rig.log.voltage_scale.std and rig.drive.motor is not None:
        key = "drive.motor.torque_per_volt"
        volts = {key: rig.drive.motor.torque_per_volt.value} if key in keys else {}
        yield VOLTAGE_SCALE, relative(rig.log.voltage_scale), volts
