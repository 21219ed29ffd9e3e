"""Modulating (test) functions with compact support, and the integrals of sampled signals with them.

φ(t) = (1 − s²)^m, s = (t − c)/L: zero with its first m − 1 derivatives at c ± L, so that integration by parts
moves the derivatives of a signal on φ and leaves nothing at the ends. Functions of a signal's values are integrated
with hat functions of these values as their basis.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from swingid.numerics.arrays import Array, Ints, stretches, sums_at
from swingid.numerics.once import once
from swingid.numerics.quadrature import GaussNodes, gauss_rule, lagrange

POWER = 3
"""m of φ. With m = 3 φ'' is continuous; a larger m weights the window's middle more and passes more noise."""

CURVATURE_POWER = 1024 / 35
"""∫φ''² ds: what white noise gives ∫φ'' of a window, times half-length^(−3)."""


AT_ONCE, CACHED = 1 << 15, 1 << 14
"""Nodes of windows whose test functions are in memory together, and in the processor's cache."""

KEPT = 5 << 19
"""Nodes of windows up to which test functions are kept for further signals, of all windows on the nodes of a log."""


APART = 1e-9
"""Share of its length by which a window may overlap another that is one length apart, by rounding."""


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
class _Places:
    """Places s in windows, and p = 1 − s², 0 outside, of the nodes of a log, (windows, width), from node `first` on.

    begin, end: the intervals in which the windows begin and end.
    """

    begin: Ints
    end: Ints
    first: Ints
    s: Array
    p: Array

    @classmethod
    def of(cls, nodes: GaussNodes, centres: Array, half: Array) -> _Places:
        """Places of all nodes from the interval in which each window begins to that in which it ends."""
        time, points = nodes.time, nodes.points
        begin = np.maximum(time.searchsorted(centres - half, side="right") - 1, 0)
        end = np.maximum(np.minimum(time.searchsorted(centres + half) - 1, len(time) - 2), begin)
        instants = nodes.flat[0]
        width = points * (int((end - begin).max(initial=0)) + 1)
        first = np.minimum(begin * points, len(instants) - width)
        s = stretches(instants, width)[first]
        s -= centres[:, None]
        s *= (1.0 / half)[:, None]
        p = s * s
        np.subtract(1.0, p, out=p)
        return cls(begin, end, first, s, np.maximum(p, 0.0, out=p))


@dataclass(frozen=True)
class _Tests:
    """Test functions of windows at the nodes of a log, (windows, width), from node `first` on.

    plain: φ and d²φ/ds², 0 outside. weights: of the nodes' values in ∫dφ^(order)/ds x dt for the orders 0 to 2, in cut
    intervals by the polynomial there.
    """

    first: Ints
    plain: dict[int, Array]
    weights: tuple[Array, Array, Array]

    @classmethod
    def of(cls, nodes: GaussNodes, centres: Array, half: Array) -> _Tests:
        """Prepare these windows."""
        places = _Places.of(nodes, centres, half)
        s, p = places.s, places.p
        square = p * p
        bent = s * s
        bent *= 30.0
        bent -= 6.0
        bent *= p
        slope = square * s
        slope *= -6.0
        plain = {0: np.multiply(square, p, out=square), 2: bent}
        steps = stretches(nodes.flat[1], s.shape[1])[places.first]
        slope *= steps
        weights = plain[0] * steps, slope, bent * steps
        place, shares = _ends(nodes, places, centres, half)
        for weight, share in zip(weights, shares, strict=True):
            weight[place] = share
        return cls(places.first, plain, weights)

    @cached_property
    def at(self) -> Ints:
        """Places of the nodes behind the first of all, flat."""
        at: Ints = (self.first - self.first.min())[:, None] + np.arange(self.plain[0].shape[1])
        return at.ravel()


def _ends(nodes: GaussNodes, places: _Places, centres: Array, half: Array) -> tuple[tuple[Ints, Ints], Array]:
    """Return where the nodes of the intervals are in which the windows begin and end, and `_cut` of these."""
    several = (places.end > places.begin).nonzero()[0]
    which = np.concatenate([np.arange(len(half)), several])
    k = np.concatenate([places.begin, places.end[several]])
    columns = (k * nodes.points - places.first[which])[:, None] + np.arange(nodes.points)
    return (which[:, None], columns), _cut(nodes, k, centres[which], half[which])


def _cut(nodes: GaussNodes, k: Ints, centres: Array, half: Array) -> Array:
    """Weights (3, windows, points) for the part of each interval `k` that lies inside the window."""
    fractions, weights = gauss_rule(nodes.points)
    start, stop = nodes.time[k], nodes.time[k + 1]
    t0, t1 = np.maximum(start, centres - half), np.minimum(stop, centres + half)
    t = t0[:, None] + (t1 - t0)[:, None] * fractions
    s, scale = (t - centres[:, None]) / half[:, None], (t1 - t0)[:, None] * weights
    tests = np.stack([phi(s, order) * scale for order in range(3)])
    u, ones = (t - start[:, None]) / (stop - start)[:, None], np.ones(nodes.points)
    moments = [tests @ ones]
    for _ in range(1, nodes.points):
        tests *= u
        moments.append(tests @ ones)
    shares: Array = np.stack(moments, axis=-1) @ lagrange(nodes.points)
    return shares


