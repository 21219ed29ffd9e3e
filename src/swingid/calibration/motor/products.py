"""The products of motor constants that equation (II) contains, and their relation to the keys of rig.toml.

Divided by a22, equation (II) reads, with B the branch of (8) (+, 0 or −) and 1 an indicator,

    q2'' + ρ q1'' = g u 1[B≠0] − v q2' + e q2' 1[B=0] − p 1[B=+] + n 1[B=−] − f (sgn q2' − 1[B=+] + 1[B=−])

    g = η c1 N/a22,  v = (η c2 + f2 N) N/a22,  e = η c2 N/a22,
    p = (f3 + d1) N/a22,  n = (f3 − d2) N/a22,  f = f3 N/a22,  ρ = a12/a22

In this form the two regressors of least excitation differ from zero in few rows: that of e inside the dead zone only,
that of f only where the motor's torque is not in the direction of rotation.
"""

from __future__ import annotations

import numpy as np

from swingid.model.rig import Rig
from swingid.numerics.arrays import Array, Bools

GAIN, DAMPING, EMF, POSITIVE, NEGATIVE, COULOMB, COUPLING = range(7)
COUNT = 7
"""Places of a vector of products, and their number."""


def products_of(rig: Rig) -> Array:
    """The products (7,) by the rig's constants, per a22: a start for searches, and values of held ones."""
    motor = rig.drive.motor
    assert motor is not None
    eta, (low, high) = motor.efficiency.value, motor.dead_zone
    torques = np.array(
        [
            eta * motor.torque_per_volt.value,
            eta * motor.back_emf.value + motor.gear_ratio.value * motor.viscous.value,
            eta * motor.back_emf.value,
            motor.coulomb.value + high,
            motor.coulomb.value - low,
            motor.coulomb.value,
        ]
    )
    scale = rig.drive.a22 / motor.gear_ratio.value  # torque on the rotor per acceleration of the wheel
    result: Array = np.append(torques / scale, rig.drive.a12 / rig.drive.a22)
    return result


def allowed(values: Array, free: Bools) -> Array:
    """Products moved to the nearest that are physical: no negative torque, no edge of the dead zone on a wrong side."""
    result = values.copy()
    if free[EMF]:
        result[EMF] = min(max(result[EMF], 0.0), max(result[DAMPING], 0.0))
    for k in (POSITIVE, NEGATIVE):
        if free[k]:
            result[k] = max(result[k], 0.0 if free[COULOMB] else result[COULOMB])
    if free[COULOMB]:
        result[COULOMB] = min(max(result[COULOMB], 0.0), result[POSITIVE], result[NEGATIVE])
    return result


def branches(values: Array, voltage: Array, speed: Array) -> Array:
    """Branch of (8), +1, 0 or −1, at each voltage (V) and wheel speed (rad/s)."""
    high = max(values[POSITIVE] - values[COULOMB], 0.0)
    low = min(values[COULOMB] - values[NEGATIVE], 0.0)
    ideal = values[GAIN] * voltage - values[EMF] * speed
    if high == low == 0.0:
        return np.where(ideal >= 0, 1.0, -1.0)
    result: Array = (ideal > high).astype(float) - (ideal < low)
    return result
