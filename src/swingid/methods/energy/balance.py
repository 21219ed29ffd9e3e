"""The terms of the energy balance (1), (2) at any instant, as rows: see `balance.energies`.

Between two instants the constant of energy drops out: that is a pass of the paper. Velocities come from the angles by
local cubics (`smooth_speed`, each channel with its own width). The work of the voltage, which is constant between
two samples, is taken over the measured turn of the wheel, so it telescopes; a smoothed speed only determines
the branch of the dead zone, the direction of rotation, and the loss by f2.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from swingid.balance.motor import motor_torque
from swingid.balance.rows import Rows, Windows
from swingid.methods.energy.chain import Chain, drive_at, observed_speed
from swingid.model.equation import Equation, shifted
from swingid.model.rig import Rig
from swingid.model.rig.drive import Motor
from swingid.model.shapes import WAVE
from swingid.model.terms import RigTerm
from swingid.numerics.arrays import Array, Bools, Ints
from swingid.numerics.quadrature import GaussNodes, running_integrals
from swingid.preparation.encoders import Encoders
from swingid.preparation.motion import Motion
from swingid.preparation.noise import Noise
from swingid.preparation.speed import SHARE, SPACING, Speed, narrowed, smooth_speed
from swingid.recording.recording import Recording

SMOOTHED = Chain()

LOSSES = ("coulomb", "viscous", "quadratic", "viscous_even")
"""Terms of friction whose work is an integral; that of `offset` is the angle."""

MOTOR = ("torque_per_volt", "back_emf", "dead_zone", "motor_viscous", "motor_coulomb")
"""Terms of the work of a wheel's motor; that of another drive is `torque`."""


@dataclass(frozen=True)
class Course:
    """Speeds and drive of a log at its Gauss nodes, arrays (n−1, points).

    axis: q1' smoothed, at the nodes speed. turn: q2' whose integral over an interval is the measured turn (or smoothed,
    see `of`); wheel_speed: q2' smoothed. drive: voltage or torque between the rows. Direct drive: turn is q1', wheel
    and motor None. Free decay: 0. encoders: what is declared of them.
    """

    nodes: GaussNodes
    axis: Speed
    wheel: Speed | None
    speed: Array
    turn: Array
    wheel_speed: Array
    drive: Array
    motor: Motor | None
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
        still = np.zeros_like(speed)
        if rig.drive.channel is None:
            return cls(nodes, axis, None, speed, still, still, still, None, encoders)
        wheel, motor, rate = None, None, still
        turned, smooth, drive = log.angle, speed, log.torque
        if rig.drive.channel != "torque":
            assert log.wheel_angle is not None
            turned, drive, motor = log.wheel_angle, log.voltage, rig.drive.motor
            if chain.observers:
                wheel = observed_speed(log.time, turned, noise.wheel)
            else:
                wheel = smooth_speed(log.time, turned, noise.wheel, spacing=SPACING, share=SHARE)
            smooth = rate = wheel.at_nodes(nodes)
        assert drive is not None
        turn = smooth if chain.observers or not measured else nodes.spline(turned, derivative=1)
        return cls(nodes, axis, wheel, speed, turn, rate, drive_at(nodes, log, drive, chain), motor, encoders)

    @cached_property
    def active(self) -> Array:
        """1 where the motor is outside its dead zone, else 0."""
        assert self.motor is not None
        acts: Bools = motor_torque(self.motor, self.drive, self.wheel_speed) != 0.0
        return acts.astype(np.float64)

    def powers(self) -> Iterator[Array]:
        """Powers f q1' of the terms `LOSSES`, then those of the drive, at the nodes, one by one: each takes memory."""
        v, size = self.speed, np.abs(self.speed)
        square = v * v
        yield from (size, square, size * square, size * v)
        if self.motor is None:
            yield self.drive * self.turn
            return
        rate, acting, (low, high) = self.wheel_speed, self.active * self.turn, self.motor.dead_zone
        yield acting * self.drive
        yield acting * rate
        yield np.where(motor_torque(self.motor, self.drive, rate) > 0.0, high, low) * acting
        yield rate * self.turn
        yield np.sign(rate) * self.turn


