"""Logs whose inertia is known without any simulator: the motion is prescribed, and the balance solved for the rest."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from swingid.model.rig import Rig
from swingid.recording.recording import Recording

Array = NDArray[np.float64]
Friction = Callable[[Array], Array]

INERTIA = 302.2e-5
"""J1 of the built-in rig, and of all rotary logs here."""

ENCODER = 2 * np.pi / 16384

EXACT: dict[str, object] = {"axis.tilt": 0, "axis.model_uncertainty": 0, "log.clock": 0, "sensors.latency": 0}
"""Keys of a rig without a wheel of which nothing is uncertain that it does not name."""


LEVEL: dict[str, object] = {"sensors.nonlinearity": 0}
"""Of a rotary axis, too."""


class Sines:
    """q(t) = Σ a sin(ω t + p) with its derivatives and the instants at which it reverses."""

    def __init__(self, *terms: Sequence[float]) -> None:
        self.a, self.w, self.p = (np.array(x, dtype=float) for x in zip(*terms, strict=True))

    def __call__(self, time: Array, derivative: int = 0) -> Array:
        phase = np.multiply.outer(np.asarray(time, dtype=float), self.w) + self.p + derivative * np.pi / 2
        return np.sin(phase) @ (self.a * self.w**derivative)

    def reversals(self, start: float, stop: float) -> Array:
        """Zeros of q', by Newton's method from a fine grid."""
        grid = np.linspace(start, stop, int((stop - start) * 2000))
        rate = self(grid, 1)
        zeros = grid[:-1][rate[:-1] * rate[1:] < 0]
        for _ in range(6):
            zeros = zeros - self(zeros, 1) / self(zeros, 2)
        return zeros


TWO_TONES = Sines((0.5, 8.5, 0.0), (0.4, 5.3, 1.0))
ONE_TONE = Sines((0.8, 8.5, 0.0))


TIME = np.arange(12_001) / 1000
SMOOTH_MOTOR: dict[str, object] = {"drive.motor.coulomb": 0.0, "drive.motor.dead_zone": [0.0, 0.0]}

LAWS: dict[str, Friction] = {
    "none": lambda v: 0.0 * v,
    "viscous": lambda v: 1.144e-3 * v,
    "eight times viscous": lambda v: 9.152e-3 * v,
    "Coulomb": lambda v: 5e-4 * v + 3e-3 * np.sign(v),
    "quadratic": lambda v: 2e-4 * v + 3e-4 * v * np.abs(v),
    "direction-dependent": lambda v: np.where(v > 0, 1.7e-3, 0.6e-3) * v,
}
"""Friction laws within the basis of the fit."""


def integrals(function: Callable[[Array], Array], time: Array, breaks: Array) -> tuple[Array, Array]:
    """∫ and ∬ of `function` from the first stamp, at the stamps, by ten Gauss points between stamps and `breaks`."""
    grid = np.unique(np.concatenate([time, breaks]))
    x, w = np.polynomial.legendre.leggauss(10)
    x, w = (x + 1) / 2, w / 2
    h = np.diff(grid)
    values = function(grid[:-1, None] + h[:, None] * x)
    once = np.concatenate([[0.0], np.cumsum(h * (values @ w))])
    twice = np.concatenate([[0.0], np.cumsum(h * once[:-1] + h**2 * (values @ (w * (1 - x))))])
    at = np.searchsorted(grid, time)
    return once[at], twice[at]


def twice_integrated(function: Callable[[Array], Array], time: Array, breaks: Array) -> Array:
    """∬ of `function` from the first stamp, at the stamps."""
    return integrals(function, time, breaks)[1]


def exact_rig(**changes: object) -> Rig:
    """The paper's rig with perfect encoders."""
    return Rig.builtin("paper").changed({"sensors.counts_per_turn": None, **changes})


def wheel_log(rig: Rig, motion: Sines, friction: Friction, time: Array) -> Recording:
    """The wheel's angle that row (I) asks for when the axis moves as `motion`; exact to about 1e-13 of it.

    The motor's voltage is not known here and not logged: momentum does not need it.
    """
    b = getattr(rig.axis.gravity_torque, "value", 78e-3)
    a12 = rig.drive.a12
    a11 = INERTIA + rig.drive.wheel.inertia.value + rig.drive.motor.rotor_inertia.value

    def load(t: Array) -> Array:
        return b * np.sin(motion(t)) + friction(motion(t, 1))

    angle = motion(time)
    loads = twice_integrated(load, time, motion.reversals(time[0], time[-1]))
    return Recording(time=time, angle=angle, wheel_angle=0.7 + 3.0 * time - (a11 * angle + loads) / a12)


