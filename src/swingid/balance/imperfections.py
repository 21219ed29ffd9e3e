"""What rig.toml declares as uncertain, each as a perturbation of the rows of the balance.

An error δ of a constant changes every row by ρ δ and the estimate of a linear fit by K ρ δ. That gives the sensitivity
coefficient of every parameter to every declared imperfection without a second fit (type B, GUM 5.1.3).
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from swingid.balance.rows import Rows, Signals, shifted
from swingid.format import time_power
from swingid.model.parameters import AXIS_TILT, WHEEL_TILT
from swingid.model.rig import Rig
from swingid.model.terms import TERMS, motor_terms, rig_terms, stated_at, stated_stiffness
from swingid.numerics.arrays import Array
from swingid.numerics.test_functions import project
from swingid.preparation.encoders import Channel, Encoders
from swingid.uncertainty.budget import Declared, stated
from swingid.units import Quantity

CLOCK = "log.clock"
"""Key of the deviation of the log's clock."""

VOLTAGE_SCALE = "log.voltage_scale"
"""Key of the volts per logged unit of the voltage."""


@dataclass(frozen=True)
class Imperfection:
    """A declared uncertainty: standard deviation, its effect ρ on the rows per unit, and on J1 directly per unit.

    shared_id: the physical quantity. calibrates: whether it is an unknown of the fit with its declared value as prior.
    constant: whether it is a constant of the model, not an error of a sensor. of_time: see `Declared`. of_noise:
    whether it is a part of the sensor's noise, which is of type A. mean: of the prior of the unknown, in standard
    deviations, where a part of it was corrected before.
    """

    source: str
    std: float
    rows: Array
    direct: float
    shared_id: str | None
    calibrates: bool = False
    constant: bool = False
    of_time: bool = False
    of_noise: bool = False
    mean: float = 0.0

    def on(self, slopes: Array) -> Declared:
        """For the budget; slopes (n,): change per unit of the parameters, the inertia of the whole axis first."""
        of_parameters = np.append(slopes[:1] + self.direct, slopes[1:])
        return Declared(stated(self.source, self.shared_id), self.std, of_parameters, self.constant, self.of_time)


def of_sensor(
    encoders: Encoders, channel: Channel, kind: str, rows: Array, *, calibrates: bool = False
) -> Imperfection:
    """A declared imperfection of an encoder with its effect on the rows per unit; kind: "cosine", "sine", "latency"."""
    sensor, prefix = (encoders.angle, "sensors") if channel == "angle" else (encoders.wheel, "sensors.wheel")
    if kind == "latency":
        return Imperfection(f"{channel} latency", sensor.latency.std or 0.0, rows, 0.0, f"{prefix}.latency", calibrates)
    source, shared_id = f"{channel} encoder nonlinearity ({kind})", f"{prefix}.nonlinearity.{kind}"
    return Imperfection(source, sensor.parts[kind].std or 0.0, rows, 0.0, shared_id, calibrates)


def propagated(found: Iterable[Imperfection], influence: Array, weights: Array | None = None) -> list[Declared]:
    """Effects of imperfections on parameters, of which the inertia is the first (GUM 5.1.3).

    influence (n, rows): of the fit; weights (m, n): of the parameters on its unknowns, where these are not the same.
    """
    slopes = ((item, influence @ item.rows) for item in found)
    return [item.on(own if weights is None else weights @ own) for item, own in slopes]


def imperfections(rig: Rig, signals: Signals, rows: Rows, a11: float, b: float) -> list[Imperfection]:
    """All uncertainties that the rig declares and that these rows depend on, always in the same order.

    a11, b: inertia of the axis and gravity torque, as known or as identified.
    """
    found = [
        *with_rig(rig, constants(rig, rows), exact=False),
        *_encoders(rig, signals, rows, a11, b),
        *_latencies(rig, signals, rows),
        *_stated_scales(rig, signals, rows, a11, b),
        *_level(signals, rows, a11, b),
    ]
    return [item for item in found if item.std > 0]


