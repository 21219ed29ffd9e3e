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
    declared = (error.on((again(*changed) - plain) / step) for error, step, changed in changes)
    return list(declared_with_deviations(rig, declared))


Change = tuple[Perturbation, float, tuple[Recording, Rig]]
"""A perturbation, a step of it, and log and rig with the step taken."""


def _of_constants(log: Recording, rig: Rig, equation: Equation) -> Iterator[Change]:
    for constant in of_constants(of_energy(rig, equation)):
        stated = stated_at(rig, constant.source)
        if constant.source == WHEEL_TILT and rig.drive.wheel is not None:
            yield constant, -STEP, (log, rig.changed({WHEEL_TILT: math.acos(rig.drive.wheel.along.value * (1 - STEP))}))
        if not constant.constant or not isinstance(stated, Quantity):
            continue  # what is a deviation of several follows from those
        step = STEP * abs(stated.value) or constant.std
        if constant.source == "log.torque_gain" and log.torque is not None:
            yield constant, step, (replace(log, torque=log.torque * (1 + step / stated.value)), rig)
        elif step:
            yield constant, step, (log, rig.changed({constant.source: stated.value + step}))


def _of_channels(log: Recording, rig: Rig, encoders: Encoders) -> Iterator[Change]:
    """Errors of one standard deviation of the channels."""
    for error in of_channels(rig, encoders):
        name = "angle" if error.channel == "angle" else "wheel_angle"
        values: Array = getattr(log, name)
        late = error.shape == "latency"
        changed: dict[str, Any] = {
            name: moved(log.time, values, error.std) if late else values + error.std * SHAPES[error.shape](values)
        }
        yield error, error.std, (replace(log, **changed), rig)
