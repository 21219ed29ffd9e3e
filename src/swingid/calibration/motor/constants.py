"""From products to the constants of rig.toml: their uncertainty budget, and the rig file that states them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from swingid.balance import wheel_equation as at
from swingid.balance.perturbations import BENDS, SHAPES, Perturbation, Shape, encoder_error
from swingid.calibration.motor.balance import BalanceFit, Separation
from swingid.calibration.motor.channels import WheelLog
from swingid.calibration.motor.output_error import STATES, OutputFit
from swingid.calibration.outcome import quantity, rewritten, rounded
from swingid.errors import InputError
from swingid.model.rig import Rig
from swingid.model.terms import FRICTION_KEYS
from swingid.numerics.arrays import Array
from swingid.preparation.encoders import Channel
from swingid.result.result import Message
from swingid.uncertainty.budget import Declared, Evaluated, Parameter, Scatter, evaluate, systematic
from swingid.uncertainty.dark import dark_uncertainty
from swingid.uncertainty.significance import INDICATED
from swingid.units import Quantity

UNITS = {
    "motor.gain": "N m/V",
    "motor.damping": "N m s",
    "motor.breakaway_positive": "N m",
    "motor.breakaway_negative": "N m",
    "motor.torque_per_volt": "N m/V",
    "motor.back_emf": "N m s",
    "motor.viscous": "N m s",
    "motor.coulomb": "N m",
    "motor.dead_zone.positive": "N m",
    "motor.dead_zone.negative": "N m",
    "motor.rotor_inertia": "kg m^2",
}
"""Everything that a calibration can give: first the products that equation (II) contains, then the constants of
rig.toml."""

Error = Callable[[Array, Array], Array]
"""An error of an angle, by the angle (rad) and the time (s) of its rows."""


def _by_angle(shape: Shape) -> Error:
    """An error that is a function of the angle alone."""
    return lambda angle, _: SHAPES[shape](angle)


ERRORS: dict[Shape, Error] = {"latency": np.gradient, **{shape: _by_angle(shape) for shape in BENDS}}
"""Error of an encoder, per unit, by its shape."""

MOTOR = ("torque_per_volt", "back_emf", "viscous", "coulomb")


@dataclass(frozen=True)
class Conversion:
    """Converts products into constants by what the rig states; coupled: the rotor's inertia comes from the products."""

    rig: Rig
    coupled: bool

    def constants(self, values: Array, rig: Rig | None = None) -> Array:
        """All of `UNITS`, in order, from products (7,); by another `rig` where one is given."""
        drive = (rig or self.rig).drive
        motor, wheel = drive.motor, drive.wheel
        assert motor is not None
        assert wheel is not None
        gear, eta, rotor = motor.gear_ratio.value, motor.efficiency.value, motor.rotor_inertia.value
        if self.coupled:
            # ρ = (J2 + N Jr)/(J2 + N² Jr)
            rho = values[at.COUPLING]
            rotor = wheel.inertia.value * (1 - rho) / (gear * (gear * rho - 1))
        scale = (wheel.inertia.value + gear**2 * rotor) / gear
        g, v, e, p, n, f = scale * values[[at.GAIN, at.DAMPING, at.EMF, at.POSITIVE, at.NEGATIVE, at.COULOMB]]
        return np.array([g, v, p, n, g / eta, e / eta, (v - e) / gear, f, max(p - f, 0.0), min(f - n, 0.0), rotor])

    def jacobian(self, values: Array) -> Array:
        """Derivatives (11, 7) of the constants to the products, by central differences."""
        result = np.zeros((len(UNITS), at.COUNT))
        for k in range(at.COUNT):
            step = np.zeros(at.COUNT)
            step[k] = 1e-6 * max(abs(values[k]), 1e-3)
            result[:, k] = (self.constants(values + step) - self.constants(values - step)) / (2 * step[k])
        return result


def evaluated(
    fit: OutputFit, other: BalanceFit, declared: list[Declared], to: Conversion
) -> tuple[Evaluated, dict[str, bool]]:
    """All constants of `UNITS`, by output error, with their budget; and whether the balance differs in each of them.

    Type A is from scatter and from the difference of the two methods, type B from `declared`.
    """
    jacobian = to.jacobian(fit.values)
    constants = to.constants(fit.values)
    values = {name: (float(value), unit) for (name, unit), value in zip(UNITS.items(), constants, strict=True)}
    gaps = to.constants(other.values) - constants
    covariance = jacobian @ fit.covariance @ jacobian.T
    variances = np.diag(jacobian @ other.covariance @ jacobian.T + covariance)
    spread = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    source = systematic("disagreement of test functions and output error")
    dark = [
        (source, name, dark_uncertainty(float(gap), float(variance), float(u)))
        for name, gap, variance, u in zip(UNITS, gaps, variances, spread, strict=True)
    ]
    scattered = Scatter("scatter of the shots and sensor noise", covariance, np.full(len(values), np.inf))
    result = evaluate(values, scattered, dark, declared)
    differs = np.abs(gaps) > INDICATED * np.sqrt(np.maximum(variances, 0.0))
    return result, dict(zip(UNITS, differs.tolist(), strict=True))


def declared_changes(fit: OutputFit, logs: list[WheelLog], split: Separation, to: Conversion) -> list[Declared]:
    """Every declared uncertainty of the rig, and its effect on the constants."""
    base = to.constants(fit.values)
    sensors = ((item, to.constants(fit.values + change)) for item, change in _sensors(fit, logs))
    return [item.on((changed - base) / item.std) for item, changed in (*_stated(fit, split, to), *sensors)]