def sensitivities(rig: Rig, rows: Rows, influence: Array) -> dict[str, float]:
    """Change of J1 per unit of every constant, by its key, exact ones too; influence: row of a11."""
    return {item.source: float(influence @ item.rows) + item.direct for item in constants(rig, rows) if item.constant}


def constants(rig: Rig, rows: Rows) -> Iterator[Imperfection]:
    """The constants of equation (I), exact ones (std 0) too."""

    def known(key: str, quantity: Quantity, effect: Array, direct: float) -> Imperfection:
        return Imperfection(key, quantity.std or 0.0, effect, direct, key, constant=True)

    if rig.drive.wheel is not None:
        along = rig.drive.wheel.along.value
        wheel = along * rows.wheel
        yield known("drive.wheel.inertia", rig.drive.wheel.inertia, -wheel, -along)
        motor = rig.drive.motor
        if motor is not None:
            gear, rotor = motor.gear_ratio, motor.rotor_inertia
            yield known("drive.motor.rotor_inertia", rotor, -gear.value * wheel, -along)
            yield known("drive.motor.gear_ratio", gear, -rotor.value * wheel, 0.0)
        yield wheel_tilt(rig, rows.wheel)
    if rig.drive.kind == "direct":
        gain = rig.log.torque_gain
        yield known("log.torque_gain", gain, rows.torque / gain.value, 0.0)
    motor = rig.drive.motor
    if rig.drive.kind == "motor" and motor is not None:
        nothing, gear, rotor = np.zeros(len(rows.windows)), motor.gear_ratio, motor.rotor_inertia
        yield known("drive.motor.rotor_inertia", rotor, nothing, -(gear.value**2))
        yield known("drive.motor.gear_ratio", gear, nothing, -2 * gear.value * rotor.value)
        for term in motor_terms(rig):
            if term.value is not None:
                yield known(term.term.key, term.value, -rows.further[term.name], 0.0)
    gravity = rig.axis.gravity_torque
    if not isinstance(gravity, str):
        yield known("axis.gravity_torque", gravity, -rig.axis.along.value * rows.gravity, 0.0)
    for term in rig_terms(rig):
        if term.value is not None:
            yield known(term.term.key, term.value, -rows.further[term.name], 0.0)
            if term.shift.std:
                effect = -term.value.value * rows.further[shifted(term.name)]
                yield known(term.term.shift, term.shift, effect, 0.0)


def wheel_tilt(rig: Rig, coupled: Array) -> Imperfection:
    """The tilt of the wheel's axis, as a relative deviation of its cosine; coupled: effect of −a12 per unit."""
    assert rig.drive.wheel is not None
    return Imperfection(
        WHEEL_TILT, relative(rig.drive.wheel.along), -rig.drive.a12 * coupled, -rig.drive.carried, WHEEL_TILT
    )


def relative(quantity: Quantity) -> float:
    """Relative standard uncertainty."""
    return (quantity.std or 0.0) / quantity.value


def with_rig(rig: Rig, found: Iterable[Imperfection], *, exact: bool = True) -> Iterator[Imperfection]:
    """The constants, and what follows from their effects: those of the tilt of the axis and of the log's clock.

    exact: also where these have no uncertainty.
    """
    constants = {item.source: item for item in found}
    yield from constants.values()
    for key, std, weights in rig_deviations(rig, constants):
        if not std and not exact:
            continue
        own = [(weight, constants[source]) for source, weight in weights.items()]
        none = np.zeros(len(next(iter(constants.values())).rows))
        rows = sum((weight * item.rows for weight, item in own), none)
        yield Imperfection(key, std, rows, sum(w * item.direct for w, item in own), key, of_time=key == CLOCK)


def declared_with_rig(rig: Rig, found: Iterable[Declared]) -> Iterator[Declared]:
    """As `with_rig`, where the effects on the parameters are known and there are no rows."""
    constants = {one.source.name: one for one in found}
    yield from constants.values()
    for key, std, weights in rig_deviations(rig, constants):
        own = [weight * constants[source].slopes for source, weight in weights.items()]
        none = np.zeros(len(next(iter(constants.values())).slopes))
        yield Declared(stated(key, key), std, sum(own, none), of_time=key == CLOCK)


