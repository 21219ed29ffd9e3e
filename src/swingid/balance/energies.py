"""The balance (1), (2) as terms: equation (I) times q1' and equation (II) times q2', with the constants of the motor.

    Σ c f = 0,   f = ∫ regressor · speed dt:    ½ a11 q1'² − b cos q1 + a12 q1' q2' + ½ a22 q2'² + ∫F q1' dt − W
    W = N ∫(M − f2 N q2' − f3 sgn q2') q2' dt  (reaction wheel),    ∫τ q1' dt  (direct drive)

M of (8) is linear in its constants between the edges of its dead zone, so each has a term of its own. What the terms
share with equation (I) has the coefficients of `model.equation`.
"""

from __future__ import annotations

from dataclasses import replace

from swingid.model.equation import Coefficient, Constant, Equation, deviations
from swingid.model.rig import Rig
from swingid.model.rig.drive import Motor

MOTOR = "drive.motor."
GEAR, ROTOR = MOTOR + "gear_ratio", MOTOR + "rotor_inertia"

OF_TORQUE = ("torque_per_volt", "efficiency", "back_emf", "viscous", "coulomb")
"""Constants of a motor that equation (II) has beside those of equation (I)."""


def of_energy(rig: Rig, equation: Equation) -> Equation:
    """The equation of energies of a rig, with the terms of (II) where it has a wheel."""
    motor = rig.drive.motor
    if "wheel" not in equation.coefficients or motor is None:
        return equation
    more = tuple(Constant(MOTOR + name, getattr(motor, name).std or 0.0) for name in OF_TORQUE)
    constants = (*equation.constants, *more)
    changes = list(deviations(rig, {constant.key for constant in constants}))
    coefficients = dict(equation.coefficients)
    for name, (value, sources) in _of_wheel(rig.drive.a22, motor).items():
        shared = {
            key: sum(share * sources.get(constant, 0.0) for constant, share in each.items()) for key, _, each in changes
        }
        coefficients[name] = Coefficient(value, sources | {key: change for key, change in shared.items() if change})
    return replace(equation, coefficients=coefficients, constants=constants)


def _of_wheel(a22: float, motor: Motor) -> dict[str, tuple[float, dict[str, float]]]:
    """Coefficients of the terms of (II) and their derivatives by the constants, by name."""
    n, jr, eta = motor.gear_ratio.value, motor.rotor_inertia.value, motor.efficiency.value
    c1, c2, f2, f3 = (getattr(motor, name).value for name in ("torque_per_volt", "back_emf", "viscous", "coulomb"))
    volts, emf = MOTOR + "torque_per_volt", MOTOR + "back_emf"
    return {
        "wheel_inertia": (a22, {"drive.wheel.inertia": 1.0, ROTOR: n**2, GEAR: 2 * n * jr}),
        "torque_per_volt": (-n * eta * c1, {volts: -n * eta, MOTOR + "efficiency": -n * c1, GEAR: -eta * c1}),
        "back_emf": (n * eta * c2, {emf: n * eta, MOTOR + "efficiency": n * c2, GEAR: eta * c2}),
        "dead_zone": (n, {GEAR: 1.0}),
        "motor_viscous": (n**2 * f2, {MOTOR + "viscous": n**2, GEAR: 2 * n * f2}),
        "motor_coulomb": (n * f3, {MOTOR + "coulomb": n, GEAR: f3}),
    }
