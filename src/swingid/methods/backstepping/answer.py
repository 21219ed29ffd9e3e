"""From the settled part of the curves to parameters, uncertainty budget and what the report draws."""

from __future__ import annotations

import numpy as np

from swingid.balance.motor import MotorBalance
from swingid.methods.backstepping.curve import BANDS, Curve, Run, mean_over, scatter_of_mean
from swingid.methods.backstepping.effects import Effect
from swingid.preparation.motion import Motion
from swingid.preparation.scale import Scale
from swingid.result.result import BudgetEntry, Convergence, Details, Parameter, combined

POINTS = 600
"""Points of the curve that the result keeps."""


def answer(
    run: Run, others: dict[str, Run], found: list[Effect], scale: Scale
) -> tuple[list[BudgetEntry], dict[str, Parameter], dict[str, float]]:
    """Budget, parameters, and the sensitivity of the inertia to each constant.

    others: runs with another law or other velocities, by name; what they differ by is an uncertainty, for with the
    right model and without delays they would agree.
    """
    settled = run.settled
    values = run.estimates(settled.first, settled.last)
    budget = [
        BudgetEntry("scatter of the last part of the curve", "A", name, scatter_of_mean(part))
        for name, part in (("inertia", run.inertia.swings()), ("viscous", run.viscous.swings()))
        for part in (part[settled.first : settled.last],)
    ]
    if settled.drift:
        budget.append(BudgetEntry("way left to the end of the curve", "A", "inertia", settled.drift))
    for name, other in others.items():
        if settled.converged and other.settled.converged:
            apart = abs(mean_over(other.inertia, settled.first, settled.last) - values["inertia"])
            budget.append(BudgetEntry(f"disagreement: {name}", "A", "inertia", apart))
    sensitivities = {}
    for effect in found:
        if effect.source == effect.shared_id:
            sensitivities[effect.source] = effect.slopes["inertia"]
        if effect.std > 0:
            for name, slope in effect.slopes.items():
                entry = BudgetEntry(effect.source, "B", name, abs(slope) * effect.std, slope, effect.shared_id)
                budget.append(entry)
    units = {"inertia": scale.unit, "viscous": "N m s"}
    parameters = {}
    for name, value in values.items():
        known = settled.drift is not None and (name == "inertia" or settled.converged)
        parameters[name] = Parameter.of(value, combined(budget, name) if known else None, units[name])
    return budget, parameters, sensitivities


def details(run: Run, others: dict[str, Run], law: str, motion: Motion, balance: MotorBalance | None) -> Details:
    """What the report draws: the curve, when it converged, what the other runs say; `law` names this one."""
    curve, settled = run.inertia, run.settled
    estimates = {
        name: (one.settled.mean, one.settled.scatter)
        for name, one in {law: run, **others}.items()
        if one.settled.converged
    }
    extra = {} if balance is None else {"motor_balance_residual": balance.as_stated}
    return Details(
        start=float(curve.time[0]),
        stop=float(curve.time[-1]),
        turning_times=motion.turning_times,
        turning_angles=motion.turning_angles,
        estimates=estimates,
        extra=extra,
        convergence=convergence_of(curve, settled.span(curve.turning)),
    )


def convergence_of(curve: Curve, settled: tuple[float, float]) -> Convergence:
    """The curve thinned to some hundred points, and its convergence times."""
    kept = np.unique(np.linspace(0, len(curve.time) - 1, POINTS).astype(np.int64))
    times = {name: curve.convergence_time(band) for name, band in BANDS.items()}
    return Convergence(curve.time[kept], curve.values[kept], settled, times)
