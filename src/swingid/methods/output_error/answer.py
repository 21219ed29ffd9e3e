"""From a fit of angles to parameters, uncertainty budget, and what the report draws."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from swingid.balance.friction_laws import Law, curve_speeds
from swingid.checks.stated import CONFLICT
from swingid.methods.output_error.constants import SCALE
from swingid.methods.output_error.declared import declared_effects
from swingid.methods.output_error.search import Searched
from swingid.methods.output_error.setup import Setup
from swingid.methods.output_error.unknowns import FRICTION, Unknowns
from swingid.model.terms import units_on
from swingid.numerics.arrays import Array
from swingid.numerics.regression import NEIGHBOURS, block_covariance
from swingid.numerics.shooting import widened
from swingid.preparation.noise import Noise
from swingid.result.result import Details, FrictionCurve
from swingid.uncertainty.budget import Declared, Evaluated, Scatter, Source, evaluate, systematic
from swingid.uncertainty.dark import dark_uncertainty
from swingid.uncertainty.freedom import effective_freedom, scatter_freedom

SCATTER = "scatter of the residuals and sensor noise"

LESS = 0.1
"""Weight of a channel (of half of the log) where the estimate is mostly from the other."""

PHASES = 8
"""Grid phases, in equal parts of a step, over which the effect of an encoder's grid is averaged."""

DETERMINED = 0.999
"""Posterior over prior variance of a constant above which the log does not determine it, and cannot contradict it."""

CURVE_KNOTS = 11
"""Speeds of the friction curve on each side."""


@dataclass(frozen=True)
class Estimate:
    """A fit with its uncertainties: covariance (m, m) of type A.

    freedom: degrees of freedom of that of the inertia. declared: change of the values (m,) per unit of every constant
    or imperfection. kinds: inertia, standard uncertainty and dark uncertainty where some of the readings have less
    weight. grid (m, m): covariance over the grid phases of the encoders; zero (m,): standard deviations by the unknown
    zero offset of the angle.
    """

    setup: Setup
    searched: Searched
    covariance: Array
    freedom: float
    declared: tuple[Declared, ...]
    kinds: dict[str, tuple[float, float, float]]
    grid: Array
    zero: Array

    @property
    def robust(self) -> bool:
        """Return whether outliers have less weight; the momentum balance is not robust against them."""
        return bool(np.any(self.searched.fit.weights < 1.0))

    @property
    def unknowns(self) -> Unknowns:
        """The unknowns, in order."""
        return self.searched.unknowns

    @property
    def values(self) -> Array:
        """Their values."""
        return self.searched.fit.values


def estimate_of(setup: Setup, searched: Searched) -> Estimate:
    """Covariance of a fit, effects of every constant of the rig, and consistency of parts of the readings."""
    fit = searched.fit
    covariance, freedom = _type_a(setup, searched)
    declared = declared_effects(setup, searched)
    grid, zero = np.zeros_like(covariance), np.zeros(len(covariance))
    if setup.part.log.averaged == 1:
        grid = grid_covariance(searched, setup.part.noise)
    if (k := searched.unknowns.zero) is not None:
        zero = np.abs(fit.inverse[:, k] * np.sqrt(searched.unknowns.power[k]))
    kinds = _kinds(searched, covariance)
    return Estimate(setup, searched, covariance, freedom, declared, kinds, grid, zero)


def type_a(setup: Setup, searched: Searched) -> float:
    """Standard uncertainty of a fit's inertia from scatter and disagreement; infinite where its motion diverges."""
    if not np.isfinite(searched.fit.cost):
        return np.inf
    covariance, _ = _type_a(setup, searched)
    gaps = [gap for _, _, gap in _kinds(searched, covariance).values()]
    return float(np.sqrt(covariance[0, 0] + np.sum(np.square(gaps))))


def _type_a(setup: Setup, searched: Searched) -> tuple[Array, float]:
    """Covariance, and degrees of freedom of the first value's variance.

    The covariance is that of white noise of the sensors, but no less than the scatter of the residuals over half swings
    (Newey–West): correlated residuals (an encoder's grid, a model that is not quite right) count as often as they
    repeat. Degrees of freedom: many for white noise, those of the half swings for the rest.
    """
    problem, fit, turning = searched.problem, searched.fit, setup.part.motion.turning_times
    white, count = fit.white(least=1.0), len(fit.values)
    blocks = np.searchsorted(turning, problem.times)
    segment = np.searchsorted(problem.rows, np.arange(len(problem.times)), side="right")
    _, label = np.unique(segment * (len(turning) + 1) + blocks, return_inverse=True)
    covariance, stretch = widened(white, block_covariance(fit.scores(label), count))
    weights = np.sqrt(np.bincount(label, fit.influence[0] ** 2))
    beyond = (white[0, 0] * (stretch[0] ** 2 - 1)) ** 0.5, scatter_freedom(weights, NEIGHBOURS, count)
    return covariance, effective_freedom(((white[0, 0] ** 0.5, fit.freedom), beyond))


