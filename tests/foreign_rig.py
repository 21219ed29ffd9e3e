"""A reaction wheel pendulum to stand behind a device: its equations, its motor, its encoders.

a11 q1'' + a12 q2'' + f1 q1' + b sin q1 = 0 and a12 q1'' + a22 q2'' = M, with q1 the body's angle from
hanging and q2 the wheel's against the body. Nothing here is shared with the package.
"""

from dataclasses import dataclass
from math import floor, pi, sin


@dataclass(frozen=True)
class Figures:
    """The rig's true figures, in SI units; the inertia of the body is what a host looks for."""

    weight: float = 78e-3  # b, N m
    body: float = 3.022e-3  # J1, kg m^2
    wheel: float = 11.34e-5  # J2
    rotor: float = 0.21e-5  # Jr
    gear: float = 4.4
    friction: float = 1.144e-3  # f1, N m s
    per_volt: float = 4.4 * 0.9 * 52.04e-4  # N m/V
    per_speed: float = 4.4 * (0.9 * 3.697e-6 + 4.4 * 3.687e-5)  # N m s: back EMF and viscous friction
    coulomb: float = 4.4 * 302.02e-5  # N m


class Pendulum:
    """Moves by Runge-Kutta steps of fourth order; a wheel that rests stays at rest while friction can hold it."""

    def __init__(self, figures: Figures = Figures(), steps: int = 4):
        self.q1 = self.v1 = self.q2 = self.v2 = 0.0
        self.steps = steps
        self.figures = figures
        coupling = figures.wheel + figures.gear * figures.rotor
        self.a11 = figures.body + figures.wheel + figures.rotor
        self.a12 = coupling
        self.a22 = figures.wheel + figures.gear**2 * figures.rotor
        det = self.a11 * self.a22 - coupling**2
        # q1'' = load * s[0] + torque * s[1], q2'' = load * s[2] + torque * s[3], load = f1 q1' + b sin q1
        self.sliding = (-self.a22 / det, -coupling / det, coupling / det, self.a11 / det)
        self.stuck = (-1.0 / self.a11, 0.0, 0.0, 0.0)

    def _direction(self, drive: float) -> float:
        """Which way the wheel slides: 1, -1, or 0 where it rests and friction holds it."""
        if self.v2 != 0.0:
            return 1.0 if self.v2 > 0.0 else -1.0
        load = self.figures.friction * self.v1 + self.figures.weight * sin(self.q1)
        free = drive + self.a12 * load / self.a11  # the torque that friction has to hold
        if abs(free) <= self.figures.coulomb:
            return 0.0
        return 1.0 if free > 0.0 else -1.0

    def move(self, voltage: float, duration: float) -> None:
        """Moves on by `duration` (s) under `voltage` (V)."""
        figures, drive = self.figures, self.figures.per_volt * voltage
        if voltage == 0.0 and self.q1 == self.v1 == self.v2 == 0.0:
            return
        h, f1, b, kw = duration / self.steps, figures.friction, figures.weight, figures.per_speed
        half, sixth = 0.5 * h, h / 6.0
        for _ in range(self.steps):
            way = self._direction(drive)
            cg, cm, dg, dm = self.sliding if way else self.stuck
            torque = drive - figures.coulomb * way
            q, v, w = self.q1, self.v1, self.v2
            load, m = f1 * v + b * sin(q), torque - kw * w
            a1, c1 = cg * load + cm * m, dg * load + dm * m
            v2, w2 = v + half * a1, w + half * c1
            load, m = f1 * v2 + b * sin(q + half * v), torque - kw * w2
            a2, c2 = cg * load + cm * m, dg * load + dm * m
            v3, w3 = v + half * a2, w + half * c2
            load, m = f1 * v3 + b * sin(q + half * v2), torque - kw * w3
            a3, c3 = cg * load + cm * m, dg * load + dm * m
            v4, w4 = v + h * a3, w + h * c3
            load, m = f1 * v4 + b * sin(q + h * v3), torque - kw * w4
            a4, c4 = cg * load + cm * m, dg * load + dm * m
            self.q1 = q + sixth * (v + 2.0 * (v2 + v3) + v4)
            self.v1 = v + sixth * (a1 + 2.0 * (a2 + a3) + a4)
            self.q2 += sixth * (w + 2.0 * (w2 + w3) + w4)
            self.v2 = w + sixth * (c1 + 2.0 * (c2 + c3) + c4)
            if self.v2 * way < 0.0:  # it has passed through rest: friction's impulse stops it there
                self.v1 += self.a12 / self.a11 * self.v2
                self.v2 = 0.0


@dataclass
class Mounting:
    """How encoders and motor are mounted: signs, counts per turn, and the count at which each began."""

    axis_sign: int = 1
    wheel_sign: int = 1
    motor_sign: int = 1
    axis_counts: int = 16384
    wheel_counts: int = 16384
    axis_begin: int = -4321
    wheel_begin: int = 2**31 - 300  # the count wraps soon after the wheel has begun to turn


class Bench:
    """The pendulum with its encoders: `read` gives raw 32 bit counts, `move` takes the amplifier's voltage."""

    def __init__(self, mounting: Mounting, pendulum: Pendulum | None = None):
        self.mounting = mounting
        self.pendulum = pendulum or Pendulum()
        self._axis = mounting.axis_sign * mounting.axis_counts / (2.0 * pi)
        self._wheel = mounting.wheel_sign * mounting.wheel_counts / (2.0 * pi)

    def read(self) -> tuple[int, int]:
        axis = floor(self.pendulum.q1 * self._axis + 0.3) + self.mounting.axis_begin
        wheel = floor(self.pendulum.q2 * self._wheel + 0.6) + self.mounting.wheel_begin
        return (axis + 2**31) % 2**32 - 2**31, (wheel + 2**31) % 2**32 - 2**31

    def move(self, voltage: float, duration: float) -> None:
        self.pendulum.move(voltage * self.mounting.motor_sign, duration)