_TIME_POWERS = {
    key: power
    for key, power in (
        {one.key: time_power(one.unit) for one in TERMS.values() if one.key} | {"log.torque_gain": -2}
    ).items()
    if power
}
"""Constants whose unit has a power of the time, with it."""


def rig_deviations(rig: Rig, constants: Collection[str]) -> Iterator[tuple[str, float, dict[str, float]]]:
    """The tilt's cosine and the clock: standard uncertainty, and the equivalent change of each of these constants.

    None for no constants.

    A tilt is a relative change of the gravity torque. A clock that is fast by c makes all times too long by that share,
    which is the same as constants with the power n of the time in their unit larger by n c: the gravity torque by
    −2 c. What they cannot change is the unit of the parameters (`Declared.of_time`). The scale of the voltage is a
    relative change of the motor's torque per volt.
    """
    if not constants:
        return
    gravity = rig.axis.gravity_torque
    if isinstance(gravity, Quantity) and gravity.value:
        torque = {"axis.gravity_torque": gravity.value} if "axis.gravity_torque" in constants else {}
        yield AXIS_TILT, relative(rig.axis.along), torque
    values = {key: stated_at(rig, key) for key in _TIME_POWERS if key in constants}
    weights = {key: _TIME_POWERS[key] * value.value for key, value in values.items() if isinstance(value, Quantity)}
    yield CLOCK, rig.log.clock.std or 0.0, weights
    if rig.log.voltage_scale.std and rig.drive.motor is not None:
        key = "drive.motor.torque_per_volt"
        volts = {key: rig.drive.motor.torque_per_volt.value} if key in constants else {}
        yield VOLTAGE_SCALE, relative(rig.log.voltage_scale), volts


def _encoders(rig: Rig, signals: Signals, rows: Rows, a11: float, b: float) -> Iterator[Imperfection]:
    """Once-per-turn nonlinearity, measured = q + α cos q + β sin q, on each encoder.

    Values stated in the rig file were estimated from data, maybe from these, so their uncertainty is propagated and
    they are not fitted again: the data would count twice. So a11 has the variance of the joint fit.
    """
    encoders, driven = signals.encoders, rig.drive.kind == "reaction-wheel"
    axis = axis_bends(signals, rows, a11, b) if encoders.angle.nonlinearity else {}
    wheel = wheel_bends(signals, rows, rig.drive.a12) if encoders.wheel.nonlinearity and driven else {}
    for name, effect in axis.items():
        yield of_sensor(encoders, "angle", name, effect, calibrates=name not in encoders.angle.calibrated)
    for name, effect in wheel.items():
        yield of_sensor(encoders, "wheel", name, effect, calibrates=name not in encoders.wheel.calibrated)


ANGLE_SCALE, ANGLE_OFFSET, WHEEL_SCALE = "log.angle_scale", "log.angle_offset", "log.wheel_scale"
"""Scales (errors are relative) and the zero (rad, m) of the logged angles."""

RATE_SCALE = "log.angle_speed_scale"
"""Scale of a logged rate, and so of its integral."""

OF_THE_ANGLE = (ANGLE_SCALE, RATE_SCALE)


def scale_errors(rig: Rig) -> dict[str, float]:
    """Standard uncertainties that [log] states of the scales (relative) and the zero (rad, m) of the angles."""
    log, wheel = rig.log, rig.drive.kind == "reaction-wheel"
    found = {ANGLE_SCALE: relative(log.angle_scale), ANGLE_OFFSET: log.angle_offset.std or 0.0}
    if log.angle_speed is not None:
        found[RATE_SCALE] = relative(log.angle_speed_scale)
    found |= {WHEEL_SCALE: relative(log.wheel_scale)} if wheel else {}
    return {key: std for key, std in found.items() if std > 0}


def of_scale(key: str, std: float, rows: Array) -> Imperfection:
    """An uncertain scale or zero of a logged angle, with the effect on the rows per unit."""
    return Imperfection(key, std, rows, 0.0, key)


