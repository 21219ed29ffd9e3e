"""Friction as the law with the lowest information criterion, and as a curve, beside inertia and gravity.

With the columns of `FrictionRows` any law is a linear combination of them, and so is the curve, a sum of hat functions
on a coarse grid of speeds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from swingid.balance.fits import LAG, columns_of, known_side
from swingid.balance.friction_laws import TERMS, FrictionRows, law_columns, speed_knots, stribeck_peak, stribeck_slope
from swingid.balance.law_choice import LawChoice, slowest_peak
from swingid.balance.rows import Rows, Signals
from swingid.model.equation import Equation
from swingid.numerics.arrays import Array
from swingid.numerics.regression import fit_linear
from swingid.result.result import FrictionCurve

CURVE_KNOTS = 7


@dataclass(frozen=True)
class FrictionLaw:
    """The chosen law: its unknowns with covariance and influence of the rows, and the curve.

    unknowns: the terms and, where one of them is Stribeck's peak, its speed; values are the terms' coefficients, then
    that speed. stribeck_speed: nan in a law without.
    """

    name: str
    terms: tuple[str, ...]
    unknowns: tuple[str, ...]
    values: Array
    covariance: Array
    influence: Array
    rows: Rows
    stribeck_speed: float
    curve: FrictionCurve

    def torque(self, speeds: Array) -> Array:
        """Friction torque of the law at `speeds`."""
        coefficients = self.values[: len(self.terms)]
        result: Array = law_columns(self.terms, speeds, self.stribeck_speed) @ coefficients
        return result

    def variance(self, speeds: Array) -> Array:
        """Variance of the law's torque at `speeds`, of type A."""
        slopes = law_columns(self.terms, speeds, self.stribeck_speed)
        if len(self.unknowns) > len(self.terms):
            peak = self.values[self.terms.index("stribeck")]
            slopes = np.column_stack([slopes, peak * stribeck_slope(speeds, self.stribeck_speed)])
        result: Array = np.einsum("ij,jk,ik->i", slopes, self.covariance, slopes)
        return result


def fit_friction(
    signals: Signals, rows: Rows, equation: Equation, memory: tuple[float, float], noise: float
) -> FrictionLaw:
    """Best law by the Bayesian information criterion, and the curve, with an inertia fitted beside each.

    The inertia (and an unknown gravity torque) is fitted again with every law, so that its bias on these windows does
    not bias the friction. memory: impulse at each reversal, as found before, and its standard uncertainty. noise:
    standard deviation of one sample of the angle.
    """
    friction = FrictionRows.of(signals, rows)
    target = known_side(rows, equation) - rows["memory"] * memory[0]
    _, body = columns_of(rows, equation, ())
    choice = LawChoice(friction, body, target, slowest=slowest_peak(signals.motion, noise))
    law = _fitted(friction, body, target, choice, memory[1])
    return replace(law, curve=_curve(friction, law, choice, len(target)))


def first_torque(signals: Signals, rows: Rows, equation: Equation) -> Callable[[Array], Array]:
    """Torque of friction as a function of the speeds, averaged over the laws without Stribeck's peak.

    Quick, for first corrections.
    """
    _, body = columns_of(rows, equation, ())
    choice = LawChoice(FrictionRows.of(signals, rows, hats=False), body, known_side(rows, equation), odd_only=True)

    mean = dict.fromkeys(TERMS, 0.0)
    for name, weight in choice.weights.items():
        trial = choice.trials[name]
        for term, value in zip(trial.terms, trial.values, strict=True):
            mean[term] += weight * float(value)
    terms, values = tuple(mean), np.array(list(mean.values()))

    def torque(speeds: Array) -> Array:
        result: Array = law_columns(terms, speeds, np.nan) @ values
        return result

    return torque