@dataclass(frozen=True, kw_only=True)
class PassRows(Rows):
    """The terms of the balance at the nodes of passes: of each the energy (blocks · nodes,) by its name.

    instants (blocks, nodes): of the nodes, in s; a block has a constant of energy of its own.
    """

    course: Course
    instants: Array

    @classmethod
    def of(cls, course: Course, instants: Array, equation: Equation) -> PassRows:
        """The terms of an equation at `instants` (blocks, nodes) inside the log."""
        rows = cls(Windows(instants.ravel(), np.zeros(instants.size)), {}, course=course, instants=instants)
        v1, v2 = rows.speed, rows.wheel_speed
        columns = {"inertia": 0.5 * v1**2, "wheel": v1 * v2, "wheel_inertia": 0.5 * v2**2, "offset": rows.angle}
        works = rows.at(lambda times: running_integrals(course.nodes, course.powers(), times))
        columns |= dict(zip(LOSSES + (("torque",) if course.motor is None else MOTOR), works, strict=True))
        for term in equation.terms.values():
            columns |= _works(rows, term)
        return rows.beside(columns)

    def at(self, function: Callable[[Array], Array]) -> Array:
        """A function of rising instants, (…, instants), at the nodes, which overlap where passes do."""
        flat = self.windows.centres
        values = function(flat[self._order])
        result = np.empty_like(values)
        result[..., self._order] = values
        return result

    @cached_property
    def _order(self) -> Ints:
        return np.argsort(self.windows.centres, kind="stable")

    @cached_property
    def angle(self) -> Array:
        """Smoothed angle of the axis at the nodes, flattened as the terms are."""
        return self.at(self.course.axis.angle_at)

    @cached_property
    def speed(self) -> Array:
        """q1' at the nodes."""
        return self.at(self.course.axis.at)

    @cached_property
    def wheel_speed(self) -> Array:
        """q2' at the nodes, 0 without a wheel."""
        wheel = self.course.wheel
        return np.zeros(len(self)) if wheel is None else self.at(wheel.at)

    def blocks(self, values: Array) -> Array:
        """Values (…, blocks · nodes) as (…, blocks, nodes)."""
        return values.reshape(*values.shape[:-1], *self.instants.shape)

    def within(self, values: Array) -> Array:
        """Differences of values (…, blocks · nodes) from the mean of each block."""
        blocks = self.blocks(values)
        result: Array = blocks - (blocks.sum(axis=-1) / blocks.shape[-1])[..., None]
        return result.reshape(values.shape)

    def inner(self, cut: int) -> PassRows:
        """The rows without the `cut` outermost nodes on both sides of each block."""
        instants = self.instants[:, cut:-cut]
        columns = {name: self.blocks(column)[:, cut:-cut].ravel() for name, column in self.columns.items()}
        windows = Windows(instants.ravel(), np.zeros(instants.size))
        return replace(self, windows=windows, columns=columns, instants=instants)


def _works(rows: PassRows, rig_term: RigTerm) -> dict[str, Array]:
    """∫f q1' dt of a term: a potential energy, with its derivative by the shift, or a loss."""
    term, course = rig_term.term, rows.course
    if not term.is_conservative:
        along = course.axis.angle_at(course.nodes.flat[0]).reshape(course.speed.shape)
        power = rig_term.regressor(along, course.speed, np.sign(course.speed)) * course.speed
        return {rig_term.name: rows.at(lambda times: running_integrals(course.nodes, [power], times))[0]}
    if not rig_term.shift.std:
        return {rig_term.name: term.of_angle_integral(rows.angle, *rig_term.at)}
    # ∂g/∂shift is −1 of a displacement, and of a wave dg/dq over its order
    by_shift = term.of_angle(rows.angle, *rig_term.at) / rig_term.order if term.kind == WAVE else -rows.angle
    return {rig_term.name: term.of_angle_integral(rows.angle, *rig_term.at), shifted(rig_term.name): by_shift}
