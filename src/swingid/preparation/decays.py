"""The free decays of a log: runs of swings that shrink, but for the noise of their sizes; releases and hands beside.

Sizes are compared on a scale whose unit is what noise and scatter explain, asinh(r s/n)/r: n (rad or m) by the noise of
the angle, r by the relative scatter that the sizes show. Spikes of up to two swings, as a wrong turning angle makes
them, are no growth: the envelope is the running median of five swings.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from swingid.numerics.arrays import Array, Bools, Ints, median
from swingid.numerics.reversals import reversals

if TYPE_CHECKING:
    from swingid.preparation.motion import Motion

FEWEST_TURNS = 4

REACH = 2
"""Swings on each side of one whose median is the envelope."""

SIGMAS = 4.0
"""Standard deviations of a size in the unit: the envelope of 600 swings of constant amplitude ranges over 3.1."""

FLOOR, CAP = 0.002, 0.05
"""Least and largest relative unit: less growth is no push in any log; more scatter, from 1.3 % on, a hand makes too."""

FALL = 4.0
"""Units by which a decay falls at least. Random amplitudes of 1 % about a constant one do so in none of 800 logs."""

PLATEAU = 3.0
"""Times as many swings within one unit of the largest as in the next unit below make them those of a drive: a free body
loses most where it swings most, but for dry friction, which loses the same."""

LATE = 2.2
"""Times of the usual one after which a turning point is not the next: of swings lost in the noise it takes three."""

RELEASES = 2
"""Growing swings of a log in which a body is lifted and let go; more are jitter of the angle, or a hand that drives."""

CHANCE = 0.05
"""Expected number of runs as long as the one taken, where swings grow and shrink at random. Of random amplitudes that
a hand may drive, with a scatter of 1 to 30 % in 30 or 120 swings, an answer get 0 to 2 % where each swing is another or
they are correlated over 4 swings, up to a fifth where they vary smoothly over 16; of 60 real free decays none is
refused."""

SHAPED, ROUGH, LIFTS = 10, 0.02, 3.0
"""Swings at least whose sizes have a shape, their scatter about it as a share of the fall, and how many times longer
they last than the growth between them: a body is lifted at once, a hand drives about as long as it does not."""

LONGEST = 8
"""Swings of a push that count at most: beyond, hardly more random amplitudes are refused, and a decay of 50 swings
before someone makes the body swing again would be."""


@dataclass(frozen=True)
class Decay:
    """A run of shrinking swings, by its first and last swing; free: whether no hand makes it, as one does at random."""

    first: int
    last: int
    free: bool


@dataclass(frozen=True)
class _Swings:
    """Sizes of swings (rad or m), and on the scale of their scatter: single ones and their envelope.

    grows: the steps to the next swing that are growth; kicks: those of them after which the swings stay larger. calm:
    whether the sizes scatter by no more than `FLOOR` allows for.
    """

    sizes: Array
    single: Array
    envelope: Array
    grows: Bools
    kicks: Ints
    calm: bool

    @property
    def last(self) -> int:
        return len(self.sizes) - 1


def decays(motion: Motion) -> list[Decay]:
    """The runs of at least three shrinking swings, in the order of time."""
    sizes = motion.swing_sizes
    if len(sizes) < FEWEST_TURNS - 1:
        return []
    swings = _swings(sizes, np.sqrt(2) * motion.speed.angle_noise)
    falls = _falls(swings)
    runs = [_trimmed(swings, *piece) for fall in falls for piece in _pieces(swings, *fall)]
    runs = [(first, _regular(motion.turning_times, first, last)) for first, last in runs]
    # in the last swing before others a hand takes the body
    runs = [(first, last if last == swings.last else last - 1) for first, last in runs]
    runs = [(first, last) for first, last in runs if _shrinks(swings, first, last)]
    if not runs and swings.calm and not swings.grows.any():  # too little friction to be seen; no hand is as regular
        return [Decay(0, swings.last, free=True)]
    return [Decay(first, last, _is_free(swings, first, last)) for first, last in runs]


def _swings(sizes: Array, noise: float) -> _Swings:
    """noise: standard deviation of a size by that of the angle (rad or m)."""
    envelope = sizes.copy()
    for width in (REACH + 1, 2 * REACH + 1):
        if len(sizes) >= width:
            windows = np.lib.stride_tricks.sliding_window_view(sizes, width)
            envelope[width // 2 : len(sizes) - width // 2] = np.median(windows, axis=1)
    relative = min(max(SIGMAS * _scatter(sizes), FLOOR), CAP)
    least = max(SIGMAS * noise, 1e-12 * float(sizes.max()))
    single, smooth = (np.arcsinh(relative * values / least) / relative for values in (sizes, envelope))
    grows = np.diff(single) > 1
    kicks = np.flatnonzero(grows)
    if relative > FLOOR:
        kicks = kicks[_stays(smooth, kicks)]
    return _Swings(sizes, single, smooth, grows, kicks, relative <= FLOOR)


def _scatter(sizes: Array) -> float:
    """Relative standard deviation of the sizes about a smooth course, from their second differences (robust)."""
    if len(sizes) < 2 * REACH + 1:
        return 0.0
    second = np.abs(sizes[2:] - 2 * sizes[1:-1] + sizes[:-2])
    return float(median(second / np.maximum(sizes[1:-1], 1e-300)) / (0.6745 * np.sqrt(6)))


def _stays(envelope: Array, kicks: Ints) -> Bools:
    """Return whether the envelope after each growth is a unit above its course before, of two disjoint medians."""
    before, step = np.maximum(kicks - REACH, 0), 2 * REACH + 1
    after = np.minimum(kicks + REACH + 1, len(envelope) - 1)
    loss = np.where(before >= step, envelope[before] - envelope[np.maximum(before - step, 0)], 0.0)
    stays: Bools = envelope[after] - envelope[before] - loss > 1
    return stays


def _falls(swings: _Swings) -> list[tuple[int, int]]:
    """First and last swing of the falls of the envelope; the steps of its rises are added to those that grow."""
    edges = sorted({0, swings.last, *(int(k) for k in reversals(swings.envelope, 1.0))})
    falls = []
    for first, last in pairwise(edges):
        change = swings.envelope[last] - swings.envelope[first]
        if change > 1:
            swings.grows[first:last] = True
        elif change < 0:
            falls.append((first, last))
    return falls


def _pieces(swings: _Swings, first: int, last: int) -> list[tuple[int, int]]:
    """A fall with the swings that the medians hide at its ends, divided at kicks; from its largest to its smallest."""
    first, last = max(first - REACH, 0), min(last + REACH, swings.last)
    ends = [first - 1, *(int(k) for k in swings.kicks if first <= k < last), last]
    pieces, width = [], 2 * REACH + 1
    for begin, end in ((before + 1, after) for before, after in pairwise(ends)):
        begin += int(np.argmax(swings.sizes[begin : min(begin + width, end + 1)]))
        tail = swings.sizes[max(end - width + 1, begin) : end + 1]
        pieces.append((begin, end - int(np.argmin(tail[::-1]))))
    return pieces


def _trimmed(swings: _Swings, first: int, last: int) -> tuple[int, int]:
    """Without the constant amplitude before a decay, which something drives."""
    envelope = swings.envelope[first : last + 1]
    top, below = (int(np.flatnonzero(envelope >= envelope.max() - units)[-1]) for units in (1, 2))
    driven = top > PLATEAU * (below - top) + 2 * REACH + 1
    return (first + top if driven else first), last


def _regular(times: Array, first: int, last: int) -> int:
    """The last swing before one in whose time several are lost; the time of a swing changes slowly."""
    steps = np.diff(times)[first : last + 1]
    late = np.flatnonzero(steps[3:] > LATE * np.maximum(np.maximum(steps[:-3], steps[1:-2]), steps[2:-1]))
    return last if len(late) == 0 else first + 2 + int(late[0])


def _shrinks(swings: _Swings, first: int, last: int) -> bool:
    """Return whether a run has enough swings, and falls by more than scatter does."""
    return last - first + 2 >= FEWEST_TURNS and bool(swings.single[first] - swings.single[last] > FALL)


def _is_free(swings: _Swings, first: int, last: int) -> bool:
    """Return whether a run of shrinking swings is not one of those that a hand makes, which drives the body now and
    then.

    Swings that grow and shrink at random hold a run of n shrinking ones after one in 2ⁿ pushes; where a push lasts
    several swings, that many count as one. A run is also free where the loss of its swings is a smooth course, and the
    last one where it decays to half of what was before.
    """
    grow = int(np.count_nonzero(swings.grows))
    if grow <= RELEASES:
        return True
    pushes = int(np.count_nonzero(np.diff(np.concatenate([[False], swings.grows]).astype(np.int8)) > 0))
    if (last - first) / min(grow / pushes, LONGEST) >= np.log2((pushes + 1) / CHANCE):
        return True
    if last - first + 1 >= max(SHAPED, LIFTS * grow / pushes) and _is_smooth(swings.sizes[first : last + 1]):
        return True
    # in the median of five, for the smallest of some random ones may be half of them
    end = float(np.median(swings.sizes[max(last - 2 * REACH, 0) : last + 1]))
    return bool(last >= swings.last - REACH - 1 and end < 0.5 * np.median(swings.sizes[: first + 1]))


def _is_smooth(sizes: Array) -> bool:
    """Return whether sizes scatter by less than a share of their fall about a parabola, as friction makes it."""
    places = np.linspace(-1.0, 1.0, len(sizes))
    residuals = sizes - np.polynomial.Polynomial.fit(places, sizes, 2)(places)
    return float(np.sqrt(residuals @ residuals / (len(sizes) - 3))) < ROUGH * float(sizes[0] - sizes[-1])
