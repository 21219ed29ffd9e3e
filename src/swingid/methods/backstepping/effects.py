"""Effects of every constant and declared imperfection on the estimate, by finite differences: the adaptation again."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

from swingid.balance.energies import of_energy
from swingid.balance.perturbations import SHAPES, Perturbation, declared_with_deviations, of_channels, of_constants
from swingid.model.equation import Equation
from swingid.model.parameters import WHEEL_TILT
from swingid.model.rig import Rig
from swingid.model.terms import stated_at
from swingid.numerics.arrays import Array
from swingid.preparation.encoders import Encoders, moved
from swingid.recording.recording import Recording
from swingid.uncertainty.budget import Declared
from swingid.units import Quantity

STEP = 1e-4
"""Relative step of a constant."""

Again = Callable[[Recording, Rig], Array]
"""The estimates that another log or another rig gives, over the same part."""


def effects(log: Recording, rig: Rig, equation: Equation, encoders: Encoders, again: Again) -> list[Declared]:
    """Effects of all constants that the model contains and of all declared imperfections."""
    plain = again(log, rig)
    changes = [*_of_constants(log, rig, equation), *_of_channels(log, rig, encoders)]
    found = (one.on((again(*changed) - plain) / step) for one, step, changed in changes)
    return list(declared_with_deviations(rig, found))


Change = tuple[Perturbation, float, tuple[Recording, Rig]]
"""A perturbation, a step of it, and log and rig with the step taken."""


def _of_constants(log: Recording, rig: Rig, equation: Equation) -> Iterator[Change]:
    for one in of_constants(of_energy(rig, equation)):
        stated = stated_at(rig, one.source)
        if one.source == WHEEL_TILT and rig.drive.wheel is not None:
            yield one, -STEP, (log, rig.changed({WHEEL_TILT: math.acos(rig.drive.wheel.along.value * (1 - STEP))}))
        if not one.constant or not isinstance(stated, Quantity):
            continue  # what is a deviation of several follows from those
        step = STEP * abs(stated.value) or one.std
        if one.source == "log.torque_gain" and log.torque is not None:
            yield one, step, (replace(log, torque=log.torque * (1 + step / stated.value)), rig)
        elif step:
            yield one, step, (log, rig.changed({one.source: stated.value + step}))


def _of_channels(log: Recording, rig: Rig, encoders: Encoders) -> Iterator[Change]:
    """Errors of one standard deviation of the channels."""
    for one in of_channels(rig, encoders):
        name = "angle" if one.channel == "angle" else "wheel_angle"
        values: Array = getattr(log, name)
        late = one.shape == "latency"
        changed: dict[str, Any] = {
            name: moved(log.time, values, one.std) if late else values + one.std * SHAPES[one.shape](values)
        }
        yield one, one.std, (replace(log, **changed), rig)
