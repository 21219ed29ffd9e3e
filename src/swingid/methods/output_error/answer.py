"""From a fit of angles to parameters, uncertainty budget, and what the report draws."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from swingid.checks.consistency import DISAGREES, Consistency
from swingid.methods.output_error.curve import friction_curve
from swingid.methods.output_error.declared import declared_effects, shift_of_momentum
from swingid.methods.output_error.problem import Problem
from swingid.methods.output_error.resolution import grid_covariance, zero_effect
from swingid.methods.output_error.search import Searched
from swingid.methods.output_error.solver import influence_of, informed, inverse_of, reduce
from swingid.methods.output_error.unknowns import Unknowns
from swingid.model.rig import Rig
from swingid.model.terms import units_on
from swingid.numerics.arrays import Array
from swingid.numerics.regression import NEIGHBOURS, block_covariance
from swingid.preparation.motion import Motion
from swingid.preparation.noise import Noise
from swingid.preparation.scale import Scale
from swingid.recording.recording import Recording
from swingid.result.result import Details
from swingid.uncertainty.budget import Declared, Evaluated, Scatter, Source, evaluate, systematic
from swingid.uncertainty.dark import dark_uncertainty
from swingid.uncertainty.freedom import effective_freedom, scatter_freedom

SCATTER = "scatter of the residuals and sensor noise"
LESS = 0.1
"""Weight of a channel (of half of the log) when the estimate is taken mostly from the other."""


@dataclass(frozen=True)
class Estimate:
    """A finished fit: unknowns and values; influence K (m, r) of the readings; covariance (m, m) of type A.

    freedom: degrees of freedom of that of the inertia. declared: shift of the values (m,) by one unit of every constant
    or imperfection. kinds: inertia, standard uncertainty and dark uncertainty when
    some of the readings count less. grid (m, m), zero (m,): covariance over the place of the encoders' grids, standard
    deviations from the angle's zero.
    """

    searched: Searched
    influence: Array
    covariance: Array
    freedom: float
    declared: tuple[Declared, ...]
    kinds: dict[str, tuple[float, float, float]]
    grid: Array
    zero: Array

    @property
    def robust(self) -> bool:
        """Whether outliers count less, which the momentum balance does not bear."""
        return bool(np.any(self.searched.fit.weights < 1.0))

    @property
    def unknowns(self) -> Unknowns:
        """The unknowns, in order."""
        return self.searched.unknowns

    @property
    def values(self) -> Array:
        """Their values."""
        return self.searched.fit.values


def estimate_of(
    searched: Searched, problem: Problem, log: Recording, rig: Rig, scale: Scale, motion: Motion, noise: Noise
) -> Estimate:
    """Judge a fit: covariance, what every constant of the rig does to it, and how parts of the readings agree."""
    fit = searched.fit
    influence = influence_of(problem, fit.prediction.slopes, fit.weights, fit.reduced)
    covariance, freedom = _covariance(influence, fit.residuals, problem, motion)
    declared = declared_effects(searched, problem, influence, log, rig, scale, noise)
    grid = np.zeros_like(covariance)
    if log.averaged == 1:
        grid = grid_covariance(problem, fit, influence, noise)
    kinds = _kinds(searched, problem, influence, covariance)
    zero = zero_effect(fit, searched.unknowns)
    return Estimate(searched, influence, covariance, freedom, declared, kinds, grid, zero)


def type_a(problem: Problem, searched: Searched, motion: Motion) -> float:
    """Standard uncertainty of a fit's inertia from scatter and disagreement, infinite where its motion ran away."""
    fit = searched.fit
    if not np.isfinite(fit.cost):
        return np.inf
    influence = influence_of(problem, fit.prediction.slopes, fit.weights, fit.reduced)
    covariance, _ = _covariance(influence, fit.residuals, problem, motion)
    gaps = [gap for _, _, gap in _kinds(searched, problem, influence, covariance).values()]
    return float(np.sqrt(covariance[0, 0] + np.sum(np.square(gaps))))


def _covariance(influence: Array, residuals: Array, problem: Problem, motion: Motion) -> tuple[Array, float]:
    """That of white noise of the sensors, no less than the residuals' own scatter over half swings (Newey–West) shows.

    Correlated residuals (an encoder's grid, a model that is not quite right) count as many times as they repeat. Also
    the degrees of freedom of the first value's: many for white noise, those of the half swings for what is beyond it.
    """
    freedom = max(len(residuals) - len(influence) - problem.states * (len(problem.rows) - 1), 1)
    size = max(1.0, float(residuals @ residuals) / freedom)
    white: Array = influence @ influence.T * size
    blocks = np.searchsorted(motion.turning_times, problem.times)
    segment = np.searchsorted(problem.rows, np.arange(len(residuals)), side="right")
    _, label = np.unique(segment * (len(motion.turning_times) + 1) + blocks, return_inverse=True)
    scores = np.array([np.bincount(label, row) for row in influence * residuals])
    robust = block_covariance(scores, len(influence))
    floor = np.maximum(np.diag(white), 1e-300)
    stretch = np.sqrt(np.maximum(np.diag(robust) / floor, 1.0))
    weights = np.sqrt(np.bincount(label, influence[0] ** 2))
    beyond = (white[0, 0] * (stretch[0] ** 2 - 1)) ** 0.5, scatter_freedom(weights, NEIGHBOURS, len(influence))
    return white * np.outer(stretch, stretch), effective_freedom(((white[0, 0] ** 0.5, freedom), beyond))


