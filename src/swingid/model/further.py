"""The further terms of equation (I) in the compiled model: sums over slots of the vector of constants.

A slot holds what the registry (`terms`) records of a term: coefficient c, shift and order of g(q), kind of g, power and
parity of the speed. Its torque is c (sgn v)^odd |v|^power g(q). Side s = +1 or −1 of sliding as in `friction`.

Arguments: q in rad, v in rad/s, p the vector (SIZE,) of `parameters`. On a linear axis m, m/s, N.
"""

from __future__ import annotations

import math

from swingid.model.parameters import COEFFICIENT, FIRST_SLOT, FURTHER, KIND, ODD, ORDER, POWER, SHIFT, SLOT
from swingid.model.terms import DISPLACEMENT, STRINGS, WAVE, WEIGHT
from swingid.numerics.arrays import Array
from swingid.numerics.compiled import njit_called, place

FLATTEST = 1e-3
"""Least square of the strings' height over that at rest: below it they are about to cross, and the model ends."""

HELD, DRY, WET, ALL = map(place, (1, 2, 4, 7))
"""Kinds of terms by their speed: without it (springs, cogging), with its sign alone, with its size."""

POSITIVE = place(1)
"""The side towards which speeds are positive."""


@njit_called
def kind_of(i: int, p: Array) -> int:
    """`HELD`, `DRY` or `WET`: how the slot at place i depends on the speed."""
    if p[i + POWER] != 0.0:
        return WET
    return HELD if p[i + ODD] == 0.0 else DRY


@njit_called
def height_squared(q: float, shape: float) -> float:
    """(H(q)/H(0))² = 1 − ε (1 − cos q) of a body on strings, not below `FLATTEST`; shape: ε."""
    return max(1.0 - shape * (1.0 - math.cos(q)), FLATTEST)


@njit_called
def angle_factor(q: float, i: int, p: Array) -> float:
    """g(q) of the slot at place i."""
    kind = p[i + KIND]
    if kind == DISPLACEMENT:
        return float(q - p[i + SHIFT])
    if kind == WAVE:
        return math.sin(p[i + ORDER] * q + p[i + SHIFT])
    if kind == STRINGS:
        return math.sin(q) / math.sqrt(height_squared(q, p[i + ORDER]))
    return abs(math.cos(q)) if kind == WEIGHT else 1.0


@njit_called
def angle_slope(q: float, i: int, p: Array) -> float:
    """dg/dq of the slot at place i."""
    kind = p[i + KIND]
    if kind == DISPLACEMENT:
        return 1.0
    if kind == WAVE:
        return float(p[i + ORDER] * math.cos(p[i + ORDER] * q + p[i + SHIFT]))
    if kind == STRINGS:
        square = height_squared(q, p[i + ORDER])
        return float((math.cos(q) + 0.5 * p[i + ORDER] * math.sin(q) ** 2 / square) / math.sqrt(square))
    if kind == WEIGHT:
        return -math.sin(q) if math.cos(q) > 0.0 else math.sin(q)
    return 0.0


@njit_called
def angle_energy(q: float, i: int, p: Array) -> float:
    """∫g dq from 0 to q of the slot at place i, a displacement or a wave."""
    kind, shift, order = p[i + KIND], p[i + SHIFT], p[i + ORDER]
    if kind == DISPLACEMENT:
        return float(q * (0.5 * q - shift))
    if kind == WAVE:
        return float((math.cos(shift) - math.cos(order * q + shift)) / order)
    if kind == STRINGS:
        return float(2.0 * (1.0 - math.cos(q)) / (1.0 + math.sqrt(height_squared(q, order))))
    return q


@njit_called
def half_powers(x: float, power: float) -> float:
    """x^power of a whole or half-whole power, for x >= 0; a little below 0 its continuation."""
    result = 1.0
    for _ in range(int(power)):
        result *= x
    return result if power % 1.0 == 0.0 else float(result * math.sqrt(abs(x)))


@njit_called
def speed_factor(v: float, s: int, i: int, p: Array) -> float:
    """(sgn v)^odd |v|^power of the slot at place i, sliding towards side s."""
    factor = 1.0 if p[i + ODD] == 0.0 else float(s)
    return factor * half_powers(s * v, p[i + POWER])


@njit_called
def further_torque(q: float, v: float, s: int, kinds: int, p: Array) -> float:
    """Torque (N m) of the further terms of some kinds, the sum of `HELD`, `DRY` and `WET`.

    Of dry terms alone, towards the side 1: the torque up to which they hold a resting axis, in either direction.
    """
    total = 0.0
    for k in range(int(p[FURTHER])):
        i = FIRST_SLOT + SLOT * k
        if kinds & kind_of(i, p):
            total += p[i + COEFFICIENT] * speed_factor(v, s, i, p) * angle_factor(q, i, p)
    return total


@njit_called
def further_energy(q: float, p: Array) -> float:
    """Potential energy (J) of the further terms that do not depend on the motion; 0 at q = 0."""
    total = 0.0
    for k in range(int(p[FURTHER])):
        i = FIRST_SLOT + SLOT * k
        if kind_of(i, p) == HELD:
            total += p[i + COEFFICIENT] * angle_energy(q, i, p)
    return total


@njit_called
def further_slopes(q: float, v: float, s: int, p: Array) -> tuple[float, float]:
    """Derivatives of the further torque by the angle (N m/rad) and by the speed (N m s)."""
    by_angle = by_speed = 0.0
    for k in range(int(p[FURTHER])):
        i = FIRST_SLOT + SLOT * k
        by_angle += p[i + COEFFICIENT] * speed_factor(v, s, i, p) * angle_slope(q, i, p)
        power = p[i + POWER]
        if power > 0.0:
            slope = power * half_powers(s * v, power - 1.0) * (s if p[i + ODD] == 0.0 else 1)
            by_speed += p[i + COEFFICIENT] * slope * angle_factor(q, i, p)
    return by_angle, by_speed


@njit_called
def further_row(q: float, v: float, s: int, p: Array, row: Array) -> None:
    """Derivative of minus the further torque by the coefficients and shifts, into their places of `row` (SIZE,)."""
    for k in range(int(p[FURTHER])):
        i = FIRST_SLOT + SLOT * k
        factor = speed_factor(v, s, i, p)
        row[i + COEFFICIENT] = -factor * angle_factor(q, i, p)
        by_shift = 0.0
        if p[i + KIND] == DISPLACEMENT:
            by_shift = -1.0
        elif p[i + KIND] == WAVE:
            by_shift = math.cos(p[i + ORDER] * q + p[i + SHIFT])
        row[i + SHIFT] = -p[i + COEFFICIENT] * factor * by_shift
