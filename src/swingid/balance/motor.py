"""Equation (II), the motor's balance, on modulating functions: an independent check of the reading of the wheel angle.

    a12 ∫φ'' q1 + a22 ∫φ'' q2 = N ∫φ (M(u, q2') − f2 N q2' − f3 sgn q2')

While the wheel rests, friction is any torque up to f3, and the balance is determined only to within that.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from swingid.balance import wheel_equation as at
from swingid.balance.wheel_equation import WheelRows
from swingid.balance.windows import law_windows
from swingid.format import left
from swingid.model.equation import relative
from swingid.model.rig import Rig
from swingid.model.rig.drive import Motor
from swingid.numerics.arrays import Array, Bools
from swingid.numerics.regression import fit_linear
from swingid.numerics.test_functions import CURVATURE_POWER
from swingid.recording.recording import Recording
from swingid.result.result import Message
from swingid.uncertainty.significance import INDICATED

if TYPE_CHECKING:
    from swingid.balance.rows import Signals, Windows
    from swingid.preparation.noise import Noise


RESTLESS = 0.05
"""Share of the typical row that friction at rest may be in a window that determines the motor's constants."""

FEWEST_ROWS = 12

QUARTER = 1 / 4
"""Half-length, in swings, of the windows on which the readings are compared without motor constants."""

SWINGS = 16
"""Swings at the start of a log that are used: no check of a reading needs more."""

GOOD = 0.05
"""Relative residual below which the sign of the voltage is not checked."""

FINE = 0.005
"""Relative residual below which it is not checked whether the voltage was held."""

HELD = 0.4
"""Share of the residual up to which the other reading of the voltage between the rows is accepted. For a voltage that
is a row late, reading it as measured gives half."""


@dataclass(frozen=True)
class MotorBalance:
    """Relative residuals of equation (II): wheel angle as stated, wheel angle read the other way, voltage reversed
    (infinite where not evaluated), and voltage between the rows read the other way (likewise): held is as stated.

    refitted, refitted_otherwise: the first two with the motor's strength c1 and friction f2, f3 fitted, so that errors
    of these constants do not favour either reading; None with too few windows that determine them. rests: share of the
    time in which the wheel is not distinguishable from rest.
    """

    as_stated: float
    otherwise: float
    turned: float
    is_relative: bool
    refitted: float | None = None
    refitted_otherwise: float | None = None
    rests: float = 0.0
    held: bool = True
    held_otherwise: float = np.inf

    def hold_warning(self, *, harm: str) -> list[Message]:
        """One message where the voltage between the rows is not as drive_held states; harm: the effect of that."""
        if self.held_otherwise > HELD * self.as_stated:
            return []
        held, measured = "held from each row to the next", "measured at each row"
        stated, other = (held, measured) if self.held else (measured, held)
        text = (
            f"the voltage is not {stated}: the residual of the motor's balance is {left(self.as_stated)}, and "
            f"{left(self.held_otherwise)} with it {other}; set drive_held = {str(not self.held).lower()} under [log], "
            "unless the angles are read half a row late or early"
        )
        return [Message("drive-held", f"{text}; {harm}.")]


@dataclass(frozen=True)
class _Reading:
    """Equation (II), per a22, under one reading of the channels, one value per window.

    inertial: left side, of which noise of the angles gives the mean square `expected`; driven: right side, with
    friction at rest 0; open: bound of friction at rest, ±; free: columns (windows, n) of what may be fitted.
    """

    inertial: Array
    expected: float
    driven: Array
    open: Array
    free: Array

    def residual(self) -> float:
        """Residual relative to the left side, beyond what noise leaves."""
        remaining = np.maximum(np.abs(self.inertial - self.driven) - self.open, 0.0)
        unexplained = max(float(np.mean(remaining**2)) - 2 * self.expected, 0.0)
        return float(np.sqrt(unexplained / self.power))

    def refitted(self, used: Bools) -> float:
        """Relative residual with `free` fitted on the windows `used`; noise included.

        At least that by noise: few windows with noise only do not distinguish the readings.
        """
        remaining = fit_linear(self.free[used], (self.inertial - self.driven)[used]).residuals
        return float(np.sqrt(max(float(np.mean(remaining**2)), 2 * self.expected) / self.power))

    @property
    def power(self) -> float:
        """Mean square of the left side."""
        return max(float(np.mean(self.inertial**2)), 1e-300)


def motor_torque(motor: Motor, voltage: Array, wheel_speed: Array) -> Array:
    """M of (8), corrected: the motor's torque on its shaft after the dead zone, N m."""
    low, high = motor.dead_zone
    ideal = motor.efficiency.value * (motor.torque_per_volt.value * voltage - motor.back_emf.value * wheel_speed)
    result: Array = np.maximum(ideal - high, 0.0) + np.minimum(ideal - low, 0.0)
    return result


def motor_drag(motor: Motor, wheel_speed: Array) -> Array:
    """f2 N q2' + f3 sgn q2' on the rotor, N m."""
    slope = motor.viscous.value * motor.gear_ratio.value
    result: Array = slope * wheel_speed + motor.coulomb.value * np.sign(wheel_speed)
    return result


