"""Parameters of a result as values with sources, for what is computed from one result or several."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from itertools import combinations

from swingid.result.data import ResultData
from swingid.uncertainty.budget import BudgetEntry, Evaluated
from swingid.uncertainty.uncertain import Uncertain

Identity = Callable[[BudgetEntry], str]
"""From an entry of a result's budget to the identity of its source among all results that are combined."""


def by_source(entry: BudgetEntry) -> str:
    """Identity of what a result states: the physical quantity, else the source's name."""
    return entry.shared_id or entry.source


def values_of(
    result: ResultData | Evaluated, names: Iterable[str], identity: Identity = by_source
) -> dict[str, Uncertain]:
    """Parameters with the sources of their budgets; their scatter is correlated as the result states.

    Sources of type A are each parameter's own. What the correlation of two parameters has beyond the sources of type B
    that they share is one of their scatter, the first source of type A.
    """
    values = {name: value_of(result, name, identity) for name in names}
    scatter = {
        name: next((k for k in value.shifts if value.sources[k].type == "A"), "") for name, value in values.items()
    }
    correlations = {}
    for pair in combinations(values, 2):
        first, second = pair
        a, b = (values[name].shifts.get(scatter[name], 0.0) for name in pair)
        if not a * b or not is_correlated(result, pair):
            continue
        u = [result.parameters[name].standard_uncertainty or 0.0 for name in pair]
        shared = sum(shift * values[second].shifts.get(key, 0.0) for key, shift in values[first].shifts.items())
        scattered = result.correlation[first][second] * u[0] * u[1] - shared
        correlations[scatter[first], scatter[second]] = scattered / (a * b)
    return {name: replace(value, correlations=correlations) for name, value in values.items()}


def value_of(result: ResultData | Evaluated, name: str, identity: Identity = by_source) -> Uncertain:
    """A parameter with the sources of its budget."""
    value = Uncertain(result.parameters[name].value)
    for k, entry in enumerate(entry for entry in result.budget if entry.parameter == name):
        key, shift, source = identity(entry), entry.standard_uncertainty, entry.origin
        if entry.sensitivity:
            source = replace(source, std=shift / abs(entry.sensitivity))
            shift = math.copysign(shift, entry.sensitivity)
        if entry.type == "A":
            key = f"{name}: {key}"
        # two entries of one identity in one budget are two quantities
        value += Uncertain.of(0.0, shift, source, key if key not in value.shifts else f"{key} #{k}")
    return value


def is_correlated(result: ResultData | Evaluated, names: Iterable[str]) -> bool:
    """Return whether the result states how these parameters are correlated."""
    return all(name in result.correlation for name in names)