def _tests_of(nodes: GaussNodes, centres: Array, half: Array) -> _Tests:
    """Test functions at the nodes, kept with these for the next signals on the same windows."""
    key = centres.tobytes() + half.tobytes()
    tests = nodes.tests.get(key)
    if tests is None:
        tests = _Tests.of(nodes, centres, half)
        if tests.plain[0].size + sum(other.plain[0].size for other in nodes.tests.values()) <= KEPT:
            nodes.tests[key] = tests
    result: _Tests = tests
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
    """Project as `project` signals that were stacked once for many calls: (signals, nodes) with nodes in one row."""
    result = np.empty((len(centres), len(orders)))
    groups = [(order, (orders == order).nonzero()[0]) for order in sorted(set(orders.tolist()))]
    signals = [stacked if len(groups) == 1 else stacked[places] for _, places in groups]
    for k in _portions(nodes, half, AT_ONCE):
        tests = _tests_of(nodes, centres[k], half[k])
        for (order, places), values in zip(groups, signals, strict=True):
            placed = stretches(values, tests.weights[0].shape[1])[:, tests.first]
            result[k, places] = np.einsum("gwn,wn->wg", placed, tests.weights[order])
    for order, places in groups:
        if order:
            result[:, places] /= (half**order)[:, None]
    return result


def _portions(nodes: GaussNodes, half: Array, size: int) -> list[slice]:
    """The windows in portions of about `size` nodes together."""
    width = 2.0 * float(half.max(initial=0.0)) / float(nodes.time[-1] - nodes.time[0]) * nodes.instants.size
    count = max(int(size / (width + 2 * nodes.points)), 1)
    return [slice(k, k + count) for k in range(0, len(half), count)]


def superposed(nodes: GaussNodes, centres: Array, half: Array, factors: Array, orders: Sequence[int]) -> Array:
    """Σ_i factors_i φ_i^(order)(t) at the nodes, for each row of factors (n, windows): (orders, n, nodes).

    The adjoint of `project`, of the orders 0 and 2.
    """
    result = np.zeros((len(orders), len(factors), nodes.instants.size))
    for k in _portions(nodes, half, AT_ONCE):
        tests = _tests_of(nodes, centres[k], half[k])
        first = int(tests.first.min())
        for totals, order in zip(result, orders, strict=True):
            for total, row in zip(totals, factors[:, k] / half[k] ** order, strict=True):
                part = np.bincount(tests.at, (tests.plain[order] * row[:, None]).ravel())
                total[first : first + len(part)] += part
    return result


def superpose(instants: Array, centres: Array, half: Array, factors: Array, order: int) -> Array:
    """Superpose as `superposed` at any rising instants, for each row of factors (n, windows); returns (n, instants)."""
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
    """Σ_j strengths_j φ(t_j) of impulses at rising `instants`: (windows,), or of several (n, instants) (n, windows)."""
    which, at, s = _pairs(instants, centres, half)
    each = strengths[..., at] * phi(s, 0)
    if strengths.ndim == 1:
        return sums_at(which, each, len(centres))
    return np.array([sums_at(which, row, len(centres)) for row in each])


def curvature_overlap(distance: Array, gravity: float = 0.0) -> Array:
    """∫g(s) g(s − d) ds, g = φ'' + gravity φ: what white noise gives two windows d half-lengths apart in common.

    gravity: b cos q1 L²/a11, what noise of the angle does through ∫φ b sin q1 beside a11 ∫φ'' q1.
    """
    grid, table = _overlap_table()
    curved, crossed, plain = (np.interp(np.abs(distance), grid, values) for values in table)
    result: Array = curved + gravity * (2 * crossed + gravity * plain)
    return result


def neighbour_overlaps(centres: Array, half: Array, lags: int) -> Array:
    """∫φ''φ'', ∫φ''φ and ∫φφ of each window with itself and the ones after it, (3, lags, windows), 0 behind the last.

    Of at most so many lags: those beyond which no windows overlap are left out.
    """
    grid, tables = _overlap_table()
    beyond = np.full(lags - 1, np.inf)  # windows behind the last are far away
    later = stretches(np.concatenate([centres, beyond]), len(centres))
    halves = stretches(np.concatenate([half, np.ones(lags - 1)]), len(centres))
    place = np.minimum(np.abs(later - centres) / (halves * grid[1]), len(grid) - 1.0)
    overlapping = np.flatnonzero(place.min(axis=1, initial=len(grid)) < (1.0 - APART) * (len(grid) - 1.0))
    place = place[: 1 + int(overlapping.max(initial=0))]
    k = np.minimum(place.astype(np.int64), len(grid) - 2)
    place -= k
    result: Array = tables[:, k]
    result += place * (tables[:, 1:] - tables[:, :-1])[:, k]
    return result


