"""Inertia and an unknown gravity torque from several logs together: generalised least squares on both.

One frequency determines one combination of the two (q1'' is nearly parallel to sin q1), another frequency another one.
Each log's pair (inertia, gravity torque) with its whole type A covariance is the equation of its combination; together
they determine both, as a fit of all rows at once would.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from swingid.numerics.arrays import Array
from swingid.pooling.pooling import BETWEEN, Pooled
from swingid.result.result import Result
from swingid.result.sources import is_correlated, values_of
from swingid.uncertainty.budget import correlation_of
from swingid.uncertainty.budget import scatter as scatter_source
from swingid.uncertainty.significance import FAMILY
from swingid.uncertainty.uncertain import Uncertain, covariance, weighted_sum

PAIR = ("inertia", "gravity_torque")
SCATTER = "scatter of the logs, inertia and gravity torque together"


def is_joint(results: Sequence[Result]) -> bool:
    """Whether every result holds the pair with its covariance."""
    return all(set(PAIR) <= set(result.covariance) and set(PAIR) <= set(result.parameters) for result in results)


@dataclass(frozen=True)
class Pairs:
    """The pairs of n logs: values (n, 2), type A covariances (n, 2, 2), estimates of type B alone (2 n, log by log)."""

    values: Array
    own: Array
    type_b: list[Uncertain]

    @classmethod
    def of(cls, results: Sequence[Result], estimates: dict[str, list[Uncertain]]) -> Pairs:
        """From the results and the estimates of each of the two parameters, per log."""
        flat = [estimates[name][k] for k in range(len(results)) for name in PAIR]
        own = [_own_covariance(result, estimates[PAIR[0]][k]) for k, result in enumerate(results)]
        return cls(np.array([e.value for e in flat]).reshape(-1, 2), np.array(own), [e.of_type("B") for e in flat])

    def gains(self, used: Sequence[int]) -> Array:
        """Weights (2, 2 n) of all values in the common pair of the logs `used`, least squares by type A."""
        unit = np.abs(self.values).max(axis=0)
        information = {k: _inverse(self.own[k] / np.outer(unit, unit)) for k in used}
        whole = sum(information.values())
        found = np.zeros((2, self.values.size))
        for k, each in information.items():
            found[:, 2 * k : 2 * k + 2] = np.linalg.solve(whole, each) * np.outer(unit, 1 / unit)
        return found

    def covariance(self) -> Array:
        """Of all values, type A and B, (2 n, 2 n)."""
        whole = covariance(self.type_b)
        for k, matrix in enumerate(self.own):
            whole[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] += matrix
        return whole

    def scatter(self, gains: Array) -> Array:
        """Type A covariance (2, 2) of the common pair."""
        blocks = [gains[:, 2 * k : 2 * k + 2] for k in range(len(self.values))]
        result: Array = np.sum([b @ own @ b.T for b, own in zip(blocks, self.own, strict=True)], axis=0)
        return result

    def common_covariance(self) -> dict[str, dict[str, float]]:
        """Type A covariance of the common pair, by name."""
        matrix = self.scatter(self.gains(range(len(self.values))))
        return {one: {other: float(matrix[i, j]) for j, other in enumerate(PAIR)} for i, one in enumerate(PAIR)}


def pool_pair(pairs: Pairs, between_them: str = BETWEEN) -> dict[str, Pooled]:
    """Pooled inertia and gravity torque; between_them: name of the scatter between the logs.

    Where the logs scatter more than their covariances explain, all type A covariances are scaled by the Birge ratio
    (Birge 1932, Phys. Rev. 40, 207): along the direction that a log hardly determines, additive scatter
    is not identifiable.
    """
    count = len(pairs.values)
    gains = pairs.gains(range(count))
    scatter = pairs.scatter(gains)
    excess, freedom = _excess(pairs, gains), 2 * (count - 1)
    pooled = {}
    for i, name in enumerate(PAIR):
        estimate = weighted_sum(pairs.type_b, gains[i])
        estimate += Uncertain.of(0.0, math.sqrt(scatter[i, i]), scatter_source(SCATTER))
        between, effective = math.sqrt(excess * scatter[i, i]), math.inf
        if excess > 0:
            estimate += Uncertain.of(0.0, between, scatter_source(between_them, freedom))
            effective = freedom * (estimate.u / between) ** 4
        weights = np.array([gains[i, 2 * k + i] for k in range(count)])
        pooled[name] = Pooled(estimate, weights, between, effective)
    return pooled


def correlation(
    results: Sequence[Result], pooled: Mapping[str, Pooled], pairs: Pairs | None
) -> dict[str, dict[str, float]]:
    """Correlation coefficients of the common values; none where a result holds none of its own.

    Within a log as its covariance has it, between logs by what rig.toml states; scatter between logs and errors that
    are alike in all of them count as uncorrelated between parameters.
    """
    names, count = list(pooled), len(results)
    gains = np.zeros((count, len(names), len(names)))  # of the common values to those of each log
    for i, one in enumerate(pooled.values()):
        gains[:, i, i] = one.weights
    given = [[name for name in names if name in result.parameters] for result in results]
    if len(names) < 2 or not all(map(is_correlated, results, given)):
        return {}
    matrix = covariance([one.estimate.of_type("B") for one in pooled.values()])
    at = [names.index(name) for name in PAIR] if pairs is not None else []
    together = np.zeros((2, 0)) if pairs is None else pairs.gains(range(count))
    spread = 1.0 if pairs is None else 1.0 + _excess(pairs, together)
    for k, (result, here) in enumerate(zip(results, given, strict=True)):
        within = np.zeros_like(matrix)
        there = [names.index(name) for name in here]
        within[np.ix_(there, there)] = covariance([one.of_type("A") for one in values_of(result, here).values()])
        if pairs is not None:
            gains[k][np.ix_(at, at)] = together[:, 2 * k : 2 * k + 2]
            within[np.ix_(at, at)] = pairs.own[k] * spread
        matrix += gains[k] @ within @ gains[k].T
    np.fill_diagonal(matrix, [one.estimate.u**2 for one in pooled.values()])
    return correlation_of(names, matrix)


def outlying_pair(pairs: Pairs) -> tuple[int, float] | None:
    """The log whose pair is farthest from the others', and how far (1: the limit of chance); None where all agree."""
    count = len(pairs.values)
    if count < 2:
        return None
    whole, flat = pairs.covariance(), pairs.values.ravel()
    limit = -2 * math.log(FAMILY / count)
    far = []
    for k in range(count):
        apart = -pairs.gains([j for j in range(count) if j != k])
        apart[:, 2 * k : 2 * k + 2] += np.eye(2)
        far.append(math.sqrt(_distance(apart @ flat, apart @ whole @ apart.T) / limit))
    worst = int(np.argmax(far))
    return (worst, far[worst]) if far[worst] > 1 else None


