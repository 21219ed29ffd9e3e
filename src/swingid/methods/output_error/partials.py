"""Partial derivatives of the equations of motion, for exact sensitivities: by state and by constant.

Rows (I) and (II) are M q'' = r, so ∂q''/∂θ = M⁻¹ (∂r/∂θ − ∂M/∂θ q''). Everything here holds within one mode (both
sides of sliding and the branch of the dead zone given), where r is smooth.
"""

from __future__ import annotations

import math

from swingid.model.further import further_row, further_slopes
from swingid.model.motor import branch_torque
from swingid.model.parameters import (
    A11,
    A12,
    A22,
    C1,
    C2,
    COULOMB_N,
    COULOMB_P,
    CUBIC,
    D1,
    D2,
    ETA,
    F2,
    F3,
    FURTHER,
    GEAR,
    OFFSET,
    QUADRATIC,
    STATIC_N,
    STATIC_P,
    STRIBECK_SPEED,
    VISCOUS_N,
    VISCOUS_P,
    B,
)
from swingid.numerics.arrays import Array
from swingid.numerics.compiled import njit_inlined


@njit_inlined
def friction_slope(v: float, s: int, p: Array) -> float:
    """∂F/∂v (N m s) of an axis that slides towards side s at speed v (rad/s); no LuGre."""
    coulomb, static, viscous = p[COULOMB_N], p[STATIC_N], p[VISCOUS_N]
    if s > 0:
        coulomb, static, viscous = p[COULOMB_P], p[STATIC_P], p[VISCOUS_P]
    slope = viscous + v * (2.0 * s * p[QUADRATIC] + 3.0 * v * p[CUBIC])
    if static != coulomb and p[STRIBECK_SPEED] > 0.0:
        x = v / p[STRIBECK_SPEED]
        slope -= s * (static - coulomb) * math.exp(-x * x) * 2.0 * x / p[STRIBECK_SPEED]
    return float(slope)


@njit_inlined
def axis_slopes(q1: float, v: float, s: int, p: Array) -> tuple[float, float]:
    """Derivatives of the torques that row (I) has on the left, by the angle (N m/rad) and by the speed (N m s)."""
    by_angle, by_speed = p[B] * math.cos(q1), friction_slope(v, s, p)
    if p[FURTHER] != 0.0:
        further = further_slopes(q1, v, s, p)
        by_angle, by_speed = by_angle + further[0], by_speed + further[1]
    return float(by_angle), float(by_speed)


@njit_inlined
def axis_row(q1: float, v: float, s: int, p: Array, row: Array) -> None:
    """∂r1/∂p into the places of `row` (SIZE,) that stand in row (I): −sin q1 for b, and those of −F."""
    row[B] = -math.sin(q1)
    peak = 0.0
    if p[STRIBECK_SPEED] > 0.0:
        x = v / p[STRIBECK_SPEED]
        peak = math.exp(-x * x)
        height = p[STATIC_P] - p[COULOMB_P] if s > 0 else p[STATIC_N] - p[COULOMB_N]
        row[STRIBECK_SPEED] = -s * height * peak * 2.0 * x * x / p[STRIBECK_SPEED]
    up, down = (1.0 if s > 0 else 0.0), (1.0 if s < 0 else 0.0)
    row[VISCOUS_P], row[VISCOUS_N] = -v * up, -v * down
    row[COULOMB_P], row[COULOMB_N] = -(1.0 - peak) * up, (1.0 - peak) * down
    row[STATIC_P], row[STATIC_N] = -peak * up, peak * down
    row[QUADRATIC], row[CUBIC], row[OFFSET] = -s * v * v, -v * v * v, -1.0
    if p[FURTHER] != 0.0:
        further_row(q1, v, s, p, row)


@njit_inlined
def motor_row(u: float, v2: float, s2: int, branch: int, p: Array, row: Array) -> None:
    """∂r2/∂p into the places of `row` (SIZE,) that stand in row (II): gear, motor and its friction."""
    n, active = p[GEAR], (1.0 if branch != 0 else 0.0)
    row[GEAR] = branch_torque(u, v2, branch, p) - p[F3] * s2 - 2.0 * p[F2] * n * v2
    row[C1], row[C2] = active * n * p[ETA] * u, -active * n * p[ETA] * v2
    row[ETA] = active * n * (p[C1] * u - p[C2] * v2)
    row[D1], row[D2] = (-n if branch > 0 else 0.0), (-n if branch < 0 else 0.0)
    row[F2], row[F3] = -n * n * v2, -n * s2


@njit_inlined
def mass_rows(a1: float, a2: float, row1: Array, row2: Array) -> None:
    """−∂M/∂p q'' into `row1`, `row2` (SIZE,) for accelerations a1, a2 (rad/s²)."""
    row1[A11], row1[A12], row1[A22] = -a1, -a2, 0.0
    row2[A11], row2[A12], row2[A22] = 0.0, -a1, -a2
