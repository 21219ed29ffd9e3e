"""From a result in units of an unknown constant to ratios that do not depend on it, or to the scale of a stated one.

Every new parameter is y = C Π x_k^n_k of the old ones. Its standard uncertainty is that of linear propagation (JCGM 100
5.2) with the joint covariance of the old ones: y/J, not y, is what such a log determines best.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from swingid.format import pretty_unit, time_power
from swingid.model.terms import TERMS
from swingid.numerics.arrays import Array
from swingid.result.data import Details, Message
from swingid.result.result import Result
from swingid.uncertainty.budget import BudgetEntry, Parameter, combined, correlation_of, freedom_of, stated
from swingid.uncertainty.freedom import effective_freedom
from swingid.units import Quantity

OVER_INERTIA = {
    "N m": "rad/s^2",
    "N m/rad": "1/s^2",
    "N m s": "1/s",
    "N m s^2": "1/rad",
    "N m s^3": "s/rad^2",
    "N": "m/s^2",
    "N/m": "1/s^2",
    "N s/m": "1/s",
    "N s": "m/s",
    "N s^2/m^2": "1/m",
    "N s^3/m^3": "s/m^2",
}
"""Unit of a parameter divided by the inertia, by the unit of the parameter."""


Scaling = tuple[str, str, Quantity]
"""A constant that scales a result: its name among the parameters, its key, what the rig states of it."""


@dataclass(frozen=True)
class Ratio:
    """A new parameter: name, unit, exponents of the old ones by name; by: a stated factor, its key and value."""

    name: str
    unit: str
    powers: Mapping[str, int]
    by: tuple[str, Quantity] | None = None

    def value(self, old: Mapping[str, Parameter]) -> float:
        """Its value."""
        factor = 1.0 if self.by is None else self.by[1].value
        return factor * math.prod(old[name].value ** power for name, power in self.powers.items())

    def slopes(self, old: Mapping[str, Parameter]) -> dict[str, float]:
        """Its derivatives to the old parameters."""
        factor = 1.0 if self.by is None else self.by[1].value
        found = {}
        for name, power in self.powers.items():
            rest = math.prod(old[other].value ** n for other, n in self.powers.items() if other != name)
            found[name] = factor * power * old[name].value ** (power - 1) * rest
        return found


def over_inertia(result: Result, reference: str) -> list[Ratio]:
    """The ratios of a result in which the constant `reference` is 1, the one with that constant first.

    Parameters that are no torque (a Stribeck speed) stay as they are.
    """
    inertia = result.parameters["inertia"].unit
    unit = _units(reference, linear=inertia == "kg")
    first = Ratio(f"{reference}/inertia", OVER_INERTIA.get(unit, "rad/s^2"), {"inertia": -1})
    if reference == "gravity_torque":
        first = replace(first, unit="1/s^2")
    if reference == "wheel_inertia":
        first = Ratio("inertia/wheel_inertia", "", {"inertia": 1})
    found = [first]
    for name, parameter in result.parameters.items():
        if name == "gravity_torque":
            found.append(Ratio("gravity_torque/inertia", "1/s^2", {name: 1, "inertia": -1}))
        elif parameter.unit in OVER_INERTIA:
            found.append(Ratio(f"{name}/inertia", OVER_INERTIA[parameter.unit], {name: 1, "inertia": -1}))
        elif name != "inertia":
            found.append(Ratio(name, parameter.unit, {name: 1}))
    return found


def scaled(result: Result, reference: str, by: Scaling) -> list[Ratio]:
    """The parameters of a result in which `reference` is 1, in SI by a stated constant among them.

    by: its name as a parameter, its key, its value.
    """
    known, key, value = by
    found = []
    for name, parameter in result.parameters.items():
        if name == known:
            unit = _units(reference, linear=result.parameters["inertia"].unit == "kg")
            found.append(Ratio(reference, unit, {known: -1}, (key, value)))
        elif parameter.unit in OVER_INERTIA or name == "inertia":
            found.append(Ratio(name, parameter.unit, {name: 1, known: -1}, (key, value)))
        else:
            found.append(Ratio(name, parameter.unit, {name: 1}))
    return found


def _units(reference: str, *, linear: bool) -> str:
    """Unit of the constant that is the unit of a result."""
    return TERMS[reference].unit_on(linear=linear) if reference in TERMS else ""


def transformed(result: Result, ratios: list[Ratio]) -> Result:
    """The result with these parameters in the place of its own; their budget, correlation and degrees of freedom."""
    old = result.parameters
    ratios = [ratio for ratio in ratios if all(math.isfinite(old[name].value) for name in ratio.powers)]
    whole = _covariance(result)
    budget: list[BudgetEntry] = []
    for ratio in ratios:
        budget += _entries(ratio, result, whole)
    parameters = {}
    for ratio in ratios:
        known = all(old[name].standard_uncertainty is not None for name in ratio.powers)
        u = combined(budget, ratio.name) if known else None
        parameters[ratio.name] = Parameter.of(ratio.value(old), u, ratio.unit, freedom_of(budget, ratio.name))
    sure = [ratio for ratio in ratios if parameters[ratio.name].standard_uncertainty is not None]
    return replace(
        result,
        parameters=parameters,
        budget=tuple(budget),
        correlation=_correlation(sure, result, whole),
        covariance={},
        sensitivities={},
    )


def _covariance(result: Result) -> tuple[list[str], Array]:
    """Names of the parameters with a known uncertainty, and their whole covariance."""
    names = [name for name, one in result.parameters.items() if one.standard_uncertainty is not None]
    u = np.array([result.parameters[name].standard_uncertainty for name in names], dtype=np.float64)
    table = result.correlation
    matrix = np.array([[table.get(a, {}).get(b, float(a == b)) for b in names] for a in names])
    return names, matrix.reshape(len(names), len(names)) * np.outer(u, u)


def _entries(ratio: Ratio, result: Result, whole: tuple[list[str], Array]) -> list[BudgetEntry]:
    """Its budget: signed effects of what was stated; errors of single parameters; of the scatter what is left.

    The joint covariance is that of the result, so the scatter's part of a ratio is the rest of its variance.
    """
    slopes = ratio.slopes(result.parameters)
    stated_ones: dict[tuple[str, str | None], list[BudgetEntry]] = {}
    alone: list[BudgetEntry] = []
    scattered: list[BudgetEntry] = []
    for entry in (entry for entry in result.budget if entry.parameter in slopes):
        if entry.origin.averages_over_logs:
            scattered.append(entry)
        elif entry.sensitivity is not None:
            stated_ones.setdefault((entry.source, entry.shared_id), []).append(entry)
        else:
            alone.append(entry)
    found = []
    for entries in stated_ones.values():
        shift = sum(slopes[e.parameter] * math.copysign(e.standard_uncertainty, e.sensitivity or 0.0) for e in entries)
        std = max((abs(e.standard_uncertainty / e.sensitivity) for e in entries if e.sensitivity), default=0.0)
        found.append(BudgetEntry(entries[0].origin, ratio.name, abs(shift), shift / std if std else None))
    found += [BudgetEntry(e.origin, ratio.name, abs(slopes[e.parameter]) * e.standard_uncertainty, None) for e in alone]
    found += _scatter(ratio, slopes, scattered, found, whole)
    if ratio.by is not None and ratio.by[1].std:
        key, quantity = ratio.by
        slope = ratio.value(result.parameters) / quantity.value
        found.append(BudgetEntry(stated(key, key), ratio.name, abs(slope) * (quantity.std or 0.0), slope))
    return found


def _scatter(
    ratio: Ratio,
    slopes: dict[str, float],
    scattered: list[BudgetEntry],
    others: list[BudgetEntry],
    whole: tuple[list[str], Array],
) -> list[BudgetEntry]:
    """The entry of the scatter: what the joint covariance has of the ratio beyond the other entries."""
    if not scattered:
        return []
    names, matrix = whole
    weights = np.array([slopes.get(name, 0.0) for name in names])
    rest = float(weights @ matrix @ weights) - sum(entry.standard_uncertainty**2 for entry in others)
    parts = [abs(slopes[e.parameter]) * e.standard_uncertainty for e in scattered]
    least = 1e-6 * max(parts)  # what rounding leaves of a difference
    freedom = effective_freedom(zip(parts, (e.origin.degrees_of_freedom for e in scattered), strict=True))
    origin = replace(scattered[0].origin, degrees_of_freedom=freedom)
    return [BudgetEntry(origin, ratio.name, math.sqrt(max(rest, least**2)), None)]


def _correlation(ratios: list[Ratio], result: Result, whole: tuple[list[str], Array]) -> dict[str, dict[str, float]]:
    """Correlation coefficients of the new parameters."""
    names, matrix = whole
    rows = []
    for ratio in ratios:
        slopes = ratio.slopes(result.parameters)
        rows.append([slopes.get(name, 0.0) for name in names])
    jacobian = np.array(rows).reshape(len(ratios), len(names))
    covariance = jacobian @ matrix @ jacobian.T
    stated_slopes = np.array(
        [0.0 if r.by is None else r.value(result.parameters) / r.by[1].value * (r.by[1].std or 0.0) for r in ratios]
    )
    return correlation_of([ratio.name for ratio in ratios], covariance + np.outer(stated_slopes, stated_slopes))


def converted(details: Details | None, leading: Ratio, old: Mapping[str, Parameter], torque: float) -> Details | None:
    """What the report draws, with `leading` of the parameters `old` in the place of the inertia.

    torque: the factor of torques.
    """
    if details is None:
        return None
    power = leading.powers["inertia"]
    scale = leading.value({**old, "inertia": Parameter.of(1.0, None, "")})

    def value(x: Array | float) -> Array:
        return np.asarray(scale * np.asarray(x, dtype=np.float64) ** power)

    def spread(x: Array | float, u: Array | float) -> Array:
        return np.asarray(np.abs(value(x) * power / np.asarray(x)) * u)

    swings, friction, curve = details.swings, details.friction, details.convergence
    return replace(
        details,
        swings=swings
        and replace(swings, values=value(swings.values), uncertainties=spread(swings.values, swings.uncertainties)),
        friction=friction
        and replace(
            friction,
            torques=friction.torques * torque,
            uncertainties=friction.uncertainties * abs(torque),
            law_torques=friction.law_torques * torque,
        ),
        estimates={
            name: (float(value(one)), float(spread(one, u))) for name, (one, u) in details.estimates.items() if one
        },
        residuals=details.residuals if details.residual_unit else details.residuals * torque,
        convergence=curve and replace(curve, values=value(curve.values)),
    )


_NUMBER = re.compile(r"(?<=[\d)]) (kg m²|kg m\^2|kg|N m/rad|N m s²|N m s|N m|N/m|N s/m|N s|N)(?![\w/²^])(?! m\b)")


def in_words(messages: tuple[Message, ...], name: str, unit: str) -> tuple[Message, ...]:
    """Messages whose numbers in kg and N are named as multiples of the constant that is the unit of the result."""
    return tuple(replace(one, message=_NUMBER.sub(_multiple(name, unit), one.message)) for one in messages)


def _multiple(name: str, unit: str) -> Callable[[re.Match[str]], str]:
    def text(match: re.Match[str]) -> str:
        power = time_power(match[1].replace("²", "^2")) - time_power(unit)
        seconds = {0: "", 1: " s"}.get(power) if power in (0, 1) else pretty_unit(f" s^{power}")
        return f" {seconds} × {name}".replace("  ", " ")

    return text
