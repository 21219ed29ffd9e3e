"""What a method that uses the motor's work or torque asks of a log and a rig."""

from __future__ import annotations

from dataclasses import replace

from swingid.errors import InputError, UnanswerableError
from swingid.identify.momentum.balance import moved
from swingid.identify.scale import Scale
from swingid.model.rig import Rig
from swingid.recording.recording import Recording


def require_motor(log: Recording, rig: Rig, scale: Scale, method: str) -> None:
    """Raise InputError without the voltage of a reaction wheel's motor, UnanswerableError without its constants."""
    if scale.drive != "reaction-wheel":
        return
    if log.voltage is None:
        raise InputError(
            f"{log.source.path or 'the log'} has no voltage, which the {method} method needs; name its column as "
            "voltage under [log], or use the momentum method, which does not.",
            code="missing-voltage",
        )
    motor = rig.drive.motor
    if motor is None or motor.torque_per_volt.value == 0:
        raise UnanswerableError(
            f"rig {rig.name}: drive.motor.torque_per_volt is not given, but the {method} method needs the motor's "
            "constants; give them, or use the momentum method, which does not need them.",
            code="no-motor-constants",
        )


def without_latency(log: Recording, rig: Rig) -> Recording:
    """The log with each angle moved to its stamp, where the rig declares a latency: the voltage acts at the stamps."""
    late, wheel_late = rig.sensors.of("angle").latency.value, rig.sensors.of("wheel").latency.value
    if late == 0 and (wheel_late == 0 or log.wheel_angle is None):
        return log
    wheel = None if log.wheel_angle is None else moved(log.time, log.wheel_angle, wheel_late)
    return replace(log, angle=moved(log.time, log.angle, late), wheel_angle=wheel)
