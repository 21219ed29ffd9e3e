"""The equations of motion (I), (II), with axis and wheel each sliding or resting.

    a11 q1'' + a12 q2'' = -b sin q1 - F(q1') - Σ c f(q1, q1')     (I)   (direct drive: + torque; Σ: `further`)
    a12 q1'' + a22 q2'' = N (M - f2 N q2' - f3 sign q2')          (II)

A mode is three integers: s1, s2 in {+1, -1, 0} are the sides to which axis and wheel slide (0: at rest),
`branch` is that of the motor's dead zone (8). Within a mode the right-hand side is smooth. A rig
without a wheel has a12 = 0 and a wheel that rests for ever.

Arguments: q1 in rad, v1 = q1' and v2 = q2' in rad/s, z the bristles' deflection in rad, u the held command in V (direct
drive: N m), p the vector (SIZE,) of `parameters`. On a linear axis m, m/s, N.
"""

from __future__ import annotations

import math

from swingid.model.friction import sliding_friction
from swingid.model.further import ALL, HELD, POSITIVE, further_torque
from swingid.model.motor import branch_torque, motor_friction
from swingid.model.parameters import A11, A12, A22, DIRECT, FURTHER, GEAR, B
from swingid.numerics.arrays import Array
from swingid.numerics.compiled import njit_inlined


@njit_inlined
def axis_load(q1: float, u: float, p: Array) -> float:
    """Right-hand side of (I) without friction (N m): gravity, springs, cogging, and the torque u of a direct drive."""
    load = p[DIRECT] * u - p[B] * math.sin(q1)
    return float(load - further_torque(q1, 0.0, POSITIVE, HELD, p)) if p[FURTHER] != 0.0 else float(load)


@njit_inlined
def sliding_load(q1: float, v1: float, s1: int, z: float, torque: float, p: Array) -> float:
    """A torque on an axis that slides less everything that equation (I) has on the left beside the inertias (N m)."""
    load = torque - p[B] * math.sin(q1) - sliding_friction(v1, s1, z, p)
    return float(load - further_torque(q1, v1, s1, ALL, p)) if p[FURTHER] != 0.0 else float(load)


@njit_inlined
def wheel_load(u: float, v2: float, s2: int, branch: int, p: Array) -> float:
    """Right-hand side of (II) (N m); with s2 = 0 and v2 = 0 the torque that would turn a resting wheel."""
    return float(p[GEAR] * (branch_torque(u, v2, branch, p) - motor_friction(v2, s2, p)))


@njit_inlined
def accelerations(
    q1: float, v1: float, v2: float, z: float, s1: int, s2: int, branch: int, u: float, p: Array
) -> tuple[float, float]:
    """(q1'', q2'') (rad/s^2) in the mode (s1, s2, branch) under the held command u (V, direct drive N m).

    The acceleration of what rests is 0, and its equation gives way to the constraint (`holding_torques`).
    """
    if s1 != 0 and s2 != 0:
        r1 = sliding_load(q1, v1, s1, z, p[DIRECT] * u, p)
        r2 = wheel_load(u, v2, s2, branch, p)
        determinant = p[A11] * p[A22] - p[A12] * p[A12]
        return (p[A22] * r1 - p[A12] * r2) / determinant, (p[A11] * r2 - p[A12] * r1) / determinant
    if s1 != 0:
        return (sliding_load(q1, v1, s1, z, p[DIRECT] * u, p)) / p[A11], 0.0
    if s2 != 0:
        return 0.0, wheel_load(u, v2, s2, branch, p) / p[A22]
    return 0.0, 0.0


@njit_inlined
def holding_torques(
    q1: float, v2: float, a1: float, a2: float, s2: int, branch: int, u: float, p: Array
) -> tuple[float, float]:
    """Torques (N m) that friction must supply to hold a resting axis and a resting wheel.

    From (I) with q1'' = 0: -b sin q1 - a12 q2''; from (II) with q2'' = 0: N M - a12 q1''.
    """
    return axis_load(q1, u, p) - p[A12] * a2, wheel_load(u, v2, s2, branch, p) - p[A12] * a1
