"""The further terms of equation (I) in the compiled model: sums over slots of the vector of constants.

A slot holds what the registry (`terms`) records of a term: coefficient c, shift and order of g(q), kind of g, power and
parity of the speed. Its torque is c (sgn v)^odd |v|^power g(q). Side s = +1 or −1 of sliding as in `friction`.

Arguments: q in rad, v in rad/s, p the vector (SIZE,) of `parameters`. On a linear axis m, m/s, N.
"""

from __future__ import annotations

from swingid.model import shapes
from swingid.model.parameters import COEFFICIENT, FIRST_SLOT, FURTHER, KIND, ODD, ORDER, POWER, SHIFT, SLOT
from swingid.numerics.arrays import Array
from swingid.numerics.compiled import njit_called, place

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


_factor, _integral = njit_called(shapes.angle_factor), njit_called(shapes.angle_integral)
_slope, _by_shift = njit_called(shapes.angle_slope), njit_called(shapes.shift_slope)
_powers = njit_called(shapes.half_powers)


@njit_called
def angle_factor(q: float, i: int, p: Array) -> float:
    """g(q) of the slot at place i."""
    return float(_factor(p[i + KIND], q, p[i + ORDER], p[i + SHIFT]))


@njit_called
def angle_slope(q: float, i: int, p: Array) -> float:
    """dg/dq of the slot at place i."""
    return float(_slope(p[i + KIND], q, p[i + ORDER], p[i + SHIFT]))


@njit_called
def angle_energy(q: float, i: int, p: Array) -> float:
    """∫g dq from 0 to q of the slot at place i, of a term that has a potential energy."""
    return float(_integral(p[i + KIND], q, p[i + ORDER], p[i + SHIFT]))


@njit_called
def speed_factor(v: float, s: int, i: int, p: Array) -> float:
    """(sgn v)^odd |v|^power of the slot at place i, sliding towards side s."""
    factor = 1.0 if p[i + ODD] == 0.0 else float(s)
    return float(factor * _powers(s * v, p[i + POWER]))


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
            slope = power * _powers(s * v, power - 1.0) * (s if p[i + ODD] == 0.0 else 1)
            by_speed += p[i + COEFFICIENT] * slope * angle_factor(q, i, p)
    return by_angle, by_speed


@njit_called
def further_row(q: float, v: float, s: int, p: Array, row: Array) -> None:
    """Derivative of minus the further torque by the coefficients and shifts, into their places of `row` (SIZE,)."""
    for k in range(int(p[FURTHER])):
        i = FIRST_SLOT + SLOT * k
        factor = speed_factor(v, s, i, p)
        row[i + COEFFICIENT] = -factor * angle_factor(q, i, p)
        by_shift = _by_shift(p[i + KIND], q, p[i + ORDER], p[i + SHIFT])
        row[i + SHIFT] = -p[i + COEFFICIENT] * factor * by_shift