def _stated_scales(rig: Rig, signals: Signals, rows: Rows, a11: float, b: float) -> Iterator[Imperfection]:
    """An angle of which the log shows (1 + ε) q + δ: effects on the rows of ε and of δ."""
    for key, std in scale_errors(rig).items():
        if key == WHEEL_SCALE:
            yield of_scale(key, std, -rig.drive.a12 * rows.wheel)
        else:
            shape = signals.angle if key in OF_THE_ANGLE else np.ones_like(signals.angle)
            yield of_scale(key, std, -angle_error(signals, rows, shape, a11, b))


def _level(signals: Signals, rows: Rows, a11: float, b: float) -> Iterator[Imperfection]:
    """What is left of start, bias and random walk of the integral of a rate: errors of the angle that are slow."""
    level = signals.encoders.level
    if level is None:
        return
    instants = signals.nodes.flat[0].reshape(signals.angle.shape)
    for name, one in level.unknowns(instants).items():
        effect = -angle_error(signals, rows, one.shape, a11, b)
        mean = one.taken / one.std
        yield Imperfection(name, one.std, effect, 0.0, None, calibrates=True, of_noise=True, mean=mean)


def angle_error(signals: Signals, rows: Rows, shape: Array, a11: float, b: float) -> Array:
    """Change of the rows by an error `shape` (rad or m, at the nodes) of the angle, per unit: ∫φ'' a11 s + φ b cos q s.

    That in the terms of friction is a multiple of their own columns where `shape` is the angle, else negligible.
    """
    pull = np.zeros_like(shape) if signals.linear else b * signals.cosine
    if signals.further:
        pull = pull + stated_stiffness(signals.further, signals.angle)
    columns = [(shape, 2), (pull * shape, 0)]
    part = project(signals.nodes, columns, rows.windows.centres, rows.windows.half)
    result: Array = a11 * part[:, 0] + part[:, 1]
    return result


def axis_bends(signals: Signals, rows: Rows, a11: float, b: float) -> dict[str, Array]:
    """Effect on the rows of α = 1 ("cosine") and of β = 1 ("sine") of the axis' encoder; {} for a linear axis."""
    if signals.linear:
        return {}
    shapes = {"cosine": signals.cosine, "sine": signals.sine}
    return {name: -angle_error(signals, rows, shape, a11, b) for name, shape in shapes.items()}


def wheel_bends(signals: Signals, rows: Rows, a12: float) -> dict[str, Array]:
    """The same for the wheel's encoder; {} without a wheel."""
    if signals.wheel is None:
        return {}
    columns = [(np.cos(signals.wheel), 2), (np.sin(signals.wheel), 2)]
    part = project(signals.nodes, columns, rows.windows.centres, rows.windows.half)
    return {name: -a12 * part[:, k] for name, k in (("cosine", 0), ("sine", 1))}


def _latencies(rig: Rig, signals: Signals, rows: Rows) -> Iterator[Imperfection]:
    """A channel read δ later than its stamp shows q + q' δ.

    Inertia, gravity and friction all come from the angle, so an angle that is late is a drive that is early; a free
    decay does not depend on it.
    """
    encoders = signals.encoders
    if signals.wheel_values is not None and (encoders.angle.latency.std or encoders.wheel.latency.std):
        effect = late_channel(signals, rows, rig.drive.a12)
        yield of_sensor(encoders, "angle", "latency", -effect, calibrates=True)
        yield of_sensor(encoders, "wheel", "latency", effect, calibrates=True)
    elif signals.torque is not None and encoders.angle.latency.std:
        yield of_sensor(encoders, "angle", "latency", late_channel(signals, rows, 0.0), calibrates=True)


def late_channel(signals: Signals, rows: Rows, a12: float) -> Array:
    """Effect on the rows, per s, of a wheel read later than the angle, or of an angle later than the torque acts."""
    columns = [(signals.torque, 1)] if signals.torque is not None else []
    if signals.wheel_rate is not None:
        columns = [(-a12 * signals.wheel_rate, 2)]
    effect: Array = project(signals.nodes, columns, rows.windows.centres, rows.windows.half)[:, 0]
    return effect
