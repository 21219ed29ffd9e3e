"""Modulating (test) functions with compact support, and the integrals of sampled signals with them.

φ(t) = (1 − s²)^m, s = (t − c)/L: zero with its first m − 1 derivatives at c ± L, so that integration by parts
moves the derivatives of a signal on φ and leaves nothing at the ends. Functions of a signal's values are integrated
with hat functions of these values as their basis.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from swingid.numerics.arrays import Array, Ints
from swingid.numerics.compiled import njit, njit_sums
from swingid.numerics.quadrature import GaussNodes, gauss_rule
from swingid.numerics.regression import inner
from swingid.numerics.spline import rows_before

POWER = 3
"""m of φ. With m = 3 φ'' is continuous; a larger m weights the window's middle more and passes more noise."""

CURVATURE_POWER = 1024 / 35
"""∫φ''² ds: what white noise gives ∫φ'' of a window, times half-length^(−3)."""


@njit
def phi(s: float, order: int) -> float:
    """φ, dφ/ds or d²φ/ds² at s in [−1, 1] (m = 3)."""
    p = 1.0 - s * s
    if order == 0:
        return p * p * p
    if order == 1:
        return -6.0 * s * p * p
    return -6.0 * p * (p - 4.0 * s * s)


@njit
def phi_integral(s: float) -> float:
    """∫φ ds from −1 to s (m = 3); 32/35 at s = 1 and beyond."""
    s = min(1.0, max(-1.0, s))
    return s - s**3 + 0.6 * s**5 - s**7 / 7.0 + 16.0 / 35.0


@njit
def _cut(
    time: Array,
    k: int,
    c: float,
    big_l: float,
    signals: Array,
    orders: Ints,
    fractions: Array,
    weights: Array,
    scales: Array,
    shares: Array,
    result: Array,
) -> None:
    """Add the integrals over the part of interval k that lies inside the window; scales: see `_lagrange_scales`.

    shares (3, points): overwritten with those of the nodes' values in the integrals with φ, φ' and φ''.
    """
    points, start, per_l = len(fractions), time[k], 1.0 / big_l
    t0, t1 = max(start, c - big_l), min(time[k + 1], c + big_l)
    per_h = 1.0 / (time[k + 1] - start)
    shares[:] = 0.0
    for j in range(points):
        t = t0 + (t1 - t0) * fractions[j]
        u, s, weight = (t - start) * per_h, (t - c) * per_l, (t1 - t0) * weights[j]
        plain, first, second = weight * phi(s, 0), weight * per_l * phi(s, 1), weight * per_l * per_l * phi(s, 2)
        for i in range(points):
            basis = scales[i]  # the polynomial that is 1 at node i and 0 at the others
            for m in range(points):
                if m != i:
                    basis *= u - fractions[m]
            shares[0, i] += plain * basis
            shares[1, i] += first * basis
            shares[2, i] += second * basis
    for g in range(len(orders)):
        for i in range(points):
            result[g] += shares[orders[g], i] * signals[g, k * points + i]


@njit
def _lagrange_scales(fractions: Array) -> Array:
    """What Π (u − f_m) over the other nodes is multiplied by to be 1 at node i."""
    scales = np.ones(len(fractions))
    for i in range(len(fractions)):
        for m in range(len(fractions)):
            if m != i:
                scales[i] /= fractions[i] - fractions[m]
    return scales


@njit_sums
def _fill_tests(instants: Array, steps: Array, c: float, big_l: float, tests: Array) -> None:
    """φ, φ' and φ'' at the nodes, times the nodes' weights, into the three rows of `tests`."""
    inverse = 1.0 / big_l
    for j in range(len(instants)):
        s = (instants[j] - c) * inverse
        p = 1.0 - s * s
        tests[0, j] = steps[j] * p * p * p
        tests[1, j] = steps[j] * (-6.0 * inverse) * s * p * p
        tests[2, j] = steps[j] * (-6.0 * inverse * inverse) * p * (p - 4.0 * s * s)


