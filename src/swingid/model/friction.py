"""Friction of the axis, F(q1'), as it stands on the left of row (I): positive against positive motion.

Sliding friction is smooth on each side of rest, so the side s = +1 or -1 is an argument: an integrator that
knows on which side it is sees no jump. Rest is no value of F but a state of its own, in which friction is
whatever holds the axis, up to the release torque (`release_margin`); nothing here smooths a sign.

Static curve: s (Fc + (Fs - Fc) exp(-(v/vs)^2)) + viscous v + quadratic v|v| + cubic v^3 + offset. LuGre
(Canudas de Wit et al. 1995) replaces the first term by sigma0 z + sigma1 z' with the bristle deflection z.
"""

from __future__ import annotations

import math

from swingid.model.further import further_friction, further_level
from swingid.model.parameters import (
    COULOMB_N,
    COULOMB_P,
    CUBIC,
    FURTHER,
    OFFSET,
    QUADRATIC,
    SIGMA0,
    SIGMA1,
    STATIC_N,
    STATIC_P,
    STRIBECK_SPEED,
    VISCOUS_N,
    VISCOUS_P,
)
from swingid.numerics.arrays import Array
from swingid.numerics.compiled import njit_inlined


@njit_inlined
def dry_level(v: float, s: int, p: Array) -> float:
    """Coulomb and Stribeck level g(v) >= 0 (N m) on side s at speed v (rad/s)."""
    coulomb, static = p[COULOMB_N], p[STATIC_N]
    if s > 0:
        coulomb, static = p[COULOMB_P], p[STATIC_P]
    if static == coulomb or p[STRIBECK_SPEED] == 0.0:
        return float(coulomb)
    x = v / p[STRIBECK_SPEED]
    return float(coulomb + (static - coulomb) * math.exp(-x * x))


@njit_inlined
def wet_friction(v: float, s: int, p: Array) -> float:
    """Viscous, quadratic, cubic and offset torque (N m) on side s at speed v (rad/s)."""
    viscous = p[VISCOUS_P] if s > 0 else p[VISCOUS_N]
    return float(v * (viscous + v * (s * p[QUADRATIC] + v * p[CUBIC])) + p[OFFSET])


@njit_inlined
def bristle_rate(v: float, s: int, z: float, p: Array) -> float:
    """Z' = v - sigma0 |v| z / g(v) (rad/s) of LuGre; 0 where the rig has no bristles."""
    if p[SIGMA0] == 0.0:
        return 0.0
    return float(v - p[SIGMA0] * s * v * z / dry_level(v, s, p))


@njit_inlined
def sliding_friction(v: float, s: int, z: float, p: Array) -> float:
    """F (N m) of an axis that slides towards side s at speed v (rad/s) with bristle deflection z (rad)."""
    if p[SIGMA0] == 0.0:
        return s * dry_level(v, s, p) + wet_friction(v, s, p)
    return float(p[SIGMA0] * z + p[SIGMA1] * bristle_rate(v, s, z, p) + wet_friction(v, s, p))


@njit_inlined
def static_curve(v: float, p: Array) -> float:
    """F (N m) in steady sliding at speed v (rad/s); at v = 0 the offset alone, as sign 0 = 0.

    For plots and comparisons, and for laws without memory; LuGre's curve is the one it settles to.
    """
    if v == 0.0:
        return float(p[OFFSET])
    s = 1 if v > 0.0 else -1
    return s * dry_level(v, s, p) + wet_friction(v, s, p)


@njit_inlined
def release_margin(hold: float, q: float, p: Array) -> float:
    """How far (N m) an axis at rest at q (rad) is from release when friction must supply `hold` (N m); < 0: none."""
    dry = hold - p[OFFSET]
    level = further_level(q, p) if p[FURTHER] != 0.0 else 0.0
    return float(min(p[STATIC_P] + level - dry, p[STATIC_N] + level + dry))


@njit_inlined
def axis_friction(q: float, v: float, s: int, z: float, p: Array) -> float:
    """All friction (N m) of an axis that slides at the angle q (rad); arguments as `sliding_friction`."""
    if p[FURTHER] == 0.0:
        return sliding_friction(v, s, z, p)
    return sliding_friction(v, s, z, p) + further_friction(q, v, s, p)
