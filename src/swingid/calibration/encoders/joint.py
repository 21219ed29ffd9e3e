"""The joint fit of several logs: one inertia, the encoders' parts, friction of each log for itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from swingid.balance.fits import LAG, with_excess
from swingid.calibration.encoders.logs import LogRows
from swingid.calibration.encoders.parts import Part
from swingid.numerics.arrays import Array
from swingid.numerics.regression import LinearFit, fit_linear
from swingid.uncertainty.dark import shrunk

ROUNDS = 3

TOLD = 0.7
"""Relative standard deviation of the variance that eight places of a smoothed angle tell."""


@dataclass(frozen=True)
class JointFit:
    """What the logs say together.

    parts: change of each part against the linearisation (rad, s), in the order of `asked`. scatter: variances of type
    A, of the common unknowns (inertia first) and then the parts. grid: how much more (or less) of it the steps of the
    encoder make in this motion than white noise would. errors: standard deviation of a row of each log.
    """

    asked: tuple[Part, ...]
    common: Array
    parts: Array
    scatter: Array
    grid: Array
    errors: Array

    @property
    def uncertainties(self) -> Array:
        """Standard uncertainties of the parts."""
        k = len(self.common)
        result: Array = np.sqrt((self.scatter + self.grid)[k:])
        return result


def fit_jointly(logs: Sequence[LogRows], asked: Sequence[Part], current: Mapping[str, float]) -> JointFit:
    """Least squares of all rows, each log's weighted by its own scatter, with the bounds of the parts as priors.

    current: what each part is taken for in the rows; the prior draws it back towards 0.
    """
    common = len(logs[0].common)
    constants = sorted({key for log in logs for key in log.constants})
    shared = common + len(asked) + len(constants)
    blocks = [_block(log, asked, constants) for log in logs]
    own = np.cumsum([0, *(len(log.own) for log in logs)])
    prior = np.zeros((len(asked) + len(constants), shared + own[-1]))
    prior[:, common:shared] = np.eye(len(asked) + len(constants))
    wanted = np.append([-current[part.key] / part.prior for part in asked], np.zeros(len(constants)))
    errors = np.array([_error(_alone(log)) for log in logs])
    for turn in range(ROUNDS):
        stacked = [prior]
        targets = [wanted]
        for k, (block, log) in enumerate(zip(blocks, logs, strict=True)):
            wide = np.zeros((len(block), shared + own[-1]))
            wide[:, :shared] = block
            wide[:, shared + own[k] : shared + own[k + 1]] = log.columns[:, common:]
            stacked.append(wide / errors[k])
            targets.append(log.target / errors[k])
        solved = fit_linear(np.vstack(stacked), np.concatenate(targets))
        edges = np.cumsum([len(prior), *(len(log.target) for log in logs)])
        residuals = [solved.residuals[a:b] for a, b in pairwise(edges)]
        if turn < ROUNDS - 1:
            errors = errors * np.array([_error(part) for part in residuals])
    seen = common + len(asked)
    scatter = np.sum(solved.influence[:seen, : len(prior)] ** 2, axis=1)
    white, places = np.zeros(seen), np.zeros((1, seen))
    for k, log in enumerate(logs):
        influence = solved.influence[:seen, edges[k] : edges[k + 1]] / errors[k]
        scatter += _scatter(log, influence, residuals[k] * errors[k])
        white += [log.grid_noise(row) for row in influence]
        places = places + (log.grid @ influence.T if len(log.grid) else 0.0)
    scale = np.append(np.ones(common), [part.prior for part in asked])
    return JointFit(
        asked=tuple(asked),
        common=solved.values[:common],
        parts=solved.values[common:seen] * scale[common:],
        scatter=scatter * scale**2,
        grid=_counted(np.mean(places**2, axis=0), white) * scale**2,
        errors=errors,
    )


def _block(log: LogRows, asked: Sequence[Part], constants: Sequence[str]) -> Array:
    """Columns of the common unknowns, the parts in units of their priors, the constants in theirs."""
    nothing = np.zeros(len(log.target))
    return np.column_stack(
        [
            log.columns[:, : len(log.common)],
            *(log.parts.get(part.key, nothing) * part.prior for part in asked),
            *(log.constants.get(key, nothing) for key in constants),
        ]
    )


def _alone(log: LogRows) -> Array:
    """Residuals of the log's own fit without the encoders' parts."""
    return fit_linear(log.columns, log.target).residuals


def _error(residuals: Array) -> float:
    """Standard deviation of a row; rows share data, so each of them tells less than its residual says."""
    return max(float(np.sqrt(LAG / 2 * np.mean(residuals**2))), 1e-300)


def _scatter(log: LogRows, influence: Array, residuals: Array) -> Array:
    """Variances (p,) by noise of the log's sensors and by what its rows scatter beyond it; see `momentum.fits`.

    influence (p, rows) of the log's rows, which know as much as without the unknowns that are its own.
    """
    own = len(log.common) + len(log.own)
    scatter = np.diag(LinearFit(np.zeros(own), residuals, influence, 1.0).covariance(LAG))
    pairs = zip((log.sensor_noise(row) for row in influence), scatter, strict=True)
    return np.array([with_excess(*noise, found, max(len(residuals) - own, 1)) for noise, found in pairs])


def _counted(steps: Array, white: Array) -> Array:
    """What the variances by the encoder's `steps` differ from those by `white` noise, by how sure that is.

    More than white where errors come again, less in a quick motion, where they cancel; see `shrunk`.
    """
    return np.asarray(shrunk(steps - white, TOLD * white))
