"""What faults do: to the columns of a log as the logger wrote it, and as torques on the twin's axis from outside.

A function of columns takes (log, scene, severity) and returns a log; one of torques takes (scene, severity) and returns
the torque (N m or N) at every instant of the scene. What is random is drawn by `Scene.rng`, the same at every call.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from swingid.model.rig import Rig
from swingid.numerics.arrays import Array, Ints
from swingid.recording.recording import CHANNELS, Recording

MARGIN = 0.1
"""Share of a log at its start and at its end in which no single event (push, lost counts) is put."""

MEMORY = 0.02
"""Correlation time (s) of sensor noise with memory, as of a fused angle."""

YIELDS = (0.05, 0.1, 0.2, 0.4, 0.8)
"""Angles (rad) after a reversal at which the parts of a cable slip, as a bundle of wires does from the outside in."""

TAKEN_UP = 0.02
"""Torque at which the play of a gear is taken up to three quarters, as a share of the gravity torque."""

STIFF = 20.0
"""Stiffness of a stop over its severity, in units of the gravity torque per rad."""


@dataclass(frozen=True)
class Scene:
    """The true motion at some instants (s, rad, rad/s), the twin's rig, the seed of the run.

    reach: the angle (rad) that is exceeded for 5 % of the same run without torques from outside.
    """

    time: Array
    angle: Array
    speed: Array
    rig: Rig
    seed: int
    reach: float

    @property
    def rng(self) -> np.random.Generator:
        """What is drawn by the seed, from its beginning."""
        return np.random.default_rng([self.seed, 2])

    @property
    def acceleration(self) -> Array:
        """Return the acceleration of the axis, rad/s²."""
        return np.asarray(np.gradient(self.speed, self.time))

    @property
    def progress(self) -> Array:
        """The share of the run that is over, from 0 to 1."""
        return np.asarray((self.time - self.time[0]) / (self.time[-1] - self.time[0]))

    @property
    def scale(self) -> float:
        """A torque to compare with, see `torque_scale`."""
        return torque_scale(self.rig)

    def moment(self) -> float:
        """A random instant (s) with `MARGIN` before and behind it."""
        return float(np.interp(self.rng.uniform(MARGIN, 1 - MARGIN), self.progress, self.time))


def torque_scale(rig: Rig) -> float:
    """The gravity torque, N m; of a rig without one its inertia times 25 1/s², as the paper's rig has it."""
    gravity, inertia = rig.axis.gravity_torque, rig.axis.inertia
    assert not isinstance(gravity, str)
    assert inertia is not None
    return gravity.value or 25.0 * inertia.value


Columns = Callable[[Recording, Scene, float], Recording]
Torque = Callable[[Scene, float], Array]


# Columns.


def scaled(channel: str) -> Columns:
    """The values of a channel times the severity."""
    return lambda log, _scene, factor: replace(log, **{channel: getattr(log, channel) * factor})


def correlated_noise(log: Recording, scene: Scene, std: float) -> Recording:
    """Noise of the angle whose correlation decays with `MEMORY`."""
    keep = np.exp(-np.diff(log.time, prepend=log.time[0]) / MEMORY)
    noise = _first_order(scene.rng.normal(0, std, len(log)), keep, np.sqrt(1 - keep**2))
    return replace(log, angle=log.angle + noise)


def low_pass(log: Recording, _scene: Scene, frequency: float) -> Recording:
    """The angle through a filter of first order with this cut-off frequency, in Hz."""
    keep = np.exp(-2 * np.pi * frequency * np.diff(log.time, prepend=log.time[0]))
    return replace(log, angle=_first_order(log.angle, keep, 1 - keep))


def _first_order(values: Array, keep: Array, gain: Array) -> Array:
    """y_k = keep_k y_(k-1) + gain_k x_k, from the first value on."""
    passed = values.copy()
    for k in range(1, len(passed)):
        passed[k] = keep[k] * passed[k - 1] + gain[k] * values[k]
    return passed


def clock(log: Recording, _scene: Scene, off: float) -> Recording:
    """Stamps of a clock that is fast by this share."""
    return replace(log, time=log.time * (1 + off))


