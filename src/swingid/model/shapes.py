"""What the angle and the speed make of a term's regressor: g(q) by its kind, its slopes and its integral, powers.

Each is written once, for numbers and arrays alike: the methods call it with arrays, and `further` compiles it under
njit for the twin. So none calls another, and none branches by the value of an angle or a speed.

Arguments: kind of g; q in rad (m); order and shift, the numbers in g (shift in rad, of a displacement as q).
"""

from __future__ import annotations

from typing import Any

import numpy as np

Number = Any
"""A number or an array of numbers."""

# Kinds of g(q): 1, q − shift, sin(order q + shift), |cos q|, sin q / √(1 − order (1 − cos q)).
ONE, DISPLACEMENT, WAVE, WEIGHT, STRINGS = 0, 1, 2, 3, 4

FLATTEST = 1e-3
"""Least square of the strings' height over that at rest, 1 − order (1 − cos q): below it they are about to cross, and
the model ends."""


def angle_factor(kind: float, q: Number, order: float, shift: float) -> Number:
    """g(q)."""
    if kind == DISPLACEMENT:
        return q - shift
    if kind == WAVE:
        return np.sin(order * q + shift)
    if kind == STRINGS:
        return np.sin(q) / np.sqrt(np.maximum(1.0 - order * (1.0 - np.cos(q)), FLATTEST))
    return np.abs(np.cos(q)) if kind == WEIGHT else q**0


def angle_slope(kind: float, q: Number, order: float, shift: float) -> Number:
    """dg/dq."""
    if kind == DISPLACEMENT:
        return q**0
    if kind == WAVE:
        return order * np.cos(order * q + shift)
    if kind == STRINGS:
        square = np.maximum(1.0 - order * (1.0 - np.cos(q)), FLATTEST)
        return (np.cos(q) + 0.5 * order * np.sin(q) ** 2 / square) / np.sqrt(square)
    return -np.sign(np.cos(q)) * np.sin(q) if kind == WEIGHT else 0.0 * q


def shift_slope(kind: float, q: Number, order: float, shift: float) -> Number:
    """∂g/∂shift."""
    if kind == WAVE:
        return np.cos(order * q + shift)
    return 0.0 * q - (1.0 if kind == DISPLACEMENT else 0.0)


def angle_integral(kind: float, q: Number, order: float, shift: float) -> Number:
    """∫g dq from 0 to q of a torque that has a potential energy: of a displacement, a wave, strings."""
    if kind == DISPLACEMENT:
        return q * (0.5 * q - shift)
    if kind == WAVE:
        return (np.cos(shift) - np.cos(order * q + shift)) / order if order != 0.0 else np.sin(shift) * q
    height = np.sqrt(np.maximum(1.0 - order * (1.0 - np.cos(q)), FLATTEST))
    return 2.0 * (1.0 - np.cos(q)) / (1.0 + height)


def half_powers(x: Number, power: float) -> Number:
    """x^power of a whole or half-whole power, for x >= 0; a little below 0 its continuation."""
    result = x**0
    for _ in range(int(power)):
        result = result * x
    return result if power % 1.0 == 0.0 else result * np.sqrt(np.abs(x))
