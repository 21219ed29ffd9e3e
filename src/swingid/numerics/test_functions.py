"""Modulating (test) functions with compact support, and the integrals of sampled signals with them.

φ(t) = (1 − s²)^m, s = (t − c)/L: zero with its first m − 1 derivatives at c ± L, so that integration by parts
moves the derivatives of a signal on φ and leaves nothing at the ends. Functions of a signal's values are integrated
with hat functions of these values as their basis.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from swingid.numerics.arrays import Array, Ints, stretches, sums_at
from swingid.numerics.quadrature import GaussNodes, gauss_rule, lagrange

POWER = 3
"""m of φ. With m = 3 φ'' is continuous; a larger m weights the window's middle more and passes more noise."""

CURVATURE_POWER = 1024 / 35
"""∫φ''² ds: what white noise gives ∫φ'' of a window, times half-length^(−3)."""


AT_ONCE, CACHED = 1 << 15, 1 << 14
"""Nodes of windows whose test functions are in memory together, and in the processor's cache."""

KEPT = 1 << 20
"""Nodes of windows up to which test functions are kept for further signals, of all windows on the nodes of a log."""


def phi(s: Array, order: int) -> Array:
    """φ, dφ/ds or d²φ/ds² at s in [−1, 1] (m = 3)."""
    p = 1.0 - s * s
    if order == 0:
        return p * p * p
    if order == 1:
        return -6.0 * s * p * p
    return -6.0 * p * (p - 4.0 * s * s)


def phi_integral(s: Array) -> Array:
    """∫φ ds from −1 to s (m = 3); 32/35 at s = 1 and beyond."""
    s = np.minimum(1.0, np.maximum(-1.0, s))
    square = s * s
    result: Array = s * (1.0 - square * (1.0 - square * (0.6 - square / 7.0))) + 16.0 / 35.0
    return result


@dataclass(frozen=True)
class _Tests:
    """Test functions of windows at the nodes of a log, with their `steps`; (windows, width), from node `first` on.

    s: place in the window; p = 1 − s², 0 outside. begin, end: the intervals in which the windows begin and end.
    """

    time: Array
    steps: Array
    points: int
    centres: Array
    half: Array
    begin: Ints
    end: Ints
    first: Ints
    s: Array
    p: Array
    found: dict[int, Array]

    @classmethod
    def of(cls, nodes: GaussNodes, centres: Array, half: Array) -> _Tests:
        """Places of all nodes from the interval in which each window begins to that in which it ends."""
        time, points = nodes.time, nodes.points
        begin = np.maximum(np.searchsorted(time, centres - half, side="right") - 1, 0)
        end = np.maximum(np.minimum(np.searchsorted(time, centres + half) - 1, len(time) - 2), begin)
        instants = nodes.flat[0]
        width = points * (int((end - begin).max(initial=0)) + 1)
        first = np.minimum(begin * points, len(instants) - width)
        s = stretches(instants, width)[first]
        s -= centres[:, None]
        s *= (1.0 / half)[:, None]
        p = s * s
        np.subtract(1.0, p, out=p)
        return cls(time, nodes.flat[1], points, centres, half, begin, end, first, s, np.maximum(p, 0.0, out=p), {})

    @cached_property
    def at(self) -> Ints:
        """Places of the nodes among all, flat."""
        return (self.first[:, None] + np.arange(self.s.shape[1])).ravel()

    def plain(self, order: int) -> Array:
        """φ or its derivative by s at the nodes, 0 outside; kept."""
        if order not in self.found:
            if order == 2:
                result = self.s * self.s
                result *= 30.0
                result -= 6.0
            else:
                result = self.p * self.p
                if order == 1:
                    result *= self.s
                    result *= -6.0
            if order != 1:
                result *= self.p
            self.found[order] = result
        return self.found[order]

    def weights(self, order: int) -> Array:
        """Weights of the nodes' values in ∫φ^(order) x dt, in cut intervals by the polynomial there; kept."""
        key = order + 3
        if key not in self.found:
            result = self.plain(order) * stretches(self.steps, self.s.shape[1])[self.first]
            if order:
                result *= (1.0 / self.half**order)[:, None]
            place, shares = self.ends
            result[place] = shares[order]
            self.found[key] = result
        return self.found[key]

    @cached_property
    def ends(self) -> tuple[tuple[Ints, Ints], Array]:
        """Where the nodes of the intervals are in which the windows begin and end, and `_cut` of these."""
        several = np.flatnonzero(self.end > self.begin)
        which = np.concatenate([np.arange(len(self.half)), several])
        k = np.concatenate([self.begin, self.end[several]])
        columns = (k * self.points - self.first[which])[:, None] + np.arange(self.points)
        return (which[:, None], columns), self._cut(k, self.centres[which], self.half[which])

    def _cut(self, k: Ints, centres: Array, half: Array) -> Array:
        """Weights (3, windows, points) for the part of each interval `k` that lies inside the window."""
        fractions, weights = gauss_rule(self.points)
        start, stop = self.time[k], self.time[k + 1]
        t0, t1 = np.maximum(start, centres - half), np.minimum(stop, centres + half)
        t = t0[:, None] + (t1 - t0)[:, None] * fractions
        s, scale = (t - centres[:, None]) / half[:, None], (t1 - t0)[:, None] * weights
        tests = np.stack([phi(s, order) * (scale / (half**order)[:, None]) for order in range(3)])
        u = (t - start[:, None]) / (stop - start)[:, None]
        basis = u[..., None] ** np.arange(self.points) @ lagrange(self.points)
        shares: Array = (tests[:, :, None] @ basis)[:, :, 0]
        return shares


