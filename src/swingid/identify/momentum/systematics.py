"""Errors that are alike at every swing, so that no scatter shows them: the encoder's grid, late turning points."""

from __future__ import annotations

import numpy as np

from swingid.identify.momentum.balance import Signals
from swingid.identify.momentum.fits import WindowFit
from swingid.identify.noise import Noise
from swingid.numerics.test_functions import superpose


def timing_spread(fit: WindowFit, impulse: float) -> float:
    """What an impulse of unknown sign at every reversal does to a11, where none is fitted.

    A turning point that is taken too late by δ is one, of δ times the jump of friction.
    """
    if "memory" in fit.unknowns:
        return 0.0
    return abs(float(fit.fit.influence[0] @ fit.rows.friction["memory"])) * impulse


def grid_spread(signals: Signals, fit: WindowFit, noise: Noise, unknown: str) -> float:
    """What the place of the encoder's grid does to an unknown: its standard deviation over shifts of the grid.

    A coarse encoder errs alike at every turning point, so its error does not average out over the swings as white
    noise does. The smoothed angle is rounded on a grid that is shifted by eighths of a step.
    """
    if noise.resolution == 0.0:
        return 0.0
    windows, row = fit.rows.windows, fit.fit.influence[fit.unknowns.index(unknown)]
    weights = superpose(signals.nodes.flat[0], windows.centres, windows.half, row, 2) * fit.a11
    effects = signals.grid_errors(noise.resolution) @ weights
    return float(np.sqrt(np.mean(effects**2)))
