"""Linear least squares whose uncertainties survive correlated residuals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swingid.numerics.compiled import njit, njit_sums

Array = NDArray[np.float64]


@njit
def symmetric_inverse(matrix: Array) -> Array:
    """Inverse of a small positive definite matrix, for compiled loops where a call of LAPACK costs more (Cholesky)."""
    n = len(matrix)
    factor, inverse = np.zeros((n, n)), np.zeros((n, n))
    for a in range(n):
        for c in range(a + 1):
            total = matrix[a, c]
            for j in range(c):
                total -= factor[a, j] * factor[c, j]
            factor[a, c] = np.sqrt(max(total, 1e-300)) if a == c else total / factor[c, c]
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


def fit_linear(columns: Array, target: Array, *, smallest: float = 1e-9) -> LinearFit:
    """Least squares by SVD of the column-scaled matrix; directions below `smallest` of the largest are dropped.

    columns (n, p), target (n,). A column of zeros gets the value 0.
    """
    scale = np.linalg.norm(columns, axis=0)
    scale[scale == 0] = 1.0
    u, s, vt = np.linalg.svd(columns / scale, full_matrices=False)
    seen = s > smallest * s[0]
    inverse = np.where(seen, 1 / np.where(seen, s, 1.0), 0.0)
    influence = ((vt.T * inverse) @ u.T) / scale[:, None]
    values = influence @ target
    condition = float(s[0] / s[-1]) if s[-1] > 0 else float("inf")
    return LinearFit(values, target - columns @ values, influence, condition)


def parzen(reach: int) -> Array:
    """Parzen's weights of lags 0 to `reach`, shape (reach + 1,)."""
    x = np.arange(reach + 1) / (reach + 1)
    return np.asarray(np.where(x < 0.5, 1 - 6 * x**2 + 6 * x**3, 2 * (1 - x) ** 3))


def hac_covariance(scores: Array, reach: int, unknowns: int, used: int) -> Array:
    """Covariance of Σ scores, scores (p, n), with the Parzen kernel over `reach` neighbours (Andrews 1991).

    Its window falls off as the fourth power of the frequency, so that scores whose power lies far above the frequency
    that counts, as those of twice differentiated noise, don't leak into it as they do with Bartlett weights.
    used: scores that are not zero. Small-sample factor n / (n − p), n = 1.85 used / reach independent stretches.
    """
    reach = min(reach, scores.shape[1] - 1)
    covariance = scores @ scores.T
    for k, weight in enumerate(parzen(reach)[1:], start=1):
        cross = scores[:, k:] @ scores[:, :-k].T
        covariance += weight * (cross + cross.T)
    independent = 1.85 * used / (reach + 1)
    result: Array = covariance * max(independent / max(independent - unknowns, 1.0), 1.0)
    return result
