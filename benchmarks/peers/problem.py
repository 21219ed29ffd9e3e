"""The log and the loop that all are given: the paper's rig, 0.8 sin 8.5t, 14-bit encoders, 1 kHz, and its model.

Who fits gets the log's file, read back, and the constants that the rig file states; neither inertia nor friction.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

import swingid as sw

PART = (15.0, 18.0)
"""s of the log that is fitted: eight half swings, 3001 rows."""

DURATION, RATE = 25.0, 1000.0
HIDDEN = {"axis.friction.coulomb": 2e-3, "axis.friction.static": 4e-3, "axis.friction.stribeck_speed": 0.3}
LOGS = {"viscous": {}, "hidden dry": HIDDEN}
"""Friction of the twin: viscous as in the paper; and Stribeck's beside it, which no model below has."""

START = (3.3e-3, 1e-3, 1e-4)
"""Where searches begin: J1 (kg m^2) a tenth too large, as from a drawing; viscous (N m s), Coulomb (N m) friction."""

SCALE = np.array([3e-3, 1e-3, 1e-3])
"""Sizes of the three, so that all solvers see numbers near one."""


@dataclass(frozen=True)
class Motor:
    """Constants as the rig file states them, in the paper's letters; gear is N."""

    b: float
    J2: float
    Jr: float
    gear: float
    c1: float
    c2: float
    eta: float
    d1: float
    d2: float
    f2: float
    f3: float


@dataclass(frozen=True)
class Log:
    """What is fitted: the recording of `PART` with its rig for swingid, the same as arrays for the others."""

    recording: sw.Recording
    rig: sw.Rig
    motor: Motor
    truth: float

    @property
    def time(self) -> np.ndarray:
        return self.recording.time - self.recording.time[0]

    @property
    def step(self) -> float:
        return 1.0 / RATE

    @property
    def angles(self) -> np.ndarray:
        """(rows, 2), rad, from zero at the first wheel reading."""
        wheel = self.recording.wheel_angle
        return np.column_stack([self.recording.angle, wheel - wheel[0]])

    @property
    def voltage(self) -> np.ndarray:
        return self.recording.voltage

    @property
    def noise(self) -> float:
        """Standard deviation of a reading: a step of the encoder over the square root of 12."""
        return self.rig.sensors.of("angle").resolution / np.sqrt(12.0)

    @property
    def first_state(self) -> np.ndarray:
        """q1, q1', q2, q2' at the first row: readings, and slopes of straight lines through the next 20."""
        slopes = np.polynomial.polynomial.polyfit(self.time[:20], self.angles[:20], 1)
        return np.array([slopes[0, 0], slopes[1, 0], slopes[0, 1], slopes[1, 1]])

    def error(self, inertia: float) -> float:
        """Per cent of the twin's inertia."""
        return 100.0 * (inertia / self.truth - 1.0)


def read(angles: np.ndarray, rig: sw.Rig) -> np.ndarray:
    """What the rig's encoders show of angles (rad)."""
    step = rig.sensors.of("angle").resolution
    return step * np.rint(np.asarray(angles) / step)


def twin(name: str, **changes: object) -> sw.Rig:
    return sw.Rig.builtin("paper").changed(LOGS[name] | changes)


@cache
def log(name: str) -> Log:
    rig = twin(name)
    run = sw.simulate(
        rig,
        sw.parse_reference("sine 0.8 rad 8.5 rad/s"),
        sw.Compensator.paper(rig),
        duration=DURATION,
        rate=RATE,
        seed=1,
    )
    told = rig.changed({"axis.inertia": None, "axis.friction": None})
    with tempfile.TemporaryDirectory() as folder:
        recording = sw.Recording.load(run.save(Path(folder) / "run.parquet", told), told).segment(*PART)
    return Log(recording, told, motor(rig), rig.axis.inertia.value)


def motor(rig: sw.Rig) -> Motor:
    m = rig.drive.motor
    return Motor(
        rig.axis.gravity_torque.value, rig.drive.wheel.inertia.value, m.rotor_inertia.value, m.gear_ratio.value,
        m.torque_per_volt.value, m.back_emf.value, m.efficiency.value, m.dead_zone[1], m.dead_zone[0],
        m.viscous.value, m.coulomb.value,
    )  # fmt: skip


def slope(xp: object, x: tuple, u: object, theta: tuple, m: Motor) -> tuple:
    """(I), (II) as a first order system: derivatives of (q1, q1', q2, q2'); theta = (J1, viscous, Coulomb).

    xp: numpy, jax.numpy or casadi, which all know sin, sign, fmax or maximum.
    """
    _, v1, _, v2 = x
    inertia, viscous, coulomb = theta
    most, least = (xp.fmax, xp.fmin) if hasattr(xp, "fmax") else (xp.maximum, xp.minimum)
    a11, a12, a22 = inertia + m.J2 + m.Jr, m.J2 + m.gear * m.Jr, m.J2 + m.gear**2 * m.Jr
    torque = m.eta * (m.c1 * u - m.c2 * v2)
    live = most(torque - m.d1, 0.0) + least(torque - m.d2, 0.0)
    r1 = -m.b * xp.sin(x[0]) - viscous * v1 - coulomb * xp.sign(v1)
    r2 = m.gear * (live - m.f2 * m.gear * v2 - m.f3 * xp.sign(v2))
    determinant = a11 * a22 - a12 * a12
    return v1, (a22 * r1 - a12 * r2) / determinant, v2, (a11 * r2 - a12 * r1) / determinant