def wandering_clock(log: Recording, scene: Scene, off: float) -> Recording:
    """Stamps of a clock whose rate changes by this share over the run."""
    share = np.interp(log.time, scene.time, scene.progress)
    return replace(log, time=log.time * (1 + off * share / 2))


def lost_rows(log: Recording, scene: Scene, share: float) -> Recording:
    """Rows lost at random, and the time made anew from the row number and the rate."""
    kept = np.flatnonzero(scene.rng.random(len(log)) >= share)
    return _rows(log, kept, log.time[: len(kept)])


def slow_rows(log: Recording, _scene: Scene, rate: float) -> Recording:
    """Every so many rows only, while the file says that the drive is held from row to row."""
    return _rows(log, np.arange(0, len(log), max(1, round(log.rate / rate))))


def polled(log: Recording, _scene: Scene, rate: float) -> Recording:
    """Angles that are read at a lower rate and repeated until the next reading."""
    step = max(1, round(log.rate / rate))
    read = np.arange(len(log)) // step * step
    return replace(log, **{name: getattr(log, name)[read] for name in _angles(log)})


def _rows(log: Recording, rows: Ints, time: Array | None = None) -> Recording:
    cut = {name: values[rows] for name in CHANNELS if (values := getattr(log, name)) is not None}
    return replace(log, **cut if time is None else cut | {"time": time})


def _angles(log: Recording) -> tuple[str, ...]:
    return ("angle",) if log.wheel_angle is None else ("angle", "wheel_angle")


def spikes(log: Recording, scene: Scene, number: float) -> Recording:
    """So many single readings of each angle are off by up to half a turn."""
    rng, changed = scene.rng, {}
    for name in _angles(log):
        values = getattr(log, name).copy()
        values[rng.choice(len(log), int(number), replace=False)] += rng.uniform(-np.pi, np.pi, int(number))
        changed[name] = values
    return replace(log, **changed)


def zero_drift(log: Recording, scene: Scene, angle: float) -> Recording:
    """An angle whose zero moves by this much over the run, as of a gyro's integral or a potentiometer that warms."""
    return _moved(log, scene, angle * scene.progress)


def lost_counts(log: Recording, scene: Scene, angle: float) -> Recording:
    """Put the encoder off by an angle from a random instant on."""
    return replace(log, angle=log.angle + np.where(log.time > scene.moment(), angle, 0.0))


def soft_shaft(log: Recording, scene: Scene, frequency: float) -> Recording:
    """The encoder sits on a shaft that twists as far as the body's acceleration does at a natural frequency in Hz."""
    return _moved(log, scene, scene.acceleration / (2 * np.pi * frequency) ** 2)


def backlash(log: Recording, scene: Scene, play: float) -> Recording:
    """The encoder is moved by the axis with a play of this angle (rad)."""
    read = scene.angle.copy()
    for k in range(1, len(read)):
        read[k] = min(max(read[k - 1], scene.angle[k] - play / 2), scene.angle[k] + play / 2)
    return _moved(log, scene, read - scene.angle)


def motor_backlash(log: Recording, scene: Scene, play: float) -> Recording:
    """The encoder sits on the motor, whose gear has this play (rad): ahead of the axis by half of it, by the torque."""
    assert log.torque is not None
    side = np.tanh(np.interp(scene.time, log.time, log.torque) / (TAKEN_UP * scene.scale))
    return _moved(log, scene, play / 2 * side)


def slipping_wheel(log: Recording, _scene: Scene, share: float) -> Recording:
    """The wheel's encoder sits on the motor's shaft, on which the wheel slips by this share as it turns forward."""
    assert log.wheel_angle is not None
    forward = np.maximum(np.diff(log.wheel_angle, prepend=log.wheel_angle[0]), 0.0)
    return replace(log, wheel_angle=log.wheel_angle + share * np.cumsum(forward))


def _moved(log: Recording, scene: Scene, further: Array) -> Recording:
    """The log of an encoder that is turned further by some angle (rad) at the scene's instants, on its grid again."""
    step = scene.rig.sensors.of("angle").resolution
    shift = np.round((scene.angle + further) / step) * step - np.round(scene.angle / step) * step if step else further
    return replace(log, angle=log.angle + np.interp(log.time, scene.time, shift))


