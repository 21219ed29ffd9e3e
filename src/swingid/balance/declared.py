"""Declared imperfections in a fit: encoders calibrate themselves, constants are passed on.

A once-per-turn nonlinearity enters the rows linearly, and its standard deviation is declared: its amplitudes join the
unknowns with that normal prior (one row more each), and the data take back what they can (THEORY 4, self-calibration).
So does a latency. Constants are not told from the data but passed on to the unknowns as they are declared.
"""

from __future__ import annotations

from dataclasses import replace

from swingid.balance.fits import Effect, WindowFit, covariance_of, fit_with_prior
from swingid.balance.imperfections import Imperfection, imperfections
from swingid.balance.rows import Signals
from swingid.model.rig import Rig
from swingid.numerics.regression import LinearFit
from swingid.preparation.noise import Noise
from swingid.preparation.scale import Scale


def with_declared(fit: WindowFit, rig: Rig, signals: Signals, scale: Scale, noise: Noise) -> WindowFit:
    """The fit with encoder nonlinearities and latencies calibrated and the effect of every declared imperfection."""
    b = fit.value("gravity_torque") if scale.b is None else scale.b
    items = imperfections(rig, signals, fit.rows, fit.a11, b)
    if not items:
        return fit
    own = [item for item in items if item.calibrates]
    if own:
        fit, effects = _calibrated(fit, own, scale, noise)
    else:
        effects = []
    passed = [
        Effect(item.source, item.std, fit.fit.influence @ item.rows * item.std, item.direct, item.shared_id)
        for item in items
        if not item.calibrates
    ]
    return replace(fit, declared=(*effects, *passed))


def _calibrated(
    fit: WindowFit, items: list[Imperfection], scale: Scale, noise: Noise
) -> tuple[WindowFit, list[Effect]]:
    """Fit with one more unknown per imperfection, in units of its standard deviation, with a standard normal prior."""
    solved, error = fit_with_prior(fit, scale, [-item.rows * item.std for item in items])
    rows, unknowns = len(items[0].rows), len(fit.unknowns)
    data = LinearFit(
        solved.values[:unknowns], solved.residuals[:rows], solved.influence[:unknowns, :rows], fit.fit.condition
    )
    covariance, computed = covariance_of(data, fit.rows, fit.unknowns, scale, noise)
    effects = [
        Effect(item.source, item.std, solved.influence[:unknowns, rows + k] * error, item.direct, item.shared_id)
        for k, item in enumerate(items)
    ]
    return replace(fit, fit=data, covariance=covariance, computed=computed), effects
