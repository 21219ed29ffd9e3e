"""Significance levels: from which on a finding counts as indicated, detected, certain. Checks take theirs from here.

A level is a number of standard deviations of a normal quantity. Beside each: its two-sided probability for one test
and the number of tests of a log with it; a false finding per log has the product for its probability. Constants of
single checks that are no levels (a relative change worth a warning, a share of a swing) are in the checks.
"""

from __future__ import annotations

import math
from statistics import NormalDist

DIFFERS = 2.0
"""4.6e-2, four tests per log: two methods differ, where only a note follows. k = 2 of E_n."""

INDICATED = 3.0
"""2.7e-3, a handful of tests per log: of little consequence if false, as a term that is tried or a note."""

INDICATED_PAIR = 13.8
"""Quadratic form of two normal quantities (χ² with 2 degrees of freedom), 1.0e-3, one test per log: as `INDICATED`."""

DETECTED = 4.0
"""6.3e-5, some ten tests per log: changes the model of the fit, or contradicts a constant."""

CERTAIN = 5.0
"""5.7e-7, scans of hundreds of tests per log: contradicts the rig file, or corrects the log."""

CERTAIN_RATIO = 10.0
"""Power that four amplitudes explain, over four times the mean power of the rest (F of 4 and ν degrees of freedom):
1e-4 for ν = 20 and 7e-7 for ν = 100; the residuals are those of a model that may be wrong, not of noise alone."""

FAMILY = 0.01
"""Probability of any false finding in a family of tests, whatever their number (Bonferroni)."""

DECISIVE = 10.0
"""Difference of the Bayesian criterion that is decisive (Kass and Raftery 1995, J. Am. Stat. Assoc. 90, 773)."""

MATTERS = 2.0
"""A finding matters where it changes the estimate by more than this many of its standard uncertainties."""

BETTER = 0.85
"""Root mean square of the residuals with further unknowns, over that without, below which these explain a lack of fit.

Unknowns without effect reduce the power by one part each: of 14 independent rows, four of them."""


LEAST_POWER = 1e-300
"""Least sum of squares, whose logarithm is finite."""


def misfit(power: float, independent: float) -> float:
    """−2 ln of the likelihood of residuals with this sum of squares, of so many independent rows, less a constant.

    The variance of the rows is unknown. Of two models, one in the other, the fall is χ² of the further unknowns.
    """
    return independent * math.log(max(power, LEAST_POWER))


def bayesian(power: float, unknowns: int, independent: float) -> float:
    """Bayesian information criterion (Schwarz 1978) of so many unknowns that leave this sum of squares; less is better.

    exp(−c/2) is proportional to the probability of the model.
    """
    return misfit(power, independent) + unknowns * math.log(independent)


def akaike(power: float, unknowns: int, independent: float) -> float:
    """Akaike's information criterion, which does not favour smaller models (Burnham and Anderson 2002)."""
    return misfit(power, independent) + 2.0 * unknowns


def family_level(tests: int) -> float:
    """Standard deviations beyond which one of so many tests (≥ 1) counts, at `FAMILY` for all together."""
    return NormalDist().inv_cdf(1 - FAMILY / (2 * tests))


def normal_of_ratio(ratio: float, first: float, second: float) -> float:
    """Standard normal quantity of the same upper tail as a ratio with the distribution F(first, second).

    Paulson 1942, Ann. Math. Stat. 13, 233: the cube roots of both χ² are nearly normal.
    """
    if ratio <= 0:
        return -math.inf
    cube, v1, v2 = math.cbrt(ratio), 2 / (9 * first), 2 / (9 * second)
    return ((1 - v2) * cube - (1 - v1)) / math.sqrt(v2 * cube**2 + v1)
