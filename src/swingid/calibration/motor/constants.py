"""From products to the constants of rig.toml: their uncertainty budget, and the rig file that states them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from swingid.calibration.motor.balance import BalanceFit, Separation
from swingid.calibration.motor.channels import WheelLog
from swingid.calibration.motor.output_error import OutputFit
from swingid.calibration.motor.products import (
    COULOMB,
    COUNT,
    COUPLING,
    DAMPING,
    EMF,
    GAIN,
    NEGATIVE,
    POSITIVE,
    products_of,
)
from swingid.errors import InputError
from swingid.model.rig import Rig
from swingid.model.rig.edit import edited
from swingid.model.terms import FRICTION_KEYS
from swingid.numerics.arrays import Array
from swingid.result.result import Message
from swingid.uncertainty.budget import Declared, Evaluated, Parameter, Scatter, evaluate, stated, systematic
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
"""Everything that a calibration can give: first the products that row (II) shows, then the constants of rig.toml."""

SCATTER = "scatter of the shots and sensor noise"


MOTOR = ("torque_per_volt", "back_emf", "viscous", "coulomb")


def constants(values: Array, rig: Rig, *, coupled: bool) -> Array:
    """All of `UNITS`, in order, from products (7,); coupled: the rotor's inertia comes from the products."""
    motor, wheel = rig.drive.motor, rig.drive.wheel
    assert motor is not None
    assert wheel is not None
    gear, eta, rotor = motor.gear_ratio.value, motor.efficiency.value, motor.rotor_inertia.value
    if coupled:
        # ρ = (J2 + N Jr)/(J2 + N² Jr)
        rho = values[COUPLING]
        rotor = wheel.inertia.value * (1 - rho) / (gear * (gear * rho - 1))
    scale = (wheel.inertia.value + gear**2 * rotor) / gear
    g, v, e, p, n, f = scale * values[[GAIN, DAMPING, EMF, POSITIVE, NEGATIVE, COULOMB]]
    return np.array([g, v, p, n, g / eta, e / eta, (v - e) / gear, f, max(p - f, 0.0), min(f - n, 0.0), rotor])


@dataclass(frozen=True)
class Change:
    """One declared imperfection at one standard uncertainty: what it does to all constants (of `UNITS`)."""

    source: str
    std: float
    shifts: Array
    shared_id: str


def evaluated(
    fit: OutputFit, other: BalanceFit, changes: list[Change], rig: Rig, *, coupled: bool
) -> tuple[Evaluated, dict[str, bool]]:
    """All constants of `UNITS`, by output error, with their budget; and in which of them test functions disagree.

    Type A is from scatter and from what the two ways differ by, type B from `changes`.
    """
    jacobian = _jacobian(fit.values, rig, coupled=coupled)
    found = constants(fit.values, rig, coupled=coupled)
    values = {name: (float(value), unit) for (name, unit), value in zip(UNITS.items(), found, strict=True)}
    gaps = constants(other.values, rig, coupled=coupled) - found
    own = jacobian @ fit.covariance @ jacobian.T
    variances = np.diag(jacobian @ other.covariance @ jacobian.T + own)
    spread = np.sqrt(np.maximum(np.diag(own), 0.0))
    source = systematic("disagreement of test functions and output error")
    dark = [
        (source, name, dark_uncertainty(float(gap), float(variance), float(u)))
        for name, gap, variance, u in zip(UNITS, gaps, variances, spread, strict=True)
    ]
    declared = [Declared(stated(one.source, one.shared_id), one.std, one.shifts / one.std) for one in changes]
    answer = evaluate(values, Scatter(SCATTER, own, np.full(len(values), np.inf)), dark, declared)
    apart = np.abs(gaps) > INDICATED * np.sqrt(np.maximum(variances, 0.0))
    return answer, dict(zip(UNITS, apart.tolist(), strict=True))


def _jacobian(values: Array, rig: Rig, *, coupled: bool) -> Array:
    """Derivatives (11, 7) of the constants to the products, by central differences."""
    result = np.zeros((len(UNITS), COUNT))
    for k in range(COUNT):
        step = np.zeros(COUNT)
        step[k] = 1e-6 * max(abs(values[k]), 1e-3)
        high, low = (constants(values + sign * step, rig, coupled=coupled) for sign in (1, -1))
        result[:, k] = (high - low) / (2 * step[k])
    return result


def declared_changes(
    fit: OutputFit, logs: list[WheelLog], rig: Rig, split: Separation, *, coupled: bool
) -> list[Change]:
    """What every declared uncertainty of the rig does to the constants, at one standard uncertainty each."""
    base = constants(fit.values, rig, coupled=coupled)
    found = [*_inertias(fit, rig, base, coupled=coupled), *_held(fit, rig, split, base, coupled=coupled)]
    for source, std, shared, changes in _sensors(fit, logs, rig):
        shifts = constants(fit.values + fit.shift(changes), rig, coupled=coupled) - base
        found.append(Change(source, std, shifts, shared))
    return found


