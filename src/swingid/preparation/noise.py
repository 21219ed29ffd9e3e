"""Noise, sample step and resolution of the channels of a log, as declared or as estimated."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from swingid.model.rig import Rig
from swingid.model.rig.sensors import RateSensor
from swingid.numerics.arrays import Array, median
from swingid.preparation.motion import grid_step, sample_noise
from swingid.recording.recording import Recording

EVEN = 1e-6
"""Relative differences of the steps below which stamps count as evenly spaced."""


@dataclass(frozen=True)
class Noise:
    """Standard deviations of one sample of the angle and of the wheel angle, the sample step in s, and their grids.

    rate, wheel_rate: of one sample of the rate (rad/s) of which the angle is the integral, 0 where it was measured. Its
    white noise is a random walk of the angle, whose `angle` (`wheel`) then is that of white noise which is as large in
    the speeds of this motion (`equivalent`).
    """

    angle: float
    wheel: float
    step: float
    resolution: float = 0.0
    wheel_resolution: float = 0.0
    rate: float = 0.0
    wheel_rate: float = 0.0

    @property
    def of_angle(self) -> float:
        """White noise of the angle itself: none where its rate was measured."""
        return 0.0 if self.rate else self.angle

    @property
    def of_wheel(self) -> float:
        """White noise of the wheel's angle itself."""
        return 0.0 if self.wheel_rate else self.wheel


SPAN = 1 / 3
"""Half-width of a local cubic that smooths a speed, in the time 1/ω of the motion: of a sine of amplitude 1 it biases
speeds by 4e-5."""


def equivalent(angle: Array, rate: Array, noise: float) -> float:
    """White noise of an angle (rad) with that slope noise of a local cubic that white `noise` of its rate (rad/s) has.

    The slope of a cubic over ±w has the variance 9.375 σ² h/w³ by white noise of the angle, and 1.25 σ_r² h/w by that
    of the rate, for its weights are the derivative of a kernel K with ∫K² = 1.25/w. w is `SPAN` of the ratio of angle
    and rate, which for a sine is 1/ω.
    """
    width = SPAN * float(np.std(angle)) / max(float(np.std(rate)), 1e-300)
    return noise * width * float(np.sqrt(1.25 / 9.375))


def channel_noise(log: Recording, rig: Rig) -> Noise:
    """Noise and grid of the channels: declared by the rig or estimated from the samples, whichever is larger.

    Where each row is the mean of n rows of the log, the declared white noise is smaller by √n, and a grid found in the
    means is n times as wide in the rows.
    """
    levels, grids, rates = [], [], []
    rows = log.averaged
    steps = np.diff(log.time)
    even = bool(np.ptp(steps) <= EVEN * steps[0]) if len(steps) else True
    channels: tuple[tuple[Literal["angle", "wheel"], Array | None, Array | None], ...]
    channels = ("angle", log.angle, log.angle_speed), ("wheel", log.wheel_angle, log.wheel_speed)
    for channel, values, rate in channels:
        sensor = rig.sensors.of(channel)
        if values is not None and rate is not None:
            rates.append(_rate_noise(log.time, rate, rig.sensors.of_rate(channel), even=even))
            levels.append(equivalent(values, rate, rates[-1]))
            grids.append(0.0)
            continue
        declared = float(np.hypot(sensor.noise, sensor.resolution / np.sqrt(12)) / np.sqrt(rows))
        seen, grid = 0.0, 0.0
        if values is not None:
            grid = grid_step(values)
            white = sample_noise(values) if even else uneven_noise(log.time, values)
            seen = max(white, np.sqrt(rows / 12) * grid)
        rates.append(0.0)
        levels.append(max(declared, seen))
        grids.append(max(sensor.resolution, rows * grid))
    return Noise(levels[0], levels[1], 1 / log.rate, grids[0], grids[1], rates[0], rates[1])


def _rate_noise(time: Array, rate: Array, sensor: RateSensor, *, even: bool) -> float:
    """Standard deviation of one sample of a rate: declared or estimated, whichever is larger."""
    white = sample_noise(rate) if even else uneven_noise(time, rate)
    declared = float(np.hypot(sensor.noise, sensor.resolution / np.sqrt(12)))
    return float(max(declared, white, grid_step(rate) / np.sqrt(12)))


def uneven_noise(time: Array, values: Array) -> float:
    """Standard deviation of white noise in a smooth signal at uneven stamps, from divided differences (robust).

    Plain differences, as in `sample_noise`, would include the unevenness of the stamps.
    """
    if len(values) < 20:
        return 0.0
    return median(np.abs(_sixth_differences(time, values))) / 0.6745


def _sixth_differences(time: Array, values: Array) -> Array:
    """Sums over seven neighbours that vanish for polynomials up to degree five, with weights of unit length."""
    count = len(time) - 6
    unit = time[6:] - time[:-6]
    places = [(time[j : j + count] - time[:count]) / unit for j in range(7)]
    total, power = np.zeros(count), np.zeros(count)
    for j, place in enumerate(places):
        product = np.ones(count)
        for i, other in enumerate(places):
            if i != j:
                product *= place - other
        total += (values[j : j + count] - values[:count]) / product
        power += 1.0 / product**2
    result: Array = total / np.sqrt(power)
    return result
