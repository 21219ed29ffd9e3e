"""A log on an even grid of instants, and central differences there.

Filters need even samples. A log with uneven stamps is resampled to an even grid of its median rate by cubic splines;
a held torque by its exact integrals.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swingid.balance.rows import Signals
from swingid.errors import UnanswerableError
from swingid.numerics.arrays import Array
from swingid.numerics.spline import spline_at, spline_slopes
from swingid.preparation.encoders import moved
from swingid.preparation.noise import EVEN

MOST_FILLED = 10
"""Rows of the even grid per row of the log above which the log is mostly gaps."""

STENCIL = 2
"""Rows at each end for which there are no differences."""


@dataclass(frozen=True)
class Grid:
    """Channels of a log on an even grid: time (n,) s, step s, angle, wheel angle and torque where the drive has them.

    A held torque is the difference of its double integral, as the acceleration is that of the angle. resampled: whether
    the stamps of the log were uneven.
    """

    time: Array
    step: float
    angle: Array
    wheel: Array | None
    torque: Array | None
    resampled: bool


def even_grid(signals: Signals) -> Grid:
    """The log on its even grid, on the clock of the angle, as in momentum.

    Raises UnanswerableError where the log is mostly gaps.
    """
    log, rig = signals.source
    steps = np.diff(log.time)
    resampled = bool(np.ptp(steps) > EVEN * steps[0])
    count = int(np.rint(log.duration * log.rate)) + 1
    if count > MOST_FILLED * len(log):
        raise UnanswerableError(
            f"{log.source.path or 'the log'} has rows for only {len(log) / count:.1%} of its time, too few for an even "
            "grid; cut out the part without gaps, or use the momentum method.",
            code="gaps",
        )
    time = np.linspace(log.time[0], log.time[-1], count) if resampled else log.time

    def carried(values: Array) -> Array:
        return spline_at(log.time, values, spline_slopes(log.time, values), time, 0) if resampled else values

    wheel = None if signals.wheel_values is None else carried(signals.wheel_values)
    torque, late = None, signals.encoders.angle.latency.value
    if rig.drive.channel == "torque" and log.torque is not None:
        # the angle at the time t of a torque is in the row stamped t − late
        held = log.drive_held
        torque = (
            as_held(log.time - late, log.torque[:-1], time) if held else carried(moved(log.time, log.torque, -late))
        )
    return Grid(time, float(time[1] - time[0]), carried(log.angle), wheel, torque, resampled)


def as_held(edges: Array, levels: Array, time: Array) -> Array:
    """A piecewise constant signal on an even grid, as the second difference of its exact double integral.

    levels[k] holds from edges[k] to edges[k+1], the first and the last also beyond the outermost edges.
    """
    steps = np.diff(edges)
    once = np.concatenate([[0.0], np.cumsum(levels * steps)])
    twice = np.concatenate([[0.0], np.cumsum(once[:-1] * steps + levels * steps**2 / 2)])
    at = np.clip(np.searchsorted(edges, time, side="right") - 1, 0, len(levels) - 1)
    since = time - edges[at]
    return curvature(twice[at] + once[at] * since + levels[at] * since**2 / 2, float(time[1] - time[0]))


def slope(values: Array, step: float) -> Array:
    """First derivative by central differences of five points, error (ωh)⁴/30; 0 in the outermost rows."""
    result = np.zeros_like(values)
    result[2:-2] = (values[:-4] - 8 * values[1:-3] + 8 * values[3:-1] - values[4:]) / (12 * step)
    return result


def curvature(values: Array, step: float) -> Array:
    """Second derivative by central differences of five points, error (ωh)⁴/90; 0 in the outermost rows."""
    result = np.zeros_like(values)
    inner = 16 * (values[1:-3] + values[3:-1]) - values[:-4] - values[4:] - 30 * values[2:-2]
    result[2:-2] = inner / (12 * step**2)
    return result
