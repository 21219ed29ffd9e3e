"""Linear least squares whose uncertainties survive correlated residuals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swingid.numerics.arrays import Array
from swingid.numerics.compiled import njit, njit_sums


@njit
def cholesky(matrix: Array) -> None:
    """Cholesky's factor of a small positive definite matrix into its lower triangle, of which alone it is read."""
    for a in range(len(matrix)):
        for c in range(a + 1):
            total = matrix[a, c]
            for j in range(c):
                total -= matrix[a, j] * matrix[c, j]
            matrix[a, c] = np.sqrt(max(total, 1e-300)) if a == c else total / matrix[c, c]


@njit
def symmetric_inverse(matrix: Array) -> Array:
    """Inverse of a small positive definite matrix, for compiled loops where a call of LAPACK costs more (Cholesky)."""
    n = len(matrix)
    factor, inverse = matrix.copy(), np.zeros((n, n))
    cholesky(factor)
    for k in range(n):  # the columns of L⁻¹, then L⁻ᵀ L⁻¹
        for a in range(k, n):
            total = 1.0 if a == k else 0.0
            for j in range(k, a):
                total -= factor[a, j] * inverse[j, k]
            inverse[a, k] = total / factor[a, a]
    result = np.zeros((n, n))
    for a in range(n):
        for c in range(n):
            for j in range(max(a, c), n):
                result[a, c] += inverse[j, a] * inverse[j, c]
    return result


@njit_sums
def _newey_west(influence: Array, residuals: Array, lag: int) -> Array:
    """Σ over lags of the Bartlett-weighted products of scores, the rows of influence times residuals."""
    unknowns, count = influence.shape
    scores = influence * residuals
    result = np.zeros((unknowns, unknowns))
    for a in range(unknowns):
        for c in range(a + 1):
            total = 0.0
            for i in range(count):
                total += scores[a, i] * scores[c, i]
            for k in range(1, min(lag, count - 1) + 1):
                cross = 0.0
                for i in range(count - k):
                    cross += scores[a, i + k] * scores[c, i] + scores[c, i + k] * scores[a, i]
                total += (1.0 - k / (lag + 1.0)) * cross
            result[a, c] = result[c, a] = total
    return result


@dataclass(frozen=True)
class LinearFit:
    """Solution of X θ ≈ y: values (p,), residuals (n,), influence K (p, n) with θ = K y, and the condition number.

    The condition is that of X with columns scaled to unit length, so units do not matter.
    """

    values: Array
    residuals: Array
    influence: Array
    condition: float

    def covariance(self, lag: int) -> Array:
        """Newey–West covariance of the values: residuals may be correlated over up to `lag` neighbouring rows.

        (Newey and West 1987, Bartlett weights; small-sample factor from the number of rows that do not overlap.)
        """
        covariance = _newey_west(self.influence, self.residuals, lag)
        independent = self.influence.shape[1] / max(1.0, lag / 2)
        spare = max(independent - len(self.values), 1.0)
        result: Array = covariance * independent / spare
        return result


@njit_sums
def gram(rows: Array) -> Array:
    """X Xᵀ of rows X (p, n), for p of some dozens: quicker than BLAS where that would wake other processors.

    Four products at a time, so that each row is read once for them.
    """
    count, length = rows.shape
    result = np.empty((count, count))
    for a in range(count):
        one = rows[a]
        for c in range(0, a + 1, 4):
            last = count - 1
            r0, r1, r2, r3 = rows[c], rows[min(c + 1, last)], rows[min(c + 2, last)], rows[min(c + 3, last)]
            t0 = t1 = t2 = t3 = 0.0
            for i in range(length):
                x = one[i]
                t0 += x * r0[i]
                t1 += x * r1[i]
                t2 += x * r2[i]
                t3 += x * r3[i]
            for k, total in enumerate((t0, t1, t2, t3)):
                if c + k <= a:
                    result[a, c + k] = result[c + k, a] = total
    return result


@njit_sums
def inner(one: Array, other: Array) -> float:
    """Sum of products; the sum may be reordered, so that the compiler can use vector instructions."""
    total = 0.0
    for i in range(len(one)):
        total += one[i] * other[i]
    return total


@njit
def _orthonormal(rows: Array) -> tuple[Array, Array]:
    """Q (p, n) and R (p, p) with Xᵀ = Qᵀ R for rows X (p, n), by Gram and Schmidt twice; Q's rows are orthonormal.

    A row that the ones before it explain to rounding becomes 0.
    """
    count, length = rows.shape
    q, r = rows.copy(), np.zeros((count, count))
    for k in range(count):
        own = q[k]
        before = np.sqrt(inner(own, own))
        for _ in range(2):
            for j in range(k):
                other = q[j]
                share = inner(other, own)
                r[j, k] += share
                for i in range(length):
                    own[i] -= share * other[i]
        left = np.sqrt(inner(own, own))
        seen = left > 1e-15 * before
        r[k, k] = left if seen else 0.0
        for i in range(length):
            own[i] = own[i] / left if seen else 0.0
    return q, r


