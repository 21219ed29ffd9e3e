"""Gauss nodes of blocks of samples: a log for slow modulating (test) functions, in fewer numbers than it has rows.

Within a block a signal is replaced by its projection on parabolas (least squares over the block), given at three Gauss
nodes. The integral with any function that is a parabola in each block is kept exactly, and with a smooth function the
error is the product of what parabolas leave of both, of sixth order in the length of the blocks
(of fifth with a window that ends within a block).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from swingid.numerics.arrays import Array, Ints
from swingid.numerics.compiled import njit, njit_sums
from swingid.numerics.quadrature import GaussNodes, gauss_rule
from swingid.numerics.spline import spline_slopes

POINTS = 3
"""Nodes of a block: a parabola has three coefficients."""

THIRD, FIFTH, SIXTH = 1.0 / 3.0, 1.0 / 5.0, 1.0 / 6.0
"""In a loop over rows a product costs less than a division."""


@njit
def block_edges(stamps: Array, longest: float) -> Ints:
    """Rows at which blocks end, the first row with them: as many rows together as `longest` (s) holds, at least one."""
    edges = np.empty(len(stamps), np.int64)
    count, edges[0] = 1, 0
    for k in range(1, len(stamps)):
        if k == len(stamps) - 1 or stamps[k + 1] - stamps[edges[count - 1]] > longest:
            edges[count] = k
            count += 1
    return edges[:count].copy()


@njit
def _parabola(m0: float, m1: float, m2: float, fractions: Array, nodes: Array) -> None:
    """Values at the nodes of the parabola with these moments with the Legendre polynomials of order 0, 1, 2."""
    for j in range(len(fractions)):
        z = 2.0 * fractions[j] - 1.0
        nodes[j] = m0 + 3.0 * z * m1 + 2.5 * (3.0 * z * z - 1.0) * m2


@njit
def _splined(stamps: Array, edges: Ints, values: Array, slopes: Array, derivative: int, fractions: Array) -> Array:
    """Projection of a cubic spline or its derivative, given by values and slopes at the stamps."""
    nodes = np.empty((len(edges) - 1, len(fractions)))
    for block in range(len(edges) - 1):
        start = stamps[edges[block]]
        inverse = 1.0 / (stamps[edges[block + 1]] - start)
        m0 = m1 = m2 = 0.0
        for k in range(edges[block], edges[block + 1]):
            h = stamps[k + 1] - stamps[k]
            rise = values[k + 1] - values[k]
            x0, x1 = values[k], h * slopes[k]  # the cubic x0 + x1 s + x2 s² + x3 s³, s from 0 to 1
            x2 = 3.0 * rise - h * (2.0 * slopes[k] + slopes[k + 1])
            x3 = h * (slopes[k] + slopes[k + 1]) - 2.0 * rise
            if derivative == 1:
                x0, x1, x2, x3 = x1 / h, 2.0 * x2 / h, 3.0 * x3 / h, 0.0
            whole = x0 + 0.5 * x1 + THIRD * x2 + 0.25 * x3
            first = 0.5 * x0 + THIRD * x1 + 0.25 * x2 + FIFTH * x3
            second = THIRD * x0 + 0.25 * x1 + FIFTH * x2 + SIXTH * x3
            # the Legendre polynomials of z = begin + 2 share s
            begin, share = 2.0 * (stamps[k] - start) * inverse - 1.0, h * inverse
            m0 += share * whole
            m1 += share * (begin * whole + 2.0 * share * first)
            square = begin * begin * whole + 4.0 * share * (begin * first + share * second)
            m2 += share * (1.5 * square - 0.5 * whole)
        _parabola(m0, m1, m2, fractions, nodes[block])
    return nodes


@njit
def _held(stamps: Array, edges: Ints, signals: Array, slopes: Array, fractions: Array) -> Array:
    """Projections of signals (m, n−1) that are constant from stamp to stamp, or lines with these middles and slopes.

    slopes (m, n−1): the change over the interval; no rows: constants.
    """
    count = len(signals)
    nodes, m = np.empty((count, len(edges) - 1, len(fractions))), np.empty((count, 3))
    for block in range(len(edges) - 1):
        start = stamps[edges[block]]
        inverse = 1.0 / (stamps[edges[block + 1]] - start)
        m[:] = 0.0
        for k in range(edges[block], edges[block + 1]):
            share = (stamps[k + 1] - stamps[k]) * inverse
            z = (stamps[k] + stamps[k + 1] - 2.0 * start) * inverse - 1.0
            bent = 1.5 * (z * z + share * share * THIRD) - 0.5
            for g in range(count):
                x = signals[g, k] * share
                m[g, 0] += x
                m[g, 1] += x * z
                m[g, 2] += x * bent
                if len(slopes):
                    tilt = slopes[g, k] * share * share * SIXTH
                    m[g, 1] += tilt
                    m[g, 2] += 3.0 * tilt * z
        for g in range(count):
            _parabola(m[g, 0], m[g, 1], m[g, 2], fractions, nodes[g, block])
    return nodes


@njit_sums
def _rounded(stamps: Array, edges: Ints, values: Array, fractions: Array) -> Array:
    """Projections of the errors of rounding `values` (held from stamp to stamp) on integers moved by eighths."""
    nodes = np.empty((8, len(edges) - 1, len(fractions)))
    m0, m1, m2 = np.empty(8), np.empty(8), np.empty(8)
    for block in range(len(edges) - 1):
        start = stamps[edges[block]]
        inverse = 1.0 / (stamps[edges[block + 1]] - start)
        m0[:], m1[:], m2[:] = 0.0, 0.0, 0.0
        for k in range(edges[block], edges[block + 1]):
            share = (stamps[k + 1] - stamps[k]) * inverse
            z = (stamps[k] + stamps[k + 1] - 2.0 * start) * inverse - 1.0
            bent = 1.5 * (z * z + share * share * THIRD) - 0.5
            for m in range(8):
                moved = values[k] + m * 0.125
                error = (np.floor(moved + 0.5) - moved) * share
                m0[m] += error
                m1[m] += error * z
                m2[m] += error * bent
        for m in range(8):
            _parabola(m0[m], m1[m], m2[m], fractions, nodes[m, block])
    return nodes


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

    def until(self, instant: float) -> BlockNodes:
        """The blocks that end up to `instant` (s), at least one."""
        count = max(int(np.searchsorted(self.time, instant, side="right")) - 1, 1)
        stop = self.rows[count]
        return BlockNodes(time=self.time[: count + 1], stamps=self.stamps[: stop + 1], rows=self.rows[: count + 1])

    def spline(self, values: Array, derivative: int = 0) -> Array:
        """The natural cubic spline through `values` at all stamps, or its first derivative, projected on the blocks."""
        return self.cubics(values, spline_slopes(self.stamps, values), derivative)

    def cubics(self, values: Array, slopes: Array, derivative: int = 0) -> Array:
        """The cubics with these `values` and `slopes` at all stamps, or their first derivative, on the blocks."""
        return _splined(self.stamps, self.rows, values, slopes, derivative, self.fractions)

    def hold(self, values: Array, ahead: float = 0.0) -> Array:
        """As `GaussNodes.hold` on all stamps, projected on the blocks."""
        if ahead == 0.0:
            constant: Array = self.held(values[None, :-1])[0]
            return constant
        ends = GaussNodes(self.stamps, 2).hold(values, ahead)  # a line in each interval
        rise = (ends[:, 1] - ends[:, 0]) / float(np.diff(gauss_rule(2)[0])[0])
        line: Array = _held(self.stamps, self.rows, ends.mean(axis=1)[None], rise[None], self.fractions)[0]
        return line

    def held(self, signals: Array) -> Array:
        """Signals (m, n−1) that are constant in every interval between stamps; projections (m, blocks, points)."""
        return _held(self.stamps, self.rows, signals, np.empty((0, 0)), self.fractions)

    def rounded(self, values: Array) -> Array:
        """Errors of rounding `values` (one for each interval between stamps) on grids of step 1 moved by eighths.

        Projected on the blocks; shape (8, nodes).
        """
        return _rounded(self.stamps, self.rows, values, self.fractions).reshape(8, -1)