def motor_balance(log: Recording, rig: Rig, signals: Signals, windows: Windows, noise: Noise) -> MotorBalance | None:
    """Residuals of equation (II) on `windows` over the first swings; None without voltage or motor constants."""
    motor = rig.drive.motor
    if motor is None or signals.wheel is None or log.voltage is None or motor.torque_per_volt.value == 0:
        return None
    wheel, values = WheelRows.of(signals, windows, noise, SWINGS), at.products_of(rig)
    voltage = wheel.voltage(held=log.drive_held)

    def side(rate: Array, slow: float, voltage: Array = voltage) -> Array:
        rests = (np.abs(rate) < slow).astype(np.float64)
        driven, *free = at.right_side(values, voltage, rate, np.sign(rate) * (1.0 - rests))
        return np.stack([driven, values[at.COULOMB] * rests, *free])

    def under(voltage: Array) -> float:
        driven = wheel.integrals(side(wheel.rate, wheel.slow, voltage)[:1])[:, 0]
        return replace(stated, driven=driven).residual()

    stated, other = _readings(wheel, rig, noise, side)
    used = np.maximum(stated.open, other.open) < RESTLESS * np.sqrt(np.mean(stated.inertial**2))
    enough = int(np.count_nonzero(used)) >= FEWEST_ROWS
    as_stated = stated.residual()
    # the readings differ by half a row, from which a latency of it is not distinguishable
    unsure = max(signals.encoders.angle.latency.std or 0.0, signals.encoders.wheel.latency.std or 0.0)
    explained = INDICATED * _by_constants(rig, stated)
    checked = as_stated > max(FINE, explained) and INDICATED * unsure < noise.step / 2
    return MotorBalance(
        as_stated=as_stated,
        otherwise=other.residual(),
        turned=under(-voltage) if as_stated > GOOD else np.inf,
        held=log.drive_held,
        held_otherwise=under(wheel.voltage(held=not log.drive_held)) if checked else np.inf,
        is_relative=rig.log.wheel_angle_is == "relative",
        refitted=stated.refitted(used) if enough else None,
        refitted_otherwise=other.refitted(used) if enough else None,
        rests=float(np.mean(np.abs(wheel.rate) < wheel.slow)),
    )


def free_balance(rig: Rig, signals: Signals, noise: Noise) -> MotorBalance | None:
    """The first two residuals over the first swings, with all constants of the motor fitted and noise included.

    The right side of (II) is then k u − d q2' − f sgn q2' − h sgn u − c (a dead zone acts as h and c). Windows in
    which the wheel rests determine nothing. None without voltage, and with too few windows.
    """
    log = signals.source[0]
    if signals.wheel is None or log.voltage is None or not np.any(np.diff(log.voltage)):
        return None
    wheel = WheelRows.of(signals, law_windows(signals, QUARTER * signals.motion.half_period), noise, SWINGS)
    if len(wheel.windows) < FEWEST_ROWS:
        return None
    voltage, ones = wheel.voltage(held=log.drive_held), np.ones_like(wheel.rate)

    def side(rate: Array, slow: float) -> Array:
        return np.stack([0.0 * ones, np.abs(rate) < slow, voltage, np.sign(voltage), ones, rate, np.sign(rate)])

    readings = _readings(wheel, rig, noise, side)
    used = np.maximum(*(reading.open for reading in readings)) < RESTLESS * wheel.windows.half
    if np.count_nonzero(used) < FEWEST_ROWS:
        return None
    as_stated, otherwise = (reading.refitted(used) for reading in readings)
    return MotorBalance(as_stated, otherwise, np.inf, rig.log.wheel_angle_is == "relative")


def _readings(
    wheel: WheelRows, rig: Rig, noise: Noise, side: Callable[[Array, float], Array]
) -> tuple[_Reading, _Reading]:
    """Equation (II) with the wheel's angle as stated and read the other way.

    side (2 + n, rows − 1): right side, bound of friction at rest and free columns at a speed (rad/s) of the wheel,
    which is not distinguishable from rest below another.
    """
    coupling = float(at.products_of(rig)[at.COUPLING])
    sign = -1.0 if rig.log.wheel_angle_is == "relative" else 1.0
    stated, other = np.split(wheel.integrals(np.vstack([side(*wheel.turning()), side(*wheel.turning(sign))])).T, 2)
    inertial, angle = wheel.inertial(coupling)
    power = ((coupling * noise.angle) ** 2 + noise.wheel**2) * noise.step
    expected = power * CURVATURE_POWER * float(np.mean(wheel.windows.half**-3.0))
    return (
        _Reading(inertial, expected, stated[0], stated[1], stated[2:].T),
        _Reading(inertial + sign * angle, expected, other[0], other[1], other[2:].T),
    )


def _by_constants(rig: Rig, reading: _Reading) -> float:
    """Relative residual of (II), one standard deviation, by the stated uncertainties of its constants.

    The interval contains such a residual, whatever its cause.
    """
    motor, wheel = rig.drive.motor, rig.drive.wheel
    assert motor is not None
    assert wheel is not None
    gear, eta = motor.gear_ratio.value, motor.efficiency.value
    scale, gain = gear / rig.drive.a22, at.products_of(rig)[at.GAIN]
    sizes = [
        gain * np.hypot(relative(motor.torque_per_volt), relative(motor.efficiency)),
        scale * np.hypot(eta * (motor.back_emf.std or 0.0), gear * (motor.viscous.std or 0.0)),
        scale * (motor.coulomb.std or 0.0),
        relative(wheel.inertia),
    ]
    effects = np.column_stack([reading.free, reading.inertial]) * sizes
    return float(np.sqrt(np.mean(np.sum(effects**2, axis=1)) / reading.power))
