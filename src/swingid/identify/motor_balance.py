"""Row (II), the motor's balance, on test functions: a second opinion on what the wheel angle is.

a12 ∫φ'' q1 + a22 ∫φ'' q2 = N ∫φ (M(u, q2') − f2 N q2' − f3 sgn q2')
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swingid.identify.momentum.balance import Signals, Windows, moved
from swingid.identify.momentum.fits import Noise
from swingid.model.rig import Rig
from swingid.model.rig.tables import Motor
from swingid.numerics.spline import local_cubic, spline_at, spline_slopes
from swingid.numerics.test_functions import curvature_overlap, project
from swingid.recording.recording import Recording

Array = NDArray[np.float64]


@dataclass(frozen=True)
class MotorBalance:
    """Relative residuals of row (II): wheel angle as stated, wheel angle read the other way, voltage turned."""

    as_stated: float
    otherwise: float
    turned: float
    is_relative: bool


def motor_torque(motor: Motor, voltage: Array, wheel_speed: Array) -> Array:
    """M of (8), corrected: the motor's torque on its shaft after the dead zone, N m."""
    low, high = motor.dead_zone
    ideal = motor.efficiency.value * (motor.torque_per_volt.value * voltage - motor.back_emf.value * wheel_speed)
    result: Array = np.maximum(ideal - high, 0.0) + np.minimum(ideal - low, 0.0)
    return result


def motor_balance(log: Recording, rig: Rig, signals: Signals, windows: Windows, noise: Noise) -> MotorBalance | None:
    """Residuals of row (II) on `windows`; None without voltage or motor constants."""
    motor, wheel = rig.drive.motor, signals.wheel
    if motor is None or wheel is None or log.voltage is None or motor.torque_per_volt.value == 0:
        return None
    nodes = signals.nodes
    speed = signals.motion.speed
    assert signals.wheel_values is not None
    fitted = local_cubic(nodes.time, signals.wheel_values, speed.grid, speed.half_width)[:, 1]
    known = np.isfinite(fitted)
    instants = nodes.instants
    slopes = spline_slopes(speed.grid[known], fitted[known])
    wheel_speed = spline_at(speed.grid[known], fitted[known], slopes, instants.ravel(), 0).reshape(instants.shape)
    late = rig.sensors.of("angle").latency.value  # the signals are on the angle's clock
    voltage = nodes.hold(log.voltage, late) if log.drive_held else nodes.spline(moved(log.time, log.voltage, -late))
    gear = motor.gear_ratio.value

    def drag(rate: Array) -> Array:
        return motor.viscous.value * gear * rate + motor.coulomb.value * np.sign(rate)

    def drive(u: Array, rate: Array) -> Array:
        return gear * (motor_torque(motor, u, rate) - drag(rate))

    relative = rig.log.wheel_angle_is == "relative"
    other_speed = wheel_speed - signals.speed if relative else wheel_speed + signals.speed
    columns = [
        (signals.angle, 2),
        (wheel, 2),
        (drive(voltage, wheel_speed), 0),
        (drive(voltage, other_speed), 0),
        (drive(-voltage, wheel_speed), 0),
    ]
    part = project(nodes, columns, windows.centres, windows.half)
    a12, a22 = rig.drive.a12, rig.drive.a22
    angle, turn = part[:, 0], part[:, 1]
    other = turn - angle if relative else turn + angle

    # what white noise of the angles leaves of row (II) by itself
    power = ((a12 * noise.angle) ** 2 + (a22 * noise.wheel) ** 2) * noise.step
    expected = power * float(curvature_overlap(np.zeros(1))[0] * np.mean(windows.half**-3.0))

    def residual(left: Array, right: Array) -> float:
        unexplained = max(float(np.mean((left - right) ** 2)) - 2 * expected, 0.0)
        return float(np.sqrt(unexplained / max(float(np.mean(left**2)), 1e-300)))

    return MotorBalance(
        as_stated=residual(a12 * angle + a22 * turn, part[:, 2]),
        otherwise=residual(a12 * angle + a22 * other, part[:, 3]),
        turned=residual(a12 * angle + a22 * turn, part[:, 4]),
        is_relative=relative,
    )
