"""What each constant and declared imperfection does to the estimate: the adaptation is run again with it changed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from swingid.model.rig import Rig
from swingid.model.rig.sensors import Sensor
from swingid.numerics.arrays import Array
from swingid.preparation.encoders import Encoders, moved
from swingid.recording.recording import Recording
from swingid.units import Quantity

STEP = 1e-4
"""Relative step of a constant."""

MOTOR_KEYS = ("torque_per_volt", "efficiency", "back_emf", "viscous", "coulomb", "gear_ratio", "rotor_inertia")


@dataclass(frozen=True)
class Effect:
    """Change of every parameter per unit of a source, with the source's standard uncertainty (0: exact).

    constant: whether the source is a constant of the rig, not a sensor.
    """

    source: str
    std: float
    shared_id: str
    slopes: dict[str, float]
    constant: bool


Estimates = dict[str, float]
Again = Callable[[Recording, Rig], Estimates]
"""The estimates that another log or another rig gives, over the same part."""


def effects(log: Recording, rig: Rig, encoders: Encoders, again: Again) -> list[Effect]:
    """Effects of all constants that the model uses and of all declared imperfections, by differences."""
    plain = again(log, rig)
    found, constants = [], _constants(rig)
    for source, std, shared, step, changed_log, changed_rig in _changes(log, rig, encoders):
        changed = again(changed_log, changed_rig)
        slopes = {name: (changed[name] - value) / step for name, value in plain.items()}
        found.append(Effect(source, std, shared, slopes, constant=shared in constants))
    return found


Change = tuple[str, float, str, float, Recording, Rig]
"""Source, its standard uncertainty, shared id, step, log and rig with the step taken."""


def _changes(log: Recording, rig: Rig, encoders: Encoders) -> Iterator[Change]:
    for key, quantity in _constants(rig).items():
        step = STEP * abs(quantity.value) or float(quantity.std or 0.0)
        if step == 0.0:
            continue
        if key == "log.torque_gain":
            assert log.torque is not None
            changed = replace(log, torque=log.torque * (1 + step / quantity.value))
            yield key, quantity.std or 0.0, key, step, changed, rig
        else:
            yield key, quantity.std or 0.0, key, step, log, rig.changed({key: quantity.value + step})
    yield from _of_sensor(log, rig, encoders.angle, "angle")
    if log.wheel_angle is not None:
        yield from _of_sensor(log, rig, encoders.wheel, "wheel")


def _constants(rig: Rig) -> dict[str, Quantity]:
    gravity = rig.axis.gravity_torque
    assert not isinstance(gravity, str)
    found = {"axis.gravity_torque": gravity}
    if rig.drive.kind == "direct":
        return found | {"log.torque_gain": rig.log.torque_gain}
    if rig.drive.kind != "reaction-wheel":
        return found
    assert rig.drive.wheel is not None
    found["drive.wheel.inertia"] = rig.drive.wheel.inertia
    return found | {f"drive.motor.{key}": getattr(rig.drive.motor, key) for key in MOTOR_KEYS}


def _of_sensor(log: Recording, rig: Rig, sensor: Sensor, name: str) -> Iterator[Change]:
    """Once-per-turn nonlinearity q + α cos q + β sin q, and latency, of one encoder; only what is declared."""
    values = log.angle if name == "angle" else log.wheel_angle
    assert values is not None
    prefix = "sensors" if name == "angle" else "sensors.wheel"

    def with_values(changed: Array) -> Recording:
        return replace(log, angle=changed) if name == "angle" else replace(log, wheel_angle=changed)

    for part, shape in (("cosine", np.cos), ("sine", np.sin)):
        if step := sensor.parts[part].std:
            source, shared = f"{name} encoder nonlinearity ({part})", f"{prefix}.nonlinearity.{part}"
            yield source, step, shared, step, with_values(values + step * shape(values)), rig
    if sensor.latency.std:
        late = with_values(moved(log.time, values, float(sensor.latency.std)))
        yield f"{name} latency", sensor.latency.std, f"{prefix}.latency", sensor.latency.std, late, rig
