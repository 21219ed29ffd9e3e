"""Weighted least squares or instrumental variables on filtered rows, with uncertainties that know of the filter.

Least squares is biased where the regressors are noisy: by the share of noise in the power of the acceleration.
Instruments take it away. Here they are the same regressors from the other half of the rows of the log (every second
one): white noise of the two halves is independent, so the moment conditions Z'(y − X θ) = 0 hold for the true θ.
(Replicated measurements as instruments: Söderström 2018, "Errors-in-Variables Methods in System Identification".)
The robotics form, Janot, Vandanjon and Gautier 2014, simulates the instruments; for row (I) that takes the noisy wheel
angle or a controller as input, and is consistent only where the noise of that input does not matter. Noise that
neighbouring rows share, such as the steps of a coarse encoder near rest, is not removed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swingid.errors import UnanswerableError
from swingid.identify.momentum.balance import Rows
from swingid.identify.momentum.fits import columns_of, known_side
from swingid.identify.scale import Scale
from swingid.numerics.regression import LinearFit, hac_covariance

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

ROBUST = 3.0
"""Robust standard deviations of a residual beyond which its row weighs less (Huber)."""

ROUNDS = 4


@dataclass(frozen=True)
class RowFit:
    """A fit of filtered rows: unknowns by name ("inertia" first), type A covariance, weights of the rows (0 unused)."""

    unknowns: tuple[str, ...]
    fit: LinearFit
    covariance: Array
    weights: Array

    @property
    def a11(self) -> float:
        """Inertia of the whole axis, a11 = J1 + J2 + Jr."""
        return float(self.fit.values[0])

    @property
    def u(self) -> float:
        """Type A standard uncertainty of a11."""
        return float(np.sqrt(self.covariance[0, 0]))

    def value(self, name: str) -> float:
        """Value of an unknown, 0 where it was not sought."""
        return float(self.fit.values[self.unknowns.index(name)]) if name in self.unknowns else 0.0


def fit_rows(halves: tuple[Rows, Rows], scale: Scale, terms: tuple[str, ...], usable: Bools, reach: int) -> RowFit:
    """Fit the rows; `halves` are the same rows from independent noise, or one and the same for plain least squares.

    usable (rows,): which to use. reach: rows over which the covariance looks for correlation.
    Raises UnanswerableError where too few rows are left.
    """
    unknowns, first = columns_of(halves[0], scale, terms)
    _, second = columns_of(halves[1], scale, terms)
    targets = known_side(halves[0], scale), known_side(halves[1], scale)
    if usable.sum() < 5 * len(unknowns):
        raise UnanswerableError(
            f"{usable.sum()} filtered rows are left, too few for {len(unknowns)} unknowns; record a longer run, "
            "or give a higher cutoff.",
            code="too-short",
        )
    weights = usable.astype(np.float64)
    for _ in range(ROUNDS):
        fit, scores = _solve((first, second), targets, weights)
        weights = usable * _huber(fit.residuals, usable)
    covariance = hac_covariance(scores, reach, len(unknowns), int(usable.sum()))
    return RowFit(unknowns, fit, covariance, weights)


def _solve(columns: tuple[Array, Array], targets: tuple[Array, Array], weights: Array) -> tuple[LinearFit, Array]:
    """Symmetric instrumental-variable solution, each half the instrument of the other; and the scores (p, rows)."""
    first, second = columns
    scale = np.sqrt(np.abs(weights @ (first * second)))
    scale[scale == 0] = 1.0
    one, two = first / scale, second / scale
    cross = two.T @ (weights[:, None] * one)
    gram = (cross + cross.T) / 2
    powers = np.abs(np.linalg.eigvalsh(gram))
    inverse = np.linalg.pinv(gram, rcond=1e-14, hermitian=True)
    right = two.T @ (weights * targets[0]) + one.T @ (weights * targets[1])
    scaled = inverse @ right / 2
    left = targets[0] - one @ scaled, targets[1] - two @ scaled
    scores = inverse @ (two.T * left[0] + one.T * left[1]) * weights / 2 / scale[:, None]
    influence = inverse @ (one + two).T * weights / 2 / scale[:, None]
    condition = float(np.sqrt(powers.max() / powers.min())) if powers.min() > 0 else float("inf")
    return LinearFit(scaled / scale, (left[0] + left[1]) / 2, influence, condition), scores


def _huber(residuals: Array, usable: Bools) -> Array:
    """Huber's weights from the robust spread of the usable residuals."""
    spread = 1.4826 * float(np.median(np.abs(residuals[usable])))
    size = np.abs(residuals) / max(ROBUST * spread, 1e-300)
    return np.asarray(1 / np.maximum(size, 1.0))
