"""What the channels of a log are worth: noise, step and grid, as declared or as seen."""

from __future__ import annotations

import numpy as np

from swingid.identify.fits import Noise
from swingid.identify.motion import grid_step, sample_noise
from swingid.model.rig import Rig
from swingid.recording.recording import Recording


def channel_noise(log: Recording, rig: Rig) -> Noise:
    """Noise and grid of the channels: what the rig declares or what the samples show, whichever is more."""
    levels = []
    grid = max(rig.sensors.of("angle").resolution, grid_step(log.angle))
    for sensor, values in ((rig.sensors.of("angle"), log.angle), (rig.sensors.of("wheel"), log.wheel_angle)):
        declared = float(np.hypot(sensor.noise, sensor.resolution / np.sqrt(12)))
        seen = 0.0 if values is None else max(sample_noise(values), grid_step(values) / np.sqrt(12))
        levels.append(max(declared, seen))
    return Noise(levels[0], levels[1], 1 / log.rate, grid)
