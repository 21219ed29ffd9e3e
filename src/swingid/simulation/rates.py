"""Gyroscopes and tachometers of the twin: rates of its true motion, with bias, noise, steps and limit of the sensor.

They are made of the motion that the loop has simulated; the loop itself reads encoders.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from swingid.model.integrator import Q1, Q2, V1, V2
from swingid.recording.rates import integral, rate_of, without_line
from swingid.simulation.draws import stream

if TYPE_CHECKING:
    from swingid.model.rig import Rig
    from swingid.model.rig.sensors import RateSensor
    from swingid.numerics.arrays import Array, Bools, Ints
    from swingid.recording.recording import Recording


def with_rates(log: Recording, rig: Rig, seed: int, seen: Array, places: Ints, kept: Bools) -> Recording:
    """The recording with the rate of the axis where the rig logs one, that of the wheel where it has a sensor of it.

    seen: true states; places: of those at the readings of both encoders, all rows; kept: rows that reach the log. Each
    sensor's bias is drawn by its uncertainty. The angle is the integral, as a log with a rate alone gives it.
    """
    conventions, rows = rig.log, len(kept)
    changes: dict[str, Any] = {}
    axis, wheel = seen[places[:rows]][kept], seen[places[rows : 2 * rows]][kept]
    truth = dict(log.metadata.get("truth", {}))  # type: ignore[call-overload]
    generators = stream(seed, "rates").spawn(2)
    if conventions.angle_speed is not None:
        true = axis[:, V1] if conventions.angle_speed_is == "instant" else _means(log, axis[:, Q1], rig, "angle")
        rate, truth["angle_speed_bias"] = _read(true, rig.sensors.of_rate("angle"), generators[0])
        changes["angle_speed"] = rate
        if conventions.has_rate_alone:
            changes["angle"] = without_line(log.time, integral(log.time, rate, conventions.angle_speed_is))
    if rig.sensors.wheel_speed is not None and log.wheel_angle is not None:
        absolute = conventions.wheel_angle_is == "absolute"
        speed, angle = (wheel[:, V2] + axis[:, V1], wheel[:, Q2] + axis[:, Q1]) if absolute else wheel[:, [V2, Q2]].T
        true = speed if conventions.wheel_speed_is == "instant" else _means(log, angle, rig, "wheel")
        rate, truth["wheel_speed_bias"] = _read(true, rig.sensors.of_rate("wheel"), generators[1])
        turned = integral(log.time, rate, conventions.wheel_speed_is)
        changes |= {
            "wheel_speed": rate,
            "wheel_angle": turned - changes.get("angle", log.angle) if absolute else turned,
        }
    return replace(log, metadata={**log.metadata, "truth": truth}, **changes) if changes else log


def _means(log: Recording, angle: Array, rig: Rig, channel: str) -> Array:
    """Means of the true rate between rows."""
    return rate_of(log.time, angle, rig.log.angle_speed_is if channel == "angle" else rig.log.wheel_speed_is)


def _read(true: Array, sensor: RateSensor, generator: np.random.Generator) -> tuple[Array, float]:
    """What the sensor reads of a true rate, and its bias."""
    bias = sensor.bias.value + (sensor.bias.std or 0.0) * float(generator.standard_normal())
    read = true + bias + sensor.noise * generator.standard_normal(len(true))
    if sensor.resolution > 0:
        read = sensor.resolution * np.rint(read / sensor.resolution)
    return np.clip(read, -sensor.range, sensor.range), bias
