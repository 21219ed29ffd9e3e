"""How columns move, and move with each other: slopes, correlations, smoothness."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from swingid.numerics.arrays import Array


MOST = 20_000
"""Rows that the comparison of columns looks at."""

GAINS = (1.0, 180 / np.pi, np.pi / 180, 30 / np.pi, 2 * np.pi, 0.5 / np.pi)
"""Speed per slope of its angle: equal units, degrees and radians, revolutions per minute, turns."""


def thin(values: Array) -> Array:
    """A stretch from the middle of the log, NaN filled, for comparisons."""
    if len(values) > MOST:
        begin = (len(values) - MOST) // 2
        values = values[begin : begin + MOST]
    bad = ~np.isfinite(values)
    if bad.any() and not bad.all():
        values = values.copy()
        values[bad] = np.interp(np.flatnonzero(bad), np.flatnonzero(~bad), values[~bad])
    return values


def smooth(values: Array) -> Array:
    """Moving average over five rows."""
    return np.convolve(values, np.full(5, 0.2), "same")


def slope(values: Array, stamps: Array) -> Array:
    """Speed of a column over some rows on each side, without the jumps of a wrapped angle."""
    reach = 3
    slope = np.zeros(len(values))
    steps = stamps[2 * reach :] - stamps[: -2 * reach]
    rise = values[2 * reach :] - values[: -2 * reach]
    with np.errstate(divide="ignore", invalid="ignore"):
        slope[reach:-reach] = np.where(steps > 0, rise / steps, 0.0)
    limit = 6 * np.quantile(np.abs(slope), 0.9)
    return np.where(np.abs(slope) <= limit, slope, 0.0)


def correlation(one: Array, other: Array) -> float:
    """Pearson's correlation, 0 where one of the two does not vary."""
    one, other = one - one.mean(), other - other.mean()
    size = float(np.sqrt((one @ one) * (other @ other)))
    return float(one @ other) / size if size > 0 and np.isfinite(size) else 0.0


def roughness(values: Array) -> float:
    """How much a column moves from row to row against its range: small for a position, large for a command."""
    part = thin(values)
    span = float(np.ptp(part))
    return float(np.sqrt(np.mean(np.diff(part, 2) ** 2))) / span if span > 0 and len(part) > 2 else np.inf


def has_size(speed: Array, slope: Array) -> bool:
    """Whether a speed is its angle's slope in one of the usual units."""
    gain = float(np.sqrt((speed @ speed) / max(float(slope @ slope), 1e-300)))
    return min(abs(gain / usual - 1) for usual in GAINS) < 0.05


def passes(values: Array, low: float, high: float) -> int:
    """How often the values go from below `low` to above `high` or back; 0 where the two are close (less than 4)."""
    side = np.where(values >= high, 1, np.where(values <= low, -1, 0))
    return int(np.count_nonzero(np.diff(side[side != 0]))) if high - low > 4 else 0
