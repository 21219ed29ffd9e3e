"""A smoothed speed from a measured angle: local cubics, as wide as the motion allows."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from swingid.numerics.arrays import Array, median
from swingid.numerics.quadrature import GaussNodes
from swingid.numerics.spline import Samples, spline_at, spline_slopes

NARROWEST = 3.5
"""Half-width of the narrowest local cubic in sample steps."""

NOISES = 14.0
"""Standard deviations of noise at the mean speed that the narrowest local cubic spans: of an encoder (step/√12) four
steps, from which on its errors are nearly independent."""

EDGE = 0.1
"""Of the half-width: how far into a gap a speed is evaluated."""

WIDER = 1.4
"""Factor from one half-width to the next."""


SHARE = 0.7
"""Of the half-width that is best for one speed: over the nodes of all swings noise averages out, bias does not."""

SPACING = 1.5
"""Places per half-width at which speeds are computed; a spline runs through them."""


@dataclass(frozen=True)
class Speed:
    """Smoothed speed of the axis on a grid of instants (s), with the noise of its values (rad/s or m/s).

    The half-width of the local cubic is the largest for which the speeds change by noise only (Lepski's principle), so
    it adapts to sensor and motion.
    """

    grid: Array
    angle: Array
    speed: Array
    half_width: float
    noise: float

    def at(self, instants: Array) -> Array:
        """Speed at rising `instants`, by a cubic spline over the grid."""
        return spline_at(self.grid, self.speed, self._speed_slopes, instants, 0)

    def angle_at(self, instants: Array) -> Array:
        """Smoothed angle at rising `instants`."""
        return spline_at(self.grid, self.angle, self._angle_slopes, instants, 0)

    def acceleration(self, instants: Array) -> Array:
        """Slope of the speed at rising `instants`."""
        return spline_at(self.grid, self.speed, self._speed_slopes, instants, 1)

    def at_nodes(self, nodes: GaussNodes) -> Array:
        """Speed at Gauss nodes, shape (n−1, points)."""
        instants = nodes.instants
        return self.at(instants.ravel()).reshape(instants.shape)

    @property
    def angle_noise(self) -> float:
        """Standard deviation of a smoothed angle by white noise: (9/4) σ²/n in the middle of a cubic over n samples."""
        return float(np.sqrt(0.12) * self.noise * self.half_width)

    @cached_property
    def _speed_slopes(self) -> Array:
        return spline_slopes(self.grid, self.speed)

    @cached_property
    def _angle_slopes(self) -> Array:
        return spline_slopes(self.grid, self.angle)


def smooth_speed(time: Array, angle: Array, noise: float, *, spacing: float = 3.0, share: float = 1.0) -> Speed:
    """Smoothed speed of `angle` (n samples at irregular `time`), `noise` its standard deviation per sample.

    spacing: places of the grid per half-width; fewer cost less, a spline runs through them either way. share: of the
    half-width found, to use; less than 1 where noise averages out later and bias does not.

    The narrowest width also spans `NOISES` standard deviations of noise at the mean speed.
    """
    least = narrowest(time, angle, noise)
    # the search uses some places of the log, the speed itself is computed everywhere
    places = np.linspace(time[0] + least, time[-1] - least, 80)
    samples = Samples(time, angle)
    width = _widest(samples, places, least, (time[-1] - time[0]) / 8, float(noise), typical_step(time))
    return speed_on_grid(time, angle, noise, max(width * share, least), spacing, samples)


def _widest(samples: Samples, places: Array, width: float, longest: float, noise: float, step: float) -> float:
    """Half-width below `longest` (s), from `width` on, up to which the speeds at `places` change by noise only."""
    speeds = samples.cubics(places, width)[:, 1]
    least = 1e-9 * float(np.nanmax(np.abs(speeds), initial=0.0))
    while width * WIDER < longest:
        wider = samples.cubics(places, width * WIDER)[:, 1]
        changes = wider - speeds
        changes = changes[np.isfinite(changes)]
        if len(changes) == 0 or np.sqrt(changes @ changes / len(changes)) > 1.3 * max(
            _slope_noise(noise, step, width), least
        ):
            break
        width, speeds = width * WIDER, wider
    return width


def typical_step(time: Array) -> float:
    """Median step between the stamps, of two hundred steps where there are more."""
    every = max(1, (len(time) - 1) // 200)
    return median(time[1::every] - time[:-1:every])


def narrowest(time: Array, angle: Array, noise: float) -> float:
    """Least half-width (s) of a local cubic: some sample steps, and some steps of the encoder."""
    step = typical_step(time)
    duration = float(time[-1] - time[0])
    mean_speed = float(np.abs(np.diff(angle[:: max(1, len(angle) // 2000)])).sum()) / duration
    return max(NARROWEST * step, min(NOISES * noise / max(mean_speed, 1e-300), duration / 100))


def narrowed(speed: Speed, time: Array, angle: Array, noise: float) -> Speed:
    """The speed of the axis again, over `SHARE` of the half-width."""
    width = max(SHARE * speed.half_width, narrowest(time, angle, noise))
    return speed_on_grid(time, angle, noise, width, SPACING)


def speed_on_grid(
    time: Array, angle: Array, noise: float, width: float, spacing: float, samples: Samples | None = None
) -> Speed:
    """Speed by local cubics of half-width `width` (s) on a grid of `spacing` places per half-width.

    Widths below those of five samples are widened to them. samples: time and angle, where they are smoothed before.
    """
    step = typical_step(time)
    width = max(width, NARROWEST * step)
    grid = np.linspace(time[0], time[-1], max(int(np.ceil((time[-1] - time[0]) / (width / spacing))), 4) + 1)
    fitted = (samples or Samples(time, angle)).cubics(grid, width)
    reached = np.isfinite(fitted[:, 0])
    # inside a gap a cubic extrapolates
    for k in np.flatnonzero(np.diff(time) > width):
        reached &= (grid <= time[k] + EDGE * width) | (grid >= time[k + 1] - EDGE * width)
    angles, slopes = np.ascontiguousarray(fitted[reached, 0]), np.ascontiguousarray(fitted[reached, 1])
    return Speed(grid[reached], angles, slopes, width, _slope_noise(float(noise), step, width))


def _slope_noise(noise: float, step: float, width: float) -> float:
    """Standard deviation of the slope of a cubic fitted to 2w/h samples of white noise: 18.75 σ²/(n w²)."""
    return float(noise * np.sqrt(9.375 * step / width**3))
