"""The uncertainty budget of a result: typed sources, their effects on the parameters, and the joint covariance.

Linear propagation (JCGM 100:2008 5.2, JCGM 102:2011 6.2): the covariance of all parameters is V = V_A + S Sᵀ, with V_A
of the fit, and S the signed change of each parameter for one standard uncertainty of each other source.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from swingid.errors import UnanswerableError, missing_package
from swingid.format import time_power
from swingid.numerics.arrays import Array
from swingid.uncertainty.freedom import coverage_factor, effective_freedom
from swingid.uncertainty.significance import MATTERS

Distribution = Literal["normal", "rectangular"]


UNMODELLED = "what is not modelled"
"""Source of `axis.model_uncertainty`: one of each parameter, alike in logs of one rig, of unknown sign."""


@dataclass(frozen=True)
class Source:
    """A source of uncertainty.

    type: "A", evaluated from the data, or "B", otherwise (JCGM 100 4.2, 4.3): what rig.toml states. shared_id: the
    physical quantity, equal in all results of one rig. averages_over_logs: whether it is independent between logs, as
    scatter is; drift, disagreement and grid come from motion, friction and sensors, which are equal in logs of one
    rig. degrees_of_freedom: of its standard uncertainty; infinite for stated or bounded ones (G.4.2, G.4.3). std: the
    standard uncertainty in the source's own unit, None where only its effect on a value is known.
    """

    name: str
    type: Literal["A", "B"]
    shared_id: str | None = None
    averages_over_logs: bool = False
    degrees_of_freedom: float = math.inf
    distribution: Distribution = "normal"
    std: float | None = field(default=None, compare=False)


def scatter(name: str, degrees_of_freedom: float = math.inf) -> Source:
    """Source of the scatter of the data, of type A, independent between logs."""
    return Source(name, "A", averages_over_logs=True, degrees_of_freedom=degrees_of_freedom)


def systematic(name: str, distribution: Distribution = "normal") -> Source:
    """Source of an error that is evaluated from the data, of type A, but is equal in all logs of one rig."""
    return Source(name, "A", distribution=distribution)


def stated(name: str, shared_id: str | None, std: float | None = None) -> Source:
    """Source of a constant or an imperfection that the rig file states, of type B."""
    return Source(name, "B", shared_id, std=std)


@dataclass(frozen=True)
class BudgetEntry:
    """Contribution of one source to the uncertainty of one parameter.

    sensitivity: change of the parameter per unit of the source (None for type A).
    """

    origin: Source
    parameter: str
    standard_uncertainty: float
    sensitivity: float | None = None

    @property
    def source(self) -> str:
        """Name of the source."""
        return self.origin.name

    @property
    def type(self) -> Literal["A", "B"]:
        """Type of the evaluation."""
        return self.origin.type

    @property
    def shared_id(self) -> str | None:
        """The physical quantity behind the source."""
        return self.origin.shared_id

    def to_dict(self) -> dict[str, object]:
        """Return the data as in the JSON of a result; infinitely many degrees of freedom are None."""
        origin = self.origin
        return {
            "source": origin.name,
            "type": origin.type,
            "parameter": self.parameter,
            "standard_uncertainty": self.standard_uncertainty,
            "sensitivity": self.sensitivity,
            "shared_id": origin.shared_id,
            "degrees_of_freedom": origin.degrees_of_freedom if math.isfinite(origin.degrees_of_freedom) else None,
            "distribution": origin.distribution,
            "averages_over_logs": origin.averages_over_logs,
        }


@dataclass(frozen=True)
class Parameter:
    """An identified constant in SI units; `standard_uncertainty` None means unknown, never zero.

    degrees_of_freedom: effective ones of the standard uncertainty.
    """

    value: float
    standard_uncertainty: float | None
    interval95: tuple[float, float] | None
    unit: str
    degrees_of_freedom: float = math.inf

    @classmethod
    def of(
        cls, value: float, standard_uncertainty: float | None, unit: str, degrees_of_freedom: float = math.inf
    ) -> Parameter:
        """Parameter with the 95 % interval value ± k standard uncertainties, k of Student's t."""
        if standard_uncertainty is None or not math.isfinite(standard_uncertainty):
            return cls(float(value), None, None, unit)
        freedom = max(float(degrees_of_freedom), 1.0)
        reach = coverage_factor(freedom) * standard_uncertainty
        interval = float(value - reach), float(value + reach)
        return cls(float(value), float(standard_uncertainty), interval, unit, freedom)

    @property
    def u(self) -> float | None:
        """Short name of `standard_uncertainty`; None where it is unknown."""
        return self.standard_uncertainty

    @property
    def coverage_factor(self) -> float | None:
        """k: half-width of the interval over the standard uncertainty; None where either is unknown."""
        if self.interval95 is None or self.standard_uncertainty is None:
            return None
        return coverage_factor(self.degrees_of_freedom)

    def ufloat(self) -> Any:
        """Value and standard uncertainty as a ufloat of `uncertainties`, independent of any other.

        Raises InputError without the extra `exchange`, UnanswerableError where the uncertainty is unknown.
        """
        try:
            from uncertainties import ufloat
        except ImportError:
            raise missing_package("a ufloat", "uncertainties", "exchange") from None
        if self.standard_uncertainty is None:
            raise UnanswerableError(
                "the uncertainty of this parameter is unknown, so it is no ufloat.", code="no-ufloat"
            )
        return ufloat(self.value, self.standard_uncertainty)

    def to_dict(self) -> dict[str, object]:
        """Return the data as in the JSON of a result; infinitely many degrees of freedom are None."""
        return {
            "value": self.value,
            "standard_uncertainty": self.standard_uncertainty,
            "interval95": self.interval95,
            "unit": self.unit,
            "degrees_of_freedom": self.degrees_of_freedom if math.isfinite(self.degrees_of_freedom) else None,
            "coverage_factor": self.coverage_factor,
        }


