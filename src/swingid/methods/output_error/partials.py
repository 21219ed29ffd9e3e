"""Partial derivatives of the equations of motion, for exact sensitivities: by state and by constant.

Equations (I) and (II) are M q'' = r, so ∂q''/∂θ = M⁻¹ (∂r/∂θ − ∂M/∂θ q''). All of this is within one mode (both
sides of sliding and the branch of the dead zone given), where r is smooth.
"""

from __future__ import annotations

import math

from swingid.model import parameters as at
from swingid.model.further import further_row, further_slopes
from swingid.model.motor import branch_torque
from swingid.numerics.arrays import Array
from swingid.numerics.compiled import njit_inlined


@njit_inlined
def friction_slope(v: float, s: int, p: Array) -> float:
    """∂F/∂v (N m s) of an axis that slides towards side s at speed v (rad/s); no LuGre."""
    coulomb, static, viscous = p[at.COULOMB_N], p[at.STATIC_N], p[at.VISCOUS_N]
    if s > 0:
        coulomb, static, viscous = p[at.COULOMB_P], p[at.STATIC_P], p[at.VISCOUS_P]
    slope = viscous + v * (2.0 * s * p[at.QUADRATIC] + 3.0 * v * p[at.CUBIC])
    if static != coulomb and p[at.STRIBECK_SPEED] > 0.0:
        x = v / p[at.STRIBECK_SPEED]
        slope -= s * (static - coulomb) * math.exp(-x * x) * 2.0 * x / p[at.STRIBECK_SPEED]
    return float(slope)


@njit_inlined
def sliding_slopes(q1: float, cosine: float, v: float, s: int, p: Array) -> tuple[float, float]:
    """Derivatives of all torques of a sliding axis by its angle (N m/rad) and speed (N m s); cosine: of the angle."""
    by_angle, by_speed = float(p[at.B] * cosine), friction_slope(v, s, p)
    if p[at.FURTHER] != 0.0:
        more = further_slopes(q1, v, s, p)
        by_angle, by_speed = by_angle + more[0], by_speed + more[1]
    return by_angle, by_speed


@njit_inlined
def sliding_row(q1: float, sine: float, v: float, s: int, p: Array, row: Array) -> None:
    """∂r1/∂p into the places of `row` (SIZE,): −sin q1 for b, those of −F, and those of the further terms."""
    row[at.B] = -sine
    peak = 0.0
    if p[at.STRIBECK_SPEED] > 0.0:
        x = v / p[at.STRIBECK_SPEED]
        peak = math.exp(-x * x)
        height = p[at.STATIC_P] - p[at.COULOMB_P] if s > 0 else p[at.STATIC_N] - p[at.COULOMB_N]
        row[at.STRIBECK_SPEED] = -s * height * peak * 2.0 * x * x / p[at.STRIBECK_SPEED]
    up, down = (1.0 if s > 0 else 0.0), (1.0 if s < 0 else 0.0)
    row[at.VISCOUS_P], row[at.VISCOUS_N] = -v * up, -v * down
    row[at.COULOMB_P], row[at.COULOMB_N] = -(1.0 - peak) * up, (1.0 - peak) * down
    row[at.STATIC_P], row[at.STATIC_N] = -peak * up, peak * down
    row[at.QUADRATIC], row[at.CUBIC], row[at.OFFSET] = -s * v * v, -v * v * v, -1.0
    if p[at.FURTHER] != 0.0:
        further_row(q1, v, s, p, row)


@njit_inlined
def motor_row(u: float, v2: float, s2: int, branch: int, p: Array, row: Array) -> None:
    """∂r2/∂p into the places of `row` (SIZE,) that equation (II) contains: gear, motor and its friction."""
    n, active = p[at.GEAR], (1.0 if branch != 0 else 0.0)
    row[at.GEAR] = branch_torque(u, v2, branch, p) - p[at.F3] * s2 - 2.0 * p[at.F2] * n * v2
    row[at.C1], row[at.C2] = active * n * p[at.ETA] * u, -active * n * p[at.ETA] * v2
    row[at.ETA] = active * n * (p[at.C1] * u - p[at.C2] * v2)
    row[at.D1], row[at.D2] = (-n if branch > 0 else 0.0), (-n if branch < 0 else 0.0)
    row[at.F2], row[at.F3] = -n * n * v2, -n * s2


@njit_inlined
def mass_rows(a1: float, a2: float, row1: Array, row2: Array) -> None:
    """−∂M/∂p q'' into `row1`, `row2` (SIZE,) for accelerations a1, a2 (rad/s²)."""
    row1[at.A11], row1[at.A12], row1[at.A22] = -a1, -a2, 0.0
    row2[at.A11], row2[at.A12], row2[at.A22] = 0.0, -a1, -a2
