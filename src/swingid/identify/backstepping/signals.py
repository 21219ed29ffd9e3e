"""What the adaptation is driven by: speed, gravity and drive of a log, at the start, middle and end of each interval.

u2 of (10) is what the motor does after its dead zone, its Coulomb friction taken off, for whatever controller made the
voltage: c7 x4 − c4 u2 = −(a12/(a22 b)) N (M(u0, x4) − f2 N x4 − f3 sgn x4). With u1 and u3 exact it is u0 − u1 − u3.
On a direct drive this term is τ/b, in a free decay 0.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swingid.control.observer import VelocityObserver
from swingid.identify.energy.balance import motor_drag, narrowed
from swingid.identify.energy.chain import held_between
from swingid.identify.motion import Motion, smooth_speed, speed_on_grid
from swingid.identify.motor_balance import motor_torque
from swingid.identify.noise import Noise
from swingid.identify.scale import Scale
from swingid.model.rig import Rig
from swingid.numerics.spline import spline_at, spline_slopes
from swingid.recording.recording import Recording

Array = NDArray[np.float64]

VELOCITIES = ("smoothed", "observers")
SHARE, SPACING = 0.7, 1.5


@dataclass(frozen=True)
class Channels:
    """Angle, speed (rad or m, per s), wheel speed and held drive (V, N m or N), each (n − 1, 3): start, middle, end.

    No constant of the rig has gone into them.
    """

    time: Array
    angle: Array
    speed: Array
    wheel_speed: Array
    drive: Array


@dataclass(frozen=True)
class Widths:
    """Half-widths (s) of the local cubics that smooth axis and wheel; None: by observers."""

    axis: float
    wheel: float


@dataclass(frozen=True)
class Signals:
    """time (n,) (s); speed x2, sine = sin x1 and phi, all (n − 1, 3): start, middle and end of each interval."""

    time: Array
    speed: Array
    sine: Array
    phi: Array


def widths_of(log: Recording, motion: Motion, noise: Noise) -> Widths:
    """The widths that `energy` takes: 0.7 of what is best for one speed, as noise averages out later."""
    axis = narrowed(motion.speed, log.time, log.angle, noise.angle)
    if log.wheel_angle is None:
        return Widths(axis.half_width, 0.0)
    wheel = smooth_speed(log.time, log.wheel_angle, noise.wheel, spacing=SPACING, share=SHARE)
    return Widths(axis.half_width, wheel.half_width)


def channels_of(log: Recording, widths: Widths | None) -> Channels:
    """Speeds by local cubics of those widths, or by the observers (23) run causally with the paper's gains."""
    axis, wheel = log.angle, log.wheel_angle
    still = np.zeros((len(log) - 1, 3))
    angle, speed = _observed(log.time, axis) if widths is None else _smoothed(log.time, axis, widths.axis)
    wheel_speed = still
    if wheel is not None:
        by_wheel = _observed(log.time, wheel) if widths is None else _smoothed(log.time, wheel, widths.wheel)
        wheel_speed = by_wheel[1]
    drive = log.voltage if log.voltage is not None else log.torque
    if drive is None:
        return Channels(log.time, angle, speed, wheel_speed, still)
    if log.drive_held:
        held = np.repeat(held_between(log.time, drive)[:, None], 3, axis=1)
        return Channels(log.time, angle, speed, wheel_speed, held)
    bends = spline_slopes(log.time, drive)
    return Channels(
        log.time, angle, speed, wheel_speed, _thrice(log.time, lambda t: spline_at(log.time, drive, bends, t, 0))
    )


def _smoothed(time: Array, angle: Array, width: float) -> tuple[Array, Array]:
    speed = speed_on_grid(time, angle, 0.0, width, SPACING)
    return _thrice(time, speed.angle_at), _thrice(time, speed.at)


def _thrice(time: Array, function: Callable[[Array], Array]) -> Array:
    instants = np.column_stack([time[:-1], (time[:-1] + time[1:]) / 2, time[1:]])
    return function(instants.ravel()).reshape(instants.shape)


def _observed(time: Array, angle: Array) -> tuple[Array, Array]:
    """Straight lines between the samples, as the observers take the angle too."""
    first = float((angle[1] - angle[0]) / (time[1] - time[0]))
    return _on_lines(angle), _on_lines(VelocityObserver().run(time, angle, first))


def _on_lines(values: Array) -> Array:
    return np.column_stack([values[:-1], (values[:-1] + values[1:]) / 2, values[1:]])


def signals_of(channels: Channels, rig: Rig) -> Signals:
    """The signals of the adaptation, with the constants of a rig; its gravity torque b must be known and not 0."""
    gravity = rig.axis.gravity_torque
    assert not isinstance(gravity, str)
    sine = np.sin(channels.angle)
    phi = -sine
    if rig.drive.kind == "direct":
        phi = phi + channels.drive / gravity.value
    elif rig.drive.kind == "reaction-wheel":
        motor = rig.drive.motor
        assert motor is not None
        torque = motor_torque(motor, channels.drive, channels.wheel_speed) - motor_drag(motor, channels.wheel_speed)
        phi = phi - rig.drive.a12 / (rig.drive.a22 * gravity.value) * motor.gear_ratio.value * torque
    return Signals(channels.time, channels.speed, sine, phi)


def inertia_of(alpha2: Array, rig: Rig) -> Array:
    """J1^ (kg m²) of (22) for estimates of α2 (1/s²); without a wheel b/α2."""
    gravity = rig.axis.gravity_torque
    assert not isinstance(gravity, str)
    whole = gravity.value / alpha2
    if rig.drive.kind != "reaction-wheel":
        return whole
    return whole + rig.drive.a12**2 / rig.drive.a22 - Scale.of(rig).carried


def viscous_of(alpha2: Array, alpha3: Array, rig: Rig) -> Array:
    """f1^ N (N m s) of (22), with a wheel or without."""
    gravity = rig.axis.gravity_torque
    assert not isinstance(gravity, str)
    return alpha3 * gravity.value / alpha2
