"""Projections of functions of a signal on test functions, with hat functions of the signal's values as their basis."""

from __future__ import annotations

import numpy as np

from swingid.numerics.arrays import Array
from swingid.numerics.compiled import njit
from swingid.numerics.quadrature import GaussNodes, gauss_rule
from swingid.numerics.search import rows_before
from swingid.numerics.test_functions import phi


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

    The projection of any function f(x) is then ``hats @ f(knots)``, up to its piecewise linear interpolation.
    Values of x beyond the knots count for the outermost one.
    """
    fractions, weights = gauss_rule(nodes.points)
    return _project_hats(nodes.time, signal, knots, centres, half, fractions, weights)
