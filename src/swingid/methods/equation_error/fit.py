"""Weighted least squares or instrumental variables on filtered rows, with uncertainties that account for the filter.

Least squares is biased where the regressors are noisy: by the share of noise in the power of the acceleration.
Instruments remove the bias: the same regressors some time earlier, Σ z_k (y_k − x_k θ) = 0 with z_k = x_(k−lag). The
lag is longer than the impulse response of the filter, so the noise of the two is independent; and it points to the
past, so that the response of a controller to that noise is not in the instruments either. Of such lags the one of least
variance is taken. Regressors of the direction of motion, as Coulomb friction, have no noise and are their own
instruments. (Delayed signals as instruments: Söderström and Stoica 1983, "Instrumental Variable Methods for System
Identification". In robotics, Janot, Vandanjon and Gautier 2014, instruments are simulated; for equation (I) that takes
a controller, which is unknown, or the measured wheel angle as input, whose noise is not independent.)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swingid.balance.fits import NamedFit, columns_of, known_side
from swingid.balance.rows import Rows
from swingid.errors import UnanswerableError
from swingid.model.equation import Equation
from swingid.numerics.arrays import Array, Bools, median
from swingid.numerics.regression import LinearFit, hac_covariance

ROBUST = 5.0
"""Robust standard deviations of a residual beyond which its row weighs less (Huber)."""

ROWS_PER_UNKNOWN = 5

ROUNDS = 4

LAGS_TRIED = 40

OF_DIRECTION = ("coulomb", "stribeck", "stribeck_speed", "offset", "memory")
"""Regressors of the direction of motion: without noise except at the reversals, so their own instruments."""


@dataclass(frozen=True)
class RowFit(NamedFit):
    """A fit of filtered rows; weights of the rows (0: unused), inverse (p, p) of Z'W X."""

    weights: Array
    inverse: Array


def fit_rows(rows: Rows, equation: Equation, terms: tuple[str, ...], usable: Bools, reach: int, lag: int) -> RowFit:
    """Fit the rows by least squares (lag 0), or with the regressors `lag` rows earlier as instruments.

    usable (rows,): which to use. reach: rows up to which the covariance contains correlation.
    Raises UnanswerableError where too few rows are left.
    """
    unknowns, columns = columns_of(rows, equation, terms)
    target = known_side(rows, equation)
    instruments, usable = lagged(columns, usable, lag, unknowns)
    if usable.sum() < ROWS_PER_UNKNOWN * len(unknowns):
        raise UnanswerableError(
            f"{usable.sum()} filtered rows are left, too few for {len(unknowns)} unknowns; record a longer run, "
            "or give a higher cutoff.",
            code="too-short",
        )
    weights = usable.astype(np.float64)
    for _ in range(ROUNDS):
        fit, inverse = _solve(columns, target, instruments, weights)
        before, weights = weights, usable * _huber(fit.residuals, usable)
        if np.array_equal(weights, before):
            break
    covariance = hac_covariance(fit.influence * fit.residuals, reach, len(unknowns), int(usable.sum()))
    return RowFit(unknowns, fit, covariance, weights, inverse)


def lagged(columns: Array, usable: Bools, lag: int, unknowns: tuple[str, ...]) -> tuple[Array, Bools]:
    """The columns `lag` rows earlier, but for those of the direction, and the rows that are usable with them."""
    if lag == 0:
        return columns, usable
    earlier, sound = np.zeros_like(columns), np.zeros_like(usable)
    earlier[lag:] = columns[:-lag]
    kept = [k for k, name in enumerate(unknowns) if name in OF_DIRECTION]
    earlier[:, kept] = columns[:, kept]
    sound[lag:] = usable[lag:] & usable[:-lag]
    return earlier, sound


def best_lag(rows: Rows, equation: Equation, terms: tuple[str, ...], usable: Bools, shortest: int, longest: int) -> int:
    """The lag of the instruments, in rows, that gives the inertia the least variance under white residuals."""
    unknowns, columns = columns_of(rows, equation, terms)
    columns = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    best, least = 0, np.inf
    for lag in range(shortest, longest + 1, max(1, (longest - shortest) // LAGS_TRIED)):
        earlier, sound = lagged(columns, usable, lag, unknowns)
        z, x = earlier[sound], columns[sound]
        if len(z) < 5 * x.shape[1]:
            break
        inverse = np.linalg.pinv(z.T @ x, rcond=1e-12)
        variance = float(inverse[0] @ (z.T @ z) @ inverse[0])
        if variance < least:
            best, least = lag, variance
    if best == 0:
        raise UnanswerableError(
            "the log is too short for instruments from an earlier swing; record a longer run, or leave them out.",
            code="too-short",
        )
    return best


def _solve(columns: Array, target: Array, instruments: Array, weights: Array) -> tuple[LinearFit, Array]:
    """Solution of Z'W (y − X θ) = 0 with its condition for columns of unit length, and the inverse of Z'W X."""
    used = np.sqrt(weights)[:, None]
    scale = np.linalg.norm(columns * used, axis=0)
    scale[scale == 0] = 1.0
    weighted = (instruments / scale).T * weights
    gram = weighted @ (columns / scale)
    left, spread, right = np.linalg.svd(gram)
    seen = np.divide(1.0, spread, out=np.zeros_like(spread), where=spread > 1e-14 * spread[0])
    inverse = (right.T * seen) @ left.T / scale[:, None]
    influence = inverse @ weighted
    values = influence @ target
    condition = float(np.sqrt(spread[0] / spread[-1])) if spread[-1] > 0 else float("inf")
    return LinearFit(values, target - columns @ values, influence, condition), inverse / scale


def _huber(residuals: Array, usable: Bools) -> Array:
    """Huber's weights from the robust spread of the usable residuals."""
    spread = 1.4826 * median(np.abs(residuals[usable]))
    size = np.abs(residuals) / max(ROBUST * spread, 1e-300)
    return np.asarray(1 / np.maximum(size, 1.0))