def _kinds(
    searched: Searched, problem: Problem, influence: Array, covariance: Array
) -> dict[str, tuple[float, float, float]]:
    """The inertia when one channel, or one half of the log, counts `LESS`: one Gauss–Newton step from the answer."""
    fit = searched.fit
    middle = problem.times[problem.rows[(len(problem.rows) - 1) // 2]]
    groups = {"mostly its first half": problem.times < middle, "mostly its second half": problem.times >= middle}
    if len(problem.rows) < 3:
        groups = {}
    if problem.input == "voltage":
        groups |= {"mostly the angle": ~problem.wheel, "mostly the wheel": problem.wheel}
    ratio = covariance[0, 0] / max(float(influence[0] @ influence[0]), 1e-300)
    found = {}
    for name, mostly in groups.items():
        weights = fit.weights * np.where(mostly, 1.0, LESS**2)
        data = reduce(problem, fit.prediction.slopes, fit.residuals, weights)
        reduced = informed(data, searched.unknowns, fit.values)
        other = influence_of(problem, fit.prediction.slopes, weights, reduced)[0]
        shift = float(inverse_of(reduced)[0] @ reduced.right)
        # readings count otherwise, and what is stated of constants and sensors, which is off by its own std
        told = (inverse_of(reduced)[0] - inverse_of(fit.reduced)[0]) * np.sqrt(searched.unknowns.power)
        variance = float((other - influence[0]) @ (other - influence[0])) * ratio + float(told @ told)
        dark = dark_uncertainty(shift, variance, float(np.sqrt(covariance[0, 0])))
        found[name] = float(fit.values[0]) + shift, float(np.sqrt(other @ other * ratio)), dark
    return found


def answer_of(estimate: Estimate, rig: Rig, scale: Scale, consistency: Consistency) -> Evaluated:
    """Parameters with their budget, and the sensitivity of the inertia to each constant.

    consistency: the momentum balance of some of the swings. Residuals do not show what a wrong model does to the
    inertia, another method does.
    """
    weights = _sought(estimate.unknowns)
    units = units_on(linear=scale.linear) | {item.name: item.unit for item in estimate.unknowns.items}
    values = {name: (float(own @ estimate.values), units[name]) for name, own in weights.items()}
    own = np.array(list(weights.values()))
    searched, common = estimate.searched, list(_grid(estimate, weights))
    found = {f"disagreement of readings, {name}": gap for name, (_, _, gap) in estimate.kinds.items()}
    found |= {"choice of the friction law": searched.spread, "drift with the length of the segments": searched.drift}
    common += [(systematic(source), "inertia", u) for source, u in found.items()]
    windows = consistency.windows
    if windows is not None and not estimate.robust:
        balance = windows.a11 + shift_of_momentum(consistency, searched, rig, scale) - scale.carried
        type_a = math.sqrt(estimate.covariance[0, 0] + sum(u**2 for _, name, u in common if name == "inertia"))
        dark = dark_uncertainty(float(estimate.values[0]) - balance, type_a**2 + windows.u**2, type_a)
        common.append((systematic(DISAGREES), "inertia", dark))
    declared = [replace(one, slopes=own @ one.slopes) for one in estimate.declared]
    matrix = own @ estimate.covariance @ own.T
    unknown = [name for k, name in enumerate(values) if matrix[k, k] <= 0]
    return evaluate(values, Scatter(SCATTER, matrix, np.full(len(own), estimate.freedom)), common, declared, unknown)


def _grid(estimate: Estimate, weights: dict[str, Array]) -> Iterator[tuple[Source, str, float]]:
    """What the encoders' grids do beyond the scatter, which holds them too, and what is left open of the zero."""
    for name, own in weights.items():
        beyond = float(own @ (estimate.grid - estimate.covariance) @ own)
        yield systematic("place of the encoder's grid"), name, math.sqrt(max(beyond, 0.0))
        yield systematic("zero of the angle"), name, float(np.abs(own) @ estimate.zero)


def _sought(unknowns: Unknowns) -> dict[str, Array]:
    """Weights of every reported parameter on the unknowns: the static friction is Stribeck's peak on Coulomb's."""
    unit = {item.name: np.eye(len(unknowns))[k] for k, item in enumerate(unknowns.items) if item.is_sought}
    if "stribeck" not in unit:
        return unit
    sides = [unit[name] for name in ("coulomb", "coulomb_positive", "coulomb_negative") if name in unit]
    peak = unit.pop("stribeck")
    # a peak of no height has no speed
    return unit | {"static": peak + np.mean(sides, axis=0)}


def details_of(
    estimate: Estimate, problem: Problem, scale: Scale, motion: Motion, span: tuple[float, float], law: str
) -> Details:
    """What the report draws; the residuals are those of the axis' angle, in rad (m)."""
    fit = estimate.searched.fit
    kinds = {name: (value, u) for name, (value, u, _) in estimate.kinds.items()}
    own = float(np.sqrt(estimate.covariance[0, 0]))
    return Details(
        start=span[0],
        stop=span[1],
        turning_times=motion.turning_times,
        turning_angles=motion.turning_angles,
        friction=friction_curve(
            estimate.searched, estimate.covariance, float(np.max(np.abs(fit.prediction.rates[~problem.wheel]))), law
        ),
        estimates={"all readings": (float(estimate.values[0]), own)} | kinds,
        residual_times=problem.times[~problem.wheel],
        residuals=(fit.residuals * problem.sigma)[~problem.wheel],
        residual_unit="m" if scale.linear else "rad",
    )
