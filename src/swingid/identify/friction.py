"""The friction that the balance leaves once inertia and gravity are known: as a curve, and as the best simple law.

On windows all over the motion the torque that remains is ∫φ F(v). With hat functions Λ_j on a grid of speeds,
F = Σ F_j Λ_j is the curve, and any law f is the column ``hats @ f(speeds)``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from swingid.identify.balance import Rows, Signals
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
    "cubic": lambda v: v**3,
    "offset": np.ones_like,
    "viscous_even": np.abs,
}

LAWS: dict[str, tuple[str, ...]] = {
    "viscous": ("viscous",),
    "coulomb + viscous": ("coulomb", "viscous"),
    "coulomb + quadratic": ("coulomb", "quadratic"),
    "viscous + quadratic": ("viscous", "quadratic"),
    "viscous + cubic": ("viscous", "cubic"),
    "coulomb + viscous + quadratic": ("coulomb", "viscous", "quadratic"),
    "stribeck": ("coulomb", "viscous", "stribeck"),
    "stribeck + quadratic": ("coulomb", "viscous", "stribeck", "quadratic"),
}
"""Odd laws tried. One whose coefficients come out negative beyond their uncertainty is no law of friction."""

DIRECTIONS: dict[str, tuple[str, ...]] = {
    "": (),
    ", offset": ("offset",),
    ", direction-dependent": ("offset", "viscous_even"),
}

CURVE_KNOTS = 8
FINE_KNOTS = 24


@dataclass(frozen=True)
class FrictionLaw:
    """The chosen law: terms with their coefficients, covariance and influence of the rows, Stribeck speed, curve."""

    name: str
    terms: tuple[str, ...]
    values: Array
    covariance: Array
    influence: Array
    rows: Rows
    stribeck_speed: float
    curve: FrictionCurve

    def torque(self, speeds: Array) -> Array:
        """Friction torque of the law at `speeds`."""
        columns = [_term(term, speeds, self.stribeck_speed) for term in self.terms]
        result: Array = np.column_stack(columns) @ self.values
        return result


def _term(name: str, speeds: Array, stribeck_speed: float) -> Array:
    if name == "stribeck":
        return np.sign(speeds) * np.exp(-((speeds / stribeck_speed) ** 2))
    return TERMS[name](speeds)


def fit_friction(signals: Signals, rows: WindowFit, inertia: WindowFit, target: Array) -> FrictionLaw:
    """Best law by the Bayesian information criterion, and the curve.

    rows: the fit whose windows are used; inertia: the fit that gave a11; target: what the rows leave for friction,
    known side − a11 ∫φ'' q1 (− b ∫φ sin q1), shape (rows,).
    """
    fastest = float(np.quantile(np.abs(signals.speed), 0.999))
    speeds = _knots(fastest, FINE_KNOTS)
    windows = rows.rows.windows
    hats = project_hats(signals.nodes, signals.speed, speeds, windows.centres, windows.half)
    target = target - rows.rows.friction["memory"] * inertia.value("memory")
    scores: dict[str, float] = {}
    fits: dict[str, tuple[LinearFit, tuple[str, ...], float]] = {}
    independent = len(target) / (LAG / 2)
    for name, odd in LAWS.items():
        for direction, even in DIRECTIONS.items():
            terms = odd + even
            fit, stribeck_speed = _fit_terms(hats, speeds, target, terms, fastest)
            if not _dissipates(fit, terms):
                continue
            count = len(terms) + ("stribeck" in terms)
            power = float(fit.residuals @ fit.residuals) / len(target)
            scores[name + direction] = float(independent * np.log(max(power, 1e-300)) + count * np.log(independent))
            fits[name + direction] = (fit, terms, stribeck_speed)
    if not fits:
        fits["viscous"] = (*_fit_terms(hats, speeds, target, ("viscous",), fastest)[:1], ("viscous",), 1.0)
        scores["viscous"] = 0.0
    best = min(scores, key=lambda name: scores[name])
    fit, terms, stribeck_speed = fits[best]
    law = FrictionLaw(best, terms, fit.values, fit.covariance(LAG), fit.influence, rows.rows, stribeck_speed, _EMPTY)
    above = {name: score - scores[best] for name, score in scores.items()}
    return replace(law, curve=_curve(hats, speeds, target, law, inertia, fastest, above))


def _dissipates(fit: LinearFit, terms: tuple[str, ...]) -> bool:
    """Whether no coefficient, in either direction, is negative beyond two standard uncertainties."""
    unit = {term: np.eye(len(terms))[k] for k, term in enumerate(terms)}
    sides = [unit[term] for term in terms if term not in ("offset", "viscous_even")]
    if "viscous_even" in unit:
        viscous, even = unit.get("viscous", np.zeros(len(terms))), unit["viscous_even"]
        sides += [viscous + even, viscous - even]
    if "offset" in unit and "coulomb" in unit:
        sides += [unit["coulomb"] + unit["offset"], unit["coulomb"] - unit["offset"]]
    covariance = fit.covariance(LAG)
    return all(float(side @ fit.values) > -2 * float(np.sqrt(side @ covariance @ side)) for side in sides)


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

    def columns(stribeck_speed: float) -> Array:
        result: Array = hats @ np.column_stack([_term(term, speeds, stribeck_speed) for term in terms])
        return result

    best = 1.0
    if "stribeck" in terms:
        trials = fastest * np.geomspace(0.01, 0.3, 12)
        lost = [np.linalg.lstsq(columns(trial), target, rcond=None)[1].sum() for trial in trials]
        best = float(trials[int(np.argmin(lost))])
    return fit_linear(columns(best), target), best


def _curve(
    hats: Array,
    speeds: Array,
    target: Array,
    law: FrictionLaw,
    inertia: WindowFit,
    fastest: float,
    scores: dict[str, float],
) -> FrictionCurve:
    """The curve on a coarse grid of speeds, with uncertainties that include that of the inertia."""
    coarse = _knots(fastest, CURVE_KNOTS)
    blend = np.array([np.interp(speeds, coarse, unit) for unit in np.eye(len(coarse))]).T
    fit = fit_linear(hats @ blend, target, smallest=1e-4)
    spread = np.sqrt(np.diag(fit.covariance(LAG)) + (fit.influence @ law.rows.inertia * inertia.u) ** 2)
    return FrictionCurve(coarse, fit.values, spread, law.name, law.torque(coarse), scores)
