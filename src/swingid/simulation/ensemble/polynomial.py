"""The speed within a step as a polynomial: its values, its integral, where it passes a level."""

from __future__ import annotations

from swingid.numerics.arrays import Array
from swingid.simulation.ensemble.lane_functions import njit_lane

TERMS = 9
"""Terms of the series here: more than in the lanes, since Stribeck's peak is passed within a step. A constant, so that
the compiler unrolls its loops."""

INVERSES = tuple(1.0 / max(k, 1) for k in range(TERMS + 2))

MOST_TRIALS = 60


@njit_lane
def last_terms(v: Array) -> float:
    """How large the last terms of a series are; two, because one may be small by chance."""
    return float(abs(v[TERMS]) + 0.1 * abs(v[TERMS - 1]))


@njit_lane
def value(v: Array, x: float) -> float:
    """Speed (rad per step) at the fraction x of a step."""
    total = float(v[TERMS])
    for k in range(TERMS - 1, -1, -1):
        total = total * x + v[k]
    return total


@njit_lane
def grade(v: Array, x: float) -> float:
    """Derivative of `value` (rad per step^2)."""
    total = float(TERMS * v[TERMS])
    for k in range(TERMS - 1, 0, -1):
        total = total * x + k * v[k]
    return total


@njit_lane
def passed(v: Array, x: float) -> float:
    """Angle (rad) passed at the fraction x of a step: the integral of `value`."""
    total = float(v[TERMS]) * INVERSES[TERMS + 1]
    for k in range(TERMS - 1, -1, -1):
        total = total * x + v[k] * INVERSES[k + 1]
    return total * x


@njit_lane
def root(v: Array, end: float, level: float) -> float:
    """Fraction of a step at which the speed passes `level`, which lies between its values at the start and `end`."""
    low, high, at_low = 0.0, 1.0, v[0] - level
    x = float(at_low / (v[0] - end))
    for _ in range(MOST_TRIALS):
        there = value(v, x) - level
        if there * at_low > 0.0:
            low = x
        else:
            high = x
        slope = grade(v, x)
        following = x - there / slope if slope != 0.0 else 0.5 * (low + high)
        if not low < following < high:
            following = 0.5 * (low + high)
        if abs(following - x) < 1e-14:
            return following
        x = following
    return x
