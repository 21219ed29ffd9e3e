"""The motor's torque M with its dead zone (8), and the friction of motor and gearbox.

M = deadzone(eta (c1 u - c2 q2')). The third branch of the printed (8) reads "eta M2 + d2" with d2 < 0, which
would jump at the edge of the dead zone; here it is eta M2 - d2, continuous.

Arguments: u the voltage in V, v2 = q2' the wheel's speed in rad/s, p the vector (SIZE,) of `parameters`. Torques are
on the rotor's shaft; on the wheel they are N times as large.
"""

from __future__ import annotations

import numpy as np

from swingid.model.parameters import C1, C2, D1, D2, ETA, F2, F3, GEAR
from swingid.numerics.arrays import Array
from swingid.numerics.compiled import njit_inlined


@njit_inlined
def ideal_torque(u: float, v2: float, p: Array) -> float:
    """Eta M2 = eta (c1 u - c2 q2') (N m): the torque before the dead zone, u in V, v2 = q2' in rad/s."""
    return float(p[ETA] * (p[C1] * u - p[C2] * v2))


@njit_inlined
def motor_branch(u: float, v2: float, p: Array) -> int:
    """Branch of (8) at u (V) and v2 (rad/s): +1 above the dead zone, -1 below, 0 inside; +1 where there is none."""
    if p[D1] == 0.0 and p[D2] == 0.0:
        return 1
    torque = ideal_torque(u, v2, p)
    if torque > p[D1]:
        return 1
    if torque < p[D2]:
        return -1
    return 0


@njit_inlined
def branch_margin(u: float, v2: float, branch: int, p: Array) -> float:
    """How far (N m) the torque is inside its branch of (8); < 0: it has left it."""
    if p[D1] == 0.0 and p[D2] == 0.0:
        return np.inf
    torque = ideal_torque(u, v2, p)
    if branch > 0:
        return float(torque - p[D1])
    if branch < 0:
        return float(p[D2] - torque)
    return float(min(p[D1] - torque, torque - p[D2]))


@njit_inlined
def branch_torque(u: float, v2: float, branch: int, p: Array) -> float:
    """M (N m) of one branch of (8), smooth in v2: eta M2 less the edge of the dead zone, or 0 inside."""
    if branch > 0:
        return ideal_torque(u, v2, p) - float(p[D1])
    if branch < 0:
        return ideal_torque(u, v2, p) - float(p[D2])
    return 0.0


@njit_inlined
def motor_torque(u: float, v2: float, p: Array) -> float:
    """M (N m) of (8) at voltage u (V) and wheel speed v2 (rad/s)."""
    return branch_torque(u, v2, motor_branch(u, v2, p), p)


@njit_inlined
def motor_friction(v2: float, s: int, p: Array) -> float:
    """f2 N q2' + f3 s (N m) on the rotor of a wheel that turns towards side s (rest is its own state)."""
    return float(p[F2] * p[GEAR] * v2 + p[F3] * s)
