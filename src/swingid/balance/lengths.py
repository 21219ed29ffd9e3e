"""The search for the length of the windows: octaves downwards while the uncertainty falls, then beside the best."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import TypeVar

import numpy as np

from swingid.balance.fits import WindowFit

WORSE = 2.5
"""Ratio of relative uncertainties from which on shorter windows are not tried.

White noise multiplies it by 2.8 per octave. Of 100 searches on foreign logs (benchmarks/strangers.py) that ended so,
none had a better length among the shorter ones.
"""


Known = TypeVar("Known")


def each(known: Mapping[float, Known], fitted: Callable[[Known], WindowFit | None]) -> dict[float, WindowFit]:
    """The fits by half-length that are made of what is known at each, without those of too few rows (None)."""
    fits = {half: fitted(known[half]) for half in known}
    return {half: fit for half, fit in fits.items() if fit is not None}


def longest_of_best(
    fits: Iterable[WindowFit], measure: Callable[[WindowFit], float], factor: float
) -> WindowFit | None:
    """The fit on the longest windows of those whose measure is the least within this factor; None if none is finite."""
    measured = [(fit, size) for fit in fits if np.isfinite(size := measure(fit))]
    least = min((size for _, size in measured), default=0.0)
    return max((fit for fit, size in measured if size <= factor * least), key=lambda fit: fit.half, default=None)


def search(fit_at: Callable[[float], WindowFit | None], longest: float, shortest: float) -> dict[float, WindowFit]:
    """Fits by half-length (s) from `longest` down to above `shortest`, in the order in which they were tried.

    fit_at: from a half-length to its fit, None where there are too few rows. Empty where no length gives a fit.
    """
    tried: dict[float, WindowFit] = {}

    def attempt(half: float) -> None:
        fit = fit_at(half)
        if fit is not None and np.isfinite(fit.u):
            tried[half] = fit

    def relative(half: float) -> float:
        return tried[half].relative(tried[half].u)

    half = longest
    while half > shortest:
        attempt(half)
        if half in tried and relative(half) > WORSE * min(map(relative, tried)):
            break
        half /= 2
    if tried:
        best = min(tried, key=relative)
        for neighbour in (best / np.sqrt(2), best * np.sqrt(2)):
            if shortest < neighbour < longest:
                attempt(neighbour)
    return tried