@njit
def _project(
    time: Array,
    instants: Array,
    steps: Array,
    signals: Array,
    orders: Ints,
    centres: Array,
    half: Array,
    fractions: Array,
    weights: Array,
) -> Array:
    """See `project`; instants, steps and signals are flat over all nodes."""
    points, scales = len(fractions), _lagrange_scales(fractions)
    result = np.zeros((len(centres), len(orders)))
    tests, shares = np.empty((3, len(instants))), np.empty((3, points))
    for i in range(len(centres)):
        c, big_l = centres[i], half[i]
        first = max(rows_before(time, c - big_l, True) - 1, 0)
        last = min(rows_before(time, c + big_l, False) - 1, len(time) - 2)
        _cut(time, first, c, big_l, signals, orders, fractions, weights, scales, shares, result[i])
        if last > first:
            _cut(time, last, c, big_l, signals, orders, fractions, weights, scales, shares, result[i])
            begin, end = (first + 1) * points, last * points
            _fill_tests(instants[begin:end], steps[begin:end], c, big_l, tests)
            for g in range(len(orders)):
                result[i, g] += inner(tests[orders[g], : end - begin], signals[g, begin:end])
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
    fractions, weights = gauss_rule(nodes.points)
    instants, steps = nodes.flat
    return _project(nodes.time, instants, steps, stacked, orders, centres, half, fractions, weights)


@njit_sums
def _add_test(instants: Array, c: float, big_l: float, factor: float, order: int, result: Array) -> None:
    """Add factor · φ^(order), by s, at the instants."""
    inverse = 1.0 / big_l
    for k in range(len(instants)):
        result[k] += factor * phi((instants[k] - c) * inverse, order)


@njit
def superpose(instants: Array, centres: Array, half: Array, factors: Array, order: int) -> Array:
    """Σ_i factors_i φ_i^(order)(t) at rising `instants`: the adjoint of `project`, one value per instant."""
    result = np.zeros(len(instants))
    for i in range(len(centres)):
        begin = rows_before(instants, centres[i] - half[i], False)
        end = rows_before(instants, centres[i] + half[i], False)
        factor = factors[i] / half[i] ** order
        _add_test(instants[begin:end], centres[i], half[i], factor, order, result[begin:end])
    return result


@njit
def project_steps(edges: Array, levels: Array, centres: Array, half: Array) -> Array:
    """∫φ x dt of a piecewise constant x, exactly: `levels[j]` holds from `edges[j]` to `edges[j+1]`, 0 outside."""
    result = np.zeros(len(centres))
    for i in range(len(centres)):
        c, big_l = centres[i], half[i]
        j = max(0, rows_before(edges, c - big_l, False) - 1)
        while j < len(levels) and edges[j] < c + big_l:
            result[i] += (
                levels[j] * big_l * (phi_integral((edges[j + 1] - c) / big_l) - phi_integral((edges[j] - c) / big_l))
            )
            j += 1
    return result


@njit
def project_impulses(instants: Array, strengths: Array, centres: Array, half: Array) -> Array:
    """Σ_j strengths_j φ(t_j): the modulated integral of impulses at rising `instants`."""
    result = np.zeros(len(centres))
    for i in range(len(centres)):
        j = rows_before(instants, centres[i] - half[i], False)
        while j < len(instants) and instants[j] < centres[i] + half[i]:
            result[i] += strengths[j] * phi((instants[j] - centres[i]) / half[i], 0)
            j += 1
    return result


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


def overlaps(
    weights: Array, centres: Array, half: Array, lags: int, reach: int, gravity: float
) -> tuple[tuple[float, float], tuple[float, float]]:
    """What white noise of power 1 gives Σ weights ∫g noise: Σ Σ w w ∫g g with this `gravity` and without.

    Then the same as Bartlett's weights, which end after `reach` neighbours, sum it. Windows up to lags − 1 apart count
    as overlapping; weights hold what scales g, as half^(−3/2).
    """
    grid, (curved, crossed, plain) = _overlap_table()
    sums = _overlaps(weights, centres, half, lags, reach, grid[1], curved, crossed, plain)
    true, tapered = [(one + gravity * (2 * two + gravity * three), one) for one, two, three in sums.tolist()]
    return true, tapered


SLOPE_POWER = 3072 / 1155
"""∫φ'² over the support of half-length 1."""