def _overlap_sums(weights: Array, neighbours: Array, reach: int) -> Array:
    """Sums over all pairs of windows of w w times each of `neighbours`, (..., 3, 2): true, and with Bartlett's weights.

    weights (..., windows).
    """
    lags, count = neighbours.shape[1:]
    padded = np.zeros((*weights.shape[:-1], count + lags - 1))
    padded[..., :count] = weights
    pairs = stretches(padded, count) * weights[..., None, :]
    result: Array = np.einsum("tln,...ln->...tl", neighbours, pairs) @ _lag_weights(lags, reach)
    return result


@cache
def _lag_weights(lags: int, reach: int) -> Array:
    """How often pairs of windows so many apart count, (lags, 2): truly, and with Bartlett's weights."""
    twice = np.where(np.arange(lags) > 0, 2.0, 1.0)
    return np.stack([twice, twice * np.maximum(0.0, 1.0 - np.arange(lags) / (reach + 1.0))], axis=1)


def overlaps(weights: Array, neighbours: Array, reach: int, gravity: Array | float) -> tuple[Array, Array]:
    """What white noise of power 1 gives Σ weights ∫g noise, (..., 2): Σ Σ w w ∫g g, and as Bartlett's weights sum it.

    Those end after `reach` neighbours. The first result is with this `gravity` (...), the second without. neighbours:
    `neighbour_overlaps`; weights (..., windows) hold what scales g, as half^(−3/2).
    """
    sums = _overlap_sums(weights, neighbours, reach)
    curved, pull = sums[..., 0, :], np.asarray(gravity)[..., None]
    return curved + pull * (2 * sums[..., 1, :] + pull * sums[..., 2, :]), curved


SLOPE_POWER = 3072 / 1155
"""∫φ'² over the support of half-length 1."""


def rate_overlaps(weights: Array, neighbours: Array, reach: int) -> Array:
    """Return as `overlaps` those of Σ weights ∫φ' noise: white noise of a rate, of which ∫φ'' of its integral is −∫φ'.

    weights hold half^(−1/2). ∫φ'φ' = −∫φ''φ.
    """
    result: Array = -_overlap_sums(weights, neighbours, reach)[..., 1, :]
    return result


@cache
def _overlap_table() -> tuple[Array, Array]:
    """∫φ''φ'', ∫φ''φ and ∫φφ on a grid of distances fine enough for linear interpolation to 1e-6 of the maximum."""
    grid = np.linspace(0, 2, 4001)
    d = grid[:, None]
    x, w = gauss_rule(7)
    s = d - 1 + (2 - d) * x
    shifted, weights = s - d, (2 - d) * w
    plain, curvature = phi(s, 0), phi(s, 2)
    others = phi(shifted, 2), (1 - shifted * shifted) ** 3
    products = curvature * others[0], curvature * others[1], plain * others[1]
    return grid, np.stack([(weights * product).sum(axis=1) for product in products])


@once
def _among_knots(nodes: GaussNodes, signal: Array, knots: Array) -> tuple[Ints, Array]:
    """The interval of the knots in which each value of a signal at the nodes is, and its place there from 0 to 1."""
    values = signal.ravel()
    place = np.minimum(np.maximum(np.searchsorted(knots, values) - 1, 0), len(knots) - 2)
    share = (values - knots[place]) / np.diff(knots)[place]
    return place, np.clip(share, 0.0, 1.0, out=share)


def project_hats(nodes: GaussNodes, signal: Array, knots: Array, centres: Array, half: Array) -> Array:
    """∫φ Λ_j(x) dt for the hat functions Λ_j on rising `knots`; returns (windows, knots).

    The modulated integral of any function f(x) is then ``hats @ f(knots)``, up to its piecewise linear interpolation.
    Values of x beyond the knots count for the outermost one.
    """
    (place, share), steps = _among_knots(nodes, signal, knots), nodes.flat[1]
    result = np.empty((len(centres), len(knots)))
    for k in _portions(nodes, half, CACHED):
        tests = _Places.of(nodes, centres[k], half[k])
        count, width = tests.s.shape
        at = stretches(place, width)[tests.first]
        at += (len(knots) * np.arange(count))[:, None]
        phi = stretches(steps, width)[tests.first]
        for _ in range(POWER):
            phi *= tests.p
        whole = sums_at(at, phi, count * len(knots))
        phi *= stretches(share, width)[tests.first]
        above = sums_at(at, phi, count * len(knots))
        whole -= above
        whole[1:] += above[:-1]
        result[k] = whole.reshape(count, -1)
    return result