def grid_covariance(searched: Searched, noise: Noise) -> Array:
    """Covariance (m, m) of the unknowns over the grid phase of each encoder, whose errors repeat with the motion.

    The predicted angles are rounded on a grid that is shifted by eighths of its step; noise beside the grid is drawn
    once, and makes the rounding errors white, which the scatter of the residuals contains.
    """
    draws, problem, fit = np.random.default_rng(0), searched.problem, searched.fit
    total = np.zeros((len(fit.values), len(fit.values)))
    channels = ((~problem.wheel, noise.angle, noise.resolution), (problem.wheel, noise.wheel, noise.wheel_resolution))
    for here, sigma, step in channels:
        if step == 0.0 or not here.any():
            continue
        white = np.sqrt(max(sigma**2 - step**2 / 12, 0.0))
        angles = fit.prediction.outputs[here] + white * draws.standard_normal(int(np.count_nonzero(here)))
        shifted = angles / step + np.arange(PHASES)[:, None] / PHASES
        errors = (np.round(shifted) - shifted) * step / problem.sigma[here]
        effects = errors @ fit.influence[:, here].T
        total += effects.T @ effects / PHASES
    return total


def _kinds(searched: Searched, covariance: Array) -> dict[str, tuple[float, float, float]]:
    """The inertia with weight `LESS` on one channel or one half of the log: one Gauss–Newton step from the estimate."""
    problem, fit = searched.problem, searched.fit
    middle = problem.times[problem.rows[(len(problem.rows) - 1) // 2]]
    pairs = [(("mostly its first half", "mostly its second half"), problem.times < middle)]
    if len(problem.rows) < 3:
        pairs = []
    if problem.input == "voltage":
        pairs.append((("mostly the angle", "mostly the wheel"), ~problem.wheel))
    ratio = covariance[0, 0] / max(float(fit.influence[0] @ fit.influence[0]), 1e-300)
    kinds, first = {}, np.eye(1, len(fit.values))
    for names, here in pairs:
        for name, other in zip(names, fit.leaning(here, LESS**2), strict=True):
            influence, shift = other.influence_on(first)[0], float(other.left[0])
            # the priors too, whose errors have their own standard uncertainties, have another influence
            prior = (other.inverse[0] - fit.inverse[0]) * np.sqrt(searched.unknowns.power)
            apart = influence - fit.influence[0]
            variance = float(apart @ apart) * ratio + float(prior @ prior)
            dark = dark_uncertainty(shift, variance, float(np.sqrt(covariance[0, 0])))
            kinds[name] = float(fit.values[0]) + shift, float(np.sqrt(influence @ influence * ratio)), dark
    return kinds


def prior_conflict(estimate: Estimate) -> float:
    """Standard uncertainty of the inertia where the log contradicts a stated constant: the largest of all constants.

    Without its prior a constant would be θ' = θ/(1 − h), h its posterior over its prior variance, and the inertia
    C0 θ/(s² (1 − h)) more, C0 its covariance with the constant and s² the prior variance (deletion of one row of
    least squares; Cook 1977, Technometrics 19, 15). θ' has the variance s² + r h s²/(1 − h) where nothing is wrong,
    r the variance of the scatter over that of white noise.
    """
    unknowns, fit = estimate.unknowns, estimate.searched.fit
    stated = [k for k, item in enumerate(unknowns.items) if item.places and not item.is_sought and item.name != SCALE]
    inverse = fit.inverse
    ratio = float(estimate.covariance[0, 0]) / max(float(fit.influence[0] @ fit.influence[0]), 1e-300)
    u, conflict = math.sqrt(max(float(inverse[0, 0]), 0.0)), 0.0
    for k in stated:
        power = float(unknowns.power[k])
        share = float(inverse[k, k]) * power
        if share > DETERMINED:
            continue
        change = float(inverse[0, k]) * power * float(fit.values[k]) / (1 - share)
        # of the deviation without prior, then of the change, which is in proportion to it
        variance = (1 + ratio * share / (1 - share)) * (float(inverse[0, k]) * power) ** 2 / power
        conflict = max(conflict, dark_uncertainty(change, variance, u, ways=len(stated)))
    return conflict


def answer_of(estimate: Estimate) -> Evaluated:
    """Parameters with their budget, and the sensitivity of the inertia to each constant."""
    setup = estimate.setup
    weights = _sought(estimate.unknowns)
    units = units_on(linear=setup.equation.linear) | {item.name: item.unit for item in estimate.unknowns.items}
    values = {name: (float(row @ estimate.values), units[name]) for name, row in weights.items()}
    combinations = np.array(list(weights.values()))
    searched, common = estimate.searched, list(_grid(estimate, weights))
    disagreements = {f"disagreement of readings, {name}": gap for name, (_, _, gap) in estimate.kinds.items()}
    disagreements |= {
        "choice of the friction law": searched.spread,
        "drift with the length of the segments": searched.drift,
    }
    common += [(systematic(source), "inertia", u) for source, u in disagreements.items()]
    conflict = max(prior_conflict(estimate), setup.check.conflict_with(math.sqrt(estimate.covariance[0, 0])))
    common.append((systematic(CONFLICT), "inertia", conflict))
    declared = [replace(effect, slopes=combinations @ effect.slopes) for effect in estimate.declared]
    matrix = combinations @ estimate.covariance @ combinations.T
    unknown = [name for k, name in enumerate(values) if matrix[k, k] <= 0]
    scattered = Scatter(SCATTER, matrix, np.full(len(combinations), estimate.freedom))
    relative = setup.rig.axis.model_uncertainty
    return evaluate(values, scattered, common, declared, unknown, relative)


def _grid(estimate: Estimate, weights: dict[str, Array]) -> Iterator[tuple[Source, str, float]]:
    """Effects of the encoders' grids beyond the scatter, which contains them too, and of the unknown zero offset."""
    for name, row in weights.items():
        beyond = float(row @ (estimate.grid - estimate.covariance) @ row)
        yield systematic("place of the encoder's grid"), name, math.sqrt(max(beyond, 0.0))
        yield systematic("zero of the angle"), name, float(np.abs(row) @ estimate.zero)


def _sought(unknowns: Unknowns) -> dict[str, Array]:
    """Weights of every reported parameter on the unknowns: the static friction is Stribeck's peak on Coulomb's."""
    unit = {item.name: np.eye(len(unknowns))[k] for k, item in enumerate(unknowns.items) if item.is_sought}
    if "stribeck" not in unit:
        return unit
    sides = [unit[name] for name in ("coulomb", "coulomb_positive", "coulomb_negative") if name in unit]
    peak = unit.pop("stribeck")
    # a peak of no height has no speed
    return unit | {"static": peak + np.mean(sides, axis=0)}


def details_of(estimate: Estimate, extra: dict[str, float]) -> Details:
    """What the report draws; the residuals are those of the axis' angle, in rad (m). extra: more shares."""
    fit, problem, setup = estimate.searched.fit, estimate.searched.problem, estimate.setup
    kinds = {name: (value, u) for name, (value, u, _) in estimate.kinds.items()}
    spread, balance = float(np.sqrt(estimate.covariance[0, 0])), setup.check.motor_balance
    return Details(
        start=setup.part.start,
        stop=setup.part.stop,
        turning_times=setup.part.motion.turning_times,
        turning_angles=setup.part.motion.turning_angles,
        friction=_friction_curve(estimate),
        estimates={"all readings": (float(estimate.values[0]), spread)} | kinds,
        residual_times=problem.times[~problem.wheel],
        residuals=(fit.residuals * problem.sigma)[~problem.wheel],
        residual_unit="m" if setup.equation.linear else "rad",
        extra=extra if balance is None else extra | {"motor_balance_residual": balance.as_stated},
    )


def _friction_curve(estimate: Estimate) -> FrictionCurve:
    """The fitted law up to the highest speed, with uncertainties of type A."""
    names, searched = estimate.unknowns.names, estimate.searched
    at = dict(zip(names, estimate.values, strict=True))
    terms = tuple(name for name in names if name in FRICTION and name != "stribeck_speed")
    law = Law(searched.law, terms, np.array([at[name] for name in terms]), at.get("stribeck_speed", np.nan))
    places = [names.index(name) for name in law.unknowns]
    fastest = float(np.max(np.abs(searched.fit.prediction.rates[~searched.problem.wheel])))
    speeds = curve_speeds(fastest, CURVE_KNOTS)
    return law.curve_at(speeds, estimate.covariance[np.ix_(places, places)], searched.candidates)
