"""Values whose errors are sums of independent sources, so that sums of such values keep their correlation.

The linear propagation of the GUM (JCGM 100, 5.2), source by source: two values that share a source are correlated by
it, with the signs of their sensitivities.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from swingid.numerics.arrays import Array
from swingid.result.result import Result
from swingid.uncertainty.budget import BudgetEntry, Parameter, Source
from swingid.uncertainty.freedom import effective_freedom


@dataclass(frozen=True)
class Share:
    """The contribution of one source to a value.

    u: change of the value for one standard deviation of the source, with its sign where that is known. std: the
    source's standard deviation in its own unit (None: type A).
    """

    source: Source
    u: float
    std: float | None = None


@dataclass(frozen=True)
class Estimate:
    """A value and its shares by identity of their source: equal keys are one and the same random quantity."""

    value: float
    shares: dict[str, Share]

    @property
    def u(self) -> float:
        """Standard uncertainty."""
        return math.sqrt(sum(share.u**2 for share in self.shares.values()))

    @property
    def of_type_b(self) -> Estimate:
        """The same with its shares of type B alone."""
        return Estimate(self.value, {key: share for key, share in self.shares.items() if share.source.type == "B"})

    @property
    def freedom(self) -> float:
        """Effective degrees of freedom."""
        return effective_freedom((share.u, share.source.degrees_of_freedom) for share in self.shares.values())

    def entries(self, parameter: str) -> list[BudgetEntry]:
        """The budget of a parameter with this value; sources of one name and nature are one entry."""
        merged: dict[Source, list[Share]] = {}
        for share in self.shares.values():
            merged.setdefault(replace(share.source, degrees_of_freedom=math.inf), []).append(share)
        found = []
        for source, shares in merged.items():
            first, u = shares[0], math.sqrt(sum(share.u**2 for share in shares))
            slope = first.u / first.std if len(shares) == 1 and first.std else None
            freedom = effective_freedom((share.u, share.source.degrees_of_freedom) for share in shares)
            found.append(BudgetEntry(replace(source, degrees_of_freedom=freedom), parameter, u, slope))
        return found

    def parameter(self, unit: str) -> Parameter:
        """The value with its interval."""
        return Parameter.of(self.value, self.u, unit, self.freedom)


Identity = Callable[[BudgetEntry], str]
"""From an entry of a result's budget to the identity of its source among all results that are combined."""


def by_source(entry: BudgetEntry) -> str:
    """Identity of what a result states: the physical quantity, else the source's name."""
    return entry.shared_id or entry.source


def estimate_of(result: Result, parameter: str, identity: Identity) -> Estimate:
    """Value and shares of a parameter from a result's budget."""
    shares: dict[str, Share] = {}
    for k, entry in enumerate(entry for entry in result.budget if entry.parameter == parameter):
        u, std = entry.standard_uncertainty, None
        if entry.sensitivity:
            std = u / abs(entry.sensitivity)
            u = math.copysign(u, entry.sensitivity)
        key = identity(entry)
        # two entries of one identity in one budget are two quantities
        shares[key if key not in shares else f"{key} #{k}"] = Share(entry.origin, u, std)
    return Estimate(result.parameters[parameter].value, shares)


def sum_of(estimates: Sequence[Estimate], weights: Iterable[float], constant: float = 0.0) -> Estimate:
    """Constant + Σ weight · estimate, source by source."""
    shares: dict[str, Share] = {}
    value = constant
    for estimate, weight in zip(estimates, weights, strict=True):
        value += weight * estimate.value
        for key, share in estimate.shares.items():
            u = weight * share.u + (shares[key].u if key in shares else 0.0)
            shares[key] = Share(share.source, u, share.std)
    return Estimate(value, shares)


def covariance(estimates: Sequence[Estimate]) -> Array:
    """Covariance of the values, (n, n)."""
    keys = list(dict.fromkeys(key for estimate in estimates for key in estimate.shares))
    matrix = np.array([[e.shares[key].u if key in e.shares else 0.0 for key in keys] for e in estimates])
    matrix = matrix.reshape(len(estimates), len(keys))
    result: Array = matrix @ matrix.T
    return result


def scatter_covariance(result: Result, names: Sequence[str]) -> Array | None:
    """Type A covariance of parameters in a result, (n, n): all less that of type B; None where it is not known."""
    if any(name not in result.correlation for name in names):
        return None
    u = np.array([result.parameters[name].standard_uncertainty for name in names], dtype=np.float64)
    whole = np.array([[result.correlation[one][other] for other in names] for one in names]) * np.outer(u, u)
    stated = [estimate_of(result, name, by_source).of_type_b for name in names]
    found: Array = whole - covariance(stated)
    return found