def _tests_of(nodes: GaussNodes, centres: Array, half: Array) -> _Tests:
    """Test functions at the nodes, kept with these for the next signals on the same windows."""
    key = centres.tobytes() + half.tobytes()
    found = nodes.tests.get(key)
    if found is None:
        found = _Tests.of(nodes, centres, half)
        if found.s.size + sum(one.s.size for one in nodes.tests.values()) <= KEPT:
            nodes.tests[key] = found
    result: _Tests = found
    return result


def project(nodes: GaussNodes, signals: list[tuple[Array, int]], centres: Array, half: Array) -> Array:
    """Integrals ∫φ^(d) x dt of each (x, d) of `signals` for windows at `centres` with half-lengths `half` (s).

    x is given at the nodes, shape (n−1, points); d is 0, 1 or 2. Returns (windows, signals). An interval that a
    window's end cuts is integrated over its part inside (x is continued by the polynomial through its nodes): without
    that, short windows are wrong by per cents. The windows must lie inside the log.
    """
    stacked = np.stack([x.ravel() for x, _ in signals])
    return project_stacked(nodes, stacked, np.array([d for _, d in signals]), centres, half)


def project_stacked(nodes: GaussNodes, stacked: Array, orders: Ints, centres: Array, half: Array) -> Array:
    """As `project`, for signals stacked once for many calls: (signals, nodes) with nodes in one row."""
    result = np.empty((len(centres), len(orders)))
    groups = [(order, np.flatnonzero(orders == order)) for order in sorted(set(orders.tolist()))]
    signals = [np.ascontiguousarray(stacked[own]) for _, own in groups]
    for k in _portions(nodes, half, AT_ONCE):
        tests = _tests_of(nodes, centres[k], half[k])
        for (order, own), values in zip(groups, signals, strict=True):
            placed = stretches(values, tests.s.shape[1])[:, tests.first]
            result[k, own] = np.einsum("gwn,wn->wg", placed, tests.weights(order))
    return result


def _portions(nodes: GaussNodes, half: Array, size: int) -> list[slice]:
    """The windows in portions of about `size` nodes together."""
    width = 2.0 * float(half.max(initial=0.0)) / float(nodes.time[-1] - nodes.time[0]) * nodes.instants.size
    count = max(int(size / (width + 2 * nodes.points)), 1)
    return [slice(k, k + count) for k in range(0, len(half), count)]


