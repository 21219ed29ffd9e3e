"""From a result in units of an unknown constant to ratios that do not depend on it, or to the scale of a stated one.

Every new parameter is y = C Π x_k^n_k of the old ones with their joint covariance: y/J, not y, is what such a log
determines best.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from swingid.model.terms import TERMS
from swingid.numerics.arrays import Array
from swingid.result.data import Details
from swingid.result.result import Result
from swingid.result.sources import values_of
from swingid.uncertainty.budget import BudgetEntry, Evaluated, Parameter
from swingid.uncertainty.uncertain import Uncertain, evaluated
from swingid.units import Quantity

OVER_INERTIA = {
    "N m": "rad/s^2",
    "N m/rad": "1/s^2",
    "N m s": "1/s",
    "N m s^2": "1/rad",
    "N m s^3": "s/rad^2",
    "N m/V": "rad/s^2/V",
    "N/V": "m/s^2/V",
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

    def of(self, old: Mapping[str, Uncertain]) -> Uncertain:
        """Its value, from the old parameters."""
        product = Uncertain(1.0)
        for name, power in self.powers.items():
            product *= old[name] ** power
        return product if self.by is None else product * self.by[1].uncertain(self.by[0])


def ratios_of(result: Result, reference: str, by: Scaling | None) -> list[Ratio]:
    """The parameters of a result in which the constant `reference` is 1, that constant in the place of what scales it.

    By the inertia, so that they are ratios to it, or in SI by a stated constant among them. Those that are no torque (a
    Stribeck speed) stay as they are.
    """
    scale, factor = ("inertia", None) if by is None else (by[0], (by[1], by[2]))
    unit = TERMS[reference].unit_on(linear=result.parameters["inertia"].unit == "kg") if reference in TERMS else ""
    ratios = []
    for name, parameter in result.parameters.items():
        if name == scale and by is not None:
            ratios.append(Ratio(reference, unit, {name: -1}, factor))
        elif name == scale and reference == "wheel_inertia":
            ratios.append(Ratio("inertia/wheel_inertia", "", {name: 1}))
        elif name == scale:
            ratios.append(Ratio(f"{reference}/inertia", _over_inertia(reference, unit), {name: -1}))
        elif parameter.unit not in OVER_INERTIA and name != "inertia":
            ratios.append(Ratio(name, parameter.unit, {name: 1}))
        elif by is None:
            ratios.append(Ratio(f"{name}/inertia", _over_inertia(name, parameter.unit), {name: 1, scale: -1}))
        else:
            ratios.append(Ratio(name, parameter.unit, {name: 1, scale: -1}, factor))
    if reference == "torque_per_volt" and "viscous" in result.parameters:
        ratios.append(Ratio("time_constant", "s", {"inertia": 1, "viscous": -1}))
    return ratios


def _over_inertia(name: str, unit: str) -> str:
    """Unit of a parameter divided by the inertia; of the gravity torque as of the square of a frequency."""
    return "1/s^2" if name == "gravity_torque" else OVER_INERTIA.get(unit, "rad/s^2")


def transformed(result: Result, ratios: list[Ratio]) -> Result:
    """The result with these parameters in the place of its own; their budget, correlation and degrees of freedom."""
    old, values = result.parameters, values_of(result, result.parameters)
    ratios = [ratio for ratio in ratios if all(math.isfinite(values[name].value) for name in ratio.powers)]
    unsure = [r.name for r in ratios if any(old[name].standard_uncertainty is None for name in r.powers)]
    answer = evaluated({ratio.name: (ratio.of(values), ratio.unit) for ratio in ratios}, unsure)
    return replace(
        result,
        parameters=answer.parameters,
        budget=_ordered(answer, result.budget),
        correlation=answer.correlation,
        covariance_of_fit={},
        sensitivities={},
    )


def _ordered(answer: Evaluated, old: tuple[BudgetEntry, ...]) -> tuple[BudgetEntry, ...]:
    """What was stated, errors of single parameters, scatter, each in the order of the old budget; then what is new."""
    names = {name: k for k, name in enumerate(answer.parameters)}
    places = {(entry.source, entry.shared_id): k for k, entry in reversed(list(enumerate(old)))}

    def place(entry: BudgetEntry) -> tuple[int, bool, int, int]:
        k = places.get((entry.source, entry.shared_id), -1)
        kind = 0 if old[k].sensitivity is not None else 2 if entry.origin.averages_over_logs else 1
        return names[entry.parameter], k < 0, kind, k

    return tuple(sorted(answer.budget, key=place))


def converted(details: Details | None, leading: Ratio, old: Mapping[str, Parameter], torque: float) -> Details | None:
    """What the report draws, with `leading` of the parameters `old` in the place of the inertia.

    torque: the factor of torques.
    """
    if details is None:
        return None
    power = leading.powers["inertia"]
    scale = leading.of(
        {name: Uncertain(1.0 if name == "inertia" else parameter.value) for name, parameter in old.items()}
    ).value

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
            name: (float(value(estimate)), float(spread(estimate, u)))
            for name, (estimate, u) in details.estimates.items()
            if estimate
        },
        residuals=details.residuals if details.residual_unit else details.residuals * torque,
        convergence=curve and replace(curve, values=value(curve.values)),
    )
