"""Running integrals of signals on Gauss nodes, at any instants between the samples."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from swingid.numerics.compiled import njit
from swingid.numerics.quadrature import GaussNodes, gauss_rule

Array = NDArray[np.float64]


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


def running_integrals(nodes: GaussNodes, signals: list[Array], instants: Array) -> Array:
    """∫ x dt from the first sample to each of the rising `instants` (s), for every x given at the nodes.

    signals: arrays (n−1, points). Returns (signals, instants). Inside an interval that an instant cuts, x is the
    polynomial through its nodes, so a held signal's jump at the samples costs nothing.
    """
    fractions, weights = gauss_rule(nodes.points)
    return _running(nodes.time, np.stack(signals), instants, _antiderivatives(fractions), fractions, weights)


def _antiderivatives(fractions: Array) -> Array:
    """Coefficients of s, s², … of ∫₀ˢ of each Lagrange polynomial on `fractions`, shape (points, points)."""
    powers = np.arange(len(fractions))
    lagrange = np.asarray(np.linalg.inv(fractions[:, None] ** powers).T, dtype=np.float64)
    result: Array = lagrange / (powers + 1)
    return result
