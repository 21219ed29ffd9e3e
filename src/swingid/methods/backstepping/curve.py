"""The online estimate as a curve: when it has converged, what it settles at, and how far that is uncertain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swingid.errors import UnanswerableError
from swingid.numerics.arrays import Array
from swingid.uncertainty.significance import INDICATED

FEWEST_SWINGS = 8
"""Fewest half swings of a log: four to converge in, four to average over."""

BANDS = {"5 %": 0.05, "1 %": 0.01}
"""Relative distances from the final value whose convergence times are reported."""

STILL = 0.9
"""Ratio of successive changes above which the final value of a curve cannot be extrapolated."""


@dataclass(frozen=True)
class Curve:
    """An estimate at the rows of a log, and the turning points of the motion: time (n,), values (n,), turning (k,)."""

    time: Array
    values: Array
    turning: Array

    def swings(self) -> Array:
        """Means over the half swings between successive turning points, (k − 1,)."""
        running = np.concatenate([[0.0], np.cumsum(np.diff(self.time) * (self.values[1:] + self.values[:-1]) / 2)])
        result: Array = np.diff(np.interp(self.turning, self.time, running)) / np.diff(self.turning)
        return result

    def periods(self) -> Array:
        """Means over every two successive half swings, (k − 2,): the ripple of the adaptation has their period."""
        swings, lengths = self.swings(), np.diff(self.turning)
        weighted = swings * lengths
        result: Array = (weighted[1:] + weighted[:-1]) / (lengths[1:] + lengths[:-1])
        return result

    def final(self) -> float:
        """Mean over the last quarter of all periods."""
        periods = self.periods()
        return float(periods[-max(1, len(periods) // 4) :].mean())

    def convergence_time(self, band: float, true_value: float | None = None) -> float | None:
        """Seconds from the first row until all later periods lie within `band` of the final or the true value.

        None where the last two periods do not.
        """
        periods, aim = self.periods(), self.final() if true_value is None else true_value
        outside = np.nonzero(np.abs(periods / aim - 1) > band)[0]
        if len(outside) == 0:
            return float(self.turning[0] - self.time[0])
        last = int(outside[-1])
        return None if last >= len(periods) - 2 else float(self.turning[last + 2] - self.time[0])


@dataclass(frozen=True)
class Settled:
    """The last part of a curve: half swings first … last (an even number), and their mean.

    scatter: type A standard uncertainty of the mean. drift: distance to the extrapolated final value, 0 where there is
    no significant change, None where it cannot be extrapolated. converged: whether it stays within 1 % for a quarter.
    """

    first: int
    last: int
    mean: float
    scatter: float
    drift: float | None
    converged: bool

    def span(self, turning: Array) -> tuple[float, float]:
        """Begin and end, s."""
        return float(turning[self.first]), float(turning[self.last])


def settled_part(curve: Curve) -> Settled:
    """Return the part from the middle of the log, or from where the curve keeps within 1 %; at least a quarter.

    Raises UnanswerableError for a log of too few swings.
    """
    swings = curve.swings()
    count = len(swings)
    if count < FEWEST_SWINGS:
        raise UnanswerableError(
            f"the log contains {count} half swings, but the adaptation needs at least {FEWEST_SWINGS}; record more.",
            code="too-short",
        )
    within = curve.convergence_time(BANDS["1 %"])
    first = count // 2
    if within is not None:
        first = max(first, int(np.searchsorted(curve.turning, curve.time[0] + within)))
    latest = count - max(4, count // 4)
    converged = within is not None and first <= latest
    first = min(first, latest)
    first += (count - first) % 2
    part = swings[first:]
    return Settled(first, count, mean_over(curve, first, count), scatter_of_mean(part), remaining(part), converged)


def mean_over(curve: Curve, first: int, last: int) -> float:
    """Mean from turning point `first` to turning point `last`."""
    lengths = np.diff(curve.turning)[first:last]
    return float(curve.swings()[first:last] @ lengths / lengths.sum())


def scatter_of_mean(values: Array) -> float:
    """Standard uncertainty of the mean of neighbours that are correlated as a first-order autoregression.

    The correlation of neighbours is corrected for the few values (Kendall 1954) and not taken as negative: that of
    upper and lower swings would be, and would lower the uncertainty. The values count as m independent
    ones, of whose standard deviation few are a poor estimate: s/√m · √((m − 1)/(m − 3)) (JCGM 101, 6.4.9.4).
    """
    count = len(values)
    off = values - values.mean()
    power = float(off @ off)
    if power == 0.0:
        return 0.0
    correlation = float(off[1:] @ off[:-1]) / power
    correlation = min(max(correlation + (1 + 3 * correlation) / count, 0.0), 1 - 2 / count)
    independent = count * (1 - correlation) / (1 + correlation)
    return float(np.sqrt(power / count / max(independent - 3, 1.0)))


def remaining(values: Array) -> float | None:
    """Distance of the mean of a part from its extrapolated final value; None where that cannot be determined.

    Three thirds m1, m2, m3 of a geometric approach, r = (m3 − m2)/(m2 − m1), end at m1 + (m2 − m1)/(1 − r) (Aitken).
    0 where m3 and m1 differ by no more than three standard uncertainties; |m3 − m1| where that is below 1 % and there
    is no such approach.
    """
    m1, m2, m3 = (float(third.mean()) for third in np.array_split(values, 3))
    places = np.arange(len(values)) - (len(values) - 1) / 2
    level = values - places * (places @ values) / (places @ places)
    if abs(m3 - m1) <= INDICATED * np.sqrt(6) * scatter_of_mean(level):
        return 0.0
    ratio = (m3 - m2) / (m2 - m1) if m2 != m1 else np.inf
    if 0.0 < ratio < STILL:
        return float(abs(m1 + (m2 - m1) / (1 - ratio) - values.mean()))
    return float(abs(m3 - m1)) if abs(m3 - m1) < BANDS["1 %"] * abs(m3) else None


@dataclass(frozen=True)
class Run:
    """One run of the adaptation over a log: J1^(t) and f1^ N(t), and the settled part of the first."""

    inertia: Curve
    viscous: Curve
    settled: Settled

    def estimates(self, first: int, last: int) -> Array:
        """Means of inertia and viscous friction over half swings first … last."""
        return np.array([mean_over(curve, first, last) for curve in (self.inertia, self.viscous)])