def _own_covariance(result: Result, inertia: Uncertain) -> Array:
    """Type A covariance of the pair in one log.

    Entries of the inertia's budget beside the scatter (drift, disagreement, grid) widen the whole matrix, because a
    wrong balance moves the pair along the direction that this log hardly determines.
    """
    matrix = np.array([[result.covariance[one][other] for other in PAIR] for one in PAIR])
    widened: Array = matrix * max(1.0, inertia.of_type("A").u ** 2 / max(matrix[0, 0], 1e-300))
    return widened


def _inverse(matrix: Array) -> Array:
    """Inverse of the matrix with a floor under its eigenvalues."""
    floor = (1e-12 * float(np.trace(matrix)) + 1e-24) * np.eye(len(matrix))
    return np.asarray(np.linalg.inv(matrix + floor), np.float64)


def _excess(pairs: Pairs, gains: Array) -> float:
    """(Birge ratio)² − 1 of the pairs about their mean, not below 0."""
    count = len(pairs.values)
    if count < 2:
        return 0.0
    centring = np.eye(2 * count) - np.tile(gains, (count, 1))
    residual = centring @ pairs.values.ravel()
    observed = _distance(residual, centring @ pairs.covariance() @ centring.T)
    return max(0.0, observed / (2 * (count - 1)) - 1)


def _distance(residual: Array, spread: Array) -> float:
    """Squared Mahalanobis distance, on the directions in which the spread is not zero."""
    scale = np.sqrt(np.maximum(np.diag(spread), 1e-300))
    inverse = np.linalg.pinv(spread / np.outer(scale, scale), rcond=1e-9, hermitian=True)
    return float(residual / scale @ inverse @ (residual / scale))
