"""From fits of filtered rows to parameters, uncertainty budget and what the report draws."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swingid.identify.equation_error.effects import effects
from swingid.identify.equation_error.scatter import Fitted
from swingid.identify.friction_laws import friction_units, law_columns, parameter_weights
from swingid.identify.momentum.agreement import SEEN
from swingid.identify.momentum.fits import columns_of, known_side
from swingid.identify.motion import Motion
from swingid.identify.result import BudgetEntry, Details, FrictionCurve, Parameter, SwingSeries, combined
from swingid.identify.scale import Scale
from swingid.model.rig import Rig

Array = NDArray[np.float64]

SCATTER = "scatter of the rows and sensor noise"
CURVE_KNOTS = 8


@dataclass(frozen=True)
class Estimate:
    """The chosen fit with its law, and fits of the same log that should agree with it, by name."""

    chosen: Fitted
    law: str
    terms: tuple[str, ...]
    stribeck_speed: float
    others: dict[str, Fitted]


def answer(
    estimate: Estimate, rig: Rig, scale: Scale, motion: Motion
) -> tuple[list[BudgetEntry], dict[str, Parameter]]:
    """Budget and parameters: type A first, then every declared imperfection."""
    chosen, fit = estimate.chosen, estimate.chosen.fit
    unit = np.eye(len(fit.unknowns))
    units = friction_units(scale.linear) | {"inertia": scale.unit, "gravity_torque": scale.torque_unit}
    body = [name for name in fit.unknowns if name in ("inertia", "gravity_torque")]
    sought = {name: unit[fit.unknowns.index(name)] for name in body}
    friction = [fit.unknowns.index(term) for term in estimate.terms]
    sought |= {name: own @ unit[friction] for name, own in parameter_weights(estimate.terms).items()}
    values = {name: float(own @ fit.fit.values) for name, own in sought.items()}
    values["inertia"] -= scale.carried
    budget = [BudgetEntry(SCATTER, "A", name, float(np.sqrt(chosen.variance(own)))) for name, own in sought.items()]
    budget += _type_a(estimate, motion)
    for item in effects(rig, chosen.row_filter, chosen.rows, fit.a11, chosen.stiffness):
        shifts = fit.fit.influence @ item.rows
        for name, own in sought.items():
            slope = float(own @ shifts) + (item.direct if name == "inertia" else 0.0)
            budget.append(BudgetEntry(item.source, "B", name, abs(slope) * item.std, slope, item.shared_id))
    parameters = {name: Parameter.of(value, combined(budget, name), units[name]) for name, value in values.items()}
    if "stribeck" in estimate.terms:
        parameters["stribeck_speed"] = Parameter.of(estimate.stribeck_speed, None, units["stribeck_speed"])
    return budget, parameters


def _type_a(estimate: Estimate, motion: Motion) -> list[BudgetEntry]:
    """Type A errors of the inertia that the scatter does not show: alike in all rows, or seen by other fits only."""
    chosen = estimate.chosen
    found = chosen.common(motion)
    own = chosen.total(motion)
    for name, other in estimate.others.items():
        difference, variance = other.fit.a11 - chosen.fit.a11, abs(other.total(motion) ** 2 - own**2)
        if abs(difference) > SEEN * np.sqrt(variance):
            found[f"disagreement: {name}"] = float(np.sqrt(difference**2 - variance))
    return [BudgetEntry(source, "A", "inertia", spread) for source, spread in found.items()]


def details(estimate: Estimate, scale: Scale, motion: Motion, span: tuple[float, float]) -> Details:
    """What the report draws."""
    fit, row_filter, carried = estimate.chosen.fit, estimate.chosen.row_filter, scale.carried
    own = f"cut-off {row_filter.cutoff.frequency:.3g} Hz"
    estimates = {own: (fit.a11 - carried, fit.u)}
    estimates |= {name: (other.fit.a11 - carried, other.fit.u) for name, other in estimate.others.items()}
    used = fit.weights > 0
    return Details(
        start=span[0],
        stop=span[1],
        turning_times=motion.turning_times,
        turning_angles=motion.turning_angles,
        swings=_per_swing(estimate, scale, motion),
        friction=_curve(estimate, float(np.max(np.abs(motion.speed.speed)))),
        estimates=estimates,
        residual_times=row_filter.instants[used],
        residuals=fit.fit.residuals[used],
        extra={"cutoff": row_filter.cutoff.frequency},
    )


def _per_swing(estimate: Estimate, scale: Scale, motion: Motion) -> SwingSeries:
    """One inertia per turning point: from the rows within a quarter period, with the fitted friction taken off."""
    fit, rows = estimate.chosen.fit, estimate.chosen.rows
    _, columns = columns_of(rows, scale, estimate.terms)
    left = known_side(rows, scale) - columns[:, 1:] @ fit.fit.values[1:]
    nearest = np.searchsorted((motion.turning_times[1:] + motion.turning_times[:-1]) / 2, rows.windows.centres)
    count = len(motion.turning_times)
    power = np.bincount(nearest, fit.weights * rows.inertia**2, count)
    work = np.bincount(nearest, fit.weights * rows.inertia * left, count)
    full = power > 0.5 * np.median(power)
    values = work[full] / power[full] - scale.carried
    spread = 1.4826 * float(np.median(np.abs(values - np.median(values)))) if len(values) else 0.0
    return SwingSeries(motion.turning_times[full], motion.sides[full], values, np.full(len(values), spread))


def _curve(estimate: Estimate, fastest: float) -> FrictionCurve:
    """The fitted law as a curve, with its uncertainty."""
    side = fastest * np.linspace(0, 1, CURVE_KNOTS)[1:] ** 1.5
    speeds = np.concatenate([-side[::-1], side])
    fit = estimate.chosen.fit
    own = [fit.unknowns.index(term) for term in estimate.terms]
    columns = law_columns(estimate.terms, speeds, estimate.stribeck_speed)
    torques = columns @ fit.fit.values[own]
    variance = np.einsum("ni,ij,nj->n", columns, fit.covariance[np.ix_(own, own)], columns)
    return FrictionCurve(speeds, torques, np.sqrt(np.maximum(variance, 0.0)), estimate.law, torques)
