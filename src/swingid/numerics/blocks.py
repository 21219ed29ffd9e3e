"""Gauss nodes of blocks of samples: a log for slow modulating (test) functions, in fewer numbers than it has rows.

Within a block a signal is replaced by its projection on parabolas (least squares over the block), given at three Gauss
nodes. The integral with any function that is a parabola in each block is kept exactly, and with a smooth function the
error is the product of what parabolas leave of both, of sixth order in the length of the blocks
(of fifth with a window that ends within a block).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np

from swingid.numerics.arrays import Array, Ints
from swingid.numerics.quadrature import GaussNodes, gauss_rule
from swingid.numerics.regression import product
from swingid.numerics.spline import is_even, spline_slopes

POINTS = 3
"""Nodes of a block: a parabola has three coefficients."""


def block_edges(stamps: Array, longest: float) -> Ints:
    """Rows at which blocks end, the first row with them: as many rows together as `longest` (s) holds, at least one."""
    last = len(stamps) - 1
    rows = max(int(np.searchsorted(stamps, stamps[0] + longest, side="right")) - 1, 1)
    # of even stamps all blocks are as long as the first; the difference of the stamps counts, as it is rounded
    edges = np.append(np.arange(0, last, rows), last)
    begin, end = stamps[edges[:-1]], stamps[edges[1:]]
    further = stamps[np.minimum(edges[:-1] + rows + 1, last)]
    full = edges[:-1] + rows < last
    if np.all((end - begin <= longest) | (rows == 1)) and np.all((further - begin > longest) | ~full):
        return edges
    reached = np.searchsorted(stamps, stamps + longest, side="right") - 1
    reached -= stamps[reached] - stamps > longest
    beyond = np.minimum(reached + 1, last)
    reached = np.where(stamps[beyond] - stamps <= longest, beyond, reached)
    after = np.maximum(reached, np.minimum(np.arange(1, last + 2), last)).tolist()
    ends = [0]
    while ends[-1] < last:
        ends.append(after[ends[-1]])
    return np.array(ends, np.int64)


Ends = tuple[Array, Array]
"""A quantity at the begin and at the end of each interval."""


@dataclass(frozen=True)
class Shares:
    """Intervals between stamps as parts of their blocks: first rows of the blocks, and what the moments need of each.

    size: share of the block; middle: place of its middle, from −1 to 1; bent: Legendre polynomial of order 2, its mean.
    """

    first: Ints
    step: Array
    size: Array
    middle: Array
    bent: Array

    @classmethod
    def of(cls, stamps: Array, edges: Ints) -> Shares:
        """Shares of the intervals in the blocks between these rows."""
        first, rows = edges[:-1], np.diff(edges)
        begin, length = np.repeat(stamps[first], rows), np.repeat(np.diff(stamps[edges]), rows)
        step = np.diff(stamps)
        size = step / length
        middle = (stamps[:-1] + stamps[1:] - 2.0 * begin) / length - 1.0
        return cls(first, step, size, middle, 1.5 * (middle * middle + size * size / 3.0) - 0.5)

    def sums(self, values: Array) -> Array:
        """Sums over each block."""
        result: Array = np.add.reduceat(values, self.first, axis=-1)
        return result

    def held(self, signals: Array) -> tuple[Array, Array, Array]:
        """Moments of signals (..., n−1) that are constant over each interval, with the Legendre polynomials."""
        part = signals * self.size
        return self.sums(part), self.sums(part * self.middle), self.sums(part * self.bent)

    def lines(self, middles: Array, rises: Array) -> tuple[Array, Array, Array]:
        """The same of lines with these values in the middle that change by `rises` over the interval."""
        m0, m1, m2 = self.held(middles)
        tilt = rises * self.size * self.size / 6.0
        return m0, m1 + self.sums(tilt), m2 + self.sums(3.0 * tilt * self.middle)

    def cubics(self, values: Array, slopes: Array, derivative: int) -> tuple[Array, Array, Array]:
        """The same of the cubics with these values and slopes (..., n) at the stamps, or of their first derivative."""
        ends = (values[..., :-1], values[..., 1:]), (slopes[..., :-1], slopes[..., 1:])
        m0, m1, m2 = self.each_cubic(*ends, derivative)
        return self.sums(m0), self.sums(m1), self.sums(m2)

    def each_cubic(self, values: Ends, slopes: Ends, derivative: int) -> tuple[Array, Array, Array]:
        """What the cubic of each interval adds to these moments; values and slopes at its begin and its end."""
        # moments of each cubic with 1, z and z² − 1/3 over its interval, z from −1 to 1
        rise = values[1] - values[0]
        bend, sag = slopes[1] + slopes[0], slopes[1] - slopes[0]
        if derivative == 0:
            mean = 0.5 * (values[1] + values[0]) - self.step * sag / 12.0
            first = 0.2 * rise - self.step * bend / 60.0
            second = self.step * sag / 90.0
        else:
            mean = rise / self.step
            first = sag / 6.0
            second = (bend - 2.0 * mean) / 15.0
        mean, first, second = self.size * mean, self.size * self.size * first, self.size**3 * second
        return mean, self.middle * mean + first, self.bent * mean + 3.0 * self.middle * first + 1.5 * second


def _parabolas(m0: Array, m1: Array, m2: Array) -> Array:
    """Values at the nodes of the parabolas with these moments with Legendre polynomials, one more dimension."""
    z = 2.0 * gauss_rule(POINTS)[0] - 1.0
    values: Array = m0[..., None] + m1[..., None] * (3.0 * z) + m2[..., None] * (2.5 * (3.0 * z * z - 1.0))
    return values


@lru_cache(maxsize=64)
def _of_held(rows: int) -> Array:
    """Values at the nodes of a block of even intervals for a signal of 1 in one of them, (intervals, points)."""
    block = Shares.of(np.arange(rows + 1.0) / float(rows), np.array([0, rows]))
    return _parabolas(block.size, block.size * block.middle, block.size * block.bent)


@lru_cache(maxsize=64)
def _of_cubics(rows: int, step: float, derivative: int) -> tuple[Array, Array]:
    """The same for cubics with a value of 1, and with a slope of 1, at one stamp, (stamps, points)."""
    block, ones, zeros = Shares.of(np.arange(rows + 1.0) * step, np.array([0, rows])), np.ones(rows), np.zeros(rows)
    weights = np.zeros((2, rows + 1, POINTS))
    for end, stamps in (((ones, zeros), slice(None, -1)), ((zeros, ones), slice(1, None))):
        weights[0, stamps] += _parabolas(*block.each_cubic(end, (zeros, zeros), derivative))
        weights[1, stamps] += _parabolas(*block.each_cubic((zeros, zeros), end, derivative))
    return weights[0], weights[1]


@dataclass(frozen=True)
class BlockNodes(GaussNodes):
    """Gauss nodes of blocks; `time` holds the edges of the blocks, `stamps` all rows, `rows` the rows of the edges."""

    points: int = POINTS
    stamps: Array = field(default_factory=lambda: np.empty(0))
    rows: Ints = field(default_factory=lambda: np.empty(0, np.int64))

    @classmethod
    def of(cls, stamps: Array, longest: float) -> BlockNodes:
        """Blocks of rows no longer than `longest` (s), or of one interval; stamps strictly rising, in s."""
        rows = block_edges(stamps, longest)
        return cls(time=stamps[rows], stamps=stamps, rows=rows)

    @cached_property
    def equal(self) -> int:
        """Number of blocks at the start that hold equally many rows, at even stamps: all or all but the last, or 0."""
        rows = np.diff(self.rows)
        count = len(rows) - int(rows[-1] != rows[0])
        return count if np.all(rows[:count] == rows[0]) and is_even(self.stamps) else 0

    @cached_property
    def rest(self) -> Shares:
        """The intervals between stamps of the blocks behind the `equal` ones, as parts of these."""
        first = self.rows[self.equal]
        return Shares.of(self.stamps[first:], self.rows[self.equal :] - first)

    def until(self, instant: float) -> BlockNodes:
        """The blocks that end up to `instant` (s), at least one."""
        count = max(int(np.searchsorted(self.time, instant, side="right")) - 1, 1)
        stop = self.rows[count]
        return BlockNodes(time=self.time[: count + 1], stamps=self.stamps[: stop + 1], rows=self.rows[: count + 1])

    def spline(self, values: Array, derivative: int = 0) -> Array:
        """The natural cubic spline through `values` at all stamps, or its first derivative, projected on the blocks."""
        return self.cubics(values, spline_slopes(self.stamps, values), derivative)

    def cubics(self, values: Array, slopes: Array, derivative: int = 0) -> Array:
        """The cubics with `values` and `slopes` (..., n) at all stamps, or their first derivative, on the blocks."""
        result, first = self._nodes(values.shape[:-1]), self.rows[self.equal]
        if self.equal:
            rows, step = int(self.rows[1]), float(self.stamps[-1] - self.stamps[0]) / (len(self.stamps) - 1)
            for signal, weights in zip((values, slopes), _of_cubics(rows, step, derivative), strict=True):
                result[..., : self.equal, :] += self._projected(signal, weights[:-1])
                result[..., : self.equal, :] += signal[..., rows : first + 1 : rows, None] * weights[-1]
        if self.equal < len(self.rows) - 1:
            rest = self.rest.cubics(values[..., first:], slopes[..., first:], derivative)
            result[..., self.equal :, :] = _parabolas(*rest)
        return result

    def _projected(self, signals: Array, weights: Array) -> Array:
        """Signals (..., rows) by these weights (intervals, points) of the rows of each of the `equal` blocks."""
        first = int(self.rows[self.equal])
        apart = np.ascontiguousarray(signals[..., :first]).reshape(*signals.shape[:-1], self.equal, len(weights))
        return product(weights.T, apart.swapaxes(-1, -2)).swapaxes(-1, -2)

    def _nodes(self, signals: tuple[int, ...]) -> Array:
        """Zeros for signals at the nodes."""
        return np.zeros((*signals, len(self.rows) - 1, POINTS))

    def hold(self, values: Array, ahead: float = 0.0) -> Array:
        """Hold as `GaussNodes.hold` on all stamps, projected on the blocks."""
        if ahead == 0.0:
            return self.held(values[:-1])
        ends = GaussNodes(self.stamps, 2).hold(values, ahead)  # a line in each interval
        rises = (ends[:, 1] - ends[:, 0]) / float(np.diff(gauss_rule(2)[0])[0])
        return _parabolas(*Shares.of(self.stamps, self.rows).lines(ends.mean(axis=1), rises))

    def held(self, signals: Array) -> Array:
        """Signals (..., n−1) that are constant between stamps; their projections (..., blocks, points)."""
        result, first = self._nodes(signals.shape[:-1]), self.rows[self.equal]
        if self.equal:
            result[..., : self.equal, :] = self._projected(signals, _of_held(int(self.rows[1])))
        if self.equal < len(self.rows) - 1:
            result[..., self.equal :, :] = _parabolas(*self.rest.held(signals[..., first:]))
        return result

    def rounded(self, values: Array) -> Array:
        """Errors of rounding `values` (one for each interval between stamps) on grids of step 1 moved by eighths.

        Projected on the blocks; shape (8, nodes).
        """
        result = self._nodes((8,))
        for k in range(8):
            moved = values + k / 8
            errors = np.floor(moved + 0.5)
            errors -= moved
            result[k] = self.held(errors)
        return result.reshape(8, -1)