def _fitted(friction: FrictionRows, body: Array, target: Array, choice: LawChoice, impulse: float) -> FrictionLaw:
    """The best law with its covariance; a Stribeck speed is an unknown like the others, linearised.

    impulse: standard uncertainty of the impulse at each reversal.
    """
    name = choice.best
    trial = choice.trials[name]
    terms, weights, start = trial.terms, friction.law(trial.terms, trial.stribeck_speed), np.empty(0)
    unknowns = terms
    if "stribeck" in terms:
        peak = trial.values[terms.index("stribeck")]
        weights = np.column_stack([weights, peak * friction.stribeck_slope(trial.stribeck_speed)])
        unknowns, start = (*terms, "stribeck_speed"), np.array([trial.stribeck_speed])
    fit = fit_linear(np.column_stack([friction.columns @ weights, body]), target)
    own = slice(0, len(unknowns))
    # the search has converged, so the step of the Stribeck speed is negligible
    values = np.append(trial.values, start)
    timing = fit.influence[own] @ friction.rows["memory"] * impulse
    return FrictionLaw(
        name,
        terms,
        unknowns,
        values,
        fit.covariance(LAG)[own, own] + np.outer(timing, timing),
        fit.influence[own],
        friction.rows,
        trial.stribeck_speed,
        FrictionCurve(np.empty(0), np.empty(0), np.empty(0), name, np.empty(0)),
    )


def _curve(friction: FrictionRows, law: FrictionLaw, choice: LawChoice, rows: int) -> FrictionCurve:
    """The law plus its lack of fit, as a sum of hat functions on a coarse grid of speeds.

    Hats alone are ill-conditioned where the motion passes quickly. The deviations at the nodes have a normal prior
    whose width maximises the likelihood of these rows (empirical Bayes), so the curve is the law where the rows do not
    determine a deviation. Type A uncertainties, with those of the choice of the law.
    """
    coarse = speed_knots(friction.knots[-1], CURVE_KNOTS)
    # what the law and the inertia can describe is no part of the deviations
    left, products, shared = choice.beside(friction.law(law.terms, law.stribeck_speed), _deviations(friction, coarse))
    noise = LAG / 2 * left / rows
    eigen, vectors = np.linalg.eigh(products)
    eigen = np.maximum(eigen, 0.0)
    projected = vectors.T @ shared
    width = _likeliest_width(eigen, projected, noise)
    shrunk = width / (noise + width * eigen) if noise > 0 else np.zeros_like(eigen)
    moving = coarse != 0.0
    speeds = coarse[moving]
    # the two values at rest only allow a jump there
    own = np.r_[: len(speeds) // 2, len(speeds) // 2 + 2 : len(speeds) + 2]
    deviation = (vectors @ (shrunk * projected))[own]
    spread = ((vectors**2) @ (shrunk * noise))[own]
    torques = law.torque(speeds)
    variance = law.variance(speeds) + spread + _between_laws(choice, law, speeds)
    uncertainties = np.sqrt(np.maximum(variance, 0.0))
    return FrictionCurve(speeds, torques + deviation, uncertainties, law.name, torques, choice.scores)


def _deviations(friction: FrictionRows, coarse: Array) -> Array:
    """Weights of the coarse hat functions, the one at rest as two halves, below and above."""
    units = np.eye(len(coarse))
    hats = [np.interp(friction.knots, coarse, unit) for unit in units]
    middle, side = len(coarse) // 2, np.sign(friction.knots)
    weights = [friction.function(hat, 0.0, 0.0) for hat in hats]
    halves = [
        friction.function(hats[middle] * (side < 0), 0.0, 1.0),
        friction.function(hats[middle] * (side > 0), 1.0, 0.0),
    ]
    return np.column_stack([*weights[:middle], *halves, *weights[middle + 1 :]])


def _between_laws(choice: LawChoice, law: FrictionLaw, speeds: Array) -> Array:
    """Variance of the torque over the laws tried, weighted by their criterion (Bayesian model averaging)."""
    own, at = law.torque(speeds), {name: term(speeds) for name, term in TERMS.items()}
    variance = np.zeros(len(speeds))
    for name, weight in choice.weights.items():
        trial = choice.trials[name]
        if "stribeck" in trial.terms:
            at["stribeck"] = stribeck_peak(speeds, trial.stribeck_speed)
        torque = trial.values @ np.array([at[term] for term in trial.terms])
        variance += weight * (torque - own) ** 2
    return variance


def _likeliest_width(eigen: Array, projected: Array, noise: float) -> float:
    """Prior variance of the deviations of highest likelihood, by search over a grid (0 among its values)."""
    if noise <= 0:
        return 0.0
    trials = noise / max(float(eigen.max()), 1e-300) * np.geomspace(1e-2, 1e6, 33)
    terms = noise + trials[:, None] * eigen
    evidence = (trials[:, None] * projected**2 / (noise * terms) - np.log(terms / noise)).sum(axis=1)
    best = int(np.argmax(evidence))
    return float(trials[best]) if evidence[best] > 0 else 0.0
