"""What a controller is told of the rig's motor: the voltages of u1, u3 and the limit."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypedDict

from swingid.errors import InputError

if TYPE_CHECKING:
    from swingid.model.rig import Rig


class MotorVoltages(TypedDict):
    """f3/(c1 eta) (V) of u1, (d2, d1)/(c1 eta) (V) of u3 (12), c2/c1 (V s/rad), the limit of u0 (V) or None."""

    coulomb_voltage: float
    dead_zone_voltage: tuple[float, float]
    back_emf_ratio: float
    voltage_limit: float | None


def motor_voltages(rig: Rig) -> MotorVoltages:
    """The voltages of a rig's motor; without a wheel nothing is compensated, and only the limit is told.

    Raises InputError for a wheel whose motor gives no torque per volt.
    """
    motor = rig.drive.motor
    limit = None if motor is None else motor.voltage_limit
    if motor is None or rig.drive.kind != "reaction-wheel":
        return MotorVoltages(coulomb_voltage=0.0, dead_zone_voltage=(0.0, 0.0), back_emf_ratio=0.0, voltage_limit=limit)
    require_torque(rig)
    c1, eta = motor.torque_per_volt.value, motor.efficiency.value
    d2, d1 = motor.dead_zone
    return MotorVoltages(
        coulomb_voltage=motor.coulomb.value / (c1 * eta),
        dead_zone_voltage=(d2 / (c1 * eta), d1 / (c1 * eta)),
        back_emf_ratio=motor.back_emf.value / c1,
        voltage_limit=limit,
    )


def require_torque(rig: Rig) -> None:
    """Raise InputError for a rig whose voltage moves nothing: a reaction wheel without torque per volt."""
    motor = rig.drive.motor
    if rig.drive.kind == "reaction-wheel" and (motor is None or motor.torque_per_volt.value == 0.0):
        message = f"rig {rig.name!r} gives no drive.motor.torque_per_volt, without which no voltage moves it; add it"
        raise InputError(message, code="no-torque")