def superposed(nodes: GaussNodes, centres: Array, half: Array, factors: Array, order: int) -> Array:
    """Σ_i factors_i φ_i^(order)(t) at the nodes, in one row: the adjoint of `project`, one value per instant."""
    tests = _tests_of(nodes, centres, half)
    values = tests.plain(order) * (factors / half**order)[:, None]
    return sums_at(tests.at, values, nodes.instants.size)


def superpose(instants: Array, centres: Array, half: Array, factors: Array, order: int) -> Array:
    """As `superposed`, at any rising instants, for each row of factors (n, windows); returns (n, instants)."""
    begin = np.searchsorted(instants, centres - half)
    width = int((np.searchsorted(instants, centres + half) - begin).max(initial=1))
    first = np.minimum(begin, len(instants) - width)
    s = (stretches(instants, width)[first] - centres[:, None]) / half[:, None]
    tests = np.where(np.abs(s) < 1.0, phi(s, order), 0.0) / (half**order)[:, None]
    at = (first[:, None] + np.arange(width)).ravel()
    return np.array([sums_at(at, tests * row[:, None], len(instants)) for row in factors])


def _pairs(instants: Array, centres: Array, half: Array) -> tuple[Ints, Ints, Array]:
    """Windows and rising instants that lie in them, all pairs, and the places s of the instants in the windows."""
    begin = np.searchsorted(instants, centres - half)
    count = np.searchsorted(instants, centres + half) - begin
    which = np.repeat(np.arange(len(centres)), count)
    at = np.arange(len(which)) - np.repeat(np.cumsum(count) - count - begin, count)
    return which, at, (instants[at] - centres[which]) / half[which]


def project_steps(edges: Array, levels: Array, centres: Array, half: Array) -> Array:
    """∫φ x dt of a piecewise constant x, exactly: `levels[j]` holds from `edges[j]` to `edges[j+1]`, 0 outside."""
    which, at, s = _pairs(edges, centres, half)
    jumps = np.diff(levels, prepend=0.0, append=0.0)
    # every jump acts until the end of the window
    acting = jumps[at] * (32 / 35 - phi_integral(s))
    before = np.concatenate([[0.0], levels, [0.0]])[np.searchsorted(edges, centres - half)]
    result: Array = half * (before * (32 / 35) + sums_at(which, acting, len(centres)))
    return result


def project_impulses(instants: Array, strengths: Array, centres: Array, half: Array) -> Array:
    """Σ_j strengths_j φ(t_j): the modulated integral of impulses at rising `instants`."""
    which, at, s = _pairs(instants, centres, half)
    return sums_at(which, strengths[at] * phi(s, 0), len(centres))


def curvature_overlap(distance: Array, gravity: float = 0.0) -> Array:
    """∫g(s) g(s − d) ds, g = φ'' + gravity φ: what white noise gives two windows d half-lengths apart in common.

    gravity: b cos q1 L²/a11, what noise of the angle does through ∫φ b sin q1 beside a11 ∫φ'' q1.
    """
    curved, crossed, plain = overlap_terms(distance)
    result: Array = curved + gravity * (2 * crossed + gravity * plain)
    return result


def overlap_terms(distance: Array) -> tuple[Array, Array, Array]:
    """∫φ''(s) φ''(s − d) ds, ∫φ''(s) φ(s − d) ds and ∫φ(s) φ(s − d) ds, for d half-lengths (any shape)."""
    grid, table = _overlap_table()
    curved, crossed, plain = (np.interp(np.abs(distance), grid, values) for values in table)
    return curved, crossed, plain


def neighbour_overlaps(centres: Array, half: Array, lags: int) -> Array:
    """`overlap_terms` of each window with itself and the ones after it, (3, lags, windows), 0 behind the last."""
    result, grid, tables = np.zeros((3, lags, len(centres))), *_overlap_table()
    for lag in range(min(lags, len(centres))):
        count = len(centres) - lag
        place = np.abs(centres[lag:] - centres[:count]) / (half[lag:] * grid[1])
        k = np.minimum(place.astype(np.int64), len(grid) - 2)
        share = np.minimum(place - k, 1.0)
        for own, table in zip(result, tables, strict=True):
            own[lag, :count] = table[k] + share * (table[k + 1] - table[k])
    return result


