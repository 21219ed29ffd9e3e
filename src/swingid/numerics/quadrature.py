"""Gauss nodes between the samples of a log: one quadrature for regular, irregular and incomplete time stamps.

A trapezoid on irregular stamps is first-order wrong and averages a held voltage over its jump. Here every
interval between two samples carries its own Gauss–Legendre nodes; a measured angle is continued into them by
a cubic spline, a held signal by its constant. Integrals run from sample to sample or to any instant between.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np

from swingid.numerics.arrays import Array, Ints, median, sums_at
from swingid.numerics.spline import intervals, spline_slopes


@cache
def gauss_rule(points: int) -> tuple[Array, Array]:
    """Nodes and weights of the Gauss–Legendre rule on [0, 1]."""
    x, w = np.polynomial.legendre.leggauss(points)
    return (x + 1) / 2, w / 2


def _hermite(time: Array, values: Array, slopes: Array, fractions: Array, derivative: int) -> Array:
    h, rise, s = np.diff(time)[:, None], np.diff(values)[:, None], fractions
    before, after = slopes[:-1, None], slopes[1:, None]
    c2 = 3 * rise - h * (2 * before + after)
    c3 = h * (before + after) - 2 * rise
    nodes: Array
    if derivative == 0:
        nodes = values[:-1, None] + s * (h * before + s * (c2 + s * c3))
    else:
        nodes = before + s * (2 * c2 + 3 * s * c3) / h
    return nodes


@dataclass(frozen=True)
class GaussNodes:
    """Gauss nodes of all intervals of `time` (n stamps, strictly rising, in s); arrays of nodes are (n−1, points)."""

    time: Array
    points: int = 2

    @property
    def fractions(self) -> Array:
        """Nodes of the rule on [0, 1]."""
        return gauss_rule(self.points)[0]

    @cached_property
    def instants(self) -> Array:
        """Times of the nodes in s."""
        return self.time[:-1, None] + np.diff(self.time)[:, None] * self.fractions

    @cached_property
    def weights(self) -> Array:
        """Weights of the nodes in s: the integral of x is ``(weights * x).sum()``."""
        result: Array = np.diff(self.time)[:, None] * gauss_rule(self.points)[1]
        return result

    @cached_property
    def tests(self) -> dict[bytes, Any]:
        """What `test_functions` keeps for windows on these nodes."""
        return {}

    @cached_property
    def flat(self) -> tuple[Array, Array]:
        """Instants and weights of all nodes in one row each."""
        return self.instants.ravel(), self.weights.ravel()

    def spline(self, values: Array, derivative: int = 0) -> Array:
        """The natural cubic spline through `values`, or its first derivative, at the nodes."""
        return _hermite(self.time, values, spline_slopes(self.time, values), self.fractions, derivative)

    def hold(self, values: Array, ahead: float = 0.0) -> Array:
        """A signal that keeps the value of row k from t_k to t_(k+1), at the nodes.

        With `ahead` (s): as it is so much after each instant. Its jumps then fall between the stamps, so every interval
        gets the straight line that has the signal's integral and first moment there (an error of third order).
        """
        if ahead == 0.0:
            return np.repeat(values[:-1, None], self.points, axis=1)
        time, steps = self.time, np.diff(self.time)
        once = np.concatenate([[0.0], np.cumsum(values[:-1] * steps)])
        twice = np.concatenate([[0.0], np.cumsum(once[:-1] * steps + values[:-1] * steps**2 / 2)])
        later = time + ahead
        row = np.clip(np.searchsorted(time, later, side="right") - 1, 0, len(time) - 2)
        past = later - time[row]
        first = once[row] + values[row] * past
        second = twice[row] + once[row] * past + values[row] * past**2 / 2
        mean = np.diff(first) / steps
        # integral of (t − t_k) x from t_k to t_(k+1), by parts
        moment = first[1:] * steps - np.diff(second)
        slope = 12 * (moment / steps**2 - mean / 2)
        line: Array = mean[:, None] + slope[:, None] * (self.fractions - 0.5)
        return line


def running_integrals(nodes: GaussNodes, signals: Iterable[Array], instants: Array) -> Array:
    """∫ x dt from the first sample to each of the rising `instants` (s), for every x given at the nodes.

    signals: each (n−1, points). Returns (signals, instants). Inside an interval that an instant cuts, x is the
    polynomial through its nodes, so a held signal's jump at the samples costs nothing.
    """
    k, cut = _cut_intervals(nodes, instants)
    steps, (_, weights), whole = np.diff(nodes.time), gauss_rule(nodes.points), np.zeros(len(nodes.time))
    integrals = []
    for signal in signals:
        np.cumsum((signal @ weights) * steps, out=whole[1:])
        integrals.append(whole[k] + np.einsum("ij,ij->i", signal[k], cut))
    return np.array(integrals)


def _cut_intervals(nodes: GaussNodes, instants: Array) -> tuple[Ints, Array]:
    """The interval of each instant, and the weights (instants, points) of its nodes in ∫ dt from its begin."""
    k = intervals(nodes.time, instants)
    h = nodes.time[k + 1] - nodes.time[k]
    powers = ((instants - nodes.time[k]) / h)[:, None] ** np.arange(1, nodes.points + 1)
    return k, h[:, None] * (powers @ antiderivatives(nodes.points).T)


@cache
def lagrange(points: int) -> Array:
    """Coefficients of 1, s, s² … (rows) of each Lagrange polynomial on the nodes of the rule (points, points)."""
    fractions, _ = gauss_rule(points)
    return np.asarray(np.linalg.inv(fractions[:, None] ** np.arange(points)), dtype=np.float64)


@cache
def antiderivatives(points: int) -> Array:
    """Coefficients of s, s², … of ∫₀ˢ of each Lagrange polynomial on the nodes of the rule, shape (points, points)."""
    result: Array = lagrange(points).T / np.arange(1, points + 1)
    return result


def running_hats(nodes: GaussNodes, values: Array, powers: Array, knots: Array, instants: Array) -> Array:
    """∫Λ_k(x) y dt from the first sample to each of the rising `instants` (s), for the hat functions Λ_k on `knots`.

    values x and powers y at the nodes, (n−1, points). Returns (knots, instants). The outermost hats go on flat.
    """
    k, cut = _cut_intervals(nodes, instants)
    last = len(knots) - 2
    place = np.clip(np.searchsorted(knots, values) - 1, 0, last)
    share = np.clip((values - knots[place]) / np.diff(knots)[place], 0.0, 1.0)
    size, shape = len(knots) * (len(instants) + 1), (len(instants) + 1, len(knots))
    # an interval counts for the instants behind it, the one that an instant cuts with other weights for that alone
    whole = np.searchsorted(k, np.arange(len(nodes.time) - 1), side="right")[:, None] * len(knots) + place
    parts = nodes.weights * powers
    total = sums_at(whole, parts * (1.0 - share), size)
    total += sums_at(whole + 1, parts * share, size)
    at, parts, share = np.arange(len(instants))[:, None] * len(knots) + place[k], cut * powers[k], share[k]
    rest = sums_at(at, parts * (1.0 - share), size)
    rest += sums_at(at + 1, parts * share, size)
    result: Array = (np.cumsum(total.reshape(shape), axis=0) + rest.reshape(shape))[:-1].T
    return result


def held_between(time: Array, values: Array) -> Array:
    """The mean (n−1,) from row to row of a logged voltage or torque (n,) that is held, values of lost
    rows on a straight line, each of them held.
    """
    gaps = np.diff(time)
    rows = np.maximum(np.rint(gaps / median(gaps)), 1.0)
    result: Array = values[:-1] + np.diff(values) * (rows - 1) / (2 * rows)
    return result
