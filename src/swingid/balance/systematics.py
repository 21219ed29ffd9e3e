"""Errors that are alike at every swing, so that no scatter shows them: the encoder's grid, late turning points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from swingid.balance.fits import WindowFit
from swingid.balance.rows import Signals, Windows
from swingid.numerics.arrays import Array
from swingid.numerics.test_functions import superpose
from swingid.preparation.noise import Noise
from swingid.preparation.scale import Scale

SHIFTS = (np.arange(8) / 8 + 0.5) % 1 - 0.5
"""Of the grid in `Signals.grid_errors`, in steps."""


def timing_spread(fit: WindowFit, impulse: float) -> float:
    """What an impulse of unknown sign at every reversal does to a11, where none is fitted.

    A turning point that is taken too late by δ is one, of δ times the jump of friction.
    """
    if "memory" in fit.unknowns:
        return 0.0
    return abs(float(fit.fit.influence[0] @ fit.rows.friction["memory"])) * impulse


def angle_weights(signals: Signals, fit: WindowFit, scale: Scale, unknown: str) -> tuple[Array, Array]:
    """What an error of the angle, and of the wheel's, does to an unknown: per radian and second, at the nodes.

    Through φ'', and that of the axis through the gravity b sin q1 as well.
    """
    windows, row = fit.rows.windows, fit.fit.influence[fit.unknowns.index(unknown)]
    instants = signals.nodes.flat[0]
    curvature = superpose(instants, windows.centres, windows.half, row, 2)
    axis = curvature * fit.a11
    b = fit.value("gravity_torque") if scale.b is None else scale.b
    if b and not signals.linear:
        axis += b * signals.cosine.ravel() * superpose(instants, windows.centres, windows.half, row, 0)
    for term in signals.further:
        pull = scale.known.get(term.name, 0.0) + fit.value(term.name)
        slope = term.stiffness(signals.angle).ravel()
        axis += pull * slope * superpose(instants, windows.centres, windows.half, row, 0)
    return axis, curvature * scale.a12


def grid_spread(signals: Signals, fit: WindowFit, scale: Scale, noise: Noise, unknown: str) -> float:
    """What the place of the encoder's grid does to an unknown beyond what counts as white noise: a standard deviation.

    An encoder errs alike wherever the same angle comes again, so its error does not average out over the swings as
    white noise does. The smoothed angle is rounded on a grid that is shifted by eighths of a step, and with it the
    zero of the angle, which an encoder cannot tell any better.
    """
    if noise.resolution == 0.0:
        return 0.0
    weights = angle_weights(signals, fit, scale, unknown)[0]
    shifts = noise.resolution * SHIFTS * float(signals.nodes.flat[1] @ weights)
    effects = signals.grid_errors(noise.resolution) @ weights + shifts
    white = noise.resolution**2 / 12 * noise.step * float(signals.nodes.flat[1] @ weights**2)
    return float(np.sqrt(max(float(np.mean(effects**2)) - white, 0.0)))


def variance_of_difference(signals: Signals, one: WindowFit, other: WindowFit, scale: Scale, noise: Noise) -> float:
    """Variance of the difference of two fits' a11 by white noise of the same samples."""
    pairs = zip(*(angle_weights(signals, fit, scale, "inertia") for fit in (one, other)), strict=True)
    axis, wheel = [float(signals.nodes.flat[1] @ (mine - theirs) ** 2) for mine, theirs in pairs]
    return noise.step * (noise.angle**2 * axis + noise.wheel**2 * wheel)


def common_instants(windows: Sequence[Windows]) -> Array:
    """Even instants over all windows, 16 in the shortest of them, for `noise_weights` (instants,)."""
    first = min(float(np.min(one.centres - one.half)) for one in windows)
    last = max(float(np.max(one.centres + one.half)) for one in windows)
    step = min(float(np.min(one.half)) for one in windows) / 8
    return np.arange(first, last + step, step)


def noise_weights(windows: Windows, influence: Array, instants: Array) -> Array:
    """What noise of an angle at each instant does to values whose rows have this `influence` (p, windows).

    (p, instants), per radian, but for a factor that all values share: through φ'', beside which gravity hardly counts.
    """
    return np.array([superpose(instants, windows.centres, windows.half, row, 2) for row in influence])
