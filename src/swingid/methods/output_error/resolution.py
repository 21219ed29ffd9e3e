"""What the grid of an encoder does to a fit: its errors repeat with the motion, so residuals do not scatter by them."""

from __future__ import annotations

import numpy as np

from swingid.methods.output_error.problem import Problem
from swingid.methods.output_error.solver import Fit, inverse_of
from swingid.methods.output_error.unknowns import Unknowns
from swingid.numerics.arrays import Array
from swingid.preparation.noise import Noise

PLACES = 8
"""Places of the grid, in equal parts of its step, over which its effect is taken."""


def grid_covariance(problem: Problem, fit: Fit, influence: Array, noise: Noise) -> Array:
    """Covariance (m, m) of the unknowns over the place of each encoder's grid.

    The predicted angles are rounded on a grid that is shifted by eighths of its step; noise beside the grid is drawn
    once, and makes rounding the white noise that the scatter already shows.
    """
    draws = np.random.default_rng(0)
    total = np.zeros((len(influence), len(influence)))
    channels = ((~problem.wheel, noise.angle, noise.resolution), (problem.wheel, noise.wheel, noise.wheel_resolution))
    for here, sigma, step in channels:
        if step == 0.0 or not here.any():
            continue
        white = np.sqrt(max(sigma**2 - step**2 / 12, 0.0))
        angles = fit.prediction.outputs[here] + white * draws.standard_normal(int(np.count_nonzero(here)))
        shifted = angles / step + np.arange(PLACES)[:, None] / PLACES
        errors = (np.round(shifted) - shifted) * step / problem.sigma[here]
        effects = errors @ influence[:, here].T
        total += effects.T @ effects / PLACES
    return total


def zero_effect(fit: Fit, unknowns: Unknowns) -> Array:
    """Standard deviation (m,) of the unknowns from what is not known of the angle's zero, and the log leaves open."""
    if unknowns.zero is None:
        return np.zeros(len(unknowns))
    column = inverse_of(fit.reduced)[:, unknowns.zero] * np.sqrt(unknowns.power[unknowns.zero])
    result: Array = np.abs(column)
    return result
