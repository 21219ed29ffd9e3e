"""What rig.toml declares as uncertain, each as a perturbation of the rows of the balance.

A constant that is off by δ changes every row by ρ δ; the linear fit passes that on as K ρ δ. This gives the
sensitivity of every identified parameter to every declared imperfection, without a second fit (GUM, type B).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from swingid.balance.rows import Rows, Signals, shifted
from swingid.model.rig import Rig
from swingid.model.rig.sensors import Sensor
from swingid.model.terms import rig_terms, stated_stiffness
from swingid.numerics.arrays import Array
from swingid.numerics.test_functions import project
from swingid.units import Quantity


@dataclass(frozen=True)
class Imperfection:
    """A declared uncertainty: standard deviation, its effect ρ on the rows per unit, and on J1 directly per unit.

    shared_id names the physical constant. calibrates: whether a fit may find the value in the data. constant: whether
    it is a constant of the model, not an imperfection of a sensor.
    """

    source: str
    std: float
    rows: Array
    direct: float
    shared_id: str | None
    calibrates: bool = False
    constant: bool = False


def imperfections(rig: Rig, signals: Signals, rows: Rows, a11: float, b: float) -> list[Imperfection]:
    """All uncertainties that the rig declares and that these rows feel, always in the same order.

    a11, b: inertia of the axis and gravity torque, as known or as identified.
    """
    found = [*constants(rig, rows), *_encoders(rig, signals, rows, a11, b), *_latencies(rig, signals, rows)]
    return [item for item in found if item.std > 0]


def sensitivities(rig: Rig, rows: Rows, influence: Array) -> dict[str, float]:
    """Change of J1 per unit of every constant, by its key, exact ones too; influence: row of a11."""
    return {item.source: float(influence @ item.rows) + item.direct for item in constants(rig, rows)}


def constants(rig: Rig, rows: Rows) -> Iterator[Imperfection]:
    """The constants of row (I), exact ones (std 0) too."""

    def known(key: str, quantity: Quantity, effect: Array, direct: float) -> Imperfection:
        return Imperfection(key, quantity.std or 0.0, effect, direct, key, constant=True)

    if rig.drive.wheel is not None:
        yield known("drive.wheel.inertia", rig.drive.wheel.inertia, -rows.wheel, -1.0)
        motor = rig.drive.motor
        if motor is not None:
            gear, rotor = motor.gear_ratio, motor.rotor_inertia
            yield known("drive.motor.rotor_inertia", rotor, -gear.value * rows.wheel, -1.0)
            yield known("drive.motor.gear_ratio", gear, -rotor.value * rows.wheel, 0.0)
    if rig.drive.kind == "direct":
        gain = rig.log.torque_gain
        yield known("log.torque_gain", gain, rows.torque / gain.value, 0.0)
    gravity = rig.axis.gravity_torque
    if not isinstance(gravity, str):
        yield known("axis.gravity_torque", gravity, -rows.gravity, 0.0)
    for term in rig_terms(rig):
        if term.value is not None:
            yield known(term.term.key, term.value, -rows.further[term.name], 0.0)
            if term.shift.std:
                effect = -term.value.value * rows.further[shifted(term.name)]
                yield known(term.term.shift, term.shift, effect, 0.0)


def _encoders(rig: Rig, signals: Signals, rows: Rows, a11: float, b: float) -> Iterator[Imperfection]:
    """Once-per-turn nonlinearity, measured = q + α cos q + β sin q, on each encoder.

    What the rig file states of it was found in data, maybe in these, and is passed on: to find it again would count
    them twice. Fitted at the joint estimate and passed on, a11 has the variance of the joint fit.
    """
    axis, wheel = signals.encoders.angle, signals.encoders.wheel
    if axis.nonlinearity:
        yield from _bent(axis, axis_bends(signals, rows, a11, b), "angle", "sensors.nonlinearity")
    if wheel.nonlinearity and rig.drive.kind == "reaction-wheel":
        yield from _bent(wheel, wheel_bends(signals, rows, rig.drive.a12), "wheel", "sensors.wheel.nonlinearity")


def _bent(sensor: Sensor, bends: dict[str, Array], which: str, key: str) -> Iterator[Imperfection]:
    for name, effect in bends.items():
        std, free = sensor.parts[name].std or 0.0, name not in sensor.calibrated
        yield Imperfection(f"{which} encoder nonlinearity ({name})", std, effect, 0.0, f"{key}.{name}", free)


def axis_bends(signals: Signals, rows: Rows, a11: float, b: float) -> dict[str, Array]:
    """Effect on the rows of α = 1 ("cosine") and of β = 1 ("sine") of the axis' encoder; none on a linear axis."""
    if signals.linear:
        return {}
    cosine, sine = signals.cosine, signals.sine
    columns = [(cosine, 2), (cosine * cosine, 0), (sine, 2), (sine * cosine, 0)]
    part = project(signals.nodes, columns, rows.windows.centres, rows.windows.half)
    bends = {name: -(a11 * part[:, k] + b * part[:, k + 1]) for name, k in (("cosine", 0), ("sine", 2))}
    if signals.further:
        pull = stated_stiffness(signals.further, signals.angle)
        columns = [(pull * cosine, 0), (pull * sine, 0)]
        part = project(signals.nodes, columns, rows.windows.centres, rows.windows.half)
        bends = {name: bend - part[:, k] for k, (name, bend) in enumerate(bends.items())}
    return bends


def wheel_bends(signals: Signals, rows: Rows, a12: float) -> dict[str, Array]:
    """The same of the wheel's encoder; none without a wheel."""
    if signals.wheel is None:
        return {}
    columns = [(np.cos(signals.wheel), 2), (np.sin(signals.wheel), 2)]
    part = project(signals.nodes, columns, rows.windows.centres, rows.windows.half)
    return {name: -a12 * part[:, k] for name, k in (("cosine", 0), ("sine", 1))}


def _latencies(rig: Rig, signals: Signals, rows: Rows) -> Iterator[Imperfection]:
    """A channel read δ later than its stamp shows q + q' δ.

    Inertia, gravity and friction all come from the angle, so an angle that is late is a drive that is early; a free
    decay feels nothing of it.
    """
    std = signals.encoders.angle.latency.std or 0.0
    wheel = signals.encoders.wheel.latency.std or 0.0
    if signals.wheel_values is not None and (std > 0 or wheel > 0):
        effect = late_channel(signals, rows, rig.drive.a12)
        yield Imperfection("angle latency", std, -effect, 0.0, "sensors.latency", True)
        yield Imperfection("wheel latency", wheel, effect, 0.0, "sensors.wheel.latency", True)
    elif signals.torque is not None and std > 0:
        yield Imperfection("angle latency", std, late_channel(signals, rows, 0.0), 0.0, "sensors.latency", True)


def late_channel(signals: Signals, rows: Rows, a12: float) -> Array:
    """Effect on the rows, per s, of a wheel read later than the angle, or of an angle later than the torque acts."""
    columns = [(signals.torque, 1)] if signals.torque is not None else []
    if signals.wheel_rate is not None:
        columns = [(-a12 * signals.wheel_rate, 2)]
    effect: Array = project(signals.nodes, columns, rows.windows.centres, rows.windows.half)[:, 0]
    return effect
