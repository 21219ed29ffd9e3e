"""Levels of significance: when something counts as seen, as fitted, as certain. Every check uses one of these.

A level is a number of standard deviations of a normal quantity. Beside each: its two-sided probability for one test,
and how many tests of a log it stands behind, so that the chance of a false finding per log is their product.
"""

from __future__ import annotations

import math
from statistics import NormalDist

INDICATED = 3.0
"""Two-sided 2.7e-3, a handful of tests per log: what costs little if false, as a term tried or a word in a note."""

DETECTED = 4.0
"""Two-sided 6.3e-5, some ten tests per log: what changes the model of the fit, or warns of a constant."""

CERTAIN = 5.0
"""Two-sided 5.7e-7, hundreds of tests per log (scans): what contradicts the rig file or corrects the log."""

OVERWHELMING = 10.0
"""Two-sided 1.5e-23: where the standard deviation itself is a rough guess. As a ratio F of the power that four
amplitudes explain, on some twenty spare rows and more, its probability is below 2e-4 for normal residuals."""

FAMILY = 0.01
"""Probability that any of a family of tests finds something in sound data, whatever their number (Bonferroni)."""

MATTERS = 2.0
"""A finding matters where it moves the answer by more than this many of the answer's standard uncertainties."""

BETTER = 0.85
"""Root mean square of the residuals with a further cause, over that without, below which the cause explains something.

A cause that is none takes as many degrees of freedom as it has unknowns: 0.85 is four of fourteen."""


def two_sided(level: float) -> float:
    """Probability that a normal quantity is farther than `level` standard deviations from its mean."""
    return math.erfc(level / math.sqrt(2))


def family_level(tests: int) -> float:
    """Standard deviations beyond which one of so many tests (≥ 1) counts, at `FAMILY` for all together."""
    return NormalDist().inv_cdf(1 - FAMILY / (2 * tests))
