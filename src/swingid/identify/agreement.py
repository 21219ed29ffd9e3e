"""Do different windows agree? What the scatter of the rows cannot show, other windows can.

A friction that the basis does not describe biases windows of different length and place differently. Where such
estimates of one inertia differ by more than their uncertainties explain, the difference is an uncertainty of its own.
"""

from __future__ import annotations

import numpy as np

from swingid.identify.windows import WindowFit

SEEN = 3.0
"""Standard deviations of a difference beyond which it counts."""

COMPARABLE = 3.0
"""An estimate that is less certain than the chosen one by more than this factor cannot judge it."""


def drift_with_length(chosen: WindowFit, tried: dict[float, WindowFit]) -> float:
    """Uncertainty of a11 from its drift with the length of the windows, within a factor of four of the chosen one."""
    near = [fit for half, fit in tried.items() if 0.24 < half / chosen.half < 4.2 and fit is not chosen]
    return max((unexplained(chosen, fit, nested=True) for fit in near), default=0.0)


def unexplained(chosen: WindowFit, other: WindowFit, *, nested: bool) -> float:
    """Part of the difference of two estimates that their uncertainties do not explain, 0 where they do.

    nested: both use the same samples and the chosen one is the more efficient, so the variance of the difference
    is the difference of the variances (Hausman 1978).
    """
    if other.u > COMPARABLE * chosen.u:
        return 0.0
    variance = abs(other.u**2 - chosen.u**2) if nested else other.u**2 + chosen.u**2
    difference = other.a11 - chosen.a11
    if abs(difference) <= SEEN * np.sqrt(variance):
        return 0.0
    return float(np.sqrt(difference**2 - variance))
