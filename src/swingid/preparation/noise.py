"""Noise, sample step and resolution of the channels of a log, as declared or as estimated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swingid.model.rig import Rig
from swingid.numerics.arrays import Array, median
from swingid.numerics.compiled import njit
from swingid.preparation.motion import grid_step, sample_noise
from swingid.recording.recording import Recording

EVEN = 1e-6
"""Relative differences of the steps below which stamps count as evenly spaced."""


@dataclass(frozen=True)
class Noise:
    """Standard deviations of one sample of the angle and of the wheel angle, the sample step in s, and their grids."""

    angle: float
    wheel: float
    step: float
    resolution: float = 0.0
    wheel_resolution: float = 0.0


def channel_noise(log: Recording, rig: Rig) -> Noise:
    """Noise and grid of the channels: declared by the rig or estimated from the samples, whichever is larger.

    Where each row is the mean of n rows of the log, the declared white noise is smaller by √n, and a grid found in the
    means is n times as wide in the rows.
    """
    levels, grids = [], []
    rows = log.averaged
    steps = np.diff(log.time)
    even = bool(np.ptp(steps) <= EVEN * steps[0]) if len(steps) else True
    for sensor, values in ((rig.sensors.of("angle"), log.angle), (rig.sensors.of("wheel"), log.wheel_angle)):
        declared = float(np.hypot(sensor.noise, sensor.resolution / np.sqrt(12)) / np.sqrt(rows))
        seen, grid = 0.0, 0.0
        if values is not None:
            grid = grid_step(values)
            white = sample_noise(values) if even else uneven_noise(log.time, values)
            seen = max(white, np.sqrt(rows / 12) * grid)
        levels.append(max(declared, seen))
        grids.append(max(sensor.resolution, rows * grid))
    return Noise(levels[0], levels[1], 1 / log.rate, grids[0], grids[1])


def uneven_noise(time: Array, values: Array) -> float:
    """Standard deviation of white noise in a smooth signal at uneven stamps, from divided differences (robust).

    Plain differences, as in `sample_noise`, would include the unevenness of the stamps.
    """
    if len(values) < 20:
        return 0.0
    return median(np.abs(_sixth_differences(time, values))) / 0.6745


@njit
def _sixth_differences(time: Array, values: Array) -> Array:
    """Sums over seven neighbours that vanish for polynomials up to degree five, with weights of unit length."""
    result = np.empty(len(time) - 6)
    weights = np.empty(7)
    for k in range(len(result)):
        unit = time[k + 6] - time[k]
        power, total = 0.0, 0.0
        for j in range(7):
            product = 1.0
            for i in range(7):
                if i != j:
                    product *= (time[k + j] - time[k + i]) / unit
            weights[j] = 1.0 / product
            power += weights[j] ** 2
            total += weights[j] * (values[k + j] - values[k])
        result[k] = total / np.sqrt(power)
    return result
