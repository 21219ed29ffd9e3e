"""Inputs of the adaptation: speed, gravity and drive of a log, at the start, middle and end of each interval.

u2 of (10) is the output of the motor after its dead zone, less its Coulomb friction, for any controller:
c7 x4 − c4 u2 = −(a12/(a22 b)) N (M(u0, x4) − f2 N x4 − f3 sgn x4). With u1 and u3 exact it is u0 − u1 − u3.
On a direct drive this term is τ/b, in a free decay 0.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from swingid.balance.motor import motor_drag, motor_torque
from swingid.control.observer import VelocityObserver
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array, Bools
from swingid.numerics.quadrature import held_between
from swingid.numerics.spline import spline_at, spline_slopes
from swingid.preparation.motion import Motion
from swingid.preparation.noise import Noise
from swingid.preparation.speed import NARROWEST, SHARE, SPACING, narrowed, smooth_speed, speed_on_grid
from swingid.recording.recording import Recording

VELOCITIES = ("smoothed", "observers")
SLOW = 4.0
"""Standard deviations of the wheel's speed below which it may be rest."""


@dataclass(frozen=True)
class Channels:
    """Angle, speed (rad or m, per s), wheel speed and held drive (V, N m or N), each (n − 1, 3): start, middle, end.

    They do not depend on constants of the rig. rests: where the wheel rests, with the axis' acceleration; None where
    that is not determined.
    """

    time: Array
    angle: Array
    speed: Array
    wheel_speed: Array
    drive: Array
    rests: Bools | None = None
    acceleration: Array | None = None


@dataclass(frozen=True)
class Widths:
    """Half-widths (s) of the local cubics that smooth axis and wheel; slow: wheel speed (rad/s) that may be rest."""

    axis: float
    wheel: float
    slow: float = 0.0

    def halved(self, step: float) -> Widths:
        """Half as wide, as far as rows `step` (s) apart allow; the difference shows the bias of smoothing."""
        least = NARROWEST * step
        axis, wheel = max(self.axis / 2, least), max(self.wheel / 2, least)
        # the noise of a slope grows with the width to the power of −3/2
        return Widths(axis, wheel, self.slow * (self.wheel / wheel) ** 1.5)


@dataclass(frozen=True)
class Signals:
    """time (n,) (s); speed x2, sine = sin x1 and phi, all (n − 1, 3): start, middle and end of each interval."""

    time: Array
    speed: Array
    sine: Array
    phi: Array


def widths_of(log: Recording, motion: Motion, noise: Noise) -> Widths:
    """The widths of `energy`: 0.7 of what is best for one speed, as noise averages out later."""
    axis = narrowed(motion.speed, log.time, log.angle, noise.angle)
    if log.wheel_angle is None:
        return Widths(axis.half_width, 0.0)
    wheel = smooth_speed(log.time, log.wheel_angle, noise.wheel, spacing=SPACING, share=SHARE)
    return Widths(axis.half_width, wheel.half_width, SLOW * wheel.noise)


def channels_of(log: Recording, widths: Widths | None) -> Channels:
    """Speeds by local cubics of those widths, or by the observers (23) run causally with the paper's gains."""
    axis, wheel = log.angle, log.wheel_angle
    if widths is None:
        angle, speed = _observed(log.time, axis)
        wheel_speed = np.zeros_like(speed) if wheel is None else _observed(log.time, wheel)[1]
        return Channels(log.time, angle, speed, wheel_speed, _drive(log))
    smooth = speed_on_grid(log.time, axis, 0.0, widths.axis, SPACING)
    angle, speed = _thrice(log.time, smooth.angle_at), _thrice(log.time, smooth.at)
    if wheel is None:
        return Channels(log.time, angle, speed, np.zeros_like(speed), _drive(log))
    wheel_speed = _thrice(log.time, speed_on_grid(log.time, wheel, 0.0, widths.wheel, SPACING).at)
    rests = resting(log.time, wheel_speed, widths)
    return Channels(log.time, angle, speed, wheel_speed, _drive(log), rests, _thrice(log.time, smooth.acceleration))