def motor_log(
    rig: Rig, motion: Sines, friction: Friction, time: Array = TIME, spin: float = 0.0, late: float = 0.0
) -> Recording:
    """Wheel angle and voltage that rows (I) and (II) ask for when the axis moves as `motion`; voltage as measured.

    spin: speed of the wheel (rad/s) beside what the motion needs. late: angles and voltage are those so much later.
    """
    motor, a12, a22 = rig.drive.motor, rig.drive.a12, rig.drive.a22
    b, gear = 78e-3, motor.gear_ratio.value
    a11 = INERTIA + rig.drive.wheel.inertia.value + motor.rotor_inertia.value

    def load(t: Array) -> Array:
        return b * np.sin(motion(t)) + friction(motion(t, 1))

    t = time + late
    start = time[0] - 0.01
    once, twice = (x[1:] for x in integrals(load, np.concatenate([[start], t]), motion.reversals(start, t[-1])))
    wheel = spin * t - (a11 * motion(t) + twice) / a12
    rate = spin - (a11 * motion(t, 1) + once) / a12
    inertial = a12 * motion(t, 2) - a22 * (a11 * motion(t, 2) + load(t)) / a12
    torque = inertial / gear + motor.viscous.value * gear * rate + motor.coulomb.value * np.sign(rate)
    low, high = motor.dead_zone
    ideal = torque + np.where(torque > 0, high, low)
    voltage = (ideal / motor.efficiency.value + motor.back_emf.value * rate) / motor.torque_per_volt.value
    return Recording(time=time, angle=motion(t), wheel_angle=wheel, voltage=voltage, drive_held=False)


def direct_rig(linear: bool = False, **changes: object) -> Rig:
    """An axis with a known torque (force) on it: the paper's, or a balanced linear one."""
    kind = 'kind = "linear"' if linear else "gravity_torque = 78e-3"
    sensors = {} if linear else LEVEL
    return Rig.from_text(f'name = "driven"\n[axis]\n{kind}\n[drive]\nkind = "direct"\n').changed(
        EXACT | sensors | changes
    )


def direct_log(motion: Sines, friction: Friction, time: Array, inertia: float = INERTIA, b: float = 78e-3) -> Recording:
    """The torque measured at the stamps when the axis moves as `motion`."""
    torque = inertia * motion(time, 2) + b * np.sin(motion(time)) + friction(motion(time, 1))
    return Recording(time=time, angle=motion(time), torque=torque, drive_held=False)


def free_rig(**changes: object) -> Rig:
    """The paper's axis without its wheel."""
    text = 'name = "free"\n[axis]\ngravity_torque = 78e-3\n[drive]\nkind = "none"\n'
    return Rig.from_text(text).changed(EXACT | LEVEL | changes)


def free_log(friction: Friction, time: Array, initial_angle: float = 1.2) -> Recording:
    """A free decay under smooth friction, integrated with an error of about 1e-11."""
    from scipy.integrate import solve_ivp

    def rates(_: float, state: Array) -> list[float]:
        return [state[1], -(78e-3 * np.sin(state[0]) + float(friction(state[1]))) / INERTIA]

    span = (float(time[0]), float(time[-1]))
    made = solve_ivp(rates, span, [initial_angle, 0.0], method="DOP853", t_eval=time, rtol=1e-12, atol=1e-12)
    return Recording(time=time, angle=made.y[0])


def filmed_log(friction: Friction, band: tuple[float, float], seed: int) -> Recording:
    """A free decay at 120 rows/s whose angle has noise of 3 mrad in a band (Hz), as of a camera."""
    from scipy.signal import butter, sosfilt

    time = np.arange(0, 30, 1 / 120)
    noise = np.random.default_rng(seed).standard_normal(len(time))
    error = sosfilt(butter(4, band, btype="band", fs=120, output="sos"), noise)
    return Recording(time=time, angle=free_log(friction, time, 0.6).angle + 3e-3 * error / error.std())


def encoded(log: Recording, step: float = ENCODER) -> Recording:
    """The log as encoders of the paper's resolution read it."""
    from dataclasses import replace

    wheel = None if log.wheel_angle is None else step * np.rint(log.wheel_angle / step)
    return replace(log, angle=step * np.rint(log.angle / step), wheel_angle=wheel)
