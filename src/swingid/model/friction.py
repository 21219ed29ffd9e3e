"""Friction of the axis, F(q1'), as it stands on the left of equation (I): positive against positive motion.

Sliding friction is smooth on each side of rest, so the side s = +1 or -1 is an argument: an integrator that
stays on one side meets no jump. Rest is no value of F but a state of its own, in which friction is
whatever holds the axis, up to the release torque (`release_margin`); nothing here smooths a sign.

Static curve: s (Fc + (Fs - Fc) exp(-(v/vs)^2)) + viscous v + quadratic v|v| + cubic v^3 + offset. LuGre
(Canudas de Wit et al. 1995) replaces the first term by sigma0 z + sigma1 z' with the bristle deflection z.
"""

from __future__ import annotations

import math

from swingid.model import parameters as at
from swingid.model.further import DRY, POSITIVE, further_torque
from swingid.numerics.arrays import Array
from swingid.numerics.compiled import njit_inlined


@njit_inlined
def dry_level(v: float, s: int, p: Array) -> float:
    """Coulomb and Stribeck level g(v) >= 0 (N m) on side s at speed v (rad/s)."""
    coulomb, static = p[at.COULOMB_N], p[at.STATIC_N]
    if s > 0:
        coulomb, static = p[at.COULOMB_P], p[at.STATIC_P]
    if static == coulomb or p[at.STRIBECK_SPEED] == 0.0:
        return float(coulomb)
    x = v / p[at.STRIBECK_SPEED]
    return float(coulomb + (static - coulomb) * math.exp(-x * x))


@njit_inlined
def wet_friction(v: float, s: int, p: Array) -> float:
    """Viscous, quadratic, cubic and offset torque (N m) on side s at speed v (rad/s)."""
    viscous = p[at.VISCOUS_P] if s > 0 else p[at.VISCOUS_N]
    return float(v * (viscous + v * (s * p[at.QUADRATIC] + v * p[at.CUBIC])) + p[at.OFFSET])


@njit_inlined
def bristle_rate(v: float, s: int, z: float, p: Array) -> float:
    """Z' = v - sigma0 |v| z / g(v) (rad/s) of LuGre; 0 where the rig has no bristles."""
    if p[at.SIGMA0] == 0.0:
        return 0.0
    return float(v - p[at.SIGMA0] * s * v * z / dry_level(v, s, p))


@njit_inlined
def sliding_friction(v: float, s: int, z: float, p: Array) -> float:
    """F (N m) of an axis that slides towards side s at speed v (rad/s) with bristle deflection z (rad)."""
    if p[at.SIGMA0] == 0.0:
        return s * dry_level(v, s, p) + wet_friction(v, s, p)
    return float(p[at.SIGMA0] * z + p[at.SIGMA1] * bristle_rate(v, s, z, p) + wet_friction(v, s, p))


@njit_inlined
def static_curve(v: float, p: Array) -> float:
    """F (N m) in steady sliding at speed v (rad/s); at v = 0 the offset alone, as sign 0 = 0.

    For plots and comparisons, and for static laws; of LuGre, the curve of its steady state.
    """
    if v == 0.0:
        return float(p[at.OFFSET])
    s = 1 if v > 0.0 else -1
    return s * dry_level(v, s, p) + wet_friction(v, s, p)


@njit_inlined
def release_margin(hold: float, q: float, p: Array) -> float:
    """How far (N m) an axis at rest at q (rad) is from release when friction must supply `hold` (N m); < 0: none."""
    dry = hold - p[at.OFFSET]
    level = further_torque(q, 0.0, POSITIVE, DRY, p) if p[at.FURTHER] != 0.0 else 0.0
    return float(min(p[at.STATIC_P] + level - dry, p[at.STATIC_N] + level + dry))