def _overlap_sums(weights: Array, neighbours: Array, reach: int) -> Array:
    """Sums over all pairs of windows of w w times each of `neighbours`, (2, 3): true, and with Bartlett's weights."""
    lags = neighbours.shape[1]
    pairs = weights * stretches(np.concatenate([weights, np.zeros(lags - 1)]), len(weights))
    sums = np.einsum("tln,ln->tl", neighbours, pairs)
    sums[:, 1:] *= 2.0
    return np.stack([sums.sum(axis=1), sums @ np.maximum(0.0, 1.0 - np.arange(lags) / (reach + 1.0))])


def overlaps(
    weights: Array, neighbours: Array, reach: int, gravity: float
) -> tuple[tuple[float, float], tuple[float, float]]:
    """What white noise of power 1 gives Σ weights ∫g noise: Σ Σ w w ∫g g with this `gravity` and without.

    Then the same as Bartlett's weights, which end after `reach` neighbours, sum it. neighbours: `neighbour_overlaps`;
    weights hold what scales g, as half^(−3/2).
    """
    sums = _overlap_sums(weights, neighbours, reach)
    true, tapered = [(one + gravity * (2 * two + gravity * three), one) for one, two, three in sums.tolist()]
    return true, tapered


SLOPE_POWER = 3072 / 1155
"""∫φ'² over the support of half-length 1."""


def rate_overlaps(weights: Array, neighbours: Array, reach: int) -> tuple[float, float]:
    """As `overlaps`, of Σ weights ∫φ' noise: for white noise of a rate, of which ∫φ'' of its integral is −∫φ'.

    weights hold half^(−1/2). ∫φ'φ' = −∫φ''φ.
    """
    sums = _overlap_sums(weights, neighbours, reach)
    return -float(sums[0, 1]), -float(sums[1, 1])


@cache
def _overlap_table() -> tuple[Array, tuple[Array, Array, Array]]:
    """∫φ''φ'', ∫φ''φ and ∫φφ on a grid of distances fine enough for linear interpolation to 1e-6 of the maximum."""
    grid = np.linspace(0, 2, 4001)
    d = grid[:, None]
    x, w = gauss_rule(7)
    s = d - 1 + (2 - d) * x
    shifted, weights = s - d, (2 - d) * w
    plain, curvature = phi(s, 0), phi(s, 2)
    return grid, (
        (weights * curvature * phi(shifted, 2)).sum(axis=1),
        (weights * curvature * (1 - shifted * shifted) ** 3).sum(axis=1),
        (weights * plain * (1 - shifted * shifted) ** 3).sum(axis=1),
    )


def project_hats(nodes: GaussNodes, signal: Array, knots: Array, centres: Array, half: Array) -> Array:
    """∫φ Λ_j(x) dt for the hat functions Λ_j on rising `knots`; returns (windows, knots).

    The modulated integral of any function f(x) is then ``hats @ f(knots)``, up to its piecewise linear interpolation.
    Values of x beyond the knots count for the outermost one.
    """
    values, steps = signal.ravel(), nodes.flat[1]
    place = np.minimum(np.maximum(np.searchsorted(knots, values) - 1, 0), len(knots) - 2)
    share = (values - knots[place]) / np.diff(knots)[place]
    np.clip(share, 0.0, 1.0, out=share)
    upper, result = share * steps, np.empty((len(centres), len(knots)))
    for k in _portions(nodes, half, CACHED):
        tests = _Tests.of(nodes, centres[k], half[k])
        width, count = tests.s.shape[1], len(tests.half)
        at = stretches(place, width)[tests.first]
        at += (len(knots) * np.arange(count))[:, None]
        phi = tests.p * tests.p
        phi *= tests.p
        whole = sums_at(at, phi * stretches(steps, width)[tests.first], count * len(knots))
        phi *= stretches(upper, width)[tests.first]
        above = sums_at(at, phi, count * len(knots))
        whole -= above
        whole[1:] += above[:-1]
        result[k] = whole.reshape(count, -1)
    return result
