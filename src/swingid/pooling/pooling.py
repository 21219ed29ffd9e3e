"""The common value of one parameter in several logs, its weights and the scatter between logs; which logs disagree.

The logs' values are x_i = θ + (what all logs share) + b_i + e_i: e_i has the standard uncertainty that log i states on
its own, b_i the variance τ² of whatever differs from run to run and is in no budget. τ² is Paule and Mandel's (1982, J.
Res. NBS 87, 377), the choice of consensus building among laboratories (Koepke, Lafarge, Possolo and Toman 2017,
Metrologia 54, S34; Veroniki et al. 2016, Res. Synth. Methods 7, 55), with the shared sources removed from the observed
scatter as in the general method of moments (DerSimonian and Kacker 2007, Contemp. Clin. Trials 28, 105). A Birge ratio
would widen every log in proportion to its uncertainty: right for wrong uncertainties, not for differing runs. Where
τ > 0 the interval is Student's with n − 1 degrees of freedom (Hartung and Knapp 2001, Stat. Med. 20, 3875). Two or
three logs hardly determine τ: where its estimate is 0 by chance, the interval is that of the logs' own uncertainties.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from swingid.numerics.arrays import Array
from swingid.uncertainty.budget import Parameter, scatter
from swingid.uncertainty.significance import family_level
from swingid.uncertainty.uncertain import Uncertain, covariance, weighted_sum

BETWEEN = "scatter between the logs"


@dataclass(frozen=True)
class Pooled:
    """Common value of n logs: its estimate, the weights (n,), standard deviation τ between logs, degrees of freedom.

    beside: weights (n,) of another parameter of the logs, by its name, where both are pooled together.
    """

    estimate: Uncertain
    weights: Array
    between: float
    freedom: float
    beside: Mapping[str, Array] = field(default_factory=dict)

    def parameter(self, unit: str) -> Parameter:
        """Value with its interval."""
        return Parameter.of(self.estimate.value, self.estimate.u, unit, self.freedom)


def pool(estimates: Sequence[Uncertain], between_them: str = BETWEEN) -> Pooled:
    """Pool the estimates of one parameter from several logs (at least one); between_them: name of their scatter.

    Weights are 1/(u_i² + τ²): u_i is what log i has on its own (type A), with what the type B shifts of log i exceed
    the least such shift among the logs, so that a log that depends more on a constant than the others has less weight.
    """
    whole = covariance(estimates)
    values = np.array([estimate.value for estimate in estimates])
    variances = _weight_variances(estimates)
    between = _between(values, variances, whole)
    weights = 1 / (variances + between)
    weights = weights / weights.sum()
    pooled = weighted_sum(estimates, weights)
    if between == 0:
        return Pooled(pooled, weights, 0.0, pooled.freedom)
    extra = math.sqrt(between * float(weights @ weights))
    pooled += Uncertain.of(0.0, extra, scatter(between_them, len(values) - 1))
    # τ is known from these logs alone, so what averages out over them has n − 1 degrees of freedom
    averaged = between + np.array([_alone(estimates, k) for k in range(len(values))])
    share = float(weights**2 @ averaged) / pooled.u**2
    return Pooled(pooled, weights, math.sqrt(between), (len(values) - 1) / share**2)


def _alone(estimates: Sequence[Uncertain], k: int) -> float:
    """Variance of log k by sources that no other log has."""
    others = {key for j, estimate in enumerate(estimates) if j != k for key in estimate.shifts}
    return estimates[k].only(lambda key: key not in others).u ** 2


def _weight_variances(estimates: Sequence[Uncertain]) -> Array:
    """Variance from which the weights follow, (n,), never zero."""
    common = [key for key in estimates[0].shifts if all(key in estimate.shifts for estimate in estimates)]
    least = {key: min(abs(estimate.shifts[key]) for estimate in estimates) for key in common}
    variances = [
        sum((abs(shift) - least.get(key, 0.0)) ** 2 for key, shift in estimate.shifts.items()) for estimate in estimates
    ]
    # below the rounding of a value no log is better than another
    floor = (1e-9 * max(abs(estimate.value) for estimate in estimates)) ** 2
    result: Array = np.array(variances) + max(floor, 1e-300)
    return result


def _between(values: Array, variances: Array, whole: Array) -> float:
    """τ²: where the weighted scatter of the values is what their covariance and τ² make one expect; 0 below."""

    def excess(between: float) -> float:
        weights = 1 / (variances + between)
        share = weights / weights.sum()
        centred = values - share @ values
        expected = weights @ np.diag(whole) - weights @ whole @ share + between * (weights.sum() - weights @ share)
        return float(weights @ centred**2 - expected)

    if len(values) < 2 or excess(0.0) <= 0:
        return 0.0
    low, high = 0.0, float(np.ptp(values)) ** 2
    while excess(high) > 0:
        high *= 4
    for _ in range(200):
        middle = (low + high) / 2
        if middle in (low, high):
            break
        low, high = (middle, high) if excess(middle) > 0 else (low, middle)
    return (low + high) / 2


@dataclass(frozen=True)
class Deviation:
    """One of several values, by its number, less what the others give, and the standard uncertainty of that."""

    index: int
    value: float
    u: float

    @classmethod
    def of(cls, index: int, value: Uncertain, predicted: Uncertain) -> Deviation:
        """A value less what the others predict: common sources cancel, but for the rounding of the value."""
        gap = value - predicted
        return cls(index, gap.value, math.hypot(gap.u, 1e-9 * abs(value.value)))

    @property
    def ratio(self) -> float:
        """The deviation in standard uncertainties."""
        return self.value / self.u if self.u else math.copysign(math.inf, self.value)

    @property
    def normalised(self) -> float:
        """E_n of ISO 13528 (9.7) and ISO/IEC 17043: the deviation over its expanded uncertainty, k = 2."""
        return self.ratio / 2


def worst_beyond_chance(tested: Iterable[Deviation | None]) -> Deviation | None:
    """The deviation that is largest, where it is beyond chance: one false finding in a hundred of such families."""
    known = [deviation for deviation in tested if deviation is not None]
    if not known:
        return None
    worst = max(known, key=lambda deviation: abs(deviation.ratio))
    return worst if abs(worst.ratio) > family_level(len(known)) else None


def deviations(estimates: Sequence[Uncertain]) -> list[Deviation]:
    """Each log against the pooled value of the others (leave one out).

    The uncertainties are without the scatter between logs, which is tested here.
    """
    each = []
    for k, estimate in enumerate(estimates):
        others = [other for j, other in enumerate(estimates) if j != k]
        each.append(Deviation.of(k, estimate, weighted_sum(others, pool(others).weights)))
    return each


def outliers(estimates: Sequence[Uncertain]) -> list[Deviation]:
    """The logs that disagree with the rest, the worst first: it is taken out and the others are tested again.

    Of two logs that disagree both are returned, for nothing shows which is right. So are all where no majority agrees.
    """
    remaining = list(range(len(estimates)))
    named: list[Deviation] = []
    while len(remaining) > 1:
        worst = worst_beyond_chance(deviations([estimates[k] for k in remaining]))
        if worst is None:
            break
        if len(remaining) == 2 or len(named) + 1 >= math.ceil(len(estimates) / 2):
            return deviations(estimates)
        named.append(replace(worst, index=remaining.pop(worst.index)))
    return named
