"""Angles from rates: the integral of an angular rate (gyroscope, tachometer), and the rate that a rig would log.

A rate at its row is a cubic spline, integrated; a mean over the time since the row before, or a value that is held
until the next row, times the step is the angle exactly.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from swingid.numerics.regression import fit_linear
from swingid.numerics.spline import spline_slopes

if TYPE_CHECKING:
    from swingid.numerics.arrays import Array

    Channels = dict[str, Array]

RateIs = Literal["instant", "mean", "held"]
"""What a logged rate is: that at its row, the mean since the row before, or until the next row."""


def integral(time: Array, rate: Array, rate_is: RateIs) -> Array:
    """The angle (rad or m), 0 at the first row, of a rate (rad/s or m/s)."""
    steps = np.diff(time)
    if time.size < 2 or not (steps > 0).all():  # no Recording can be made of it, which raises
        return np.zeros_like(rate)
    if rate_is == "instant":
        slopes = spline_slopes(time, rate)
        turns = steps * (rate[1:] + rate[:-1]) / 2 - steps**2 * np.diff(slopes) / 12
    else:
        turns = (rate[1:] if rate_is == "mean" else rate[:-1]) * steps
    return np.concatenate(([0.0], np.cumsum(turns)))


def rate_of(time: Array, angle: Array, rate_is: RateIs) -> Array:
    """The rate (rad/s or m/s) that a sensor of this kind logs of an angle (rad or m); the inverse of `integral`."""
    if rate_is == "instant":
        return spline_slopes(time, np.ascontiguousarray(angle))
    means = np.diff(angle) / np.diff(time)
    return np.concatenate((means[:1], means) if rate_is == "mean" else (means, means[-1:]))


def line_of(time: Array, values: Array) -> tuple[float, float]:
    """Value at the middle of the time, and slope, of the straight line nearest to `values`."""
    since = time - (time[0] + time[-1]) / 2
    value, slope = fit_linear(np.column_stack([np.ones_like(since), since]), values).values
    return float(value), float(slope)


def without_line(time: Array, values: Array) -> Array:
    """The values less the straight line nearest to them."""
    value, slope = line_of(time, values)
    result: Array = values - value - slope * (time - (time[0] + time[-1]) / 2)
    return result


def with_angle(model: Channels, rate_is: RateIs) -> Channels:
    """The channels with an angle: where only "angle_speed" was logged its integral without a straight line, for bias
    and start of a rate are unknown.
    """
    time, rate = model["time"], model["angle_speed"]
    if "angle" in model:
        return model
    short = time.size < 3 or not (np.diff(time) > 0).all()
    return {**model, "angle": np.zeros_like(rate) if short else without_line(time, integral(time, rate, rate_is))}
