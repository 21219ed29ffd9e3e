"""From the settled part of the curves to parameters, uncertainty budget and what the report draws."""

from __future__ import annotations

import numpy as np

from swingid.balance.motor import MotorBalance
from swingid.checks.stated import CONFLICT
from swingid.methods.backstepping.curve import BANDS, Run, mean_over, scatter_of_mean
from swingid.model.equation import Equation
from swingid.preparation.motion import Motion
from swingid.result.result import Convergence, Details
from swingid.uncertainty.budget import Declared, Evaluated, Scatter, evaluate, systematic

POINTS = 600
"""Points of the curve that the result keeps."""


def answer(
    run: Run, others: dict[str, Run], declared: list[Declared], equation: Equation, conflict: float, relative: float
) -> Evaluated:
    """Parameters with their budget, and the sensitivity of the inertia to each constant.

    others: runs with another law or other velocities, by name; the difference to them is an uncertainty, as with the
    right model and without delays there would be none. conflict: uncertainty by the gravity torque.
    relative: as in `evaluate`.
    """
    settled = run.settled
    values = run.estimates(settled.first, settled.last)
    units = {"inertia": equation.unit, "viscous": "N m s"}
    parts = np.array([curve.swings()[settled.first : settled.last] for curve in (run.inertia, run.viscous)])
    spread = np.array([scatter_of_mean(part) for part in parts])
    off = parts - parts.mean(axis=1)[:, None]
    powers = np.sqrt(np.maximum((off**2).sum(axis=1), 1e-300))
    matrix = off @ off.T / np.outer(powers, powers) * np.outer(spread, spread)
    # the standard uncertainty accounts for few swings, see `scatter_of_mean`
    scattered = Scatter("scatter of the last part of the curve", matrix, np.full(2, np.inf))
    common = [(systematic("way left to the end of the curve"), "inertia", settled.drift or 0.0)]
    common.append((systematic(CONFLICT), "inertia", conflict))
    for name, other in others.items():
        if settled.converged and other.settled.converged:
            apart = abs(mean_over(other.inertia, settled.first, settled.last) - values[0])
            common.append((systematic(f"disagreement: {name}"), "inertia", apart))
    unknown = [name for name in units if settled.drift is None or not (name == "inertia" or settled.converged)]
    named = {name: (float(value), unit) for (name, unit), value in zip(units.items(), values, strict=True)}
    return evaluate(named, scattered, common, declared, unknown, relative)


def details(run: Run, others: dict[str, Run], law: str, motion: Motion, balance: MotorBalance | None) -> Details:
    """What the report draws: the curve, when it converged, and the other runs; `law` names this one."""
    curve, settled = run.inertia, run.settled
    estimates = {
        name: (variant.settled.mean, variant.settled.scatter)
        for name, variant in {law: run, **others}.items()
        if variant.settled.converged
    }
    extra = {} if balance is None else {"motor_balance_residual": balance.as_stated}
    kept = np.unique(np.linspace(0, len(curve.time) - 1, POINTS).astype(np.int64))
    times = {band: curve.convergence_time(share) for band, share in BANDS.items()}
    return Details(
        start=float(curve.time[0]),
        stop=float(curve.time[-1]),
        turning_times=motion.turning_times,
        turning_angles=motion.turning_angles,
        estimates=estimates,
        extra=extra,
        convergence=Convergence(curve.time[kept], curve.values[kept], settled.span(curve.turning), times),
    )