def combined(budget: Iterable[BudgetEntry], parameter: str) -> float:
    """Combined standard uncertainty: root of the sum of squares of all entries of a parameter (JCGM 100 5.1.2)."""
    return math.sqrt(sum(entry.standard_uncertainty**2 for entry in budget if entry.parameter == parameter))


def outweighed(budget: Sequence[BudgetEntry], parameter: str, source: str) -> bool:
    """True where the budget of a parameter has what this source does, and its other entries outweigh that."""
    effect = combined((entry for entry in budget if entry.source == source), parameter)
    rest = combined((entry for entry in budget if entry.source != source), parameter)
    return 0 < effect <= MATTERS * rest


def freedom_of(budget: Iterable[BudgetEntry], parameter: str) -> float:
    """Effective degrees of freedom of a parameter (Welch and Satterthwaite)."""
    entries = [entry for entry in budget if entry.parameter == parameter]
    return effective_freedom((entry.standard_uncertainty, entry.origin.degrees_of_freedom) for entry in entries)


@dataclass(frozen=True)
class Scatter:
    """Type A of a fit: covariance (n, n) of all parameters, and the degrees of freedom of each (n,)."""

    name: str
    covariance: Array
    degrees_of_freedom: Array


@dataclass(frozen=True)
class Declared:
    """A quantity that the rig file states, with its standard uncertainty `std` (0: exact).

    slopes (n,): sensitivity coefficients, change of each parameter per unit. constant: whether it is a constant of the
    model, not of a sensor. of_time: whether it is a relative deviation of a clock that is fast, so that each parameter
    changes besides by what its own unit has of the time.
    """

    source: Source
    std: float
    slopes: Array
    constant: bool = False
    of_time: bool = False


@dataclass(frozen=True)
class Evaluated:
    """Parameters with their budget; correlation coefficients of all whose uncertainty is known.

    sensitivities: change of the first parameter per unit of each constant, exact ones too.
    """

    parameters: dict[str, Parameter]
    budget: list[BudgetEntry]
    correlation: dict[str, dict[str, float]] = field(default_factory=dict)
    sensitivities: dict[str, float] = field(default_factory=dict)

    def widened(self, source: Source, name: str, u: float) -> Evaluated:
        """The same with one more error of a parameter, of standard uncertainty u, that no other one has."""
        before = self.parameters[name]
        if not u > 0 or before.standard_uncertainty is None:
            return self
        budget = [*self.budget, BudgetEntry(source, name, u)]
        parts = (before.standard_uncertainty, before.degrees_of_freedom), (u, source.degrees_of_freedom)
        after = Parameter.of(before.value, combined(budget, name), before.unit, effective_freedom(parts))
        share = before.standard_uncertainty / (after.standard_uncertainty or u)
        correlation = {
            first: {other: r if first == other or name not in (first, other) else share * r for other, r in row.items()}
            for first, row in self.correlation.items()
        }
        return Evaluated(self.parameters | {name: after}, budget, correlation, self.sensitivities)