# Torques.


def cubic_spring(scene: Scene, share: float) -> Array:
    """A cable that gets stiffer: this share of the gravity torque at 1 rad, growing with the cube of the angle."""
    return -share * scene.scale * scene.angle**3


def hysteresis(scene: Scene, share: float) -> Array:
    """A cable with hysteresis: springs in parallel that slip at `YIELDS` (Prandtl and Ishlinskii's stop operators).

    share: of the gravity torque, where all slip.
    """
    total = np.zeros(len(scene.angle))
    for width in YIELDS:
        held = 0.0
        for k, step in enumerate(np.diff(scene.angle, prepend=scene.angle[0])):
            held = min(max(held + step, -width), width)
            total[k] -= held / width
    return share * scene.scale / len(YIELDS) * total


def stop(scene: Scene, stiffness: float) -> Array:
    """Something soft that is touched on one side, over the outer tenth of the motion."""
    return -stiffness * STIFF * scene.scale * np.maximum(scene.angle - 0.9 * scene.reach, 0.0)


def soft_base(scene: Scene, frequency: float) -> Array:
    """A bearing that moves sideways: at rest with this natural frequency (Hz), with a hundredth of the axis' inertia.

    x'' + 2 ζ ω x' + ω² x = -(q'' cos q - q'² sin q), ζ = 0.05, in units in which the torque is -0.01 J x'' cos q.
    """
    assert scene.rig.axis.inertia is not None
    omega, step = 2 * np.pi * frequency, float(np.median(np.diff(scene.time)))
    pull = -(scene.acceleration * np.cos(scene.angle) - scene.speed**2 * np.sin(scene.angle))
    place, speed = float(pull[0]) / omega**2, 0.0
    torque = np.empty_like(pull)
    for k, force in enumerate(pull):
        torque[k] = force - 0.1 * omega * speed - omega**2 * place
        speed += step * torque[k]
        place += step * speed
    return np.asarray(-0.01 * scene.rig.axis.inertia.value * torque * np.cos(scene.angle))


def rolling_base(scene: Scene, share: float) -> Array:
    """A base that rolls freely: (m l)²/M is this share of the axis' inertia, M the mass of body and base.

    x'' = −(m l/M) (q'' cos q − q'² sin q), and the torque on the axis is −m l x'' cos q.
    """
    assert scene.rig.axis.inertia is not None
    pull = scene.acceleration * np.cos(scene.angle) - scene.speed**2 * np.sin(scene.angle)
    return np.asarray(share * scene.rig.axis.inertia.value * pull * np.cos(scene.angle))


def warming(scene: Scene, share: float) -> Array:
    """Viscous friction that falls by this share over the run, as of grease that gets warm."""
    viscous = scene.rig.axis.friction.viscous
    return share * (0.0 if viscous is None else viscous.value) * scene.progress * scene.speed


def running_in(scene: Scene, share: float) -> Array:
    """Coulomb friction that falls by this share over the run; a rig without it gets some, of 1 % of the torque scale.

    The sign of the speed is smoothed over 0.02 rad/s, for the torque is held from row to row.
    """
    coulomb = scene.rig.axis.friction.coulomb
    level = 0.01 * scene.scale if coulomb is None else coulomb.value
    remaining = share * scene.progress - (1.0 if coulomb is None else 0.0)
    return np.asarray(level * remaining * np.tanh(scene.speed / 0.02))


def push(length: float) -> Torque:
    """A half sine of torque of this length (s), as of a hand; its peak is a share of the gravity torque."""

    def torque(scene: Scene, share: float) -> Array:
        part = np.clip((scene.time - scene.moment()) / length, 0.0, 1.0)
        return share * scene.scale * np.sin(np.pi * part)

    return torque


def pumped(scene: Scene, share: float) -> Array:
    """A hand that swings the body for 70 % of the run: a share of the gravity torque, along with the speed."""
    return share * scene.scale * np.tanh(scene.speed) * (scene.progress < 0.7)
