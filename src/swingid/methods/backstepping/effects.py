"""Effects of every constant and declared imperfection on the estimate, by finite differences: the adaptation again."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from swingid.balance.perturbations import SHAPES, Perturbation, declared_with_deviations, of_channels
from swingid.model.equation import relative
from swingid.model.parameters import WHEEL_TILT
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.preparation.encoders import Encoders, moved
from swingid.recording.recording import Recording
from swingid.uncertainty.budget import Declared, stated
from swingid.units import Quantity

STEP = 1e-4
"""Relative step of a constant."""

MOTOR_KEYS = ("torque_per_volt", "efficiency", "back_emf", "viscous", "coulomb", "gear_ratio", "rotor_inertia")

Again = Callable[[Recording, Rig], Array]
"""The estimates that another log or another rig gives, over the same part."""


def effects(log: Recording, rig: Rig, encoders: Encoders, again: Again) -> list[Declared]:
    """Effects of all constants that the model contains and of all declared imperfections."""
    plain = again(log, rig)
    found = (
        replace(one, slopes=(again(*changed) - plain) / step) for one, step, changed in _changes(log, rig, encoders)
    )
    return list(declared_with_deviations(rig, found))


def _changes(log: Recording, rig: Rig, encoders: Encoders) -> Iterator[tuple[Declared, float, tuple[Recording, Rig]]]:
    """Sources without their slopes, a step of each, and log and rig with the step taken."""
    for key, quantity in _constants(rig).items():
        step = STEP * abs(quantity.value) or float(quantity.std or 0.0)
        if step == 0.0:
            continue
        source = Declared(stated(key, key), quantity.std or 0.0, np.empty(0), constant=True)
        if key == "log.torque_gain":
            assert log.torque is not None
            yield source, step, (replace(log, torque=log.torque * (1 + step / quantity.value)), rig)
        else:
            yield source, step, (log, rig.changed({key: quantity.value + step}))
    if rig.drive.wheel is not None:
        along = rig.drive.wheel.along
        tilted = rig.changed({WHEEL_TILT: math.acos(along.value * (1 - STEP))})
        yield Declared(stated(WHEEL_TILT, WHEEL_TILT), relative(along), np.empty(0)), -STEP, (log, tilted)
    for one in of_channels(rig, encoders):
        source = Declared(stated(one.source, one.shared_id), one.std, np.empty(0))
        yield source, one.std, (_with_error(log, one), rig)


def _with_error(log: Recording, one: Perturbation) -> Recording:
    """The log whose channel has this error, of one standard deviation."""
    name = "angle" if one.channel == "angle" else "wheel_angle"
    values: Array = getattr(log, name)
    late = one.shape == "latency"
    changed: Any = moved(log.time, values, one.std) if late else values + one.std * SHAPES[one.shape](values)
    channels: dict[str, Any] = {name: changed}
    return replace(log, **channels)


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
