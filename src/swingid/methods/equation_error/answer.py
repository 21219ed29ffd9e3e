"""From fits of filtered rows to parameters, uncertainty budget and what the report draws."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from swingid.balance.fits import columns_of, known_side
from swingid.balance.friction_laws import curve_speeds, parameter_weights
from swingid.balance.imperfections import (
    ANGLE_OFFSET,
    OF_THE_ANGLE,
    WHEEL_SCALE,
    Imperfection,
    constants,
    of_scale,
    of_sensor,
    propagated,
    scale_errors,
    with_rig,
)
from swingid.methods.equation_error.estimate import Selection
from swingid.methods.equation_error.grid import curvature, slope
from swingid.methods.equation_error.scatter import Fitted
from swingid.model.rig import Rig
from swingid.model.terms import TERMS, rig_terms, stated_stiffness, units_on
from swingid.preparation.scale import Scale
from swingid.result.result import Details, FrictionCurve, SwingSeries
from swingid.uncertainty.budget import Evaluated, Scatter, evaluate

SCATTER = "scatter of the rows and sensor noise"


def answer(found: Selection, rig: Rig, scale: Scale) -> Evaluated:
    """Parameters with their budget, and the sensitivity of the inertia to each constant."""
    chosen, fit, law = found.chosen, found.chosen.fit, found.law
    unit = np.eye(len(fit.unknowns))
    units = units_on(linear=scale.linear)
    body = [name for name in fit.unknowns if name in ("inertia", "gravity_torque", *scale.unknown)]
    sought = {name: unit[fit.unknowns.index(name)] for name in body}
    friction = [fit.unknowns.index(name) for name in law.unknowns]
    sought |= {name: own @ unit[friction] for name, own in parameter_weights(law.unknowns).items()}
    values = {name: (float(own @ fit.fit.values), units[name]) for name, own in sought.items()}
    values["inertia"] = fit.a11 - scale.carried, units["inertia"]
    if "stribeck" in law.terms:  # the fit estimates its change
        values["stribeck_speed"] = values["stribeck_speed"][0] + law.stribeck_speed, units["stribeck_speed"]
    own = np.array(list(sought.values()))
    declared = propagated(_effects(rig, chosen), fit.fit.influence, own)
    spread = np.sqrt([chosen.variance(row) for row in own])
    scatters = own @ fit.covariance @ own.T
    scale_of = spread / np.sqrt(np.maximum(np.diag(scatters), 1e-300))
    freedom = np.array([chosen.freedom(row) for row in own])
    scattered = Scatter(SCATTER, scatters * np.outer(scale_of, scale_of), freedom)
    return evaluate(values, scattered, found.common, declared, relative=rig.axis.model_uncertainty)


def _effects(rig: Rig, chosen: Fitted) -> Iterator[Imperfection]:
    """All constants of equation (I), and all declared imperfections of the sensors, as perturbations of the rows.

    A channel read δ later than its stamp shows q + q' δ; a late angle is equivalent to an early drive. An encoder's
    nonlinearity is measured = q + α cos q + β sin q.
    """
    yield from with_rig(rig, constants(rig, chosen.rows))
    row_filter, grid, encoders = chosen.row_filter, chosen.row_filter.grid, chosen.row_filter.grid.encoders
    q, wheel, shapes = grid.angle, grid.wheel, (("cosine", np.cos), ("sine", np.sin))
    if encoders.angle.nonlinearity and rig.axis.kind == "rotary":
        pull = chosen.stiffness * np.cos(q) + stated_stiffness(rig_terms(rig), q)
        for kind, shape in shapes:
            (effect,) = row_filter(-(chosen.fit.a11 * curvature(shape(q), grid.step) + pull * shape(q)))
            yield of_sensor(encoders, "angle", kind, effect)
    if encoders.wheel.nonlinearity and wheel is not None:
        for kind, shape in shapes:
            (effect,) = row_filter(-rig.drive.a12 * curvature(shape(wheel), grid.step))
            yield of_sensor(encoders, "wheel", kind, effect)
    if wheel is not None:
        (effect,) = row_filter(rig.drive.a12 * slope(curvature(wheel, grid.step), grid.step))
        yield of_sensor(encoders, "angle", "latency", effect)
        yield of_sensor(encoders, "wheel", "latency", -effect)
    elif grid.torque is not None:
        (effect,) = row_filter(-slope(grid.torque, grid.step))
        yield of_sensor(encoders, "angle", "latency", effect)
    yield from _stated_scales(rig, chosen)


def _stated_scales(rig: Rig, chosen: Fitted) -> Iterator[Imperfection]:
    """Angles of which the log shows (1 + ε) q + δ."""
    grid = chosen.row_filter.grid
    q, wheel = grid.angle, grid.wheel
    pull = chosen.stiffness * np.cos(q) + stated_stiffness(rig_terms(rig), q)
    for key, std in scale_errors(rig).items():
        shape = np.ones_like(q) if key == ANGLE_OFFSET else q
        if key == WHEEL_SCALE and wheel is not None:
            change = rig.drive.a12 * curvature(wheel, grid.step)
        else:
            change = chosen.fit.a11 * curvature(shape, grid.step) + pull * shape
        (effect,) = chosen.row_filter(-change)
        if key in OF_THE_ANGLE:
            friction = {
                name: chosen.rows.friction[name] for name in chosen.fit.unknowns if name in chosen.rows.friction
            }
            powers = ((TERMS[name].power or 0) * chosen.fit.value(name) * column for name, column in friction.items())
            effect = effect - sum(powers, np.zeros_like(effect))
        yield of_scale(key, std, effect)


def details(found: Selection, scale: Scale, span: tuple[float, float]) -> Details:
    """What the report draws."""
    fit, row_filter, motion, carried = found.chosen.fit, found.chosen.row_filter, found.motion, scale.carried
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
        swings=_per_swing(found, scale),
        friction=_curve(found, float(np.max(np.abs(motion.speed.speed)))),
        estimates=estimates,
        residual_times=row_filter.instants[used],
        residuals=fit.fit.residuals[used],
        extra={"cutoff": row_filter.cutoff.frequency},
    )


def _per_swing(found: Selection, scale: Scale) -> SwingSeries:
    """One inertia per turning point: from the rows within a quarter period, less the fitted friction."""
    fit, rows, motion = found.chosen.fit, found.chosen.rows, found.motion
    _, columns = columns_of(rows, scale, tuple(name for name in fit.unknowns if name in rows.friction))
    left = known_side(rows, scale) - columns[:, 1:] @ fit.fit.values[1:]
    nearest = np.searchsorted((motion.turning_times[1:] + motion.turning_times[:-1]) / 2, rows.windows.centres)
    count = len(motion.turning_times)
    power = np.bincount(nearest, fit.weights * rows.inertia**2, count)
    work = np.bincount(nearest, fit.weights * rows.inertia * left, count)
    full = power > 0.5 * np.median(power)
    values = work[full] / power[full] - scale.carried
    return SwingSeries.of(motion.turning_times[full], motion.sides[full], values)


def _curve(found: Selection, fastest: float) -> FrictionCurve:
    """The fitted law as a curve, with its uncertainty."""
    fit, law = found.chosen.fit, found.law
    own = [fit.unknowns.index(name) for name in law.unknowns]
    coefficients, change = np.split(fit.fit.values[own], [len(law.terms)])
    fitted = replace(law, coefficients=coefficients, stribeck_speed=law.stribeck_speed + float(change.sum()))
    return fitted.curve_at(curve_speeds(fastest, rest=False), fit.covariance[np.ix_(own, own)])
