"""The friction that the balance leaves once inertia and gravity are known: as a curve, and as the best simple law.

On windows all over the motion the torque that remains is ∫φ F(v). With hat functions Λ_j on a grid of speeds,
F = Σ F_j Λ_j is the curve, and any law f is the column ``hats @ f(speeds)``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swingid.identify.balance import Signals
from swingid.identify.result import FrictionCurve
from swingid.identify.windows import LAG, WindowFit
from swingid.numerics.regression import LinearFit, fit_linear
from swingid.numerics.test_functions import project_hats

Array = NDArray[np.float64]
Law = Callable[[Array], Array]

TERMS: dict[str, Law] = {
    "coulomb": np.sign,
    "viscous": lambda v: v,
    "quadratic": lambda v: v * np.abs(v),
    "offset": np.ones_like,
    "viscous_even": np.abs,
}

LAWS: dict[str, tuple[str, ...]] = {
    "viscous": ("viscous",),
    "coulomb + viscous": ("coulomb", "viscous"),
    "coulomb + quadratic": ("coulomb", "quadratic"),
    "coulomb + viscous + quadratic": ("coulomb", "viscous", "quadratic"),
    "stribeck": ("coulomb", "viscous", "stribeck"),
}

DIRECTIONS: dict[str, tuple[str, ...]] = {
    "": (),
    ", offset": ("offset",),
    ", direction-dependent": ("offset", "viscous_even"),
}

CURVE_KNOTS = 8
FINE_KNOTS = 24


@dataclass(frozen=True)
class FrictionLaw:
    """The chosen law: its name, coefficients of the terms and their covariance, and their slope with a11."""

    name: str
    terms: tuple[str, ...]
    values: Array
    covariance: Array
    slope: Array
    stribeck_speed: float
    curve: FrictionCurve
    influence: Array

    def torque(self, speeds: Array) -> Array:
        """Friction torque of the law at `speeds`."""
        columns = [_term(term, speeds, self.stribeck_speed) for term in self.terms]
        result: Array = np.column_stack(columns) @ self.values
        return result


def _term(name: str, speeds: Array, stribeck_speed: float) -> Array:
    if name == "stribeck":
        return np.sign(speeds) * np.exp(-((speeds / stribeck_speed) ** 2))
    return TERMS[name](speeds)


def fit_friction(signals: Signals, law: WindowFit, target: Array) -> FrictionLaw:
    """Best law by the Bayesian information criterion, and the curve.

    law: the fit whose rows are used; target: what the rows leave for friction, known side − a11 ∫φ'' q1
    (− b ∫φ sin q1), shape (rows,).
    """
    fastest = float(np.quantile(np.abs(signals.speed), 0.999))
    speeds = _knots(fastest, FINE_KNOTS)
    windows = law.rows.windows
    hats = project_hats(signals.nodes, signals.speed, speeds, windows.centres, windows.half)
    memory = law.rows.friction["memory"] * law.value("memory")
    target = target - memory
    scores: dict[str, float] = {}
    fits: dict[str, tuple[LinearFit, tuple[str, ...], float]] = {}
    for name, odd in LAWS.items():
        for direction, even in DIRECTIONS.items():
            terms = odd + even
            fit, stribeck_speed = _fit_terms(hats, speeds, target, terms, fastest)
            independent = len(target) / (LAG / 2)
            count = len(terms) + ("stribeck" in terms)
            power = float(fit.residuals @ fit.residuals) / len(target)
            scores[name + direction] = independent * np.log(max(power, 1e-300)) + count * np.log(independent)
            fits[name + direction] = (fit, terms, stribeck_speed)
    best = min(scores, key=lambda name: scores[name])
    fit, terms, stribeck_speed = fits[best]
    covariance, slope = fit.covariance(LAG), -(fit.influence @ law.rows.inertia)
    shell = FrictionLaw(best, terms, fit.values, covariance, slope, stribeck_speed, _EMPTY, fit.influence)
    curve = _curve(hats, speeds, target, law, fastest, shell, {k: v - scores[best] for k, v in scores.items()})
    return FrictionLaw(best, terms, fit.values, covariance, slope, stribeck_speed, curve, fit.influence)


_EMPTY = FrictionCurve(np.empty(0), np.empty(0), np.empty(0), "", np.empty(0))


def _knots(fastest: float, count: int) -> Array:
    """Speeds on both sides of zero, denser near it, with a pair at ±0 so that the curve may jump there."""
    side = fastest * np.linspace(0, 1, count) ** 1.5
    side[0] = 1e-6 * fastest
    return np.concatenate([-side[::-1], side])


def _fit_terms(
    hats: Array, speeds: Array, target: Array, terms: tuple[str, ...], fastest: float
) -> tuple[LinearFit, float]:
    """Least squares of the terms; the Stribeck speed by search over a grid."""
    trials = fastest * np.geomspace(0.02, 0.5, 12) if "stribeck" in terms else np.array([1.0])
    best: tuple[LinearFit, float] | None = None
    for trial in trials:
        columns = hats @ np.column_stack([_term(term, speeds, trial) for term in terms])
        fit = fit_linear(columns, target)
        if best is None or fit.residuals @ fit.residuals < best[0].residuals @ best[0].residuals:
            best = fit, float(trial)
    assert best is not None
    return best


def _curve(
    hats: Array,
    speeds: Array,
    target: Array,
    law: WindowFit,
    fastest: float,
    shell: FrictionLaw,
    scores: dict[str, float],
) -> FrictionCurve:
    """The curve on a coarse grid of speeds, with uncertainties that include that of the inertia."""
    coarse = _knots(fastest, CURVE_KNOTS)
    blend = np.array([np.interp(speeds, coarse, unit) for unit in np.eye(len(coarse))]).T
    fit = fit_linear(hats @ blend, target, smallest=1e-4)
    spread = np.sqrt(np.diag(fit.covariance(LAG)) + (fit.influence @ law.rows.inertia * law.u) ** 2)
    return FrictionCurve(coarse, fit.values, spread, shell.name, shell.torque(coarse), scores)
