"""Dark uncertainty: difference of two estimates of one quantity beyond their uncertainties.

The term is that of Thompson and Ellison (2011, Accred. Qual. Assur. 16, 483) for a difference that no budget explains.
An estimate x of standard uncertainty u is compared with another one of the same quantity. Their difference d has the
variance σ² where both budgets are complete, and σ² + τ² where one of them lacks an error of variance τ².

Two cases are weighted by their likelihood of d (Bayesian model averaging; Hoeting et al. 1999, Stat. Sci. 14, 382):
τ = 0, and a τ of unknown size with the prior density s²/(s² + τ²)² of τ², whose median is s: uniform in s²/(s² + τ²)
(the uniform shrinkage prior; Strawderman 1971, Ann. Math. Stat. 42, 385; Daniels 1999, Can. J. Stat. 27, 567). Its
tail is the one with which the posterior mean of τ² tends to d² where d ≫ σ; under a half-Cauchy prior of τ one
difference alone has no posterior mean of τ². s is the smaller of σ and u: a comparison with a poor estimate shows
little, and must not widen a good one.

The result is the posterior mean of τ²: smooth, rising in |d| (the likelihood ratio is monotone), small where d ≪ σ,
|d| where d ≫ σ. A test (nothing up to 3 σ, all of d beyond) would jump there, and its intervals would cover less than
they state for differences just below.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

PRIOR = 0.01
"""Prior probability that the budget of an estimate is not complete.

With it τ² is half of d² at a difference of 4 σ, and a comparison of two estimates with complete budgets widens the
standard uncertainty by 1.5 % in the mean, where σ = u. A log is compared in some six ways, so one log in seventeen has
such a case a priori. Coverage of simulated logs with it: docs/campaign.md.
"""

LARGEST = 1 - 1e-9
"""Largest prior probability, whose complement has a logarithm."""

BELOW, BEYOND, STEP = 18.0, 36.0, 0.25
"""Of the integral over ln(τ²/s²): how far below 1 and beyond (d² + σ²)/s² it goes, where less than 1e-7 is left."""


def dark_uncertainty(
    difference: float, variance: float, uncertainty: float, ways: int = 1, incomplete: float = PRIOR
) -> float:
    """Standard uncertainty τ that the difference of two estimates adds to one of them, in the unit of the difference.

    difference: d. variance: σ² ≥ 0, of d where both budgets are complete. uncertainty: u of the estimate τ is added to.
    ways: of so many in which the budget may lack one error this comparison is one; they share the prior probability.
    incomplete: that probability, where more is known of the budget.
    """
    gap, sigma = abs(difference), math.sqrt(max(variance, 0.0))
    if sigma == 0.0 or not math.isfinite(gap + sigma):
        return gap
    prior, s = min(max(incomplete, PRIOR) / ways, LARGEST), min(sigma, abs(uncertainty))
    s = max(s, 1e-6 * sigma)
    d2, v = (gap / s) ** 2, (sigma / s) ** 2
    # over x = ln τ², in units of s: density dB = e^x/(1 + e^x)² dx of B = 1/(1 + τ²), which is uniform
    x = np.arange(-BELOW, math.log(d2 + v) + BEYOND, STEP)
    tau2 = np.exp(x)
    density = x - 2 * np.log1p(tau2) + math.log(prior * STEP)
    some = density - 0.5 * (d2 / (v + tau2) + np.log(v + tau2))
    none = math.log(1 - prior) - 0.5 * (d2 / v + math.log(v))
    highest = max(float(some.max()), none)
    weights = np.exp(some - highest)
    return s * math.sqrt(float(weights @ tau2) / (float(weights.sum()) + math.exp(none - highest)))


def shrunk(excess: Any, deviation: Any) -> Any:
    """An excess e of a variance whose standard deviation is `deviation` s, as e·e²/(e² + s²): of least squared error.

    The share of e that has the least mean squared error is ε²/(ε² + s²) for a true excess ε; with e in its place it is
    Thompson's estimator (1968, J. Am. Stat. Assoc. 63, 113). Of numbers or arrays.
    """
    power = excess * excess
    return excess * (power / np.maximum(power + deviation * deviation, 1e-300))
