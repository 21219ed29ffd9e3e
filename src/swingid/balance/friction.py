"""Friction as the law with the lowest information criterion, and as a curve, beside inertia and gravity.

With the columns of `FrictionRows` any law is a linear combination of them, and so is the curve, a sum of hat functions
on a coarse grid of speeds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from swingid.balance.covariance import LAG
from swingid.balance.fits import columns_of, known_side
from swingid.balance.friction_laws import (
    CURVE_KNOTS,
    TERMS,
    FrictionRows,
    Law,
    curve_speeds,
    function_weights,
    slope_weights,
    speed_knots,
    stribeck_peak,
)
from swingid.balance.law_choice import DIRECTED, LawChoice, slowest_peak
from swingid.balance.rows import Rows, Signals
from swingid.model.equation import Equation
from swingid.numerics.arrays import Array
from swingid.numerics.regression import fit_linear
from swingid.result.data import FrictionCurve


@dataclass(frozen=True)
class FrictionLaw(Law):
    """The chosen law and the curve, with covariance and influence of the rows of everything that is friction.

    of_rig: coefficients of the rig's own terms of friction (drag, load) by name, behind the unknowns of the law.
    """

    of_rig: Mapping[str, float]
    covariance: Array
    influence: Array
    rows: Rows
    curve: FrictionCurve

    @property
    def coefficients_by_name(self) -> dict[str, float]:
        """Values of the unknowns of the law, then of the rig's own terms, in the order of the covariance."""
        return {**dict(zip(self.unknowns, self.values.tolist(), strict=True)), **self.of_rig}


def fit_friction(
    signals: Signals, rows: Rows, equation: Equation, memory: Mapping[str, float], impulse: float, noise: float
) -> FrictionLaw:
    """Best law by the Bayesian information criterion, and the curve, with an inertia fitted beside each.

    The inertia (and an unknown gravity torque) is fitted again with every law, so that its bias on these windows does
    not bias the friction. The rig's own terms of friction are fitted with every law, too, and are part of it. memory:
    coefficients of the impulses at the reversals, as found before. impulse: standard uncertainty of the one at each
    reversal. noise: standard deviation of one sample of the angle.
    """
    friction = FrictionRows.of(signals, rows)
    target = known_side(rows, equation) - rows.sum_of(memory)
    names, body = columns_of(rows, equation, ())
    choice = LawChoice.of(body, friction.columns, target, friction.knots, slowest_peak(signals.motion, noise))
    law, values = choice.best.law, dict(zip(names, choice.best.values.tolist(), strict=False))
    own_terms = {name: values[name] for name in equation.own_friction}
    places = [*range(size := len(law.unknowns)), *(size + names.index(name) for name in own_terms)]
    covariance, influence = _fitted(friction, body, target, law, impulse)
    curve = _curve(friction, law, covariance[:size, :size], choice, len(target))
    return FrictionLaw(
        law.name,
        law.terms,
        law.coefficients,
        law.stribeck_speed,
        own_terms,
        covariance[np.ix_(places, places)],
        influence[places],
        rows,
        curve,
    )


def first_torque(signals: Signals, rows: Rows, equation: Equation) -> Callable[[Array], Array]:
    """Torque of friction as a function of the speeds, averaged over the laws without Stribeck's peak.

    Quick, for first corrections.
    """
    _, body = columns_of(rows, equation, ())
    friction = FrictionRows.of(signals, rows, hats=False)
    choice = replace(
        LawChoice.of(body, friction.columns, known_side(rows, equation), friction.knots),
        names=DIRECTED,
        kept=DIRECTED[0],
    )
    mean = dict.fromkeys(TERMS, 0.0)
    for name, weight in choice.weights().items():
        law = choice.trials[name].law
        for term, value in zip(law.terms, law.coefficients, strict=True):
            mean[term] += weight * float(value)
    return Law("mean of the laws", tuple(mean), np.array(list(mean.values())), np.nan).torque


def _fitted(friction: FrictionRows, body: Array, target: Array, law: Law, impulse: float) -> tuple[Array, Array]:
    """Covariance of the unknowns of a law and of the body, and influence of the rows; a Stribeck speed is linearised.

    impulse: standard uncertainty of the impulse at each reversal. The search for the speed has converged, so its step
    is negligible.
    """
    weights = friction.law(law.terms, law.stribeck_speed)
    if "stribeck" in law.terms:
        weights = np.column_stack([weights, law.peak * slope_weights(friction.knots, law.stribeck_speed)])
    fit = fit_linear(np.column_stack([friction.columns @ weights, body]), target)
    timing = fit.influence @ friction.rows["memory"] * impulse
    return fit.covariance(LAG) + np.outer(timing, timing), fit.influence


def _curve(friction: FrictionRows, law: Law, covariance: Array, choice: LawChoice, rows: int) -> FrictionCurve:
    """The law plus its lack of fit, as a sum of hat functions on a coarse grid of speeds.

    Hats alone are ill-conditioned where the motion passes quickly. The deviations at the nodes have a normal prior
    whose width maximises the likelihood of these rows (empirical Bayes), so the curve is the law where the rows do not
    determine a deviation. Type A uncertainties, with those of the choice of the law.
    """
    coarse = speed_knots(friction.knots[-1], CURVE_KNOTS)
    # what the law and the inertia can describe is no part of the deviations
    remaining, products, shared = choice.beside(
        friction.law(law.terms, law.stribeck_speed), _deviations(friction, coarse)
    )
    noise = LAG / 2 * remaining / rows
    eigen, vectors = np.linalg.eigh(products)
    eigen = np.maximum(eigen, 0.0)
    projected = vectors.T @ shared
    width = _likeliest_width(eigen, projected, noise)
    shrunk = width / (noise + width * eigen) if noise > 0 else np.zeros_like(eigen)
    speeds = curve_speeds(friction.knots[-1], rest=False)
    # the two values at rest only allow a jump there
    places = np.r_[: len(speeds) // 2, len(speeds) // 2 + 2 : len(speeds) + 2]
    deviation = (vectors @ (shrunk * projected))[places]
    spread = ((vectors**2) @ (shrunk * noise))[places]
    variance = spread + _between_laws(choice, law, speeds)
    return law.curve_at(speeds, covariance, choice.scores(), deviation, variance)


def _deviations(friction: FrictionRows, coarse: Array) -> Array:
    """Weights of the coarse hat functions, the one at rest as two halves, below and above."""
    units = np.eye(len(coarse))
    hats = [np.interp(friction.knots, coarse, unit) for unit in units]
    middle, side = len(coarse) // 2, np.sign(friction.knots)
    weights = [function_weights(friction.knots, hat, 0.0, 0.0) for hat in hats]
    halves = [
        function_weights(friction.knots, hats[middle] * (side < 0), 0.0, 1.0),
        function_weights(friction.knots, hats[middle] * (side > 0), 1.0, 0.0),
    ]
    return np.column_stack([*weights[:middle], *halves, *weights[middle + 1 :]])


def _between_laws(choice: LawChoice, law: Law, speeds: Array) -> Array:
    """Variance of the torque over the laws tried, weighted by their criterion (Bayesian model averaging)."""
    torques, at = law.torque(speeds), {name: term(speeds) for name, term in TERMS.items()}
    variance = np.zeros(len(speeds))
    for name, weight in choice.weights().items():
        other = choice.trials[name].law
        if "stribeck" in other.terms:
            at["stribeck"] = stribeck_peak(speeds, other.stribeck_speed)
        variance += weight * (other.coefficients @ np.array([at[term] for term in other.terms]) - torques) ** 2
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
