"""Estimates of the encoders' parts from several logs: Gauss–Newton over a joint fit about corrected readings.

The logs have one inertia and the same encoders; friction is that of each log.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from swingid.balance.fits import LAG, with_excess
from swingid.balance.rows import Signals
from swingid.balance.systematics import COMPARABLE
from swingid.calibration.encoders.logs import CalibrationLog, LogRows
from swingid.calibration.encoders.parts import Part, with_parts
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.numerics.regression import LinearFit, fit_linear
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
    """Values of the parts (rad, s) by key and their uncertainties.

    covariance (parts, parts): by scatter and priors. grid, drift (parts,): standard uncertainties by the encoder's grid
    and by windows of other lengths. errors: standard deviation of a row of each log.
    """

    parts: tuple[Part, ...]
    values: dict[str, float]
    covariance: Array
    grid: Array
    drift: Array
    errors: Array

    @property
    def uncertainties(self) -> dict[str, float]:
        """Standard uncertainties of the parts by key."""
        whole = np.sqrt(np.diag(self.covariance) + self.grid**2 + self.drift**2)
        return {part.key: float(u) for part, u in zip(self.parts, whole, strict=True)}


@dataclass(frozen=True)
class Solved:
    """The joint fit about the parts `values` (by key, nuisances 0), with the rig that states them.

    signals: of the readings corrected by them.
    """

    fit: JointFit
    values: dict[str, float]
    rig: Rig
    signals: list[Signals]
    a11: float
    b: float


def solve(logs: Sequence[CalibrationLog], rig: Rig, parts: Sequence[Part]) -> Solved:
    """Gauss–Newton to the parts that minimise the weighted residuals of all logs, with one inertia."""
    values = {part.key: 0.0 for part in parts}
    best = min((log.first for log in logs), key=lambda fit: fit.total)
    stated = equation_of(rig).coefficients["gravity_torque"].value
    a11, b = best.a11, best.value("gravity_torque") if stated is None else stated
    for k in range(STEPS):
        corrected = with_parts(rig, values, parts)
        signals = [log.signals(corrected) for log in logs]
        rows = [log.rows(own, corrected, a11, b) for log, own in zip(logs, signals, strict=True)]
        fit = fit_jointly(rows, parts, values)
        a11, b = float(fit.common[0]), float(fit.common[1]) if stated is None else stated
        # the readings are not corrected by a nuisance, so every step estimates the whole of it
        step = np.where([part.nuisance for part in parts], 0.0, fit.parts)
        stepped(len(logs))
        if np.max(np.abs(step / fit.uncertainties)) < SETTLED:
            stepped((STEPS - 1 - k) * len(logs))
            break
        values = {part.key: values[part.key] + float(d) for part, d in zip(parts, step, strict=True)}
    return Solved(fit, values, corrected, signals, a11, b)


def estimate(logs: Sequence[CalibrationLog], rig: Rig, parts: Sequence[Part]) -> Estimate:
    """The parts by all logs together, with the uncertainty that windows of other lengths show."""
    found = solve(logs, rig, parts)
    fit, others = found.fit, []
    for stretch in STRETCHES:
        stepped(len(logs))
        pairs = zip(logs, found.signals, strict=True)
        rows = [log.rows(signals, found.rig, found.a11, found.b, stretch) for log, signals in pairs]
        if all(len(one.target) > 2 * len(one.own) + 8 for one in rows):
            others.append(fit_jointly(rows, parts, found.values))
    # a grid whose errors cancel narrows the scatter, and its correlations stay
    own = np.diag(fit.covariance)
    narrowed = np.sqrt(np.maximum(own + np.minimum(fit.grid, 0.0), 0.0) / np.maximum(own, 1e-300))
    nuisances = {part.key: float(v) for part, v in zip(parts, fit.parts, strict=True) if part.nuisance}
    return Estimate(
        parts=tuple(parts),
        values=found.values | nuisances,
        covariance=fit.covariance * np.outer(narrowed, narrowed),
        grid=np.sqrt(np.maximum(fit.grid, 0.0)),
        drift=_drift(fit, others),
        errors=fit.errors,
    )


def _drift(chosen: JointFit, others: Sequence[JointFit]) -> Array:
    """Uncertainty of every part by the estimates of windows of other lengths; see `balance.systematics`.

    All lengths use the same samples, so the variance of a difference is the difference of the variances.
    """
    found = np.zeros(len(chosen.parts))
    mine = chosen.uncertainties
    for other in others:
        for k, u in enumerate(other.uncertainties):
            if u < COMPARABLE * mine[k]:
                gap, variance = float(other.parts[k] - chosen.parts[k]), abs(float(u**2 - mine[k] ** 2))
                found[k] = max(found[k], dark_uncertainty(gap, variance, float(mine[k])))
    return found


@dataclass(frozen=True)
class JointFit:
    """One joint fit of all logs.

    common: the unknowns that all logs have (inertia first). parts: change of each part against the linearisation
    (rad, s). covariance (parts, parts): of type A, with the priors. grid: variance of each part by the encoder's grid
    in this motion, less that of white noise. errors: standard deviation of a row of each log.
    """

    common: Array
    parts: Array
    covariance: Array
    grid: Array
    errors: Array

    @property
    def uncertainties(self) -> Array:
        """Standard uncertainties of the parts."""
        result: Array = np.sqrt(np.diag(self.covariance) + self.grid)
        return result


def fit_jointly(logs: Sequence[LogRows], parts: Sequence[Part], current: Mapping[str, float]) -> JointFit:
    """Least squares of all rows, each log's weighted by its own scatter, with the priors of the parts.

    current: values of the parts in the rows; each prior has its mean at 0.
    """
    common = len(logs[0].common)
    constants = sorted({key for log in logs for key in log.constants})
    shared = common + len(parts) + len(constants)
    own = shared + np.cumsum([0, *(len(log.own) for log in logs)])
    prior = np.zeros((len(parts) + len(constants), own[-1]))
    prior[:, common:shared] = np.eye(len(parts) + len(constants))
    means = np.append([-current[part.key] / part.prior for part in parts], np.zeros(len(constants)))
    edges = np.cumsum([len(prior), *(len(log.target) for log in logs)])
    wide = [_wide(log, parts, constants, own[k : k + 2], int(own[-1])) for k, log in enumerate(logs)]
    errors = np.array([_error(fit_linear(log.columns, log.target).residuals) for log in logs])
    for turn in range(ROUNDS):
        columns = [prior, *(block / error for block, error in zip(wide, errors, strict=True))]
        targets = [means, *(log.target / error for log, error in zip(logs, errors, strict=True))]
        solved = fit_linear(np.vstack(columns), np.concatenate(targets))
        residuals = [solved.residuals[a:b] for a, b in pairwise(edges)]
        if turn < ROUNDS - 1:
            errors = errors * np.array([_error(part) for part in residuals])
    of_parts = solved.influence[common : common + len(parts)]
    covariance = of_parts[:, : len(prior)] @ of_parts[:, : len(prior)].T
    white, phases = np.zeros(len(parts)), np.zeros((1, len(parts)))
    for k, log in enumerate(logs):
        influence = of_parts[:, edges[k] : edges[k + 1]] / errors[k]
        covariance = covariance + _scatter(log, influence, residuals[k] * errors[k])
        white += [log.sensor_noise(row, grid=True)[0] for row in influence]
        phases = phases + (log.grid @ influence.T if len(log.grid) else 0.0)
    scale = np.array([part.prior for part in parts])
    # errors that repeat with the motion add variance; those that cancel in a quick motion take some away
    grid = np.asarray(shrunk(np.mean(phases**2, axis=0) - white, GRID_SPREAD * white))
    return JointFit(
        common=solved.values[:common],
        parts=solved.values[common : common + len(parts)] * scale,
        covariance=covariance * np.outer(scale, scale),
        grid=grid * scale**2,
        errors=errors,
    )


def _wide(log: LogRows, parts: Sequence[Part], constants: Sequence[str], own: Array, width: int) -> Array:
    """Columns of one log among those of all logs: parts and constants in units of their priors; own: from, to."""
    nothing = np.zeros(len(log.target))
    shared = [
        log.columns[:, : len(log.common)],
        *(log.parts.get(part.key, nothing) * part.prior for part in parts),
        *(log.constants.get(key, nothing) for key in constants),
    ]
    block = np.column_stack(shared)
    result = np.zeros((len(block), width))
    result[:, : block.shape[1]] = block
    result[:, own[0] : own[1]] = log.columns[:, len(log.common) :]
    return result


def _error(residuals: Array) -> float:
    """Standard deviation of a row, as of an independent one: rows of overlapping windows are correlated."""
    return max(float(np.sqrt(LAG / 2 * np.mean(residuals**2))), 1e-300)


def _scatter(log: LogRows, influence: Array, residuals: Array) -> Array:
    """Covariance (p, p) by noise of the log's sensors and by lack of fit of its rows; see `balance.fits`.

    influence (p, rows): of the log's rows on the parts.
    """
    own = len(log.common) + len(log.own)
    covariance = LinearFit(np.zeros(own), residuals, influence, 1.0).covariance(LAG)
    spare = max(len(residuals) - own, 1)
    found = np.diag(covariance)
    pairs = zip((log.sensor_noise(row) for row in influence), found, strict=True)
    variances = np.array([with_excess(*noise, scatter, spare) for noise, scatter in pairs])
    scale = np.sqrt(variances / np.maximum(found, 1e-300))
    result: Array = np.where(np.eye(len(found)) > 0, np.diag(variances), covariance * np.outer(scale, scale))
    return result
