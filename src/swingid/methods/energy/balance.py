"""The energy balance (1), (2) at any instant: energy of the rig, work of the drive, and loss by friction.

    ½ a11 q1'² + ∫F q1' dt = W + b cos q1 − a12 q1' q2' − ½ a22 q2'² + constant
    W = ∫N (M − f2 N q2' − f3 sgn q2') q2' dt    (reaction wheel)        W = ∫τ q1' dt    (direct drive)

Between two instants the constant drops out: that is a pass of the paper. Velocities come from the angles by local
cubics (`smooth_speed`, each channel with its own width). The work of the voltage, which is constant between
two samples, is taken over the measured turn of the wheel, so it telescopes; a smoothed speed only determines
the branch of the dead zone, the direction of rotation, and the loss by f2.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from swingid.balance.motor import motor_drag, motor_torque
from swingid.methods.energy.chain import Chain, between_rows, filtered_drive, observed_speed
from swingid.model.equation import Equation, shifted
from swingid.model.rig import Rig
from swingid.model.terms import WAVE, RigTerm
from swingid.numerics.arrays import Array
from swingid.numerics.quadrature import GaussNodes, running_integrals
from swingid.preparation.encoders import Encoders
from swingid.preparation.motion import Motion
from swingid.preparation.noise import Noise
from swingid.preparation.speed import SHARE, SPACING, Speed, narrowed, smooth_speed
from swingid.recording.recording import Recording

SMOOTHED = Chain()


@dataclass(frozen=True)
class Course:
    """Speeds and known powers of a log at its Gauss nodes, arrays (n−1, points).

    axis: q1' smoothed. power: of the drive (W), less the losses of the motor. turn: q2' whose integral over an
    interval is the measured turn (or smoothed, see `of`); wheel_speed: q2' smoothed. voltage:
    as held; active: 1 where the motor is outside its dead zone. Direct drive: turn is q1', voltage the torque, wheel
    None. Free decay: power 0. encoders: what is declared of them.
    """

    nodes: GaussNodes
    axis: Speed
    wheel: Speed | None
    speed: Array
    turn: Array
    wheel_speed: Array
    voltage: Array
    active: Array
    power: Array
    encoders: Encoders

    @classmethod
    def of(
        cls,
        log: Recording,
        rig: Rig,
        motion: Motion,
        noise: Noise,
        encoders: Encoders,
        chain: Chain = SMOOTHED,
        *,
        measured: bool = True,
    ) -> Course:
        """The course of the part of a log that `motion` describes; angles at their stamps (latency compensated).

        measured: whether work is taken over the turn as measured, not as smoothed (see `jitter`).
        """
        samples_per_swing = motion.half_period * log.rate if len(motion.turning_times) > 1 else len(log)
        nodes = GaussNodes(log.time, 2 if samples_per_swing > 200 else 3)
        if chain.observers:
            axis = observed_speed(log.time, log.angle, noise.angle)
        else:
            axis = narrowed(motion.speed, log.time, log.angle, noise.angle)
        speed = axis.at_nodes(nodes)
        nothing = np.zeros_like(speed)
        if rig.drive.kind == "none":
            return cls(nodes, axis, None, speed, nothing, nothing, nothing, nothing, nothing, encoders)
        command = log.voltage if rig.drive.kind == "reaction-wheel" else log.torque
        assert command is not None
        if chain.filter_time > 0:
            drive = filtered_drive(nodes, command, chain.filter_time, held=log.drive_held)
        else:
            drive = between_rows(nodes, command, held=log.drive_held)
        if rig.drive.kind == "direct":
            turn = speed if chain.observers or not measured else nodes.spline(log.angle, derivative=1)
            return cls(nodes, axis, None, speed, turn, nothing, drive, nothing, drive * turn, encoders)
        assert log.wheel_angle is not None
        assert rig.drive.motor is not None
        if chain.observers:
            wheel = observed_speed(log.time, log.wheel_angle, noise.wheel)
        else:
            wheel = smooth_speed(log.time, log.wheel_angle, noise.wheel, spacing=SPACING, share=SHARE)
        wheel_speed = wheel.at_nodes(nodes)
        turn = wheel_speed if chain.observers or not measured else nodes.spline(log.wheel_angle, derivative=1)
        motor = rig.drive.motor
        torque = motor_torque(motor, drive, wheel_speed)
        active = (torque != 0.0).astype(np.float64)
        power = motor.gear_ratio.value * (torque - motor_drag(motor, wheel_speed)) * turn
        return cls(nodes, axis, wheel, speed, turn, wheel_speed, drive, active, power, encoders)


@dataclass(frozen=True)
class States:
    """Angles, speeds, accelerations and running integrals at the nodes of all passes; arrays (blocks, nodes).

    height: cos q1, by which gravity's torque b enters (0 on a linear axis). work: W. friction: ∫f(q1') q1' dt of every
    term f of friction (`TERMS`). further: ∫f q1' dt of the rig's further terms, and under their names with "'" behind
    ∫(∂f/∂shift) q1' dt. motor: derivatives of W by the motor's constants but for constant factors (`MOTOR`). Rising
    over the flattened array.
    """

    instants: Array
    angle: Array
    height: Array
    speed: Array
    acceleration: Array
    wheel_speed: Array
    wheel_acceleration: Array
    work: Array
    friction: dict[str, Array]
    motor: dict[str, Array]
    further: dict[str, Array]

    def each(self, change: Callable[[Array], Array]) -> States:
        """The states with all arrays changed alike."""
        changed: dict[str, Any] = {
            name: {key: change(one) for key, one in value.items()} if isinstance(value, dict) else change(value)
            for name, value in vars(self).items()
        }
        return States(**changed)

    def known(self, rig: Rig, equation: Equation) -> Array:
        """The known side of the balance: W + b cos q1 − Σ c ∫f q1' dt − a12 q1' q2' − ½ a22 q2'² with what is known."""
        side = self.work + equation.value("gravity_torque") * self.height
        side = side - sum((equation.value(name) * column for name, column in self.further.items()), 0.0)
        if equation.drive != "reaction-wheel":
            return side
        v1, v2 = self.speed, self.wheel_speed
        result: Array = side - rig.drive.a12 * v1 * v2 - 0.5 * rig.drive.a22 * v2**2
        return result


TERMS = ("coulomb", "viscous", "quadratic", "offset", "viscous_even")
"""sgn v, v, v|v|; what depends on the direction: 1 and |v|."""

MOTOR = ("voltage", "back_emf", "viscous", "coulomb")
"""Factors of c1, c2, f2 and f3: u q2' and q2'² outside the dead zone, q2'², |q2'|."""


def running_powers(course: Course, instants: Array) -> Array:
    """Integrals up to rising `instants` of the power, |v|, v², |v| v², |v| v and those of `MOTOR`, (9, instants)."""
    return running_integrals(course.nodes, _powers(course), instants)


def _powers(course: Course) -> Iterator[Array]:
    """The power, |v|, v², |v| v², |v| v and the terms of `MOTOR` at the nodes, one by one, for each takes memory."""
    v, size = course.speed, np.abs(course.speed)
    square = v * v
    yield from (course.power, size, square, size * square, size * v)
    if course.wheel is None:
        yield from [np.zeros_like(v)] * len(MOTOR)
        return
    rate, acting = course.wheel_speed, course.active * course.turn
    yield acting * course.voltage
    yield acting * rate
    yield rate * course.turn
    yield np.sign(rate) * course.turn


def further_works(course: Course, instants: Array, angle: Array, terms: tuple[RigTerm, ...]) -> dict[str, Array]:
    """∫f q1' dt of further terms at rising `instants`, where the axis is at `angle`: potential energies, or losses."""
    found = {}
    for term in terms:
        if term.term.is_conservative:
            found[term.name] = term.term.of_angle_integral(angle, *term.at)
            # ∂g/∂shift is −1 of a displacement, and of a wave dg/dq over its order
            wave = term.term.kind == WAVE
            found[shifted(term.name)] = term.term.of_angle(angle, *term.at) / term.order if wave else -angle
            continue
        along = course.axis.angle_at(course.nodes.instants.ravel()).reshape(course.speed.shape)
        power = term.regressor(along, course.speed, np.sign(course.speed)) * course.speed
        (work,) = running_integrals(course.nodes, power[None], instants.ravel())
        found[term.name] = work.reshape(instants.shape)
    return found


def states_at(course: Course, instants: Array, *, linear: bool, further: tuple[RigTerm, ...] = ()) -> States:
    """States at `instants` (blocks, nodes), rising when flattened and inside the log."""
    flat, shape = instants.ravel(), instants.shape
    axis = course.axis
    terms = running_powers(course, flat).reshape(-1, *shape)
    angle = axis.angle_at(flat).reshape(shape)
    wheel = course.wheel
    still = np.zeros(shape)
    return States(
        instants=instants,
        angle=angle,
        height=still if linear else np.cos(angle),
        speed=axis.at(flat).reshape(shape),
        acceleration=axis.acceleration(flat).reshape(shape),
        wheel_speed=still if wheel is None else wheel.at(flat).reshape(shape),
        wheel_acceleration=still if wheel is None else wheel.acceleration(flat).reshape(shape),
        work=terms[0],
        friction=dict(zip(TERMS, (*terms[1:4], angle, terms[4]), strict=True)),
        motor=dict(zip(MOTOR, terms[5:], strict=True)),
        further=further_works(course, instants, angle, further),
    )
