"""Candidate motions: sines and pairs of sines within the limits, and the course of the rig that follows each exactly.

q1 is the reference itself. Equation (I) then gives the wheel, from rest, and equation (II) with the dead zone inverted
the voltage. A real controller lags and overshoots, so limits are kept with some distance (`SPARE`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from swingid.control.references import Multisine, Sine
from swingid.model.friction import static_curve
from swingid.model.parameters import rig_vector
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.numerics.compiled import njit
from swingid.recording.recording import Recording

FREQUENCIES = (1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.5, 10.0, 12.0, 15.0, 20.0, 25.0)
"""rad/s; usual for a rig with a motor."""

SPARE = 0.8
"""Share of the voltage limit that a motion may need: the controller wants the rest."""

SHARES = (1.0, 0.7, 0.5, 0.35, 0.25, 0.15, 0.08)
"""Amplitudes tried, in shares of the largest allowed."""

SPLIT = (0.6, 0.4)
"""Amplitudes of the slower and the faster of two sines."""

APART = (1.5, 3.5)
"""Least and largest ratio of two frequencies."""

RESONANCE = (0.6, 1.35)
"""A sine between these shares of the frequency of the free swing is near resonance: the wheel hardly works."""

ROUGH = 200.0
"""Rows per second at which limits are checked."""


@dataclass(frozen=True)
class Course:
    """Angle (rad or m), speeds, and what the drive does, at evenly spaced instants (s); None where there is none."""

    time: Array
    angle: Array
    speed: Array
    wheel_angle: Array | None
    wheel_speed: Array | None
    voltage: Array | None
    torque: Array | None

    def recording(self, start: float) -> Recording:
        """What perfect sensors would log of it from `start` (s) on."""
        late = self.time >= start
        channels = (self.wheel_angle, self.voltage, self.torque)
        wheel, voltage, torque = (None if x is None else x[late] for x in channels)
        return Recording(
            time=self.time[late],
            angle=self.angle[late],
            wheel_angle=wheel,
            voltage=voltage,
            torque=torque,
            drive_held=False,
        )

    @property
    def peaks(self) -> dict[str, float]:
        """Largest angle, speed, wheel speed, voltage and torque, SI."""
        named = {name: getattr(self, name) for name in ("angle", "speed", "wheel_speed", "voltage", "torque")}
        return {name: float(np.abs(x).max()) for name, x in named.items() if x is not None}


@njit
def _friction(speeds: Array, p: Array) -> Array:
    result = np.empty(len(speeds))
    for k in range(len(speeds)):
        result[k] = static_curve(speeds[k], p)
    return result


def course_of(rig: Rig, reference: Sine | Multisine, duration: float, rate: float) -> Course:
    """The course of `rig` (its axis.inertia, friction and gravity torque are what is expected) over `duration` (s)."""
    time = np.arange(int(duration * rate) + 1) / rate
    angle, speed, acceleration = (derivative(reference, time, order) for order in range(3))
    p = rig_vector(rig)
    gravity = 0.0 if isinstance(rig.axis.gravity_torque, str) else rig.axis.gravity_torque.value
    resisting = gravity * np.sin(angle) + _friction(speed, p)
    assert rig.axis.inertia is not None
    if rig.drive.channel == "torque":
        torque = rig.axis.inertia.value * acceleration + resisting
        return Course(time, angle, speed, None, None, None, torque)
    drive = rig.drive
    assert drive.wheel is not None
    assert drive.motor is not None
    a11 = rig.axis.inertia.value + drive.wheel.inertia.value + drive.motor.rotor_inertia.value
    momentum = -_integral(resisting, rate)
    wheel_speed = (momentum - a11 * speed) / drive.a12
    wheel_acceleration = (-resisting - a11 * acceleration) / drive.a12
    voltage = _voltage(rig, drive.a12 * acceleration + drive.a22 * wheel_acceleration, wheel_speed)
    correction = np.diff(wheel_acceleration) / (12 * rate**2)
    wheel_angle = _integral(wheel_speed, rate) - np.concatenate([[0.0], np.cumsum(correction)])
    return Course(time, angle, speed, wheel_angle, wheel_speed, voltage, None)


def derivative(reference: Sine | Multisine, time: Array, order: int) -> Array:
    """The reference or a derivative of it at `time` (s)."""
    total = np.zeros_like(time)
    for part in parts_of(reference):
        factor = part.amplitude * part.frequency**order
        total += factor * np.sin(part.frequency * time + part.phase + 0.5 * np.pi * order)
    return total


def parts_of(reference: Sine | Multisine) -> tuple[Sine, ...]:
    """The sines of a reference."""
    return reference.parts if isinstance(reference, Multisine) else (reference,)


def _integral(values: Array, rate: float) -> Array:
    """Running trapezoid from 0."""
    result: Array = np.concatenate([[0.0], np.cumsum((values[1:] + values[:-1]) / (2 * rate))])
    return result


def _voltage(rig: Rig, torque: Array, wheel_speed: Array) -> Array | None:
    """Voltage for `torque` (N m) on the left of equation (II); None for a motor without a torque constant."""
    motor = rig.drive.motor
    assert motor is not None
    if motor.torque_per_volt.value == 0:
        return None
    gear = motor.gear_ratio.value
    drag = motor.viscous.value * gear * wheel_speed + motor.coulomb.value * np.sign(wheel_speed)
    shaft = torque / gear + drag
    low, high = motor.dead_zone
    ideal = shaft + np.where(shaft > 0, high, low)
    result: Array = (ideal / motor.efficiency.value + motor.back_emf.value * wheel_speed) / motor.torque_per_volt.value
    return result


@dataclass(frozen=True)
class Limits:
    """Largest angle (rad, m), wheel speed or, without a wheel, speed of the axis (rad/s, m/s; None: any), voltage."""

    angle: float
    speed: float | None
    voltage: float | None

    def kept(self, peaks: dict[str, float]) -> bool:
        """Return whether a motion with these peaks stays inside, with what the controller wants to spare."""
        speed = peaks.get("wheel_speed", peaks["speed"])
        if self.speed is not None and speed > self.speed:
            return False
        return self.voltage is None or peaks.get("voltage", 0.0) <= SPARE * self.voltage


def candidates(rig: Rig, limits: Limits, natural: float, slowest: float) -> list[Sine | Multisine]:
    """Sines and pairs of sines at the largest amplitude that the limits allow.

    natural: frequency of the free swing (rad/s); slowest: the slowest allowed by the length of the run.
    """
    unit = "rad" if rig.axis.kind == "rotary" else "m"
    motions: list[Sine | Multisine] = []
    for frequencies in _frequencies(natural, slowest):
        for share in SHARES:
            motion = _motion(frequencies, share * limits.angle, unit)
            if limits.kept(course_of(rig, motion, 8.0, ROUGH).peaks):
                motions.append(motion)
                break
    return motions


def _frequencies(natural: float, slowest: float) -> Iterator[tuple[float, ...]]:
    """Frequencies (rad/s) of sines away from the resonance, and of pairs of sines of which one is above it."""
    low, high = RESONANCE[0] * natural, RESONANCE[1] * natural
    allowed = [frequency for frequency in FREQUENCIES if frequency >= slowest]
    yield from ((frequency,) for frequency in allowed if not low < frequency < high)
    for slow, fast in combinations(allowed, 2):
        if APART[0] <= fast / slow <= APART[1] and fast > high:
            yield slow, fast


def _motion(frequencies: tuple[float, ...], amplitude: float, unit: str) -> Sine | Multisine:
    if len(frequencies) == 1:
        return Sine(_neat(amplitude), frequencies[0], 0.0, unit)
    parts = zip(SPLIT, frequencies, strict=True)
    return Multisine(tuple(Sine(_neat(share * amplitude), frequency, 0.0, unit) for share, frequency in parts))


def _neat(amplitude: float) -> float:
    """Two digits, rounded down."""
    digits = 10.0 ** (np.floor(np.log10(amplitude)) - 1)
    return float(f"{np.floor(amplitude / digits + 1e-9) * digits:.6g}")
