"""The common values of several results of one body: which are pooled, their budget, how they are correlated.

Inertia and an unknown gravity torque are pooled together, by generalised least squares on both. One frequency
determines one combination of the two (q1'' is nearly parallel to sin q1), another frequency another one. Each log's
pair with its whole type A covariance is the equation of its combination; together they determine both, as a fit of all
rows at once would.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from swingid.numerics.arrays import Array
from swingid.numerics.regression import squared_distance
from swingid.pooling.pooling import BETWEEN, Pooled, pool
from swingid.result.result import Result
from swingid.result.sources import Identity, is_correlated, value_of, values_of
from swingid.uncertainty.budget import BudgetEntry, correlation_of
from swingid.uncertainty.budget import scatter as scatter_source
from swingid.uncertainty.significance import FAMILY
from swingid.uncertainty.uncertain import Uncertain, covariance, weighted_sum

PAIR = ("inertia", "gravity_torque")
SCATTER = "scatter of the logs, inertia and gravity torque together"


@dataclass(frozen=True)
class Pairs:
    """The pairs of n logs: values (n, 2), type A covariances (n, 2, 2), estimates of type B alone (2 n, log by log)."""

    values: Array
    own: Array
    type_b: list[Uncertain]

    @classmethod
    def of(cls, results: Sequence[Result], estimates: dict[str, list[Uncertain]]) -> Pairs:
        """Pair the results with the estimates of each of the two parameters, per log."""
        flat = [estimates[name][k] for k in range(len(results)) for name in PAIR]
        covariances = [_own_covariance(result, estimates[PAIR[0]][k]) for k, result in enumerate(results)]
        return cls(
            np.array([e.value for e in flat]).reshape(-1, 2), np.array(covariances), [e.of_type("B") for e in flat]
        )

    def gains(self, used: Sequence[int]) -> Array:
        """Weights (2, 2 n) of all values in the common pair of the logs `used`, least squares by type A."""
        unit = np.abs(self.values).max(axis=0)
        information = {k: _inverse(self.own[k] / np.outer(unit, unit)) for k in used}
        whole = sum(information.values())
        gains = np.zeros((2, self.values.size))
        for k, each in information.items():
            gains[:, 2 * k : 2 * k + 2] = np.linalg.solve(whole, each) * np.outer(unit, 1 / unit)
        return gains

    def covariance(self) -> Array:
        """The covariance of all values, type A and B, (2 n, 2 n)."""
        whole = covariance(self.type_b)
        for k, matrix in enumerate(self.own):
            whole[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] += matrix
        return whole

    def scatter(self, gains: Array) -> Array:
        """Type A covariance (2, 2) of the common pair."""
        blocks = [gains[:, 2 * k : 2 * k + 2] for k in range(len(self.values))]
        result: Array = np.sum([b @ covariance @ b.T for b, covariance in zip(blocks, self.own, strict=True)], axis=0)
        return result

    def common_covariance(self) -> dict[str, dict[str, float]]:
        """Type A covariance of the common pair, by name."""
        matrix = self.scatter(self.gains(range(len(self.values))))
        return {first: {second: float(matrix[i, j]) for j, second in enumerate(PAIR)} for i, first in enumerate(PAIR)}


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
        beside = {PAIR[1 - i]: gains[i, 1 - i :: 2]}
        pooled[name] = Pooled(estimate, gains[i, i::2], between, effective, beside)
    return pooled


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
        far.append(math.sqrt(squared_distance(apart @ flat, apart @ whole @ apart.T) / limit))
    worst = int(np.argmax(far))
    return (worst, far[worst]) if far[worst] > 1 else None


def _own_covariance(result: Result, inertia: Uncertain) -> Array:
    """Type A covariance of the pair in one log.

    Entries of the inertia's budget beside the scatter (drift, disagreement, grid) widen the whole matrix, because a
    wrong balance moves the pair along the direction that this log hardly determines.
    """
    matrix = np.array([[result.covariance_of_fit[first][second] for second in PAIR] for first in PAIR])
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
    observed = squared_distance(residual, centring @ pairs.covariance() @ centring.T)
    return max(0.0, observed / (2 * (count - 1)) - 1)


def given_by_all(results: Sequence[Result]) -> list[str]:
    """Parameters that every result gives with an uncertainty."""
    given = [{entry.parameter for entry in result.budget} for result in results]
    return [name for first in results[:1] for name in first.parameters if all(name in names for names in given)]


def estimates_of(results: Sequence[Result], name: str, *, scatter_is_shared: bool = False) -> list[Uncertain]:
    """Estimates of a parameter, per log; scatter_is_shared: the scatter of the logs does not average out."""
    return [value_of(result, name, _identity(k, scatter_is_shared)) for k, result in enumerate(results)]


def _identity(log: int, scatter_is_shared: bool = False) -> Identity:
    """Scatter is each log's own; the rig's constants, and errors of type A that are alike in all logs, are not."""

    def key(entry: BudgetEntry) -> str:
        if entry.type == "B":
            return entry.shared_id or f"log {log}: {entry.source}"
        per_log = entry.origin.averages_over_logs and not scatter_is_shared
        return f"log {log}: {entry.source}" if per_log else entry.source

    return key


@dataclass(frozen=True)
class Common:
    """Several results, of each pooled parameter the estimates that count and the common value.

    pairs: inertia and gravity torque of all, where they are pooled together.
    """

    results: Sequence[Result]
    estimates: dict[str, list[Uncertain]]
    pooled: dict[str, Pooled]
    pairs: Pairs | None

    @classmethod
    def of(
        cls, results: Sequence[Result], alike: Sequence[int], *, between: str = BETWEEN, scatter_is_shared: bool = False
    ) -> Common:
        """Pool inertia and gravity torque of all results, everything else of those with the numbers `alike`.

        between: name of the scatter between logs; scatter_is_shared: see `estimates_of`.
        """
        groups = {True: results, False: [results[k] for k in alike]}
        names = [
            name for paired, of_group in groups.items() for name in given_by_all(of_group) if (name in PAIR) is paired
        ]
        estimates = {
            name: estimates_of(groups[name in PAIR], name, scatter_is_shared=scatter_is_shared) for name in names
        }
        pooled = {name: pool(each, between) for name, each in estimates.items()}
        joint = all({*PAIR} <= {*result.covariance_of_fit} & {*result.parameters} for result in results)
        pairs = Pairs.of(results, estimates) if joint else None
        for name in set(pooled).difference(PAIR):
            weights = np.zeros(len(results))
            weights[list(alike)] = pooled[name].weights
            pooled[name] = replace(pooled[name], weights=weights)
        return cls(results, estimates, pooled | (pool_pair(pairs, between) if pairs else {}), pairs)

    def result(self) -> Result:
        """The result with the common values, their budget and correlations; without messages and provenance."""
        units = {name: parameter.unit for result in self.results for name, parameter in result.parameters.items()}
        sensitivities = {}
        if self.pairs is None:  # of the pooled inertia, where every log has its own
            weights, slopes = self.pooled["inertia"].weights, [result.sensitivities for result in self.results]
            keys = [key for key in slopes[0] if all(key in of_log for of_log in slopes)]
            sensitivities = {key: float(weights @ [of_log[key] for of_log in slopes]) for key in keys}
        return Result(
            method=self.results[0].method,
            status="ok",
            parameters={name: common.parameter(units[name]) for name, common in self.pooled.items()},
            budget=tuple(entry for name, common in self.pooled.items() for entry in common.estimate.entries(name)),
            sensitivities=sensitivities,
            covariance_of_fit={} if self.pairs is None else self.pairs.common_covariance(),
            correlation=self.correlation(),
        )

    def correlation(self) -> dict[str, dict[str, float]]:
        """Correlation coefficients of the common values; none where a result holds none of its own.

        Within a log as it states them, between logs by what rig.toml states; scatter between logs and errors that are
        alike in all of them count as uncorrelated between parameters.
        """
        names = list(self.pooled)
        given = [[name for name in names if name in result.parameters] for result in self.results]
        if len(names) < 2 or not all(map(is_correlated, self.results, given)):
            return {}
        values = [
            values_of(result, of_log, _identity(k))
            for k, (result, of_log) in enumerate(zip(self.results, given, strict=True))
        ]
        sums = []
        for name, value in self.pooled.items():
            shares = {name: value.weights, **value.beside}
            terms = [(values[k][of_log], w) for of_log, weights in shares.items() for k, w in enumerate(weights) if w]
            sums.append(weighted_sum(*zip(*terms, strict=True)))
        matrix = covariance(sums)
        if self.pairs is not None:  # wider than each log states it
            at = [names.index(name) for name in PAIR]
            gains = self.pairs.gains(range(len(self.results)))
            shared = covariance([self.pooled[name].estimate.of_type("B") for name in PAIR])
            matrix[np.ix_(at, at)] = shared + self.pairs.scatter(gains) * (1.0 + _excess(self.pairs, gains))
        np.fill_diagonal(matrix, [value.estimate.u**2 for value in self.pooled.values()])
        return correlation_of(names, matrix)
