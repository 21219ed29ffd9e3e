"""Errors of channels as they act on the rows of energies, ρ = −(∂E/∂channel s + ∂E/∂rate s') + ∫ ∂P/∂rate s' dt.

E: the energies of the terms, P: the power of the drive. Those of constants act as on other rows, by `constant_error`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from swingid.balance.errors import constant_error
from swingid.balance.friction_laws import TERMS
from swingid.balance.motor import motor_drag, motor_torque
from swingid.balance.perturbations import SHAPES, Perturbation, RowError, of_channels, of_constants
from swingid.methods.energy.balance import Course, PassRows
from swingid.model.equation import Equation
from swingid.model.rig import Rig
from swingid.model.terms import power_of
from swingid.numerics.arrays import Array
from swingid.numerics.quadrature import running_integrals
from swingid.preparation.speed import Speed

SLOPES: dict[str, Callable[[Array], Array]] = {
    "cosine": lambda q: -np.sin(q),
    "sine": np.cos,
    "cosine 2": lambda q: -2 * np.sin(2 * q),
    "sine 2": lambda q: 2 * np.cos(2 * q),
    "scale": np.ones_like,
    "offset": np.zeros_like,
}
"""Derivatives of the `SHAPES` of errors by the angle."""


def pass_errors(rows: PassRows, rig: Rig, equation: Equation, values: Mapping[str, float]) -> list[RowError]:
    """All perturbations that are stated, and exact constants, as they act on these rows, J per unit.

    values: of all coefficients by name, stated and fitted.
    """
    constants = [constant_error(rows, equation, error) for error in of_constants(equation)]
    channels = (error for error in of_channels(rig, rows.course.encoders) if not error.of_noise)
    return [*constants, *(RowError(error, -_change(rows, equation, values, error)) for error in channels)]


def _change(rows: PassRows, equation: Equation, values: Mapping[str, float], perturbation: Perturbation) -> Array:
    """Change of the balance by an error of the angle of axis or wheel; of friction, see `_of_friction`."""
    course, v1, v2 = rows.course, rows.speed, rows.wheel_speed
    if perturbation.channel == "wheel":
        assert course.wheel is not None
        source = course.wheel
        change = (values["wheel"] * v1 + values["wheel_inertia"] * v2) * rows.at(
            lambda t: _rate(source, perturbation, t)
        )
    else:
        source = course.axis
        error = rows.at(source.at) if perturbation.shape == "latency" else SHAPES[perturbation.shape](rows.angle)
        momentum = values["inertia"] * v1 + values.get("wheel", 0.0) * v2
        change = _pull(rows, equation, values) * error + momentum * rows.at(lambda t: _rate(source, perturbation, t))
        change = change + _of_friction(rows, values, perturbation)
    if perturbation.channel == "wheel" or "torque" in equation.coefficients:
        power = _power_slope(course) * _rate(source, perturbation, course.nodes.flat[0]).reshape(course.speed.shape)
        change = change - rows.at(lambda times: running_integrals(course.nodes, [power], times))[0]
    return np.asarray(change)


def _rate(source: Speed, error: Perturbation, instants: Array) -> Array:
    """Rate s' of an error s(q) of a channel, or of one that is read late, s = q', at rising instants."""
    if error.shape == "latency":
        return source.acceleration(instants)
    return SLOPES[error.shape](source.angle_at(instants)) * source.at(instants)


def _pull(rows: PassRows, equation: Equation, values: Mapping[str, float]) -> Array:
    """Torque on the axis by the terms of the registry; (6) and (7) have none that is sought, so it counts as 0."""
    pull = np.zeros(len(rows))
    for name, term in equation.terms.items():
        if value := values.get(name, 0.0):
            pull += value * term.regressor(rows.angle, rows.speed, np.sign(rows.speed))
    return pull


def _of_friction(rows: PassRows, values: Mapping[str, float], error: Perturbation) -> Array:
    """Change of the work of friction: all of it is read late, its speed is scaled; else negligible."""
    coefficients = {name: values[name] for name in TERMS if values.get(name)}
    if error.shape == "latency":
        power = (value * TERMS[name](rows.speed) * rows.speed for name, value in coefficients.items())
        return sum(power, np.zeros(len(rows)))
    weights = {name: (power_of(name) + 1) * value for name, value in coefficients.items()} if error.scales_speed else {}
    return rows.sum_of(weights)


def _power_slope(course: Course) -> Array:
    """Change of the drive's power per unit of the rate that it acts on."""
    motor = course.motor
    if motor is None:
        return course.drive
    n, rate = motor.gear_ratio.value, course.wheel_speed
    loss = motor.efficiency.value * motor.back_emf.value * course.active + motor.viscous.value * n
    slope: Array = n * (motor_torque(motor, course.drive, rate) - motor_drag(motor, rate) - loss * rate)
    return slope
