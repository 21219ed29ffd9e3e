"""Equation (II), the balance of the wheel and its motor, in the products of constants that it contains.

Divided by a22, with B the branch of (8) (+, 0 or −) and 1 an indicator, it reads

    q2'' + ρ q1'' = g u 1[B≠0] − v q2' + e q2' 1[B=0] − p 1[B=+] + n 1[B=−] − f (sgn q2' − 1[B=+] + 1[B=−])

    g = η c1 N/a22,  v = (η c2 + f2 N) N/a22,  e = η c2 N/a22,
    p = (f3 + d1) N/a22,  n = (f3 − d2) N/a22,  f = f3 N/a22,  ρ = a12/a22

In this form the two regressors of least excitation differ from zero in few rows: that of e inside the dead zone only,
that of f only where the motor's torque is not in the direction of rotation. A calibration fits the products; a check
takes them from the rig, with those free that `TOGETHER` names.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from swingid.balance.rows import Signals, Windows
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array, Bools
from swingid.numerics.blocks import BlockNodes
from swingid.numerics.quadrature import GaussNodes
from swingid.numerics.spline import spline_at, spline_slopes
from swingid.numerics.test_functions import project
from swingid.preparation.speed import Speed, smooth_speed

if TYPE_CHECKING:
    from swingid.preparation.noise import Noise

GAIN, DAMPING, EMF, POSITIVE, NEGATIVE, COULOMB, COUPLING = range(7)
COUNT = 7
"""Places of a vector of products, and their number."""

TOGETHER = {"torque_per_volt": [GAIN], "viscous": [DAMPING], "coulomb": [POSITIVE, NEGATIVE, COULOMB]}
"""Constants of the motor that are free where its balance is checked, with the products that each changes alike."""

SLOW = 4.0
"""Standard deviations of the wheel's speed below which it is not distinguishable from rest."""


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


def regressors(values: Array, voltage: Array, speed: Array, direction: Array) -> Array:
    """Regressors (6, …) of the products before COUPLING, with the branches that `values` give.

    voltage (V), speed (rad/s) of the wheel and direction (sgn q2', 0 where it rests) at the same instants (…).
    """
    branch = branches(values, voltage, speed)
    above, below, inside = ((branch == which).astype(float) for which in (1.0, -1.0, 0.0))
    return np.stack([voltage * (1.0 - inside), -speed, speed * inside, -above, below, above - below - direction])


def right_side(values: Array, voltage: Array, speed: Array, direction: Array) -> Array:
    """The equation's right side, and its derivatives by what `TOGETHER` names (4, …); arguments as of `regressors`."""
    columns = regressors(values, voltage, speed, direction)
    free = [columns[places].sum(axis=0) for places in TOGETHER.values()]
    return np.stack([values[: len(columns)] @ columns, *free])


@dataclass(frozen=True)
class WheelRows:
    """The wheel between the rows of a log, on the clock of the angle, and windows for equation (II).

    middles (n−1,): instants in s; rate (n−1,) and speed: of the wheel as it was logged, rad/s.
    """

    signals: Signals
    nodes: BlockNodes
    windows: Windows
    middles: Array
    speed: Speed
    rate: Array

    @classmethod
    def of(cls, signals: Signals, windows: Windows, noise: Noise, swings: int | None = None) -> WheelRows:
        """Take signals with a wheel's angle, or their first swings alone where a number is given."""
        turning, nodes = signals.motion.turning_times, signals.nodes
        if swings is not None:
            nodes = nodes.until(turning[swings]) if len(turning) > swings else nodes
            windows = windows.select(windows.centres + windows.half <= nodes.time[-1])
        stamps = nodes.stamps
        assert signals.wheel_values is not None
        speed = smooth_speed(stamps, signals.wheel_values[: len(stamps)], noise.wheel, spacing=1.5)
        middles = (stamps[1:] + stamps[:-1]) / 2
        return cls(signals, nodes, windows, middles, speed, speed.at(middles))

    @property
    def slow(self) -> float:
        """Speed of the wheel (rad/s) that is not distinguishable from rest."""
        return SLOW * self.speed.noise

    def turning(self, sign: float = 0.0) -> tuple[Array, float]:
        """The wheel's speed and what is not distinguishable from rest, where `sign` q1 is to be added to its angle."""
        axis = self.signals.motion.speed
        if not sign:
            return self.rate, self.slow
        return self.rate + sign * axis.at(self.middles), SLOW * float(np.hypot(self.speed.noise, axis.noise))

    def voltage(self, *, held: bool, late: float | None = None) -> Array:
        """The voltage between the rows: one that the angle is read `late` (s) after meets a later voltage.

        held: whether it keeps the value of a row until the next one; late: by default as stated.
        """
        log = self.signals.source[0]
        late = self.signals.encoders.angle.latency.value if late is None else late
        assert log.voltage is not None
        if held:
            moved = log.voltage[:, None] if late == 0.0 else GaussNodes(log.time, 2).hold(log.voltage, late)
            means: Array = moved[: len(self.middles)].mean(axis=1)
            return means
        return spline_at(log.time, log.voltage, spline_slopes(log.time, log.voltage), self.middles + late, 0)

    def inertial(self, coupling: float) -> tuple[Array, Array]:
        """∫φ (q2'' + ρ q1'') on the windows, with ρ = `coupling`, and ∫φ q1''."""
        blocks, wheel = len(self.nodes.rows) - 1, self.signals.wheel
        assert wheel is not None
        columns = [(self.signals.angle[:blocks], 2), (wheel[:blocks], 2)]
        angle, turn = project(self.nodes, columns, self.windows.centres, self.windows.half).T
        return coupling * angle + turn, angle

    def integrals(self, between: Array) -> Array:
        """∫φ x (windows, n) of signals (n, rows − 1) that are constant between the rows.

        A dead zone is not linear, so these are computed row by row and then gathered into blocks.
        """
        columns = [(x, 0) for x in self.nodes.held(between)]
        return project(self.nodes, columns, self.windows.centres, self.windows.half)