@njit
def _singular(r: Array) -> tuple[Array, Array, Array]:
    """U S (p, p), V (p, p) and the singular values S of R = (U S) Vᵀ, not sorted (one-sided Jacobi, Hestenes 1958)."""
    count = len(r)
    u, v = r.copy(), np.eye(count)
    for _ in range(30):
        turned = 0.0
        for a in range(count - 1):
            for c in range(a + 1, count):
                alpha = beta = gamma = 0.0
                for i in range(count):
                    alpha += u[i, a] * u[i, a]
                    beta += u[i, c] * u[i, c]
                    gamma += u[i, a] * u[i, c]
                limit = np.sqrt(alpha * beta)
                if limit == 0.0 or abs(gamma) <= 1e-15 * limit:
                    continue
                turned = max(turned, abs(gamma) / limit)
                zeta = (beta - alpha) / (2.0 * gamma)
                tangent = (1.0 if zeta >= 0 else -1.0) / (abs(zeta) + np.sqrt(1.0 + zeta * zeta))
                cosine = 1.0 / np.sqrt(1.0 + tangent * tangent)
                sine = cosine * tangent
                for i in range(count):
                    one, two = u[i, a], u[i, c]
                    u[i, a], u[i, c] = cosine * one - sine * two, sine * one + cosine * two
                    one, two = v[i, a], v[i, c]
                    v[i, a], v[i, c] = cosine * one - sine * two, sine * one + cosine * two
        if turned < 1e-14:
            break
    sizes = np.zeros(count)
    for i in range(count):
        for a in range(count):
            sizes[a] += u[i, a] ** 2
    return u, v, np.sqrt(sizes)


@njit_sums
def _fitted(columns: Array, target: Array, smallest: float) -> tuple[Array, Array, Array, float]:
    """Values, residuals, influence and condition of `fit_linear`; columns: one in a row."""
    count, length = columns.shape
    rows, scale = columns.copy(), np.empty(count)
    for k in range(count):
        power = inner(rows[k], rows[k])
        scale[k] = np.sqrt(power) if power > 0.0 else 1.0
        for i in range(length):
            rows[k, i] /= scale[k]
    q, r = _orthonormal(rows)
    u, v, s = _singular(r)
    least, largest = np.inf, 0.0
    for size in s:
        least, largest = min(least, size), max(largest, size)
    back = np.zeros((count, count))  # V S⁻¹ Uᵀ, of the directions that are seen
    for j in range(count):
        if s[j] > smallest * largest:
            for a in range(count):
                for c in range(count):
                    back[a, c] += v[a, j] * u[c, j] / (s[j] * s[j])
    influence, values, residuals = np.zeros((count, length)), np.zeros(count), target.copy()
    for a in range(count):
        own = influence[a]
        for c in range(count):
            share, other = back[a, c] / scale[a], q[c]
            for i in range(length):
                own[i] += share * other[i]
        values[a] = inner(own, target)
    for a in range(count):
        share, other = values[a] * scale[a], rows[a]
        for i in range(length):
            residuals[i] -= share * other[i]
    return values, residuals, influence, largest / least if least > 0.0 else np.inf


def fit_linear(columns: Array, target: Array, *, smallest: float = 1e-9) -> LinearFit:
    """Least squares by SVD of the column-scaled matrix; directions below `smallest` of the largest are dropped.

    columns (n, p), target (n,), p of some tens at most. A column of zeros gets the value 0. The SVD is that of R of
    the matrix = Q R.
    """
    return LinearFit(*_fitted(np.ascontiguousarray(columns.T), target, smallest))


def parzen(reach: int) -> Array:
    """Parzen's weights of lags 0 to `reach`, shape (reach + 1,)."""
    x = np.arange(reach + 1) / (reach + 1)
    return np.asarray(np.where(x < 0.5, 1 - 6 * x**2 + 6 * x**3, 2 * (1 - x) ** 3))


def _weighted_products(scores: Array, weights: Array) -> Array:
    """Products of scores (p, n) with themselves (p, p), summed over lags with weights from lag 0 (weight 1) on."""
    covariance: Array = scores @ scores.T
    for k, weight in enumerate(weights[1:], start=1):
        cross = scores[:, k:] @ scores[:, :-k].T
        covariance += weight * (cross + cross.T)
    return covariance


def hac_covariance(scores: Array, reach: int, unknowns: int, used: int) -> Array:
    """Covariance of Σ scores, scores (p, n), with the Parzen kernel over `reach` neighbours (Andrews 1991).

    Its window falls off as the fourth power of the frequency, so that scores whose power lies far above the frequency
    that counts, as those of twice differentiated noise, don't leak into it as they do with Bartlett weights.
    used: scores that are not zero. Small-sample factor n / (n − p), n = 1.85 used / reach independent stretches.
    """
    reach = min(reach, scores.shape[1] - 1)
    # a quadratic form with a Toeplitz matrix, by its spectrum
    size = 1 << (scores.shape[1] + reach).bit_length()
    kernel, spectra = np.zeros(size), np.fft.rfft(scores, size)
    kernel[: reach + 1] = parzen(reach)
    kernel[size - reach :] = kernel[reach:0:-1]
    weighted = np.fft.irfft(spectra * np.fft.rfft(kernel).real, size)[:, : scores.shape[1]]
    covariance = weighted @ scores.T
    covariance = (covariance + covariance.T) / 2
    independent = 1.85 * used / (reach + 1)
    result: Array = covariance * max(independent / max(independent - unknowns, 1.0), 1.0)
    return result


NEIGHBOURS = np.array([1.0, 0.5])
"""Newey and West's weights of a block and of its neighbour."""


def block_covariance(scores: Array, unknowns: int) -> Array:
    """Newey–West covariance of sums over blocks, scores (p, blocks), one neighbour correlated."""
    blocks = scores.shape[1]
    covariance = _weighted_products(scores, NEIGHBOURS if blocks > 2 else NEIGHBOURS[:1])
    result: Array = covariance * (blocks / max(blocks - unknowns, 1))
    return result
