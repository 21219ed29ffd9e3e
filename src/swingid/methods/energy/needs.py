"""What a method that uses the motor's work or torque asks of a log and a rig."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from swingid.balance.rows import moved
from swingid.errors import InputError, UnanswerableError
from swingid.model.rig import Rig
from swingid.preparation.scale import Scale
from swingid.recording.recording import Recording
from swingid.result.result import Message

SATURATED = 0.6
"""Share of the rows with the voltage at its limits from which on what its jumps do to the energy is seen."""


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


def check_saturation(used: Recording, rig: Rig) -> list[Message]:
    """A warning where the voltage mostly stands at its limits: it is known there, but it jumps from one to the other.

    At a jump the wheel's acceleration jumps too, which a smoothed speed does not follow. `momentum` needs no speed.
    """
    if rig.drive.kind != "reaction-wheel" or used.voltage is None:
        return []
    low, high = float(used.voltage.min()), float(used.voltage.max())
    near = 1e-3 * (high - low)
    share = float(np.mean((used.voltage <= low + near) | (used.voltage >= high - near)))
    if high <= low or share < SATURATED:
        return []
    text = (
        f"the voltage stands at its limits in {share:.0%} of the rows and jumps between them, which smoothed speeds do "
        "not follow (some 0.1 % of the inertia); use the momentum method, or record a smaller or slower motion."
    )
    return [Message("voltage-saturated", text)]
