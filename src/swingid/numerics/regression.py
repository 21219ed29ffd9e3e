"""Linear least squares whose uncertainties survive correlated residuals."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from swingid.numerics.arrays import Array

NORMAL = 1e-8
"""Ratio of the powers of directions from which on the normal equations are solved: they square the condition."""

TINY = 1e-300
"""Least power that is divided by."""

SINGLE, FEW = 1 << 18, 1 << 13
"""Products of matrices, and with a vector, from which on BLAS would wake other processors, which costs more than it
saves."""


def _newey_west(scores: Array, lag: int) -> Array:
    """Σ over lags of the Bartlett-weighted products of scores (..., p, n): of their sums over lag + 1 neighbours."""
    *many, count = scores.shape
    padded = np.zeros((*many, count + 2 * lag))
    padded[..., lag : lag + count] = scores
    sums = padded[..., : count + lag].copy()
    for k in range(1, lag + 1):
        sums += padded[..., k : k + count + lag]
    result = gram(sums)
    result /= lag + 1.0
    return result


@dataclass(frozen=True)
class LinearFit:
    """Solution of X θ ≈ y: values (p,), residuals (n,), influence K (p, n) with θ = K y, and the condition number.

    The condition is that of X with columns scaled to unit length, so units do not matter. Of several fits of as many
    rows and unknowns at once all have one dimension more, the first.
    """

    values: Array
    residuals: Array
    influence: Array
    condition: Any

    def __getitem__(self, k: int) -> LinearFit:
        """The fit at this place of several."""
        return LinearFit(self.values[k], self.residuals[k], self.influence[k], float(self.condition[k]))

    def covariance(self, lag: int) -> Array:
        """Newey–West covariance of the values: residuals may be correlated over up to `lag` neighbouring rows.

        (Newey and West 1987, Bartlett weights; small-sample factor from the number of rows that do not overlap.)
        """
        covariance = _newey_west(self.influence * self.residuals[..., None, :], lag)
        independent = self.influence.shape[-1] / max(1.0, lag / 2)
        spare = max(independent - self.values.shape[-1], 1.0)
        covariance *= independent / spare
        return covariance

    @property
    def normal(self) -> Array:
        """(X'X)⁻¹ (p, p): the covariance of the values by independent residuals of variance 1."""
        return gram(self.influence)


def squared_distance(values: Array, covariance: Array, smallest: float = 1e-9) -> float:
    """Squared Mahalanobis distance of values (p,) from 0: Wald's statistic, chi-square where they are normal.

    Of the covariance, scaled to correlations, directions below `smallest` of the largest are left out; 0 where it is
    not finite, which says nothing of the values.
    """
    if not np.isfinite(covariance).all():
        return 0.0
    return float(values @ inverse_of_gram(covariance, smallest) @ values)


def inverse_of_gram(matrix: Array, smallest: float) -> Array:
    """Pseudo-inverse of a Gram matrix or covariance (p, p), scaled to a diagonal of ones; 0 where that has a 0.

    Directions below `smallest` of the largest are left out.
    """
    sizes = np.sqrt(np.maximum(np.diag(matrix), 0.0))
    sizes[sizes == 0.0] = 1.0
    both = np.outer(sizes, sizes)
    inverse: Array = np.linalg.pinv(matrix / both, rcond=smallest, hermitian=True) / both
    return inverse


def gram(rows: Array) -> Array:
    """X Xᵀ of rows X (..., p, n), for p of some dozens, by products too small for more than one processor."""
    width = max(SINGLE // max(rows.shape[-2], 1) ** 2, 1)
    if rows.shape[-1] <= width:
        return rows @ rows.swapaxes(-1, -2)
    parts = (rows[..., k : k + width] for k in range(0, rows.shape[-1], width))
    return sum((part @ part.swapaxes(-1, -2) for part in parts), np.zeros((*rows.shape[:-1], rows.shape[-2])))


def product(first: Array, second: Array) -> Array:
    """Matrix (..., m, k) times matrix (..., k, n), n ≫ m, by products too small for more than one processor."""
    count, width = second.shape[-1], max(SINGLE // (first.shape[-2] * first.shape[-1] or 1), 1)
    if count <= width:
        return first @ second
    result = np.empty((*second.shape[:-2], first.shape[-2], count))
    for k in range(0, count, width):
        result[..., k : k + width] = first @ second[..., k : k + width]
    return result


def fit_linear(columns: Array, target: Array, *, smallest: float = 1e-9) -> LinearFit:
    """Least squares on scaled columns; directions below `smallest` of the largest singular value are dropped.

    columns (n, p), target (n,), p of some tens at most; several systems at once as (systems, n, p), (systems, n). A
    column of zeros gets the value 0. By the normal equations with one correction by the residuals where the condition
    allows it (Björck 1996, section 2.9), else by SVD.
    """
    turned = columns.swapaxes(-1, -2)
    products = gram(turned)
    scale = np.sqrt(products.diagonal(0, -2, -1))
    scale[scale == 0.0] = 1.0
    inverse = (1.0 / scale)[..., None]
    powers, directions = np.linalg.eigh(products * inverse * inverse.swapaxes(-1, -2))
    unknowns = powers.shape[-1]
    if unknowns and not (powers[..., 0] > NORMAL * powers[..., -1]).all():
        if columns.ndim > 2:
            fits = [fit_linear(*system, smallest=smallest) for system in zip(columns, target, strict=True)]
            return LinearFit(*(np.array([getattr(fit, each.name) for fit in fits]) for each in fields(LinearFit)))
        influence, condition = _by_singular_values(columns * inverse[:, 0], smallest)
        influence *= inverse
    else:
        directions *= inverse
        influence = product(directions / powers[..., None, :], product(directions.swapaxes(-1, -2), turned))
        condition = np.sqrt(powers[..., -1] / powers[..., 0]) if unknowns else np.zeros(powers.shape[:-1])
    values = _times(influence, target)
    residuals = target - _times(columns, values)
    further = _times(influence, residuals)
    residuals -= _times(columns, further)
    return LinearFit(values + further, residuals, influence, condition if columns.ndim > 2 else float(condition))


def _times(matrix: Array, vector: Array) -> Array:
    """Products of matrices (..., m, n) with vectors (..., n), by one processor."""
    if matrix.shape[-2] * matrix.shape[-1] > FEW:
        products: Array = np.einsum("...ij,...j->...i", matrix, vector)
        return products
    result: Array = (matrix @ vector[..., None])[..., 0]
    return result


def _by_singular_values(scaled: Array, smallest: float) -> tuple[Array, Any]:
    """Pseudo-inverse without the directions below `smallest`, and the condition: infinite with one not seen at all."""
    left_vectors, sizes, right_vectors = np.linalg.svd(scaled, full_matrices=False)
    seen = sizes > smallest * sizes[0]
    influence = (right_vectors[seen].T / sizes[seen]) @ left_vectors[:, seen].T
    lost = len(sizes) < scaled.shape[1] or not sizes[-1] > 1e-15 * sizes[0]
    return influence, np.inf if lost else float(sizes[0] / sizes[-1])


def fit_oblique(
    columns: Array, target: Array, instruments: Array, weights: Array | float = 1.0, *, smallest: float = 1e-7
) -> tuple[LinearFit, Array]:
    """Instrumental variables, Z'W (y − X θ) = 0: the fit, and the inverse of Z'W X (p, p).

    columns X, instruments Z (n, p), target y (n,), weights W (n,); Z = X is weighted least squares. Columns are scaled
    to unit length; directions below `smallest`² of the largest singular value of Z'W X are dropped. The condition is
    the root of that of Z'W X.
    """
    scale = np.linalg.norm(columns * np.sqrt(weights)[..., None], axis=0)
    scale[scale == 0] = 1.0
    weighted = (instruments / scale).T * weights
    left_vectors, sizes, right_vectors = np.linalg.svd(weighted @ (columns / scale))
    seen = np.divide(1.0, sizes, out=np.zeros_like(sizes), where=sizes > smallest**2 * sizes[0])
    inverse = (right_vectors.T * seen) @ left_vectors.T / scale[:, None]
    influence = inverse @ weighted
    values = influence @ target
    condition = float(np.sqrt(sizes[0] / sizes[-1])) if sizes[-1] > 0 else np.inf
    return LinearFit(values, target - columns @ values, influence, condition), inverse / scale


COLLINEAR = 1e-9
"""Share of a further column below which what the columns of a fit leave of it is rounding."""


@dataclass(frozen=True)
class Beside:
    """Further columns Z (n, m) beside the columns X (n, p) of a fit: partitioned regression (Frisch and Waugh 1933).

    lever K Z (p, m): fall of the values of the fit per unit of a further one. rest Z − X K Z (n, m). Several sets of as
    many further columns at once have one dimension more, the first.
    """

    fit: LinearFit
    lever: Array
    rest: Array

    @classmethod
    def of(cls, columns: Array, fit: LinearFit, more: Array) -> Beside:
        """Take the columns (n, p) of a fit, whose residuals are those that the further ones (..., n, m) may explain."""
        lever = fit.influence @ more
        rest = more - columns @ lever
        again = fit.influence @ rest  # what rounding left; twice is enough
        rest -= columns @ again
        sizes = np.linalg.norm(more, axis=-2, keepdims=True)
        rest *= np.linalg.norm(rest, axis=-2, keepdims=True) > COLLINEAR * sizes
        return cls(fit, lever + again, rest)

    def alone(self, error: Any = None, means: Any = 0.0) -> LinearFit:
        """The further values (m,), their influence and the residuals of both; 0 of a column that X contains.

        error: standard deviation of a row by which a standard normal prior of the further values about these means (m,)
        is weighted; it is rows of the fit, the last ones. By default there is none; 0 has no weight.
        """
        *many, rows, count = self.rest.shape
        prior = np.arange(0 if error is None else count)
        rest, target = np.zeros((*many, rows + len(prior), count)), np.zeros((*many, rows + len(prior)))
        rest[..., :rows, :], target[..., :rows] = self.rest, self.fit.residuals
        if error is not None:
            rest[..., rows + prior, prior] = np.asarray(error)[..., None]
        target[..., rows:] = rest[..., rows + prior, prior] * means
        return fit_linear(rest, target)

    def solved(self, error: Any = None, means: Any = 0.0) -> LinearFit:
        """The fit with both, values (p + m,), those of the fit first; else as `alone`."""
        more, rows = self.alone(error, means), self.rest.shape[-2]
        influence = np.concatenate([-product(self.lever, more.influence), more.influence], axis=-2)
        influence[..., : len(self.fit.influence), :rows] += self.fit.influence
        values = np.concatenate([self.fit.values - _times(self.lever, more.values), more.values], axis=-1)
        return LinearFit(values, more.residuals, influence, np.maximum(self.fit.condition, more.condition))

    def left(self, error: Any, means: Any) -> Array:
        """Residuals (..., n) under such a prior, by the normal equations: quick, for the weight of the prior."""
        powers, directions = self._directions
        weight = np.asarray(error)[..., None] ** 2
        score = _times(self.rest.swapaxes(-1, -2), self.fit.residuals) + weight * means
        turned = _times(directions.swapaxes(-1, -2), score) / np.maximum(powers + weight, TINY)
        result: Array = self.fit.residuals - _times(self.rest, _times(directions, turned))
        return result

    @cached_property
    def _directions(self) -> tuple[Array, Array]:
        """Powers (..., m) of what the fit leaves of the further columns, and the directions that have them."""
        powers, directions = np.linalg.eigh(gram(self.rest.swapaxes(-1, -2)))
        return np.maximum(powers, 0.0), directions


def parzen(reach: int) -> Array:
    """Parzen's weights of lags 0 to `reach`, shape (reach + 1,)."""
    x = np.arange(reach + 1) / (reach + 1)
    return np.asarray(np.where(x < 0.5, 1 - 6 * x**2 + 6 * x**3, 2 * (1 - x) ** 3))


@lru_cache(16)
def _parzen_spectrum(reach: int, size: int) -> Array:
    """Roots of the weights of a real spectrum's powers in sums of products under Parzen's kernel; `size` samples."""
    kernel = np.zeros(size)
    kernel[: reach + 1] = parzen(reach)
    kernel[size - reach :] = kernel[reach:0:-1]
    weights = np.maximum(np.fft.rfft(kernel).real, 0.0) / size
    weights[1:-1] *= 2.0  # frequencies that stand for their negative, too
    roots: Array = np.sqrt(weights)
    return roots


def hac_covariance(scores: Array, reach: int, unknowns: int, used: int) -> Array:
    """Covariance of Σ scores, scores (p, n), with the Parzen kernel over `reach` neighbours (Andrews 1991).

    Its window falls off as the fourth power of the frequency, so that scores whose power lies far above the frequency
    that counts, as those of twice differentiated noise, don't leak into it as they do with Bartlett weights.
    used: scores that are not zero. Small-sample factor n / (n − p), n = 1.85 used / reach independent stretches.
    """
    reach = min(reach, scores.shape[1] - 1)
    # a quadratic form with a Toeplitz matrix, by its spectrum
    size = 1 << (scores.shape[1] + reach).bit_length()
    spectra = np.fft.rfft(scores, size)
    covariance = gram(np.hstack([spectra.real, spectra.imag]) * np.tile(_parzen_spectrum(reach, size), 2))
    independent = 1.85 * used / (reach + 1)
    result: Array = covariance * max(independent / max(independent - unknowns, 1.0), 1.0)
    return result


NEIGHBOURS = np.array([1.0, 0.5])
"""Newey and West's weights of a block and of its neighbour."""


def block_covariance(scores: Array, unknowns: int) -> Array:
    """Newey–West covariance of sums over blocks, scores (p, blocks), one neighbour correlated."""
    blocks = scores.shape[1]
    result: Array = _newey_west(scores, 1 if blocks > 2 else 0) * (blocks / max(blocks - unknowns, 1))
    return result
