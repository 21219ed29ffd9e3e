"""Type A covariance of fits on windows: by noise of the sensors, by scatter beyond it, by the bias of attenuation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from swingid.balance.rows import Rows, Windows
from swingid.model.equation import Equation
from swingid.numerics.arrays import Array
from swingid.numerics.regression import LinearFit
from swingid.numerics.test_functions import CURVATURE_POWER, SLOPE_POWER, overlaps, rate_overlaps
from swingid.preparation.noise import Noise
from swingid.uncertainty.dark import shrunk

LAG = 4
"""Neighbouring rows that share data (windows of length 2L, one every L/2) and therefore are correlated."""


def covariance_of(
    fit: LinearFit, rows: Rows, unknowns: tuple[str, ...], equation: Equation, noise: Noise
) -> tuple[Array, Any]:
    """Type A covariance of the unknowns: sensor noise, scatter of the rows beyond it, and the bias of attenuation.

    Also the variance of a11 that is not estimated from the scatter. Of several fits of one kind at once, too.
    """
    covariance = fit.covariance(LAG)
    a11 = fit.values[..., 0]
    values = equation.stated | {name: fit.values[..., k] for k, name in enumerate(unknowns)}
    sensor, seen = sensor_variance(rows, fit.influence[..., 0, :], values, noise)
    scatter = covariance[..., 0, 0]
    excess = with_excess(sensor, seen, scatter, len(rows) - len(unknowns))
    covariance *= np.where(scatter > 0, excess / np.maximum(scatter, 1e-300), 1.0)[..., None, None]
    # bias of all unknowns by noise in the regressor ∫φ'' q1 of a11 (errors in variables), to first order; also of what
    # is nearly collinear with a11: at one frequency an unknown gravity torque
    bias = (a11 * column_noise(rows.windows, noise))[..., None] * (fit.influence @ fit.influence[..., 0, :, None])[
        ..., 0
    ]
    covariance += bias[..., :, None] * bias[..., None, :]
    return covariance, sensor + bias[..., 0] ** 2


def with_excess(sensor: Any, seen: Any, scatter: Any, spare: int) -> Any:
    """Variance of a11 by sensor noise and by the lack of fit beyond it; of one fit or of many (arrays).

    sensor: variance by sensor noise. seen: Newey and West's sum for that noise alone, which is larger, for its weights
    pass some of the fast noise of φ''. scatter: that sum for the rows. spare: rows less unknowns.

    The sum of a few dozen rows is itself uncertain by tens of per cent: an excess is weighted (`shrunk`) by the
    standard deviation s of the sum for sensor noise alone (for Bartlett's weights s² is 4/3 (LAG + 1) / rows of the
    square).
    """
    # as shares of the scatter, whose squares neither overflow nor vanish
    noise = np.minimum(seen / np.maximum(scatter, 1e-300), 1.0)
    return sensor + scatter * shrunk(1.0 - noise, noise * ((4 / 3) * (LAG + 1) / spare) ** 0.5)


def sensor_variance(rows: Rows, influence: Array, values: Mapping[str, Any], noise: Noise) -> tuple[Any, Any]:
    """Variance of an unknown by white noise of both angles, and Newey and West's sum for that noise.

    influence (..., windows): of the rows on the unknown, or on several; values: of the coefficients by name, that of an
    unknown may be an array (...) likewise. The noise enters through φ'' (that of a rate through φ', for ∫φ'' q1 =
    −∫φ' q1'), and that of the axis through gravity, springs and cogging as well.
    """
    windows, a11, a12 = rows.windows, values["inertia"], values.get("wheel", 0.0)
    pull = sum(values[name] * slope for name, slope in rows.pulls.items() if name in values)
    gravity = pull * windows.middle**2 / (a11 if np.all(a11) else np.where(a11 == 0.0, np.inf, a11))
    axis, wheel = (a11 * noise.of_angle) ** 2 * noise.step, (a12 * noise.of_wheel) ** 2 * noise.step
    of_axis, of_wheel = overlaps(influence * windows.loudness, windows.neighbours, LAG, gravity)
    variances = np.maximum(of_axis, 0.0) * np.asarray(axis)[..., None] + np.maximum(of_wheel, 0.0) * wheel
    if noise.rate or noise.wheel_rate:
        rates = ((a11 * noise.rate) ** 2 + (a12 * noise.wheel_rate) ** 2) * noise.step
        of_rate = rate_overlaps(influence / np.sqrt(windows.half), windows.neighbours, LAG)
        variances += np.maximum(of_rate, 0.0) * np.asarray(rates)[..., None]
    return variances[..., 0], variances[..., 1]


def column_noise(windows: Windows, noise: Noise) -> float:
    """Variance of the regressor ∫φ'' q1 by noise of the angle, summed over the windows."""
    white = noise.of_angle**2 * CURVATURE_POWER * float(windows.loudness @ windows.loudness)
    return noise.step * (white + noise.rate**2 * SLOPE_POWER * float(np.sum(1 / windows.half)))
