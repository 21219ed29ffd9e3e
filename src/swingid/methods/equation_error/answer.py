"""From fits of filtered rows to parameters, uncertainty budget and what the report draws."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from swingid.balance.errors import constant_error
from swingid.balance.fits import known_side
from swingid.balance.friction_laws import curve_speeds, parameter_weights
from swingid.balance.perturbations import (
    SHAPES,
    Perturbation,
    RowError,
    channel_of,
    of_channels,
    of_constants,
    propagated,
    slopes_by,
)
from swingid.methods.equation_error.estimate import Selection
from swingid.methods.equation_error.grid import curvature, slope
from swingid.methods.equation_error.scatter import Fitted
from swingid.model.equation import Equation
from swingid.model.rig import Rig
from swingid.model.terms import TERMS, power_of, units_on
from swingid.numerics.arrays import Array
from swingid.result.result import Details, FrictionCurve, SwingSeries
from swingid.uncertainty.budget import Evaluated, Scatter, evaluate

SCATTER = "scatter of the rows and sensor noise"


def answer(found: Selection, rig: Rig, equation: Equation) -> Evaluated:
    """Parameters with their budget, and the sensitivity of the inertia to each constant."""
    chosen, fit, law = found.chosen, found.chosen.fit, found.law
    unit = np.eye(len(fit.unknowns))
    units = units_on(linear=equation.linear)
    body = [name for name in fit.unknowns if name in equation.sought]
    sought = {name: unit[fit.unknowns.index(name)] for name in body}
    friction = [fit.unknowns.index(name) for name in law.unknowns]
    sought |= {name: own @ unit[friction] for name, own in parameter_weights(law.unknowns).items()}
    values = {name: (float(own @ fit.fit.values), units[name]) for name, own in sought.items()}
    values["inertia"] = fit.a11 - equation.carried, units["inertia"]
    if "stribeck" in law.terms:  # the fit estimates its change
        values["stribeck_speed"] = values["stribeck_speed"][0] + law.stribeck_speed, units["stribeck_speed"]
    own = np.array(list(sought.values()))
    declared = propagated(_errors(rig, chosen), fit.fit.influence, own)
    spread = np.sqrt([chosen.variance(row) for row in own])
    scatters = own @ fit.covariance @ own.T
    scale_of = spread / np.sqrt(np.maximum(np.diag(scatters), 1e-300))
    freedom = np.array([chosen.freedom(row) for row in own])
    scattered = Scatter(SCATTER, scatters * np.outer(scale_of, scale_of), freedom)
    return evaluate(values, scattered, found.common, declared, relative=rig.axis.model_uncertainty)


def _errors(rig: Rig, chosen: Fitted) -> Iterator[RowError]:
    """All constants of equation (I), and all perturbations of the channels that are stated, as errors of the rows."""
    for one in of_constants(chosen.equation):
        yield constant_error(chosen.rows, chosen.equation, one)
    grid = chosen.row_filter.grid
    values = chosen.equation.stated | chosen.fit.values
    for one in (one for one in of_channels(rig, grid.encoders) if not one.of_noise):
        (rows,) = chosen.row_filter(-_change(rig, chosen, one, values))
        if one.scales_speed:
            terms = {name: power_of(name) * chosen.fit.value(name) for name in chosen.fit.unknowns if name in TERMS}
            rows = rows - chosen.rows.sum_of(terms)
        yield RowError(one, rows)


def _change(rig: Rig, chosen: Fitted, one: Perturbation, values: dict[str, float]) -> Array:
    """Σ c ∂f/∂channel s of the error s of a channel, per unit, at every row of the grid."""
    grid, further, channel = chosen.row_filter.grid, chosen.equation.further, channel_of(one, rig.drive.kind)
    measured = {"angle": grid.angle, "wheel": grid.wheel, "torque": grid.torque}[channel]
    assert measured is not None
    error = measured if one.shape == "latency" else SHAPES[one.shape](measured)
    change = np.zeros_like(grid.angle)
    for name, order, own in slopes_by(channel, further, linear=chosen.equation.linear):
        acting = curvature(error, grid.step) if order == 2 else own(grid.angle) * error
        change = change + values.get(name, 0.0) * acting
    if one.shape != "latency":
        return change
    return slope(change, grid.step) * (1.0 if channel == one.channel else -1.0)


def details(found: Selection, equation: Equation, span: tuple[float, float]) -> Details:
    """What the report draws."""
    fit, row_filter, motion, carried = found.chosen.fit, found.chosen.row_filter, found.motion, equation.carried
    own = f"cut-off {row_filter.cutoff.frequency:.3g} Hz"
    estimates = {own: (fit.a11 - carried, fit.u)}
    estimates |= {name: (other.fit.a11 - carried, other.fit.u) for name, other in found.cutoffs.items()}
    estimates |= {law.name: (other.fit.a11 - carried, other.fit.u) for law, other, _ in found.laws}
    used = fit.weights > 0
    return Details(
        start=span[0],
        stop=span[1],
        turning_times=motion.turning_times,
        turning_angles=motion.turning_angles,
        swings=_per_swing(found, equation),
        friction=_curve(found, float(np.max(np.abs(motion.speed.speed)))),
        estimates=estimates,
        residual_times=row_filter.instants[used],
        residuals=fit.fit.residuals[used],
        extra={"cutoff": row_filter.cutoff.frequency},
    )


def _per_swing(found: Selection, equation: Equation) -> SwingSeries:
    """One inertia per turning point: from the rows within a quarter period, less the fitted friction."""
    fit, rows, motion = found.chosen.fit, found.chosen.rows, found.motion
    left = known_side(rows, equation) - rows.sum_of(dict(zip(fit.unknowns[1:], fit.fit.values[1:], strict=True)))
    nearest = np.searchsorted((motion.turning_times[1:] + motion.turning_times[:-1]) / 2, rows.windows.centres)
    count = len(motion.turning_times)
    power = np.bincount(nearest, fit.weights * rows["inertia"] ** 2, count)
    work = np.bincount(nearest, fit.weights * rows["inertia"] * left, count)
    full = power > 0.5 * np.median(power)
    values = work[full] / power[full] - equation.carried
    return SwingSeries.of(motion.turning_times[full], motion.sides[full], values)


def _curve(found: Selection, fastest: float) -> FrictionCurve:
    """The fitted law as a curve, with its uncertainty."""
    fit, law = found.chosen.fit, found.law
    own = [fit.unknowns.index(name) for name in law.unknowns]
    coefficients, change = np.split(fit.fit.values[own], [len(law.terms)])
    fitted = replace(law, coefficients=coefficients, stribeck_speed=law.stribeck_speed + float(change.sum()))
    return fitted.curve_at(curve_speeds(fastest, rest=False), fit.covariance[np.ix_(own, own)])