def resting(time: Array, wheel_speed: Array, widths: Widths) -> Bools:
    """Find where the wheel rests: its speed is not significant for longer than a reversal takes.

    Smoothing shortens a rest by half of its half-width at either end.
    """
    slow = np.concatenate([[False], np.abs(wheel_speed[:, 1]) < widths.slow, [False]])
    begins, ends = np.nonzero(~slow[:-1] & slow[1:])[0], np.nonzero(slow[:-1] & ~slow[1:])[0]
    moving = np.abs(np.diff(wheel_speed[:, 1]) / np.diff(time[:-1]))
    passage = 2 * widths.slow / max(float(np.sqrt(np.mean(moving**2))), 1e-300)
    rows = np.zeros(len(wheel_speed), dtype=bool)
    for begin, end in zip(begins, ends, strict=True):
        if time[end] - time[begin] > 3 * passage + 2 * widths.wheel:
            first, last = np.searchsorted(time, [time[begin] - widths.wheel / 2, time[end] + widths.wheel / 2])
            rows[first:last] = True
    return np.repeat(rows[:, None], 3, axis=1)


def _drive(log: Recording) -> Array:
    drive = log.voltage if log.voltage is not None else log.torque
    if drive is None:
        return np.zeros((len(log) - 1, 3))
    if log.drive_held:
        return np.repeat(held_between(log.time, drive)[:, None], 3, axis=1)
    bends = spline_slopes(log.time, drive)
    return _thrice(log.time, lambda t: spline_at(log.time, drive, bends, t, 0))


def _thrice(time: Array, function: Callable[[Array], Array]) -> Array:
    instants = np.column_stack([time[:-1], (time[:-1] + time[1:]) / 2, time[1:]])
    return function(instants.ravel()).reshape(instants.shape)


def _observed(time: Array, angle: Array) -> tuple[Array, Array]:
    """Straight lines between the samples, as the observers take the angle too."""
    first = float((angle[1] - angle[0]) / (time[1] - time[0]))
    return _on_lines(angle), _on_lines(VelocityObserver().run(time, angle, first))


def _on_lines(values: Array) -> Array:
    return np.column_stack([values[:-1], (values[:-1] + values[1:]) / 2, values[1:]])


def signals_of(channels: Channels, rig: Rig, *, sooner: bool = False) -> Signals:
    """The signals of the adaptation, with the constants of a rig; its gravity torque b must be known and not 0.

    sooner: the wheel reverses before its smoothed speed does, by half a row of the jump of its friction. A controller
    that compensates friction reacts to a reversal within a row, after half of one on average; smoothing does not
    resolve that, and whether the controller compensates is unknown.
    """
    sine, drive, motor = np.sin(channels.angle), rig.drive, rig.drive.motor
    phi = -sine
    if drive.channel == "torque":
        phi = phi + channels.drive / _gravity(rig)
    elif motor is not None:
        wheel, scale = channels.wheel_speed, drive.a12 / (drive.a22 * _gravity(rig))
        torque = motor_torque(motor, channels.drive, wheel) - motor_drag(motor, wheel)
        if sooner:
            # advanced by half a row of the jump of its friction
            jump = 2 * motor.gear_ratio.value * motor.coulomb.value / drive.a22
            ahead = np.sign(np.gradient(wheel[:, 1]))[:, None] * jump * np.diff(channels.time)[:, None] / 2
            torque = torque + motor.coulomb.value * (np.sign(wheel) - np.sign(wheel + ahead))
        pull = scale * motor.gear_ratio.value * torque
        if channels.rests is not None and channels.acceleration is not None:
            # friction holds the wheel, whatever the motor does; equation (II) is then a12 q1'' = N (M − friction)
            pull = np.where(channels.rests, scale * drive.a12 * channels.acceleration, pull)
        phi = phi - pull
    return Signals(channels.time, channels.speed, sine, phi)


def inertia_of(alpha2: Array, rig: Rig) -> Array:
    """J1^ (kg m²) of (22) for estimates of α2 (1/s²); without a wheel b/α2."""
    whole = _gravity(rig) / alpha2
    if rig.drive.wheel is None:
        return whole
    return whole + rig.drive.a12**2 / rig.drive.a22 - rig.drive.carried


def viscous_of(alpha2: Array, alpha3: Array, rig: Rig) -> Array:
    """f1^ N (N m s) of (22), with a wheel or without."""
    return alpha3 * _gravity(rig) / alpha2


def _gravity(rig: Rig) -> float:
    """The gravity torque b (N m), which the method requires."""
    gravity = rig.axis.acting_gravity
    assert gravity is not None
    return gravity.value
