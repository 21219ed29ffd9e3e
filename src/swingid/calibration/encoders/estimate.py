"""Estimates of the encoders' parts from several logs: Gauss–Newton over a joint fit about corrected readings.

The logs have one inertia and the same encoders; friction is that of each log.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import accumulate, pairwise

import numpy as np

from swingid.balance.covariance import LAG
from swingid.balance.fits import covariance_by
from swingid.balance.rows import Signals
from swingid.balance.systematics import COMPARABLE
from swingid.calibration.encoders.logs import CalibrationLog, LogRows
from swingid.calibration.encoders.parts import Part, with_parts
from swingid.errors import UnanswerableError
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.numerics.regression import Beside, fit_linear
from swingid.preparation.scale import equation_of
from swingid.progress import stepped
from swingid.uncertainty.dark import dark_uncertainty, shrunk

STEPS = 4
"""Gauss–Newton steps at most; with 1° the third changes nothing visible."""

SETTLED = 0.02
"""Change of every part, in its standard uncertainties, that ends the steps."""

STRETCHES = (0.5, 2.0**-0.5, 2.0**0.5)
"""Lengths of windows, relative to the chosen one, with which the parts are estimated as well."""

ROUNDS = 3
"""Fits of one step; each weights the logs by the residuals of the one before."""

GRID_SPREAD = 0.7
"""Relative standard deviation of a variance that is computed from eight grid phases of a smoothed angle."""


@dataclass(frozen=True)
class Estimate:
    """The parts by one joint fit of all logs.

    common: the unknowns that all logs have (inertia first). values (parts,): of the parts (rad, s); of a fit about
    corrected readings the change. covariance (parts, parts): of type A, with the priors. grid: variance of each part by
    the encoder's grid in this motion, less that of white noise. drift: standard uncertainty by windows of other
    lengths. errors: standard deviation of a row of each log.
    """

    parts: tuple[Part, ...]
    common: Array
    values: Array
    covariance: Array
    grid: Array
    drift: Array
    errors: Array

    @property
    def uncertainties(self) -> Array:
        """Standard uncertainties of the parts."""
        result: Array = np.sqrt(np.maximum(np.diag(self.covariance) + self.grid, 0.0) + self.drift**2)
        return result

    @property
    def scatter(self) -> Array:
        """The covariance; a grid whose errors cancel narrows it, and its correlations stay."""
        variances = np.diag(self.covariance)
        narrowed = np.sqrt(np.maximum(variances + np.minimum(self.grid, 0.0), 0.0) / np.maximum(variances, 1e-300))
        result: Array = self.covariance * np.outer(narrowed, narrowed)
        return result


@dataclass(frozen=True)
class Solved:
    """The joint fit about the parts `values` (nuisances 0), with the rig that states them.

    signals: of the readings corrected by them.
    """

    fit: Estimate
    values: Array
    rig: Rig
    signals: list[Signals]
    a11: float
    b: float


def solve(logs: Sequence[CalibrationLog], rig: Rig, parts: Sequence[Part]) -> Solved:
    """Gauss–Newton to the parts that minimise the weighted residuals of all logs, with one inertia."""
    values = np.zeros(len(parts))
    best = min((log.first for log in logs), key=lambda fit: fit.total)
    stated = equation_of(rig).coefficients["gravity_torque"].value
    a11, b = best.a11, best.value("gravity_torque") if stated is None else stated
    for k in range(STEPS):
        corrected = with_parts(rig, values, parts)
        signals = [log.signals(corrected) for log in logs]
        rows = _rows(logs, signals, corrected, a11, b)
        if not rows:
            text = "with the encoders corrected, too few windows of a log are usable; record longer logs."
            raise UnanswerableError(text, code="too-short")
        fit = fit_jointly(rows, parts, values)
        a11, b = float(fit.common[0]), float(fit.common[1]) if stated is None else stated
        # the readings are not corrected by a nuisance, so every step estimates the whole of it
        step = np.where([part.nuisance for part in parts], 0.0, fit.values)
        stepped(len(logs))
        if np.max(np.abs(step / fit.uncertainties)) < SETTLED:
            stepped((STEPS - 1 - k) * len(logs))
            break
        values = values + step
    return Solved(fit, values, corrected, signals, a11, b)


def _rows(
    logs: Sequence[CalibrationLog], signals: Sequence[Signals], rig: Rig, a11: float, b: float, stretch: float = 1.0
) -> list[LogRows]:
    """The rows of every log; empty where one of them has too few."""
    rows = [log.rows(of_log, rig, a11, b, stretch) for log, of_log in zip(logs, signals, strict=True)]
    return [] if None in rows else [log_rows for log_rows in rows if log_rows is not None]


def estimate(logs: Sequence[CalibrationLog], rig: Rig, parts: Sequence[Part]) -> Estimate:
    """The parts by all logs together, with the uncertainty that windows of other lengths show."""
    estimated = solve(logs, rig, parts)
    fit, others = estimated.fit, []
    for stretch in STRETCHES:
        stepped(len(logs))
        rows = _rows(logs, estimated.signals, estimated.rig, estimated.a11, estimated.b, stretch)
        if rows and all(len(log_rows.fit.known) > 2 * log_rows.own + 8 for log_rows in rows):
            others.append(fit_jointly(rows, parts, estimated.values))
    values = np.where([part.nuisance for part in parts], fit.values, estimated.values)
    return replace(fit, values=values, drift=_drift(fit, others))


def _drift(chosen: Estimate, others: Sequence[Estimate]) -> Array:
    """Uncertainty of every part by the estimates of windows of other lengths; see `balance.systematics`.

    All lengths use the same samples, so the variance of a difference is the difference of the variances.
    """
    spread = np.zeros(len(chosen.parts))
    mine = chosen.uncertainties
    for other in others:
        for k, u in enumerate(other.uncertainties):
            if u < COMPARABLE * mine[k]:
                gap, variance = float(other.values[k] - chosen.values[k]), abs(float(u**2 - mine[k] ** 2))
                spread[k] = max(spread[k], dark_uncertainty(gap, variance, float(mine[k])))
    return spread


def fit_jointly(logs: Sequence[LogRows], parts: Sequence[Part], current: Array) -> Estimate:
    """Least squares of all rows, each log's weighted by its own scatter, with the priors of all that is declared.

    current: values of the parts that the readings are corrected by; each prior has its mean at 0.
    """
    keys, size = [part.key for part in parts], len(parts)
    keys += sorted({key for log in logs for key in log.declared} - set(keys))
    places = [slice(*ends) for ends in pairwise(accumulate((len(log.fit.known) for log in logs), initial=0))]
    columns, declared = _columns(logs, places), np.zeros((places[-1].stop, len(keys)))
    for log, rows in zip(logs, places, strict=True):
        for key, effect in log.declared.items():
            declared[rows, keys.index(key)] = effect
    known, scale = np.concatenate([log.fit.known for log in logs]), np.array([part.prior for part in parts])
    means = np.append(-current / scale, np.zeros(len(keys) - size))
    errors = np.array([_error(log.fit.fit.residuals) for log in logs])
    for _ in range(ROUNDS):
        weights = np.repeat(1 / errors, [len(log.fit.known) for log in logs])
        weighted = columns * weights[:, None]
        beside = Beside.of(weighted, fit_linear(weighted, known * weights), declared * weights[:, None])
        solved, before = beside.solved(np.ones(()), means), errors
        errors = errors * np.array([_error(solved.residuals[rows]) for rows in places])
    at = slice(columns.shape[1], columns.shape[1] + size)
    priors = solved.influence[at, len(known) :]
    covariance, white, phases = priors @ priors.T, np.zeros(size), np.zeros((1, size))
    for log, rows, error in zip(logs, places, before, strict=True):
        influence = solved.influence[at, rows] / error
        covariance = covariance + covariance_by(log.fit, influence, solved.residuals[rows] * error)
        white += log.grid_noise(influence)
        phases = phases + (log.grid @ influence.T if len(log.grid) else 0.0)
    # errors that repeat with the motion add variance; those that cancel in a quick motion take some away
    grid = np.asarray(shrunk(np.mean(phases**2, axis=0) - white, GRID_SPREAD * white))
    return Estimate(
        parts=tuple(parts),
        common=solved.values[: len(logs[0].fit.unknowns) - logs[0].own],
        values=solved.values[at] * scale,
        covariance=covariance * np.outer(scale, scale),
        grid=grid * scale**2,
        drift=np.zeros(size),
        errors=before,
    )


def _columns(logs: Sequence[LogRows], places: Sequence[slice]) -> Array:
    """Columns of the unknowns that all logs have, then of the friction of each; places: its rows."""
    common = len(logs[0].fit.unknowns) - logs[0].own
    columns, begin = np.zeros((places[-1].stop, common + sum(log.own for log in logs))), common
    for log, rows in zip(logs, places, strict=True):
        columns[rows, :common] = log.fit.columns[:, :common]
        columns[rows, begin : begin + log.own] = log.fit.columns[:, common:]
        begin += log.own
    return columns


def _error(residuals: Array) -> float:
    """Standard deviation of a row, as of an independent one: rows of overlapping windows are correlated."""
    return max(float(np.sqrt(LAG / 2 * np.mean(residuals**2))), 1e-300)
