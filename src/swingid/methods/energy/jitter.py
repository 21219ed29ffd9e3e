"""Jitter of the sampling instants, from the noise that grows with the speed.

A row read δ late shows q + q' δ. So the noise of a channel is σ0² + σj² q'², with the same σj (s) in every channel. For
energies this has two effects. The width of the smoothing depends on the noise, whose median, which is used elsewhere,
is then two thirds of its root mean square. And a control loop that acts on such readings makes a voltage that is
correlated with δ, and so with the error of the wheel's turn in the same row: work over the measured turn is biased.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from swingid.numerics.arrays import Array, Bools, Ints, median
from swingid.numerics.regression import fit_linear
from swingid.preparation.motion import DIFFERENCES, sixth_differences
from swingid.preparation.noise import EVEN, Noise
from swingid.recording.recording import Recording
from swingid.result.checked import Checked, noted, warned
from swingid.result.result import Message, Parameter
from swingid.uncertainty.significance import CERTAIN

CLASSES = 8
"""Classes of speed in which the noise is evaluated."""

STEPS_PER_ROW = 2.0
"""Steps of an encoder's grid per row below which the noise of rounding depends on the speed as well."""

LOUDER = 1.1
"""Ratio of the root mean square of the noise to its median estimate, above which jitter is significant."""

AT_REST = 1e-9
"""Ratio to the largest class' noise below which the body of a class is at rest on one step of its encoder."""


@dataclass(frozen=True)
class Jitter:
    """Standard deviation of the sampling instants (s; 0: not significant), and the noise of the channels with it."""

    spread: float
    noise: Noise

    def words(self, inertia: Parameter, measured: float, unit: str) -> Checked:
        """A warning where work over the measured turn gives another inertia, else a note that the rows jitter.

        unit: of the inertia in a sentence.
        """
        low, high = inertia.interval95 or (-np.inf, np.inf)
        text = f"the sampling instants have a jitter of {1e3 * self.spread:.2g} ms (noise that grows with the speed); "
        text += "the work was computed over the smoothed turn of the drive"
        if low <= measured <= high:
            return noted(Message("jitter", f"{text}."))
        text += f", over the measured one the inertia would be {measured:.5g} {unit}; read both encoders at "
        return warned(Message("jitter-matters", f"{text}even instants, or use the momentum method."))


def find_jitter(log: Recording, noise: Noise) -> Jitter:
    """The jitter of a log and its noise, which is `noise` without significant jitter.

    Evaluated where seven rows follow each other evenly: uneven stamps were recorded as they are.
    """
    steps = np.diff(log.time)
    step = median(steps)
    even = _even_stretches(steps, step)
    if np.count_nonzero(even) < 50 * CLASSES:
        return Jitter(0.0, noise)
    rows = np.nonzero(even)[0]
    rows = rows[:: max(1, len(rows) // DIFFERENCES)]
    angle = _of_channel(log.angle, rows, step, noise.angle, noise.resolution)
    wheel = (0.0, noise.wheel)
    if log.wheel_angle is not None:
        wheel = _of_channel(log.wheel_angle, rows, step, noise.wheel, noise.wheel_resolution)
    # of two channels the wheel is faster and has more information
    return Jitter(wheel[0] or angle[0], replace(noise, angle=angle[1], wheel=wheel[1]))


def _even_stretches(steps: Array, step: float) -> Bools:
    """Return whether the six steps from each row on are the typical one."""
    odd = np.concatenate([[0], np.cumsum(np.abs(steps - step) > EVEN * step)])
    result: Bools = odd[6:] == odd[:-6]
    return result


def _of_channel(values: Array, rows: Ints, step: float, level: float, resolution: float) -> tuple[float, float]:
    """Jitter (s) of a channel and the root mean square of its noise; (0, level) where it is not significant."""
    seven = [values[rows + k] for k in range(7)]
    speed = (seven[6] - seven[0]) / (6 * step)
    if np.sqrt(np.mean(speed**2)) * step < STEPS_PER_ROW * resolution:
        return 0.0, level
    size = np.abs(sixth_differences(seven)) / np.sqrt(924)
    order = np.array_split(np.argsort(np.abs(speed)), CLASSES)
    power = np.array([(median(size[part]) / 0.6745) ** 2 for part in order])
    square = np.array([np.mean(speed[part] ** 2) for part in order])
    if not np.ptp(square) > 0 or not power.min() > AT_REST * power.max():
        return 0.0, level
    # the relative standard uncertainty of the median is the same in all classes
    units = np.array([power.max(), power.max() / square.max()])
    columns = np.column_stack([np.ones(CLASSES), square / square.max()]) * (power.max() / power)[:, None]
    fit = fit_linear(columns, np.ones(CLASSES))
    still, moving = fit.values * units
    spread = units[1] * np.sqrt(fit.normal[1, 1] * (fit.residuals @ fit.residuals) / (CLASSES - 2))
    total = np.sqrt(max(still, 0.0) + max(moving, 0.0) * np.mean(speed**2))
    if moving < CERTAIN * spread or total < LOUDER * level:
        return 0.0, level
    return float(np.sqrt(moving)), float(total)
