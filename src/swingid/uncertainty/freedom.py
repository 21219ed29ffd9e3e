"""Degrees of freedom: of scatter with overlapping rows, of a combined uncertainty, and the coverage factor they give.

Welch and Satterthwaite, JCGM 100:2008 G.4: ν = u⁴ / Σ u_i⁴/ν_i. The expanded uncertainty of a level of confidence p is
t_p(ν) u (G.3), with Student's t.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import lru_cache

import numpy as np

from swingid.numerics.arrays import Array

COVERAGE = 0.95
"""Level of confidence of every interval."""

COVERAGE_FACTOR = 1.959963984540054
"""Coverage factor of a 95 % interval for infinitely many degrees of freedom: the normal quantile of 0.975."""

MANY = 1000.0
"""Degrees of freedom beyond which Student's quantile is taken for the normal one: they differ by less than 0.13 %."""


def effective_freedom(parts: Iterable[tuple[float, float]]) -> float:
    """Effective degrees of freedom of a sum of independent parts (standard uncertainty, degrees of freedom)."""
    known = [(abs(u), freedom) for u, freedom in parts if u != 0.0]
    largest = max((u for u, _ in known), default=0.0)
    if largest == 0.0:
        return math.inf
    # as shares of the largest part, whose fourth powers neither overflow nor vanish
    shares = [(u / largest, freedom) for u, freedom in known]
    inverse = sum(share**4 / freedom for share, freedom in shares)
    return sum(share**2 for share, _ in shares) ** 2 / inverse if inverse > 0 else math.inf


def lag_weights_power(weights: Array) -> float:
    """Σ w_k² over the lags −m to m of a kernel with weights w_0 … w_m: rows per degree of freedom."""
    return float(2 * weights @ weights - weights[0] ** 2)


def bartlett(lag: int) -> Array:
    """Bartlett's weights of lags 0 to `lag`, shape (lag + 1,), as Newey and West (1987) use them."""
    return 1.0 - np.arange(lag + 1) / (lag + 1)


def scatter_freedom(influence: Array, kernel: Array, unknowns: int) -> float:
    """Degrees of freedom of a variance Σ_ij w_|i−j| k_i k_j e_i e_j estimated from residuals e of a fit; at least 1.

    influence (n,): k, of the rows on the value. kernel (m + 1,): w, of lags 0 to m. unknowns: of the fit.

    For rows of equal weight such a sum has ν = n / Σ_{|k|≤m} w_k² (Priestley 1981, Spectral Analysis and Time Series,
    6.2: an estimate of the spectrum over the kernel's bandwidth). Rows of unequal weight count as (Σk²)²/Σk⁴, by
    Satterthwaite's rule for a sum of squares k_i² e_i²; the fit uses one row for each unknown (Bell and McCaffrey
    2002, Survey Methodology 28, 169; their exact number for white noise of the torque is within a factor of 2.3).
    """
    squares = np.square(influence)
    power = float(np.max(squares, initial=0.0))
    if power == 0.0:
        return 1.0
    squares = squares / power
    rows = float(squares.sum() ** 2 / (squares @ squares))
    return max((rows - unknowns) / lag_weights_power(kernel), 1.0)


@lru_cache(maxsize=4096)
def coverage_factor(freedom: float) -> float:
    """Quantile 0.975 of Student's t for `freedom` degrees of freedom, which need not be whole; below 1 that of 1.

    By bisection on the regularised incomplete beta function; scipy.special would cost 0.1 s at the start.
    """
    if not freedom < MANY:
        return COVERAGE_FACTOR
    freedom = max(freedom, 1.0)
    low, high = COVERAGE_FACTOR, 12.8
    while high - low > 1e-13 * high:
        middle = (low + high) / 2
        if not low < middle < high:
            break
        low, high = (middle, high) if _beyond(middle, freedom) > (1 - COVERAGE) / 2 else (low, middle)
    return (low + high) / 2


def _beyond(t: float, freedom: float) -> float:
    """Probability that Student's t exceeds t > 0: I_x(ν/2, 1/2) / 2 with x = ν/(ν + t²)."""
    a, b, x = freedom / 2, 0.5, freedom / (freedom + t * t)
    front = math.exp(math.lgamma(a + b) - math.lgamma(a) - math.lgamma(b) + a * math.log(x) + b * math.log1p(-x))
    if x < (a + 1) / (a + b + 2):
        return front * _fraction(a, b, x) / a / 2
    return (1 - front * _fraction(b, a, 1 - x) / b) / 2


def _fraction(a: float, b: float, x: float) -> float:
    """Continued fraction of the incomplete beta function, by Lentz's method (DLMF 8.17.22)."""
    tiny = 1e-300
    c, d = 1.0, 1 / (1 - (a + b) * x / (a + 1) or tiny)
    value = d
    for m in range(1, 500):
        for factor in (
            m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m)),
            -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1)),
        ):
            d, c = 1 / (1 + factor * d or tiny), 1 + factor / c or tiny
            value *= c * d
        if abs(c * d - 1) < 1e-15:
            break
    return value