def _stated(fit: OutputFit, split: Separation, to: Conversion) -> Iterator[tuple[Perturbation, Array]]:
    """Constants of the rig that were not found, and all constants of `UNITS` with each off by one standard deviation.

    Wheel, rotor and gear turn accelerations into torques; others are in products that were held.
    """
    motor, wheel = to.rig.drive.motor, to.rig.drive.wheel
    assert motor is not None
    assert wheel is not None
    ratio = None if to.coupled else at.COUPLING
    constants = {
        "drive.wheel.inertia": (wheel.inertia, ratio),
        "drive.motor.gear_ratio": (motor.gear_ratio, ratio),
        "drive.motor.rotor_inertia": (Quantity(0.0) if to.coupled else motor.rotor_inertia, ratio),
        "drive.motor.back_emf": (Quantity(0.0) if split.emf else motor.back_emf, at.EMF),
        "drive.motor.coulomb": (Quantity(0.0) if split.coulomb else motor.coulomb, at.COULOMB),
    }
    for key, (known, place) in constants.items():
        if not known.std:
            continue
        other = to.rig.changed({key: Quantity(known.value + known.std)})
        values = fit.values
        if place is not None:
            change = float(at.products_of(other)[place] - at.products_of(to.rig)[place])
            values = values + _shift_by(fit, place, change)
        yield Perturbation(key, known.std, key), to.constants(values, other)


def _shift_by(fit: OutputFit, place: int, change: float) -> Array:
    """Change of all products when the held one at `place` changes by `change`."""
    slopes = fit.shots.slopes(fit.values, fit.motion.steps)
    result = fit.shift(-change * slopes[:, STATES + place])
    result[place] += change
    return result


def _sensors(fit: OutputFit, logs: list[WheelLog]) -> Iterator[tuple[Perturbation, Array]]:
    """Stated errors of the encoders, and the change of all products by one standard deviation of each."""
    still = all(log.kind == "clamped" for log in logs)
    channels: dict[Channel, Callable[[OutputFit, Error, float], Array]] = {"wheel": by_wheel, "angle": _by_axis}
    for channel, changes in channels.items():
        if still and channel == "angle":
            continue
        for shape, error in ERRORS.items():
            item = encoder_error(logs[0].encoders, channel, shape)
            if item.std:
                yield item, fit.shift(changes(fit, error, item.std))


def by_wheel(fit: OutputFit, error: Error, size: float) -> Array:
    """`size` times an error of the wheel's angle as a change of the logged angles (n,)."""
    return size * fit.shots.each(error, fit.shots.wheel)


def _by_axis(fit: OutputFit, error: Error, size: float) -> Array:
    """`size` times an error of the axis' angle as a change of the wheel's: minus its effect on the simulation."""
    shots = fit.shots
    other = shots.moved(fit.values, fit.fit.states, shots.angle - size * shots.each(error, shots.angle))
    return fit.motion.outputs - other.outputs


def calibrated_rig(
    rig: Rig, parameters: Mapping[str, Parameter], split: Separation | None, *, coupled: bool
) -> tuple[Rig, list[Message]]:
    """The rig with the constants of `found` (names of a calibration, also those held) and their uncertainties.

    Values keep two digits more than their uncertainty has. efficiency loses its uncertainty, because it acts only
    through torque_per_volt and back_emf, which carry that of the products.
    """
    values = {} if split is None else _motor(rig, parameters, split, coupled=coupled)
    notes = []
    motor = rig.drive.motor
    if split is not None and motor is not None and motor.efficiency.std is not None:
        values["drive.motor.efficiency"] = motor.efficiency.value
        text = "efficiency is written without uncertainty: it acts only with torque_per_volt and back_emf."
        notes.append(Message("efficiency-fixed", text))
    try:
        new, lost = rewritten(rig, values | _axis(rig, parameters))
    except InputError as error:
        new, lost = rewritten(rig, values)
        notes.append(Message("friction-not-written", f"friction and inertia of the axis were not written: {error}"))
    return new, notes + lost


def _axis(rig: Rig, parameters: Mapping[str, Parameter]) -> dict[str, object]:
    """Inertia and friction of a free swing instead of the stated ones; nothing without a swing."""
    if "axis.inertia" not in parameters:
        return {}
    values: dict[str, object] = {"axis.inertia": quantity(parameters["axis.inertia"], least=0.0)}
    for key in (*(key for key in FRICTION_KEYS if "." not in key), "lugre"):
        name = f"axis.friction.{key}"
        if name in parameters:
            values[name] = quantity(parameters[name]) if key == "offset" else quantity(parameters[name], least=0.0)
        elif getattr(rig.axis.friction, key) is not None:
            values[name] = None
    return values


def _motor(rig: Rig, parameters: Mapping[str, Parameter], split: Separation, *, coupled: bool) -> dict[str, object]:
    keys = [*(key for key in MOTOR if key != "back_emf" or split.emf), *(["rotor_inertia"] if coupled else [])]
    values: dict[str, object] = {f"drive.motor.{key}": quantity(parameters[f"motor.{key}"], least=0.0) for key in keys}
    low, high = parameters["motor.dead_zone.negative"], parameters["motor.dead_zone.positive"]
    values["drive.motor.dead_zone"] = [rounded(low), rounded(high)]
    if not split.coulomb:
        values["drive.motor.coulomb"] = _held_coulomb(rig, parameters["motor.coulomb"])
    return values


def _held_coulomb(rig: Rig, parameter: Parameter) -> Quantity | float:
    """Coulomb friction that the logs do not distinguish from the dead zone: as the rig states it where possible."""
    assert rig.drive.motor is not None
    known = rig.drive.motor.coulomb
    if abs(known.value - parameter.value) <= 1e-9 * abs(known.value):
        return known if known.std is not None else known.value
    return rounded(parameter)
