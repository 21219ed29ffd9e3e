"""Effects of every constant and stated error on the known side of the energy balance.

The estimate is linear in the known side, so an effect per unit at the nodes, times the influence of the nodes, is a
sensitivity coefficient, without a second fit (GUM 5.1.3). As `balance.errors`, for energies.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from swingid.balance.motor import motor_drag, motor_torque
from swingid.balance.perturbations import (
    SHAPES,
    Perturbation,
    RowError,
    of_channels,
    with_deviations,
)
from swingid.methods.energy.balance import MOTOR, Course, States
from swingid.methods.energy.fit import NodeFit
from swingid.model.equation import Equation, relative, shifted
from swingid.model.parameters import WHEEL_TILT
from swingid.model.rig import Rig
from swingid.model.rig.drive import Motor
from swingid.model.terms import TERMS, rig_terms
from swingid.numerics.arrays import Array
from swingid.numerics.quadrature import running_integrals
from swingid.units import Quantity

SLOPES: dict[str, Callable[[Array], Array]] = {
    "cosine": lambda q: -np.sin(q),
    "sine": np.cos,
    "scale": np.ones_like,
    "offset": np.zeros_like,
}
"""Derivatives of the `SHAPES` of errors by the angle."""


def effects(rig: Rig, course: Course, states: States, equation: Equation, fit: NodeFit, b: float) -> list[RowError]:
    """All constants that the balance uses (std 0 where they count as exact) and all errors that are stated.

    The rows of an `RowError` are here the nodes, flattened, in joules per unit of the source. b: gravity
    torque, as known or as identified.
    """
    channels = (one for one in of_channels(rig, course.encoders) if not one.of_noise)
    found = [*_held(rig, states), *(_channel_error(rig, course, states, fit, b, one) for one in channels)]
    motor = rig.drive.motor
    if equation.drive == "reaction-wheel" and motor is not None:
        found = [*_inertias(rig, motor, states), *_motor(rig, motor, states), *found]
    elif equation.drive == "direct":
        gain = rig.log.torque_gain
        found = [_constant("log.torque_gain", gain, states.work / gain.value), *found]
    return [item for item in with_deviations(rig, found) if item.std > 0 or item.of.constant]


def _constant(key: str, quantity: Quantity, effect: Array, direct: float = 0.0) -> RowError:
    return RowError(Perturbation(key, quantity.std or 0.0, key, constant=True), effect.ravel(), direct)


def _held(rig: Rig, states: States) -> Iterator[RowError]:
    """Gravity torque, springs and cogging."""
    gravity = rig.axis.gravity_torque
    if not isinstance(gravity, str) and rig.axis.kind == "rotary":
        yield _constant("axis.gravity_torque", gravity, states.height * rig.axis.along.value)
    for term in rig_terms(rig):
        if term.value is not None:
            yield _constant(term.term.key, term.value, -states.further[term.name])
            if term.shift.std:
                effect = -term.value.value * states.further[shifted(term.name)]
                yield _constant(term.term.shift, term.shift, effect)


def _inertias(rig: Rig, motor: Motor, states: States) -> Iterator[RowError]:
    """J2 and Jr, which are also the difference of a11 and J1."""
    assert rig.drive.wheel is not None
    n, v2, along = motor.gear_ratio.value, states.wheel_speed, rig.drive.wheel.along.value
    product = along * states.speed * v2
    yield _constant("drive.wheel.inertia", rig.drive.wheel.inertia, -product - 0.5 * v2**2, -along)
    yield _constant("drive.motor.rotor_inertia", motor.rotor_inertia, -n * product - 0.5 * n**2 * v2**2, -along)
    tilt = Perturbation(WHEEL_TILT, relative(rig.drive.wheel.along), WHEEL_TILT)
    yield RowError(tilt, -rig.drive.a12 * (states.speed * v2).ravel(), -rig.drive.carried)


def _motor(rig: Rig, motor: Motor, states: States) -> Iterator[RowError]:
    """N, c1, eta, c2, f2 and f3: partial derivatives of the work and, for N, of a12 and a22."""
    n, c1, c2 = motor.gear_ratio.value, motor.torque_per_volt.value, motor.back_emf.value
    eta, jr = motor.efficiency.value, motor.rotor_inertia.value
    volts, back, squares, path = (states.motor[name] for name in MOTOR)
    yield _constant("drive.motor.torque_per_volt", motor.torque_per_volt, n * eta * volts)
    yield _constant("drive.motor.efficiency", motor.efficiency, n * (c1 * volts - c2 * back))
    yield _constant("drive.motor.back_emf", motor.back_emf, -n * eta * back)
    yield _constant("drive.motor.viscous", motor.viscous, -(n**2) * squares)
    yield _constant("drive.motor.coulomb", motor.coulomb, -n * path)
    assert rig.drive.wheel is not None
    kinetic = -jr * states.wheel_speed * (rig.drive.wheel.along.value * states.speed + n * states.wheel_speed)
    work = states.work / n - n * motor.viscous.value * squares
    yield _constant("drive.motor.gear_ratio", motor.gear_ratio, kinetic + work)


def _channel_error(rig: Rig, course: Course, states: States, fit: NodeFit, b: float, one: Perturbation) -> RowError:
    """An error of the angle or of the wheel's angle: once per turn, a latency (q + q' δ), the scale, the zero."""
    of_angle = one.channel == "angle"
    if one.shape == "latency":
        rows = _late_angle(rig, course, states, fit, b) if of_angle else _late_wheel(rig, course, states)
        return RowError(one, rows)
    shape, slope = SHAPES[one.shape], SLOPES[one.shape]
    if not of_angle:
        assert course.wheel is not None
        at_nodes = course.wheel.angle_at(states.instants.ravel()).reshape(states.instants.shape)
        along = course.wheel.angle_at(course.nodes.instants.ravel()).reshape(course.wheel_speed.shape)
        return RowError(one, _wheel_effect(rig, course, states, slope(at_nodes), slope(along)))
    driven = rig.drive.kind == "direct" and one.shape in ("cosine", "sine")
    along = course.speed
    if driven:
        along = course.axis.angle_at(course.nodes.instants.ravel()).reshape(course.speed.shape)
    rates = slope(states.angle) * states.speed, slope(along) * course.speed
    effect = _angle_effect(rig, course, states, fit, b, shape(states.angle), *rates)
    if one.scales_speed:
        for name, column in states.friction.items():
            effect = effect - ((TERMS[name].power or 0) + 1) * fit.value(name) * column.ravel()
    return RowError(one, effect)


def _late_angle(rig: Rig, course: Course, states: States, fit: NodeFit, b: float) -> Array:
    """Effect of an angle that is read late."""
    turning = course.speed
    if rig.drive.kind == "direct":
        turning = course.axis.acceleration(course.nodes.instants.ravel()).reshape(course.speed.shape)
    effect = _angle_effect(rig, course, states, fit, b, states.speed, states.acceleration, turning)
    result: Array = effect - friction_power(fit, states.speed).ravel()
    return result


def _late_wheel(rig: Rig, course: Course, states: States) -> Array:
    """Effect of a wheel that is read late; the motor's work depends on q2' along the way."""
    assert course.wheel is not None
    turning = course.wheel.acceleration(course.nodes.instants.ravel()).reshape(1, *course.wheel_speed.shape)
    (work,) = _integrals(course, states, _wheel_slope(rig, course) * turning)
    momentum = rig.drive.a12 * states.speed + rig.drive.a22 * states.wheel_speed
    result: Array = (work - momentum * states.wheel_acceleration).ravel()
    return result


def friction_power(fit: NodeFit, v: Array) -> Array:
    """F(q1') q1' of the fitted friction, W."""
    size = np.abs(v)
    odd = fit.value("coulomb") * size + fit.value("viscous") * v * v + fit.value("quadratic") * size * v * v
    result: Array = odd + fit.value("offset") * v + fit.value("viscous_even") * size * v
    return result


def _angle_effect(
    rig: Rig, course: Course, states: States, fit: NodeFit, b: float, error: Array, rate: Array, along: Array
) -> Array:
    """Effect of an error of the angle and its rate (and of that along the way) on potential, kinetic energy and work.

    That of an error of the rate on the friction's work is negligible beside these.
    """
    momentum = fit.a11 * states.speed
    if course.wheel is not None:
        momentum = momentum + rig.drive.a12 * states.wheel_speed
    pull = b * np.sin(states.angle)
    for term in rig_terms(rig):
        coefficient = fit.value(term.name) if term.value is None else term.value.value
        pull = pull + coefficient * term.regressor(states.angle, states.speed, np.sign(states.speed))
    effect = -(pull * error + momentum * rate)
    if rig.drive.kind == "direct":
        effect = effect + _integrals(course, states, (course.voltage * along)[None])[0]
    result: Array = effect.ravel()
    return result


def _wheel_effect(rig: Rig, course: Course, states: States, derivative: Array, along: Array) -> Array:
    """Effect of an error s(q2) of the wheel's angle with this derivative at the nodes, and along the way."""
    momentum = rig.drive.a12 * states.speed + rig.drive.a22 * states.wheel_speed
    (work,) = _integrals(course, states, (_wheel_slope(rig, course) * along * course.wheel_speed)[None])
    result: Array = (work - momentum * derivative * states.wheel_speed).ravel()
    return result


def _wheel_slope(rig: Rig, course: Course) -> Array:
    """Change of the motor's power per unit of q2'."""
    motor = rig.drive.motor
    assert motor is not None
    n, rate = motor.gear_ratio.value, course.wheel_speed
    loss = motor.efficiency.value * motor.back_emf.value * course.active + motor.viscous.value * n
    slope: Array = n * (motor_torque(motor, course.voltage, rate) - motor_drag(motor, rate) - loss * rate)
    return slope


def _integrals(course: Course, states: States, signals: Array) -> Array:
    """Running integrals of signals (m, n−1, points) up to the states, (m, blocks, nodes)."""
    shape = states.instants.shape
    return running_integrals(course.nodes, signals, states.instants.ravel()).reshape(-1, *shape)