def _inertias(fit: OutputFit, rig: Rig, base: Array, *, coupled: bool) -> Iterator[Change]:
    """Wheel, rotor and gear: they turn accelerations into torques, and set a12/a22 where it is not fitted."""
    motor, wheel = rig.drive.motor, rig.drive.wheel
    assert motor is not None
    assert wheel is not None
    keys = {"drive.wheel.inertia": wheel.inertia, "drive.motor.gear_ratio": motor.gear_ratio}
    if not coupled:
        keys["drive.motor.rotor_inertia"] = motor.rotor_inertia
    for key, quantity in keys.items():
        if not quantity.std:
            continue
        other = rig.changed({key: Quantity(quantity.value + quantity.std)})
        values = fit.values.copy()
        if not coupled:
            change = products_of(other)[COUPLING] - values[COUPLING]
            values = values + _shift_by(fit, COUPLING, change)
        yield Change(key, quantity.std, constants(values, other, coupled=coupled) - base, key)


def _held(fit: OutputFit, rig: Rig, split: Separation, base: Array, *, coupled: bool) -> Iterator[Change]:
    """Constants that were held at what the rig states, with its uncertainty."""
    motor = rig.drive.motor
    assert motor is not None
    for apart, key, place in ((split.emf, "back_emf", EMF), (split.coulomb, "coulomb", COULOMB)):
        std = getattr(motor, key).std
        if apart or not std:
            continue
        other = rig.changed({f"drive.motor.{key}": Quantity(getattr(motor, key).value + std)})
        change = float(products_of(other)[place] - products_of(rig)[place])
        values = fit.values + _shift_by(fit, place, change)
        yield Change(f"drive.motor.{key}", std, constants(values, rig, coupled=coupled) - base, f"drive.motor.{key}")


def _shift_by(fit: OutputFit, place: int, change: float) -> Array:
    """Change of all products when the held one at `place` changes by `change`."""
    slopes = [shot.simulated(fit.values, x)[1][:, place] for shot, x in zip(fit.shots, fit.starts, strict=True)]
    result = fit.shift([-change * slope for slope in slopes])
    result[place] += change
    return result


def _sensors(fit: OutputFit, logs: list[WheelLog], rig: Rig) -> Iterator[tuple[str, float, str, list[Array]]]:
    """Declared imperfections of the encoders as changes of the logged wheel angle of every shot."""
    wheel, angle = logs[0].encoders.wheel, logs[0].encoders.angle
    if wheel.latency.std:
        yield "wheel latency", wheel.latency.std, "sensors.wheel.latency", late_wheel(fit, wheel.latency.std)
    for name, wave in (("cosine", np.cos), ("sine", np.sin)):
        if size := wheel.parts[name].std:
            changes = [size * wave(shot.wheel) for shot in fit.shots]
            yield f"wheel encoder nonlinearity ({name})", size, f"sensors.wheel.nonlinearity.{name}", changes
    if all(log.kind == "clamped" for log in logs):
        return
    if late := angle.latency.std:
        yield "angle latency", late, "sensors.latency", _by_axis(fit, lambda q, t: late * np.gradient(q, t))
    for name, wave in (("cosine", np.cos), ("sine", np.sin)):
        if size := angle.parts[name].std:
            changes = _by_axis(fit, partial(_scaled, wave=wave, size=size))
            yield f"angle encoder nonlinearity ({name})", size, f"sensors.nonlinearity.{name}", changes


def late_wheel(fit: OutputFit, late: float) -> list[Array]:
    """Change of the logged wheel angle of every shot when it is read `late` (s) after its stamp: q' δ."""
    return [late * np.gradient(shot.wheel, np.append(0.0, np.cumsum(shot.steps))) for shot in fit.shots]


def _scaled(angle: Array, time: Array, *, wave: Callable[[Array], Array], size: float) -> Array:
    return size * wave(angle)


def _by_axis(fit: OutputFit, error: Callable[[Array, Array], Array]) -> list[Array]:
    """An error of the axis' angle, of (angle, time), as a change of the wheel's: minus what the simulation does."""
    result = []
    for shot, start in zip(fit.shots, fit.starts, strict=True):
        time = np.append(0.0, np.cumsum(shot.steps))
        other = shot.simulated(fit.values, start, shot.angle - error(shot.angle, time))[0]
        result.append(shot.simulated(fit.values, start)[0] - other)
    return result


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
    for key in (*(key for key in FRICTION_KEYS if "." not in key), "lugre"):
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
            values["drive.motor.coulomb"] = _held_coulomb(rig, found["motor.coulomb"])
            continue
        values[f"drive.motor.{key}"] = _quantity(found[f"motor.{key}"], least=0.0)
    low, high = found["motor.dead_zone.negative"], found["motor.dead_zone.positive"]
    values["drive.motor.dead_zone"] = [rounded(low), rounded(high)]
    if coupled:
        values["drive.motor.rotor_inertia"] = _quantity(found["motor.rotor_inertia"], least=0.0)
    return values


def _held_coulomb(rig: Rig, found: Parameter) -> Quantity | float:
    """Coulomb friction that the logs do not distinguish from the dead zone: as the rig states it where possible."""
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
