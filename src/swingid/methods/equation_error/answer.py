"""From fits of filtered rows to parameters, uncertainty budget and what the report draws."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from swingid.balance.errors import constant_error
from swingid.balance.friction_laws import curve_speeds, parameters_of
from swingid.balance.perturbations import SHAPES, RowError, channel_of, of_channels, of_constants, propagated
from swingid.methods.equation_error.estimate import Selection
from swingid.methods.equation_error.fit import RowFit
from swingid.methods.equation_error.grid import slope
from swingid.model.rig import Rig
from swingid.model.terms import TERMS, power_of
from swingid.result.result import Details, FrictionCurve, SwingSeries
from swingid.uncertainty.budget import Evaluated, Scatter, evaluate

SCATTER = "scatter of the rows and sensor noise"


def answer(selected: Selection, rig: Rig) -> Evaluated:
    """Parameters with their budget, and the sensitivity of the inertia to each constant."""
    fit, law = selected.chosen, selected.law
    values, weights = parameters_of(fit, law.unknowns)
    if "stribeck" in law.terms:  # the fit estimates its change
        change, unit = values["stribeck_speed"]
        values["stribeck_speed"] = change + law.stribeck_speed, unit
    combinations = np.array(list(weights.values()))
    declared = propagated(_errors(rig, fit), fit.fit.influence, combinations)
    each = [fit.of_inertia if name == "inertia" else fit.combination(row) for name, row in weights.items()]
    spread = np.sqrt([combination.variance for combination in each])
    scatters = combinations @ fit.covariance @ combinations.T
    scale_of = spread / np.sqrt(np.maximum(np.diag(scatters), 1e-300))
    freedom = np.array([fit.freedom_of(combination) for combination in each])
    scattered = Scatter(SCATTER, scatters * np.outer(scale_of, scale_of), freedom)
    return evaluate(values, scattered, selected.common, declared, relative=rig.axis.model_uncertainty)


def _errors(rig: Rig, fit: RowFit) -> Iterator[RowError]:
    """All constants of equation (I), and all perturbations of the channels that are stated, as errors of the rows."""
    for error in of_constants(fit.equation):
        yield constant_error(fit.rows, fit.equation, error)
    part = fit.part
    for error in (error for error in of_channels(rig, part.signals.encoders) if not error.of_noise):
        channel = channel_of(error, rig.drive.channel)
        measured, late = part.channel(channel), error.shape == "latency"
        change = part.acting(channel, measured if late else SHAPES[error.shape](measured), fit.coefficients)
        if late:
            change = slope(change, part.grid.step) * (1.0 if channel == error.channel else -1.0)
        (rows,) = fit.row_filter(-change)
        if error.scales_speed:
            rows -= fit.rows.sum_of({name: power_of(name) * fit.value(name) for name in fit.unknowns if name in TERMS})
        yield RowError(error, rows)


def details(selected: Selection, span: tuple[float, float]) -> Details:
    """What the report draws."""
    fit, motion, used = selected.chosen, selected.motion, selected.chosen.weights > 0
    fits = {f"cut-off {selected.cutoff.frequency:.3g} Hz": fit} | selected.cutoffs
    fits |= {law.name: other for law, other, _ in selected.laws}
    return Details(
        start=span[0],
        stop=span[1],
        turning_times=motion.turning_times,
        turning_angles=motion.turning_angles,
        swings=_per_swing(fit),
        friction=_curve(selected, float(np.max(np.abs(motion.speed.speed)))),
        estimates={name: (variant.inertia, variant.u) for name, variant in fits.items()},
        residual_times=fit.row_filter.instants[used],
        residuals=fit.fit.residuals[used],
        extra={"cutoff": selected.cutoff.frequency, "attenuation": fit.compensated},
    )


def _per_swing(fit: RowFit) -> SwingSeries:
    """One inertia per turning point: from the rows within a quarter period, less the fitted friction."""
    motion, regressor = fit.part.motion, fit.rows["inertia"]
    remainder = fit.fit.residuals + fit.a11 * regressor
    nearest = np.searchsorted((motion.turning_times[1:] + motion.turning_times[:-1]) / 2, fit.rows.windows.centres)
    count = len(motion.turning_times)
    power = np.bincount(nearest, fit.weights * regressor**2, count)
    work = np.bincount(nearest, fit.weights * regressor * remainder, count)
    full = power > 0.5 * np.median(power)
    values = work[full] / power[full] - fit.equation.carried
    return SwingSeries.of(motion.turning_times[full], motion.sides[full], values)


def _curve(selected: Selection, fastest: float) -> FrictionCurve:
    """The fitted law as a curve, with its uncertainty."""
    fit, law = selected.chosen, selected.law
    places = [fit.unknowns.index(name) for name in law.unknowns]
    coefficients, change = np.split(fit.fit.values[places], [len(law.terms)])
    fitted = replace(law, coefficients=coefficients, stribeck_speed=law.stribeck_speed + float(change.sum()))
    return fitted.curve_at(curve_speeds(fastest, rest=False), fit.covariance[np.ix_(places, places)])
