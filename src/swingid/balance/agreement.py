"""Do different windows agree? What the scatter of the rows cannot show, other windows can.

A friction that the basis does not describe biases windows of different length and place differently. Where such
estimates of one inertia differ by more than their uncertainties explain, the difference is an uncertainty of its own:
dark uncertainty.
"""

from __future__ import annotations

from swingid.balance.choice import Choice
from swingid.balance.fits import WindowFit
from swingid.balance.systematics import variance_of_difference
from swingid.preparation.noise import Noise
from swingid.preparation.scale import Scale
from swingid.uncertainty.dark import dark_uncertainty

COMPARABLE = 2.0
"""Windows of another length that are less certain by more than this factor fail for reasons of their own."""


JUDGE = 0.1
"""A kind of windows whose own uncertainty is more than this share of the inertia contradicts nothing."""


def drift_with_length(choice: Choice, scale: Scale, noise: Noise) -> float:
    """Uncertainty of a11 from its drift with the length of the windows: from half to four times the chosen one.

    All lengths use the same samples, so the variance of a difference is the difference of the variances (Hausman 1978),
    or what white noise of the samples gives it, whichever is more.
    """
    chosen, signals = choice.law, choice.signals
    worst = 0.0
    for half, fit in choice.tried.items():
        if fit is chosen or not 0.49 < half / chosen.half < 4.2 or fit.total > COMPARABLE * chosen.total:
            continue
        variance = abs(fit.u**2 - chosen.u**2)
        if _unexplained(chosen, fit, variance) > worst:  # more variance explains no less, and takes a while to compute
            variance = max(variance, variance_of_difference(signals, chosen, fit, scale, noise))
            worst = max(worst, _unexplained(chosen, fit, variance))
    return worst


def disagreement(chosen: WindowFit, other: WindowFit | None) -> float:
    """Uncertainty of a11 from what a kind of windows differs by from the chosen one beyond both uncertainties."""
    if other is None or other.total > JUDGE * abs(chosen.a11):
        return 0.0
    return _unexplained(chosen, other, other.u**2 + chosen.u**2)


def _unexplained(chosen: WindowFit, other: WindowFit, variance: float) -> float:
    """Dark uncertainty of two estimates whose difference has this variance by their type A.

    A declared imperfection is the same in both, so it explains as much as its two effects differ.
    """
    pairs = zip(chosen.declared, other.declared, strict=True)
    variance += sum(float(mine.shifts[0] - theirs.shifts[0]) ** 2 for mine, theirs in pairs)
    return dark_uncertainty(other.a11 - chosen.a11, variance, chosen.u)
