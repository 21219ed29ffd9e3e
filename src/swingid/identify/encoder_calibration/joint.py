"""The joint fit of several logs: one inertia, the encoders' parts, friction of each log for itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from swingid.identify.encoder_calibration.logs import LogRows
from swingid.identify.encoder_calibration.parts import Part
from swingid.identify.momentum.fits import LAG
from swingid.numerics.regression import fit_linear, hac_covariance

Array = NDArray[np.float64]

ROUNDS = 3

REACH = 2 * LAG
"""Neighbouring rows over which their scatter counts as correlated, under Parzen weights.

Most of it is the encoder's steps, twice differentiated: neighbouring rows then err against each other. Bartlett weights
of the same band would take a fifth too much for what remains of that in the sum (`hac_covariance`).
"""


@dataclass(frozen=True)
class JointFit:
    """What the logs say together.

    parts: change of each part against the linearisation (rad, s), in the order of `asked`. covariance: type A, of the
    common unknowns (inertia first) and then the parts. grid: variances of the same by the place of the encoder's grid,
    beyond what the scatter of the rows holds of it. errors: standard deviation of a row of each log.
    """

    asked: tuple[Part, ...]
    common: Array
    parts: Array
    covariance: Array
    grid: Array
    errors: Array

    @property
    def uncertainties(self) -> Array:
        """Standard uncertainties of the parts."""
        k = len(self.common)
        result: Array = np.sqrt((np.diag(self.covariance) + self.grid)[k:])
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
    from_prior = solved.influence[:seen, : len(prior)]
    scatter, grid = from_prior @ from_prior.T, np.zeros(seen)
    for k, log in enumerate(logs):
        weights = solved.influence[:seen, edges[k] : edges[k + 1]]
        scatter += _scatter(weights * residuals[k], common + len(log.own))
        grid += _grid(log, weights / errors[k])
    scale = np.append(np.ones(common), [part.prior for part in asked])
    return JointFit(
        asked=tuple(asked),
        common=solved.values[:common],
        parts=solved.values[common:seen] * scale[common:],
        covariance=scatter * np.outer(scale, scale),
        grid=np.maximum(grid, 0.0) * scale**2,
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


def _scatter(scores: Array, unknowns: int) -> Array:
    """Covariance of the sums of the scores (p, rows) of one log.

    A log of few rows knows as much as its rows without the unknowns that are its own; half of the rows are independent.
    """
    count = scores.shape[1] / (LAG / 2)
    whole = hac_covariance(scores, REACH, 0, scores.shape[1])
    result: Array = whole * count / max(count - unknowns, 1.0)
    return result


def _grid(log: LogRows, influence: Array) -> Array:
    """Variances (p,) by the place of the encoder's grid, less the part that looks like scatter of the rows.

    Alike at every swing, it does not average out. Each place of the grid moves the unknowns by the sum of what it does
    to the rows; what an estimate from the scatter of such rows would say of that is taken off. Below 0 by chance.
    """
    found = np.zeros(len(influence))
    for errors in log.grid:
        found += (influence @ errors) ** 2 - np.diag(_scatter(influence * errors, 0))
    result: Array = found / max(len(log.grid), 1)
    return result