def rate_overlaps(weights: Array, centres: Array, half: Array, lags: int, reach: int) -> tuple[float, float]:
    """As `overlaps`, of Σ weights ∫φ' noise: for white noise of a rate, of which ∫φ'' of its integral is −∫φ'.

    weights hold half^(−1/2). ∫φ'φ' = −∫φ''φ.
    """
    grid, (curved, crossed, plain) = _overlap_table()
    sums = _overlaps(weights, centres, half, lags, reach, grid[1], curved, crossed, plain)
    return -float(sums[0, 1]), -float(sums[1, 1])


@njit
def _overlaps(
    weights: Array,
    centres: Array,
    half: Array,
    lags: int,
    reach: int,
    step: float,
    curved: Array,
    crossed: Array,
    plain: Array,
) -> Array:
    result = np.zeros((2, 3))
    for lag in range(min(lags, len(weights))):
        one = two = three = 0.0
        for i in range(len(weights) - lag):
            place = abs(centres[i + lag] - centres[i]) / (half[i + lag] * step)
            k = min(int(place), len(curved) - 2)
            share = min(place - k, 1.0)
            pair = weights[i] * weights[i + lag]
            one += pair * (curved[k] + share * (curved[k + 1] - curved[k]))
            two += pair * (crossed[k] + share * (crossed[k + 1] - crossed[k]))
            three += pair * (plain[k] + share * (plain[k + 1] - plain[k]))
        both = 2.0 if lag else 1.0
        sums = np.array([both * one, both * two, both * three])
        result[0] += sums
        result[1] += max(0.0, 1.0 - lag / (reach + 1.0)) * sums
    return result


@cache
def _overlap_table() -> tuple[Array, tuple[Array, Array, Array]]:
    """∫φ''φ'', ∫φ''φ and ∫φφ on a grid of distances fine enough for linear interpolation to 1e-6 of the maximum."""
    grid = np.linspace(0, 2, 4001)
    d = grid[:, None]
    x, w = gauss_rule(7)
    s = d - 1 + (2 - d) * x
    shifted, weights = s - d, (2 - d) * w
    phi, curvature = (1 - s * s) ** 3, _curvature(s)
    return grid, (
        (weights * curvature * _curvature(shifted)).sum(axis=1),
        (weights * curvature * (1 - shifted * shifted) ** 3).sum(axis=1),
        (weights * phi * (1 - shifted * shifted) ** 3).sum(axis=1),
    )


def _curvature(s: Array) -> Array:
    p = 1 - s * s
    return -6 * p * (p - 4 * s * s)


@njit
def _project_hats(
    time: Array, nodes: Array, knots: Array, centres: Array, half: Array, fractions: Array, weights: Array
) -> Array:
    points = nodes.shape[1]
    place = np.empty(nodes.shape, np.int64)
    share = np.empty(nodes.shape)
    at = 0
    for k in range(nodes.shape[0]):
        for j in range(points):
            # the speed changes little from node to node
            while at < len(knots) - 2 and nodes[k, j] > knots[at + 1]:
                at += 1
            while at > 0 and nodes[k, j] <= knots[at]:
                at -= 1
            place[k, j] = at
            share[k, j] = min(max((nodes[k, j] - knots[at]) / (knots[at + 1] - knots[at]), 0.0), 1.0)
    result = np.zeros((len(centres), len(knots)))
    for i in range(len(centres)):
        k = max(rows_before(time, centres[i] - half[i], False) - 1, 0)
        while k < len(time) - 1 and time[k] < centres[i] + half[i]:
            h = time[k + 1] - time[k]
            for j in range(points):
                s = (time[k] + h * fractions[j] - centres[i]) / half[i]
                if abs(s) < 1.0:
                    w = h * weights[j] * phi(s, 0)
                    result[i, place[k, j]] += w * (1.0 - share[k, j])
                    result[i, place[k, j] + 1] += w * share[k, j]
            k += 1
    return result


def project_hats(nodes: GaussNodes, signal: Array, knots: Array, centres: Array, half: Array) -> Array:
    """∫φ Λ_j(x) dt for the hat functions Λ_j on rising `knots`; returns (windows, knots).

    The modulated integral of any function f(x) is then ``hats @ f(knots)``, up to its piecewise linear interpolation.
    Values of x beyond the knots count for the outermost one.
    """
    fractions, weights = gauss_rule(nodes.points)
    return _project_hats(nodes.time, signal, knots, centres, half, fractions, weights)
