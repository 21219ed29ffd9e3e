"""Running integrals of signals on Gauss nodes, at any instants between the samples."""

from __future__ import annotations

from functools import cache

import numpy as np

from swingid.numerics.arrays import Array
from swingid.numerics.compiled import njit
from swingid.numerics.quadrature import GaussNodes, gauss_rule


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
