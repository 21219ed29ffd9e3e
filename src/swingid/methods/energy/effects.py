"""Effects of every constant and declared imperfection on the known side of the energy balance.

The estimate is linear in the known side, so an effect per unit at the nodes, times the influence of the nodes, is a
sensitivity coefficient, without a second fit (GUM 5.1.3). As `balance.imperfections`, for energies.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from swingid.balance.imperfections import (
    ANGLE_OFFSET,
    OF_THE_ANGLE,
    Imperfection,
    of_scale,
    of_sensor,
    scale_errors,
    wheel_tilt,
    with_rig,
)
from swingid.balance.motor import motor_drag, motor_torque
from swingid.balance.rows import shifted
from swingid.methods.energy.balance import MOTOR, Course, States
from swingid.methods.energy.fit import NodeFit
from swingid.model.rig import Rig
from swingid.model.rig.drive import Motor
from swingid.model.terms import TERMS, rig_terms
from swingid.numerics.arrays import Array
from swingid.numerics.quadrature import running_integrals
from swingid.preparation.scale import Scale
from swingid.units import Quantity

Shape = Callable[[Array], Array]

SHAPES: dict[str, tuple[Shape, Shape]] = {"cosine": (np.cos, lambda q: -np.sin(q)), "sine": (np.sin, np.cos)}
"""Shapes of the nonlinearity of an encoder over its angle, and their derivatives."""


def effects(rig: Rig, course: Course, states: States, scale: Scale, fit: NodeFit, b: float) -> list[Imperfection]:
    """All constants that the balance uses (std 0 where they count as exact) and all imperfections declared.

    The rows of an `Imperfection` are here the nodes, flattened, in joules per unit of the source. b: gravity
    torque, as known or as identified.
    """
    found = [*_held(rig, states), *_axis_sensor(rig, course, states, fit, b), *_wheel_sensor(rig, course, states)]
    found += _stated_scales(rig, course, states, fit, b)
    motor = rig.drive.motor
    if scale.drive == "reaction-wheel" and motor is not None:
        found = [*_inertias(rig, motor, states), *_motor(rig, motor, states), *found]
    elif scale.drive == "direct":
        gain = rig.log.torque_gain
        found = [_constant("log.torque_gain", gain, states.work / gain.value), *found]
    return [item for item in with_rig(rig, found) if item.std > 0 or item.constant]


def _constant(key: str, quantity: Quantity, effect: Array, direct: float = 0.0) -> Imperfection:
    return Imperfection(key, quantity.std or 0.0, effect.ravel(), direct, key, constant=True)


def _held(rig: Rig, states: States) -> Iterator[Imperfection]:
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


def _inertias(rig: Rig, motor: Motor, states: States) -> Iterator[Imperfection]:
    """J2 and Jr, which are also the difference of a11 and J1."""
    assert rig.drive.wheel is not None
    n, v2, along = motor.gear_ratio.value, states.wheel_speed, rig.drive.wheel.along.value
    product = along * states.speed * v2
    yield _constant("drive.wheel.inertia", rig.drive.wheel.inertia, -product - 0.5 * v2**2, -along)
    yield _constant("drive.motor.rotor_inertia", motor.rotor_inertia, -n * product - 0.5 * n**2 * v2**2, -along)
    yield wheel_tilt(rig, (states.speed * v2).ravel())


def _motor(rig: Rig, motor: Motor, states: States) -> Iterator[Imperfection]:
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


def _axis_sensor(rig: Rig, course: Course, states: States, fit: NodeFit, b: float) -> Iterator[Imperfection]:
    """Once-per-turn nonlinearity q + α cos q + β sin q and latency q + δ q' of the axis' encoder."""
    sensor, driven = course.encoders.angle, rig.drive.kind == "direct"
    instants = course.nodes.instants.ravel()
    if sensor.nonlinearity and rig.axis.kind == "rotary":
        q, v = states.angle, states.speed
        along = course.axis.angle_at(instants).reshape(course.speed.shape) if driven else course.speed
        for kind, (shape, slope) in SHAPES.items():
            rates = slope(q) * v, slope(along) * course.speed
            effect = _angle_effect(rig, course, states, fit, b, shape(q), *rates)
            yield of_sensor(course.encoders, "angle", kind, effect)
    if sensor.latency.std:
        turning = course.axis.acceleration(instants).reshape(course.speed.shape) if driven else course.speed
        effect = _angle_effect(rig, course, states, fit, b, states.speed, states.acceleration, turning)
        yield of_sensor(course.encoders, "angle", "latency", effect - friction_power(fit, states.speed).ravel())


def _stated_scales(rig: Rig, course: Course, states: States, fit: NodeFit, b: float) -> Iterator[Imperfection]:
    """Angles of which the log shows (1 + ε) q + δ."""
    still, moving = np.zeros_like(states.speed), np.zeros_like(course.speed)
    for key, std in scale_errors(rig).items():
        if key in OF_THE_ANGLE:
            effect = _angle_effect(rig, course, states, fit, b, states.angle, states.speed, course.speed)
            for name, column in states.friction.items():
                effect = effect - ((TERMS[name].power or 0) + 1) * fit.value(name) * column.ravel()
        elif key == ANGLE_OFFSET:
            effect = _angle_effect(rig, course, states, fit, b, np.ones_like(states.speed), still, moving)
        else:
            ones, along = np.ones_like(states.wheel_speed), np.ones_like(course.wheel_speed)
            effect = _wheel_effect(rig, course, states, ones, along)
        yield of_scale(key, std, effect)


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


def _wheel_sensor(rig: Rig, course: Course, states: States) -> Iterator[Imperfection]:
    """As for the axis; the motor's work depends on q2' along the way."""
    wheel, sensor = course.wheel, course.encoders.wheel
    if wheel is None:
        return
    instants = course.nodes.instants.ravel()
    if sensor.nonlinearity:
        at_nodes = wheel.angle_at(states.instants.ravel()).reshape(states.instants.shape)
        along = wheel.angle_at(instants).reshape(course.wheel_speed.shape)
        for kind, (_, derivative) in SHAPES.items():
            effect = _wheel_effect(rig, course, states, derivative(at_nodes), derivative(along))
            yield of_sensor(course.encoders, "wheel", kind, effect)
    if sensor.latency.std:
        (work,) = _integrals(
            course,
            states,
            _wheel_slope(rig, course) * wheel.acceleration(instants).reshape(1, *course.wheel_speed.shape),
        )
        momentum = rig.drive.a12 * states.speed + rig.drive.a22 * states.wheel_speed
        yield of_sensor(course.encoders, "wheel", "latency", (work - momentum * states.wheel_acceleration).ravel())


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
