"""Gauss nodes between the samples of a log: one quadrature for regular, irregular and incomplete time stamps.

A trapezoid on irregular stamps is first-order wrong and averages a held voltage over its jump. Here every
interval between two samples carries its own Gauss–Legendre nodes; a measured angle is continued into them by
a cubic spline, a held signal by its constant. Integrals run from sample to sample or to any instant between.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from swingid.numerics.arrays import Array, median
from swingid.numerics.compiled import njit
from swingid.numerics.spline import spline_slopes


@cache
def gauss_rule(points: int) -> tuple[Array, Array]:
    """Nodes and weights of the Gauss–Legendre rule on [0, 1]."""
    x, w = np.polynomial.legendre.leggauss(points)
    return (x + 1) / 2, w / 2


@njit
def _hermite(time: Array, values: Array, slopes: Array, fractions: Array, derivative: int) -> Array:
    nodes = np.empty((len(time) - 1, len(fractions)))
    for k in range(len(time) - 1):
        h = time[k + 1] - time[k]
        rise = values[k + 1] - values[k]
        c2 = 3 * rise - h * (2 * slopes[k] + slopes[k + 1])
        c3 = h * (slopes[k] + slopes[k + 1]) - 2 * rise
        for j in range(len(fractions)):
            s = fractions[j]
            if derivative == 0:
                nodes[k, j] = values[k] + s * (h * slopes[k] + s * (c2 + s * c3))
            else:
                nodes[k, j] = slopes[k] + s * (2 * c2 + 3 * s * c3) / h
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

    @property
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


@njit
def _running(
    time: Array, signals: Array, instants: Array, antiderivatives: Array, fractions: Array, weights: Array
) -> Array:
    count, points = signals.shape[0], len(fractions)
    result = np.empty((count, len(instants)))
    for g in range(count):
        total = 0.0
        k = 0
        for i in range(len(instants)):
            while k < len(time) - 2 and time[k + 1] <= instants[i]:
                part = 0.0
                for j in range(points):
                    part += weights[j] * signals[g, k, j]
                total += (time[k + 1] - time[k]) * part
                k += 1
            h = time[k + 1] - time[k]
            s = (instants[i] - time[k]) / h
            rest = 0.0
            for j in range(points):
                weight, power = 0.0, s
                for m in range(points):
                    weight += antiderivatives[j, m] * power
                    power *= s
                rest += weight * signals[g, k, j]
            result[g, i] = total + h * rest
    return result


def running_integrals(nodes: GaussNodes, signals: Array, instants: Array) -> Array:
    """∫ x dt from the first sample to each of the rising `instants` (s), for every x given at the nodes.

    signals: (signals, n−1, points). Returns (signals, instants). Inside an interval that an instant cuts, x is the
    polynomial through its nodes, so a held signal's jump at the samples costs nothing.
    """
    fractions, weights = gauss_rule(nodes.points)
    return _running(nodes.time, signals, instants, antiderivatives(nodes.points), fractions, weights)


@cache
def antiderivatives(points: int) -> Array:
    """Coefficients of s, s², … of ∫₀ˢ of each Lagrange polynomial on the nodes of the rule, shape (points, points)."""
    fractions, _ = gauss_rule(points)
    powers = np.arange(len(fractions))
    lagrange = np.asarray(np.linalg.inv(fractions[:, None] ** powers).T, dtype=np.float64)
    result: Array = lagrange / (powers + 1)
    return result


@njit
def _running_hats(
    time: Array, values: Array, powers: Array, knots: Array, instants: Array, anti: Array, weights: Array
) -> Array:
    points, last = len(weights), len(knots) - 1
    total, result = np.zeros(len(knots)), np.empty((len(knots), len(instants)))
    place, share = np.empty(points, np.int64), np.empty(points)
    k, at, fresh = 0, 0, True
    for i in range(len(instants)):
        while True:
            h = time[k + 1] - time[k]
            if fresh:
                for j in range(points):
                    x = values[k, j]  # which changes little from node to node
                    while at < last - 1 and x > knots[at + 1]:
                        at += 1
                    while at > 0 and x <= knots[at]:
                        at -= 1
                    place[j], share[j] = at, min(max((x - knots[at]) / (knots[at + 1] - knots[at]), 0.0), 1.0)
                fresh = False
            if k >= len(time) - 2 or time[k + 1] > instants[i]:
                break
            for j in range(points):
                part = h * weights[j] * powers[k, j]
                total[place[j]] += part * (1.0 - share[j])
                total[place[j] + 1] += part * share[j]
            k, fresh = k + 1, True
        result[:, i] = total
        s = (instants[i] - time[k]) / h
        for j in range(points):
            weight, power = 0.0, s
            for m in range(points):
                weight += anti[j, m] * power
                power *= s
            part = h * weight * powers[k, j]
            result[place[j], i] += part * (1.0 - share[j])
            result[place[j] + 1, i] += part * share[j]
    return result


def running_hats(nodes: GaussNodes, values: Array, powers: Array, knots: Array, instants: Array) -> Array:
    """∫Λ_k(x) y dt from the first sample to each of the rising `instants` (s), for the hat functions Λ_k on `knots`.

    values x and powers y at the nodes, (n−1, points). Returns (knots, instants). The outermost hats go on flat.
    """
    weights = gauss_rule(nodes.points)[1]
    return _running_hats(nodes.time, values, powers, knots, instants, antiderivatives(nodes.points), weights)


def held_between(time: Array, values: Array) -> Array:
    """The mean (n−1,) from row to row of a logged voltage or torque (n,) that is held, values of lost
    rows on a straight line, each of them held.
    """
    gaps = np.diff(time)
    rows = np.maximum(np.rint(gaps / median(gaps)), 1.0)
    result: Array = values[:-1] + np.diff(values) * (rows - 1) / (2 * rows)
    return result
