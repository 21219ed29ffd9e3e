"""Cubic splines through samples at any instants, and local polynomial smoothing.

Own code because the common path of a command must not pay for importing ``scipy.interpolate``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from swingid.numerics.arrays import Array, Ints, stretches
from swingid.numerics.regression import product

EVEN = 1e-9
"""Deviations of stamps from even ones, in steps, that change no smoothed value: some roundings of the stamps."""

AT_ONCE = 1 << 18
"""Samples of windows that are in memory together."""

LEVELS = 6
"""Reductions after which the neighbours of a spline's slopes count for less than the rounding, see `_dominant`."""


def intervals(time: Array, at: Array) -> Ints:
    """The interval of rising `time` in which each of the rising instants `at` lies, the outermost beyond the ends."""
    if len(at) < len(time):
        return np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(time) - 2)
    before = np.searchsorted(at, time[1:-1])
    return np.repeat(np.arange(len(time) - 1), np.diff(before, prepend=0, append=len(at)))


def is_even(time: Array) -> bool:
    """Return whether stamps are even but for their rounding."""
    step = (time[-1] - time[0]) / max(len(time) - 1, 1)
    if abs(time[len(time) // 2] - time[0] - len(time) // 2 * step) > EVEN * step:
        return False
    off = np.arange(len(time)) * step
    off -= time
    return bool(off.max() - off.min() <= EVEN * step)


def spline_slopes(time: Array, values: Array) -> Array:
    """First derivatives at the knots of the natural cubic splines through `values` (..., n) at strictly rising `time`.

    From the continuity of the second derivative, by cyclic reduction, O(n). Needs at least two knots.
    """
    if len(time) == 2:
        return np.repeat(np.diff(values) / np.diff(time), 2, axis=-1)
    if is_even(time):
        step = (time[-1] - time[0]) / (len(time) - 1)
        known = np.empty(values.shape)
        known[..., 1:-1] = values[..., 2:] - values[..., :-2]
        known[..., 0] = 2.0 * (values[..., 1] - values[..., 0])
        known[..., -1] = 2.0 * (values[..., -1] - values[..., -2])
        known *= 0.75 / step
        return _dominant_even(known, 0.25, 0.5, 0.5, LEVELS)
    if values.ndim > 1:
        return np.stack([spline_slopes(time, row) for row in values])
    steps = np.diff(time)
    secants = np.diff(values) / steps
    before, after, right = np.empty(len(time)), np.empty(len(time)), np.empty(len(time))
    before[1:-1] = 0.5 * steps[1:] / (steps[:-1] + steps[1:])
    after[1:-1] = 0.5 - before[1:-1]
    before[0], before[-1], after[0], after[-1] = 0.0, 0.5, 0.5, 0.0
    right[1:-1] = 3.0 * (before[1:-1] * secants[:-1] + after[1:-1] * secants[1:])
    right[0], right[-1] = 1.5 * secants[0], 1.5 * secants[-1]
    return _dominant(before, after, right, LEVELS)


def _dominant_even(known: Array, beside: float, first: float, last: float, levels: int) -> Array:
    """Solve as `_dominant` for known sides (..., n) with one number beside the diagonal, others in the first and last
    row.
    """
    count = known.shape[-1]
    if levels == 0 or count == 1:
        return known
    if count % 2 == 0:  # the last unknown has an odd place: it is eliminated before the others
        rest = 1.0 - beside * last if count > 2 else 1.0 - first * last
        near = beside if count > 2 else first
        shorter = known[..., :-1].copy()
        shorter[..., -1] = (shorter[..., -1] - near * known[..., -1]) / rest
        solution = _dominant_even(shorter, beside, first, beside / rest, levels)
        return np.concatenate([solution, known[..., -1:] - last * solution[..., -1:]], axis=-1)
    odd, reduced = known[..., 1::2], known[..., ::2].copy()
    part = beside * odd
    reduced[..., 1:] -= part
    reduced[..., :-1] -= part
    reduced[..., 0] += (beside - first) * odd[..., 0]
    reduced[..., -1] += (beside - last) * odd[..., -1]
    rest, square = 1.0 - 2.0 * beside**2, -(beside**2)
    ends = 1.0 - first * beside, 1.0 - last * beside
    reduced[..., 1:-1] *= 1.0 / rest
    reduced[..., 0] /= ends[0]
    reduced[..., -1] /= ends[1]
    solution = _dominant_even(reduced, square / rest, -first * beside / ends[0], -last * beside / ends[1], levels - 1)
    result = np.empty(known.shape)
    result[..., ::2] = solution
    result[..., 1::2] = odd - beside * (solution[..., :-1] + solution[..., 1:])
    return result


def _dominant(before: Array, after: Array, known: Array, levels: int) -> Array:
    """Solution x of before_k x_(k−1) + x_k + after_k x_(k+1) = known_k, where |before_k| + |after_k| ≤ 1/2.

    Cyclic reduction: the odd unknowns are eliminated, which squares the influence of the neighbours.
    """
    if levels == 0 or len(known) < 3:
        if levels and len(known) == 2:
            first = (known[0] - after[0] * known[1]) / (1.0 - after[0] * before[1])
            return np.array([first, known[1] - before[1] * first])
        return known
    if len(known) % 2 == 0:  # the last unknown has an odd place: it is followed by one that is 0
        before, after, known = (np.append(x, 0.0) for x in (before, after, known))
        return _dominant(before, after, known, levels)[:-1]
    a, c, d = (np.ascontiguousarray(x[1::2]) for x in (before, after, known))
    reduced, lower, upper = known[::2].copy(), -before[::2], -after[::2]
    reduced[1:] += lower[1:] * d
    reduced[:-1] += upper[:-1] * d
    diagonal = np.ones(len(reduced))
    diagonal[1:] += lower[1:] * c
    diagonal[:-1] += upper[:-1] * a
    lower[1:] *= a
    upper[:-1] *= c
    solution = _dominant(lower / diagonal, upper / diagonal, reduced / diagonal, levels - 1)
    result = np.empty(len(known))
    result[::2] = solution
    result[1::2] = d - a * solution[:-1] - c * solution[1:]
    return result


def _solved(gram: list[list[Array]], right: list[Array]) -> list[Array]:
    """Solutions of many small positive definite systems by Cholesky; gram: lower triangle, each entry of all systems.

    For loops over places a call of LAPACK for each would cost more.
    """
    n, right = len(right), [side.copy() for side in right]
    for a in range(n):
        for c in range(a + 1):
            total = gram[a][c] - sum(gram[a][j] * gram[c][j] for j in range(c))
            gram[a][c] = np.sqrt(np.maximum(total, 1e-300)) if a == c else total / gram[c][c]
        right[a] = (right[a] - sum(gram[a][j] * right[j] for j in range(a))) / gram[a][a]
    for a in range(n - 1, -1, -1):
        right[a] = (right[a] - sum(gram[j][a] * right[j] for j in range(a + 1, n))) / gram[a][a]
    return right


def local_cubic(time: Array, values: Array, at: Array, half_width: float) -> Array:
    """Value and first derivative at each instant of `at`, from a cubic fitted to the samples within `half_width`.

    Returns shape (len(at), 2); NaN where fewer than five samples lie in reach. The samples may be irregular;
    near an end of the log the window is one-sided. (Savitzky and Golay 1964 for regular samples.)
    """
    return Samples(time, values).cubics(at, half_width)


@dataclass(frozen=True)
class Samples:
    """Samples at rising stamps `time`, to be smoothed more than once."""

    time: Array
    values: Array

    @cached_property
    def even(self) -> bool:
        """Return whether the stamps are even but for their rounding."""
        return is_even(self.time)

    def cubics(self, at: Array, half_width: float) -> Array:
        """See `local_cubic`."""
        time, values = self.time, self.values
        first = np.searchsorted(time, at - half_width)
        count = np.searchsorted(time, at + half_width, side="right") - first
        enough = np.flatnonzero(count >= 5)
        if self.even and len(enough) == len(at):
            return self._shared_cubics(at, first, count)
        result = np.full((len(at), 2), np.nan)
        if self.even:
            result[enough] = self._shared_cubics(at[enough], first[enough], count[enough])
        elif len(enough):
            for places in _portions(enough, int(count.max())):
                result[places] = _own_cubics(time, values, at[places], half_width, first[places], count[places])
        return result

    def _shared_cubics(self, at: Array, first: Ints, count: Ints) -> Array:
        """Fit as `cubics` for even stamps and windows of `count` samples from `first` on: weights common to equal
        ones.
        """
        coefficients = np.empty((4, len(at)))
        for length in np.flatnonzero(np.bincount(count)).tolist():
            for places in _portions(np.flatnonzero(count == length), length):
                coefficients[:, places] = product(
                    _cubic_weights(length), stretches(self.values, length)[first[places]].T
                )
        c0, c1, c2, c3 = coefficients
        begin = self.time[first]
        unit = (self.time[first + (count - 1)] - begin) / 2
        s = (at - begin) / unit - 1.0
        result = np.empty((len(at), 2))
        result[:, 0] = c0 + s * (c1 + s * (c2 + s * c3))
        result[:, 1] = (c1 + s * (2.0 * c2 + s * (3.0 * c3))) / unit
        return result


def _portions(places: Ints, width: int) -> list[Ints]:
    """The places in portions of windows of `width` samples that are in memory together."""
    size = max(AT_ONCE // width, 1)
    return [places[k : k + size] for k in range(0, len(places), size)]


@lru_cache(maxsize=1024)
def _cubic_weights(count: int) -> Array:
    """Weights (4, count) of even samples in the coefficients of the cubic through them, places from −1 to 1."""
    powers = np.linspace(-1.0, 1.0, count)[:, None] ** np.arange(4)
    return np.asarray(np.linalg.solve(powers.T @ powers, powers.T), dtype=np.float64)


def _within(
    time: Array, values: Array, at: Array, half_width: float, first: Ints, count: Ints
) -> tuple[Array, Array, Array]:
    """Places s from −1 to 1 and values of the samples of each window (windows, samples), and 1, or 0 behind its end."""
    behind = np.arange(int(count.max()))
    inside = (behind < count[:, None]).astype(np.float64)
    rows = np.minimum(first[:, None] + behind, len(time) - 1)
    return (time[rows] - at[:, None]) / half_width * inside, values[rows] * inside, inside


def _own_cubics(time: Array, values: Array, at: Array, half_width: float, first: Ints, count: Ints) -> Array:
    """Fit as `local_cubic`, one fit for each window, of `count` samples from `first` on."""
    s, x, _ = _within(time, values, at, half_width, first, count)
    square = s * s
    third = square * s
    dot = "ij,ij->i"
    powers = [
        count.astype(np.float64),
        s.sum(axis=1),
        square.sum(axis=1),
        third.sum(axis=1),
        np.einsum(dot, square, square),
        np.einsum(dot, square, third),
        np.einsum(dot, third, third),
    ]
    right = [x.sum(axis=1), np.einsum(dot, s, x), np.einsum(dot, square, x), np.einsum(dot, third, x)]
    value, slope, _, _ = _solved([[powers[a + c] for c in range(a + 1)] for a in range(4)], right)
    return np.column_stack([value, slope / half_width])


def kinked_slopes(time: Array, values: Array, at: Array, half_width: float) -> Array:
    """Slope at each instant of `at` of a cubic whose curvature may jump there, fitted within `half_width`.

    Returns shape (len(at),); NaN where one side holds fewer than three samples or a quarter of those in reach, for a
    jump shows on both sides only. Four times as noisy as `local_cubic`.
    """
    result = np.full(len(at), np.nan)
    first = np.searchsorted(time, at - half_width, side="left")
    count = np.searchsorted(time, at + half_width, side="right") - first
    before = np.searchsorted(time, at, side="left") - first
    places = np.flatnonzero(4 * np.minimum(before, count - before) >= np.maximum(12, count))
    if len(places):
        for portion in _portions(places, int(count[places].max())):
            result[portion] = _kinked(time, values, at[portion], half_width, first[portion], count[portion])
    return result


def _kinked(time: Array, values: Array, at: Array, half_width: float, first: Ints, count: Ints) -> Array:
    s, x, inside = _within(time, values, at, half_width, first, count)
    x -= values[(2 * first + count) // 2, None] * inside
    square = s * s
    terms = [inside, s, square, square * s, s * np.abs(s)]
    gram = [[np.einsum("ij,ij->i", terms[a], terms[c]) for c in range(a + 1)] for a in range(5)]
    slope: Array = _solved(gram, [np.einsum("ij,ij->i", term, x) for term in terms])[1] / half_width
    return slope


def spline_at(time: Array, values: Array, slopes: Array, at: Array, derivative: int) -> Array:
    """Cubic Hermite interpolant of `values` and `slopes` (or its first derivative) at rising instants `at`."""
    k = intervals(time, at)
    few = len(at) < len(time)  # then coefficients for their intervals only
    begin, end = (k, k + 1) if few else (slice(None, -1), slice(1, None))
    h, rise, slope = time[end] - time[begin], values[end] - values[begin], slopes[begin]
    # value + t (slope + t (c2 + t c3)), t from the begin of the interval on
    c2 = (3 * rise / h - 2 * slope - slopes[end]) / h
    c3 = (slope + slopes[end] - 2 * rise / h) / (h * h)
    if derivative:
        c3, c2, slope, value = 0.0 * c3, 3 * c3, 2 * c2, slope
    else:
        value = values[begin]
    if not few:
        c3, c2, slope, value = c3[k], c2[k], slope[k], value[k]
    t = at - time[k]
    result = t * c3 if not derivative else np.zeros(len(at))
    for coefficient in (c2, slope):
        result += coefficient
        result *= t
    result += value
    return result
