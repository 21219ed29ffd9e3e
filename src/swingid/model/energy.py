"""Kinetic and potential energy and the powers, from the same constants that move the rig.

Along (I), (II) d/dt (T + Pi) is the drive's power less the power F q1' of the axis' friction and that of
the motor's; (1) and (2) are its integrals. With LuGre, F q1' also stores 1/2 sigma0 z^2 in the bristles.

Arguments: q1 in rad, v1 = q1' and v2 = q2' in rad/s, u in V (direct drive: N m), p the vector (SIZE,) of `parameters`.
"""

from __future__ import annotations

import math

from swingid.model.further import further_energy
from swingid.model.motor import motor_friction, motor_torque
from swingid.model.parameters import A11, A12, A22, DIRECT, GEAR, B
from swingid.numerics.arrays import Array
from swingid.numerics.compiled import njit_called


@njit_called
def kinetic_energy(v1: float, v2: float, p: Array) -> float:
    """T = 1/2 (a11 q1'^2 + 2 a12 q1' q2' + a22 q2'^2) (J)."""
    return float(0.5 * (p[A11] * v1 * v1 + 2.0 * p[A12] * v1 * v2 + p[A22] * v2 * v2))


@njit_called
def potential_energy(q1: float, p: Array) -> float:
    """Pi = b (1 - cos q1) (J), (4) and (5), and the energy of springs and cogging; 0 at the angle 0."""
    return float(p[B] * (1.0 - math.cos(q1)) + further_energy(q1, p))


@njit_called
def drive_power(u: float, v1: float, v2: float, p: Array) -> float:
    """Power (W) of the motor torque on the wheel, N M q2', or of a direct drive's torque, u q1'."""
    return float(p[DIRECT] * u * v1 + p[GEAR] * motor_torque(u, v2, p) * v2)


@njit_called
def motor_friction_power(v2: float, s2: int, p: Array) -> float:
    """Power (W) lost in motor and gearbox, N (f2 N q2' + f3 s2) q2', as the wheel turns towards side s2 = 1 or -1."""
    return float(p[GEAR]) * motor_friction(v2, s2, p) * v2
