"""A value with the sources of its uncertainty, and its arithmetic: one rule of propagation for all of them.

Linear propagation, source by source (JCGM 100:2008 5.1.2 and 5.2.2, JCGM 102:2011 6.2): the shift of a function y of
values x_i by one source is Σ ∂y/∂x_i times that of x_i, with signs, so that values that share a source are correlated
by it. Budget, parameter with its interval, covariance and correlation are views of such values.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

from swingid.numerics.arrays import Array
from swingid.uncertainty.budget import BudgetEntry, Evaluated, Parameter, Source, correlation_of
from swingid.uncertainty.freedom import effective_freedom

CANCELLED = 1e-6
"""Share of the largest shift that is left where correlated sources cancel: below it is rounding."""


@dataclass(frozen=True)
class Uncertain:
    """A value with its shifts: changes for one standard uncertainty of each source, by the source's identity.

    Equal identities are one random quantity in all values. A shift has the sign of the effect where that is known.
    correlations: coefficients of those pairs of sources that are not independent.
    """

    value: float
    shifts: Mapping[str, float] = field(default_factory=dict)
    sources: Mapping[str, Source] = field(default_factory=dict)
    correlations: Mapping[tuple[str, str], float] = field(default_factory=dict)

    __array_ufunc__: ClassVar[None] = None  # numpy leaves its numbers' products with such values to them

    @classmethod
    def of(cls, value: float, shift: float, source: Source, identity: str = "") -> Uncertain:
        """A value with one source, whose name is its identity where none is given; of value 0 it is an error alone."""
        key = identity or source.name
        return cls(value, {key: shift}, {key: source})

    def __add__(self, other: Uncertain | float) -> Uncertain:
        other = _exact(other)
        return first_order(self.value + other.value, (self, other), (1.0, 1.0))

    def __sub__(self, other: Uncertain | float) -> Uncertain:
        return self + -1 * _exact(other)

    def __mul__(self, other: Uncertain | float) -> Uncertain:
        other = _exact(other)
        return first_order(self.value * other.value, (self, other), (other.value, self.value))

    def __truediv__(self, other: Uncertain | float) -> Uncertain:
        return self * _exact(other) ** -1

    def __pow__(self, power: float) -> Uncertain:
        return first_order(self.value**power, (self,), (power * self.value ** (power - 1),))

    __radd__, __rmul__ = __add__, __mul__

    def __rtruediv__(self, other: float) -> Uncertain:
        return other * self**-1

    @property
    def u(self) -> float:
        """Standard uncertainty."""
        return _spread(self.shifts, self.correlations)

    @property
    def freedom(self) -> float:
        """Effective degrees of freedom (Welch and Satterthwaite)."""
        return effective_freedom((e.standard_uncertainty, e.origin.degrees_of_freedom) for e in self.entries(""))

    def only(self, kept: Callable[[str], bool]) -> Uncertain:
        """The same with the sources of some identities alone."""
        return replace(self, shifts={key: shift for key, shift in self.shifts.items() if kept(key)})

    def of_type(self, letter: str) -> Uncertain:
        """The same with its sources of type A or B alone."""
        return self.only(lambda key: self.sources[key].type == letter)

    def entries(self, parameter: str) -> list[BudgetEntry]:
        """The budget of a parameter with this value; sources of one name and nature are one entry."""
        alike: dict[Source, dict[str, float]] = {}
        for key, shift in self.shifts.items():
            source = replace(self.sources[key], degrees_of_freedom=math.inf, std=None)
            alike.setdefault(source, {})[key] = shift
        budget = []
        for source, shifts in alike.items():
            first = next(iter(shifts))
            std = self.sources[first].std if len(shifts) == 1 else None
            freedom = effective_freedom((shift, self.sources[key].degrees_of_freedom) for key, shift in shifts.items())
            origin, u = replace(source, degrees_of_freedom=freedom), _spread(shifts, self.correlations)
            budget.append(BudgetEntry(origin, parameter, u, shifts[first] / std if std else None))
        return budget

    def parameter(self, unit: str) -> Parameter:
        """The value with its interval."""
        return Parameter.of(self.value, self.u, unit, self.freedom)


def first_order(value: float, values: Sequence[Uncertain], slopes: Iterable[float]) -> Uncertain:
    """A function of `values`: its value, and the shifts Σ slope · shift of each source (JCGM 100 5.1.2)."""
    shifts: dict[str, float] = {}
    sources: dict[str, Source] = {}
    correlations: dict[tuple[str, str], float] = {}
    for term, slope in zip(values, slopes, strict=True):
        for key, shift in term.shifts.items():
            shifts[key] = shifts.get(key, 0.0) + slope * shift
            source = term.sources[key]
            if source.std is not None or key not in sources or sources[key].std is None:
                sources[key] = source
        correlations.update(term.correlations)
    return Uncertain(value, shifts, sources, correlations)


def weighted_sum(values: Sequence[Uncertain], weights: Iterable[float]) -> Uncertain:
    """Σ weight · value; a matrix of weights, row by row, gives several of them, correlated by what they share."""
    known = list(weights)
    return first_order(float(sum(w * term.value for w, term in zip(known, values, strict=True))), values, known)


def covariance(values: Sequence[Uncertain]) -> Array:
    """Covariance of the values, (n, n): S R Sᵀ with their shifts S and the correlations R of the sources."""
    import numpy as np

    keys = {key: k for k, key in enumerate(dict.fromkeys(key for term in values for key in term.shifts))}
    shifts = np.array([[term.shifts.get(key, 0.0) for key in keys] for term in values]).reshape(len(values), len(keys))
    matrix: Array = shifts @ shifts.T
    for (a, b), r in {pair: r for term in values for pair, r in term.correlations.items()}.items():
        if a in keys and b in keys:
            both = r * np.outer(shifts[:, keys[a]], shifts[:, keys[b]])
            matrix += both + both.T
    return matrix


def evaluated(
    values: Mapping[str, tuple[Uncertain, str]], unsure: Collection[str] = (), alone: Collection[str] = ()
) -> Evaluated:
    """Parameters by values with their sources, and units: intervals, budget, correlations.

    unsure: those whose uncertainty is not known. alone: those whose correlations are not.
    """
    known = {name: value for name, (value, _) in values.items() if name not in (*unsure, *alone)}
    return Evaluated(
        {
            name: Parameter.of(value.value, None if name in unsure else value.u, unit, value.freedom)
            for name, (value, unit) in values.items()
        },
        [entry for name, (value, _) in values.items() for entry in value.entries(name)],
        correlation_of(list(known), covariance(list(known.values()))),
    )


def _exact(number: Uncertain | float) -> Uncertain:
    return number if isinstance(number, Uncertain) else Uncertain(number)


def _spread(shifts: Mapping[str, float], correlations: Mapping[tuple[str, str], float]) -> float:
    """Standard uncertainty by some sources (JCGM 100 5.2.2)."""
    independent = math.hypot(*shifts.values())
    pairs = [(a, b, r) for (a, b), r in correlations.items() if a in shifts and b in shifts]
    if not pairs:
        return independent
    variance = independent**2 + sum(2 * r * shifts[a] * shifts[b] for a, b, r in pairs)
    return math.sqrt(max(variance, (CANCELLED * max(map(abs, shifts.values()))) ** 2))