def evaluate(
    values: Mapping[str, tuple[float, str]],
    scattered: Scatter | None,
    common: Iterable[tuple[Source, str, float]] = (),
    declared: Iterable[Declared] = (),
    unknown: Iterable[str] = (),
    relative: float = 0.0,
) -> Evaluated:
    """Budget, combined uncertainties, degrees of freedom and correlations of jointly estimated parameters.

    values: value and unit by name, in the order of the arrays. common: errors that the scatter does not contain, as
    (source, parameter, standard uncertainty); they count as uncorrelated between parameters, and those of 0 are
    omitted. unknown: parameters whose uncertainty is not determined. relative: standard uncertainty of each parameter,
    as a share of it, that the rig file states for what the model does not contain.
    """
    names, matrix = list(values), np.zeros((len(values), len(values)))
    budget: list[BudgetEntry] = []
    if scattered is not None:
        matrix += scattered.covariance
        for k, name in enumerate(names):
            origin = scatter(scattered.name, float(scattered.degrees_of_freedom[k]))
            budget.append(BudgetEntry(origin, name, math.sqrt(max(float(scattered.covariance[k, k]), 0.0))))
    unmodelled = [
        (stated(UNMODELLED, f"axis.model_uncertainty.{name}"), name, relative * abs(value))
        for name, (value, _) in values.items()
    ]
    for source, name, u in (*common, *unmodelled):
        if u > 0 and name in values:
            matrix[names.index(name), names.index(name)] += u**2
            budget.append(BudgetEntry(source, name, u))
    sensitivities = {}
    for effect in declared:
        if effect.constant:
            sensitivities[effect.source.name] = float(effect.slopes[0])
        if effect.std > 0:
            if effect.of_time:
                powers = [-value * time_power(unit) for value, unit in values.values()]
                effect = replace(effect, slopes=effect.slopes + powers)
            shifts = effect.slopes * effect.std
            matrix += np.outer(shifts, shifts)
            slopes = zip(names, effect.slopes.tolist(), strict=True)
            budget += [BudgetEntry(effect.source, name, abs(slope) * effect.std, slope) for name, slope in slopes]
    left_out = set(unknown)
    parameters = {
        name: Parameter.of(value, None if name in left_out else combined(budget, name), unit, freedom_of(budget, name))
        for name, (value, unit) in values.items()
    }
    known = [name for name, parameter in parameters.items() if parameter.standard_uncertainty is not None]
    at = [names.index(name) for name in known]
    return Evaluated(parameters, budget, correlation_of(known, matrix[np.ix_(at, at)]), sensitivities)


def correlation_of(names: Sequence[str], covariance: Array) -> dict[str, dict[str, float]]:
    """Correlation coefficients by name, of a covariance (n, n); empty for one name, 0 beside an exact value."""
    if len(names) < 2:
        return {}
    spread = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    inverse = np.where(spread > 0, 1 / np.maximum(spread, 1e-300), 0.0)
    matrix = np.clip(covariance * inverse[:, None] * inverse, -1.0, 1.0)
    np.fill_diagonal(matrix, 1.0)
    return {name: {other: float(matrix[i, j]) for j, other in enumerate(names)} for i, name in enumerate(names)}


def joined(first: Array, second: Array, cross: Array, first_model: Array, second_model: Array) -> Array:
    """Covariance of two groups of values, each with its own covariance, correlated as a common model correlates them.

    first (p, p), second (q, q): the covariances. first_model, second_model, cross (p, q): those of the model, as white
    noise in both groups. The model's canonical correlations, none above 1, are kept (Hotelling 1936, Biometrika
    28, 321), so that the result is positive semidefinite whatever the two covariances are.
    """
    if second.size == 0:
        return first
    (s1, q1, _), (s2, q2, _) = _roots(first), _roots(second)
    (m1, _, p1), (m2, _, p2) = _roots(first_model), _roots(second_model)
    u, sizes, v = np.linalg.svd(p1 @ (cross / np.outer(m1, m2)) @ p2, full_matrices=False)
    shared = (s1[:, None] * q1) @ (u * np.minimum(sizes, 1.0)) @ v @ (s2[:, None] * q2).T
    result: Array = np.block([[first, shared], [shared.T, second]])
    return result


def _roots(matrix: Array) -> tuple[Array, Array, Array]:
    """Standard deviations of a covariance (n,); symmetric root of its correlations (n, n), and that root's inverse."""
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    powers, vectors = np.linalg.eigh(matrix / np.outer(scale, scale))
    sizes = np.sqrt(np.maximum(powers, 0.0))
    inverse = np.where(powers > 1e-12 * powers[-1], 1 / np.maximum(sizes, 1e-300), 0.0)
    return scale, (vectors * sizes) @ vectors.T, (vectors * inverse) @ vectors.T
