"""Equation (II), the motor's balance, on modulating functions: an independent check of the reading of the wheel angle.

    a12 ∫φ'' q1 + a22 ∫φ'' q2 = N ∫φ (M(u, q2') − f2 N q2' − f3 sgn q2')

While the wheel rests, friction is any torque up to f3, and the balance is determined only to within that.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from swingid.balance import wheel_equation as at
from swingid.balance.wheel_equation import WheelRows
from swingid.balance.windows import law_windows
from swingid.format import left
from swingid.model.rig import Rig
from swingid.model.rig.drive import Motor
from swingid.numerics.arrays import Array, Bools
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
class FreeBalance:
    """Relative residuals of equation (II) with all constants of the motor fitted: wheel angle as stated, and otherwise.

    At least those by the sensors' noise.
    """

    as_stated: float
    otherwise: float


@dataclass(frozen=True)
class _Reading:
    """Equation (II), per a22, under one reading of the channels, one value per window.

    inertial: left side; driven: right side, with friction at rest 0; open: bound of friction at rest, ±. free: columns
    (windows, n) of what is free on the right side.
    """

    inertial: Array
    driven: Array
    open: Array
    free: Array

    def residual(self, expected: float) -> float:
        """Residual relative to the left side; `expected`: mean square of it by noise alone."""
        left = np.maximum(np.abs(self.inertial - self.driven) - self.open, 0.0)
        unexplained = max(float(np.mean(left**2)) - 2 * expected, 0.0)
        return float(np.sqrt(unexplained / self._power))

    def refitted(self, used: Bools, expected: float) -> float:
        """Relative residual with `free` fitted on the windows `used`; noise included.

        At least that by noise (`expected` as above): few windows with noise only do not distinguish the readings.
        """
        missing, free = (self.inertial - self.driven)[used], self.free[used]
        free = free / np.maximum(np.sqrt(np.mean(free**2, axis=0)), 1e-300)
        left = missing - free @ np.linalg.lstsq(free, missing, rcond=1e-10)[0]
        return float(np.sqrt(max(float(np.mean(left**2)), 2 * expected) / self._power))

    @property
    def _power(self) -> float:
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
    is_relative = rig.log.wheel_angle_is == "relative"
    sign = -1.0 if is_relative else 1.0
    voltage = wheel.voltage(held=log.drive_held)
    sides = [_sides(values, voltage, *turning) for turning in ((wheel.rate, wheel.slow), wheel.otherwise(sign))]
    parts = np.hsplit(wheel.integrals(np.vstack(sides)), 2)
    stated, other = (
        _Reading(inertial, part[:, 0], part[:, -1], part[:, 1:-1])
        for inertial, part in zip(_inertial(wheel, values, sign), parts, strict=True)
    )
    expected = _expected(wheel, values, noise)
    used = np.maximum(stated.open, other.open) < RESTLESS * np.sqrt(np.mean(stated.inertial**2))
    enough = int(np.count_nonzero(used)) >= FEWEST_ROWS

    def under(voltage: Array) -> float:
        driven = _sides(values, voltage, wheel.rate, wheel.slow)[:1]
        return replace(stated, driven=wheel.integrals(driven)[:, 0]).residual(expected)

    as_stated = stated.residual(expected)
    # the readings differ by half a row, from which a latency of it is not distinguishable
    unsure = max(signals.encoders.angle.latency.std or 0.0, signals.encoders.wheel.latency.std or 0.0)
    explained = INDICATED * _by_constants(rig, stated)
    checked = as_stated > max(FINE, explained) and INDICATED * unsure < noise.step / 2
    return MotorBalance(
        as_stated=as_stated,
        otherwise=other.residual(expected),
        turned=under(-voltage) if as_stated > GOOD else np.inf,
        held=log.drive_held,
        held_otherwise=under(wheel.voltage(held=not log.drive_held)) if checked else np.inf,
        is_relative=is_relative,
        refitted=stated.refitted(used, expected) if enough else None,
        refitted_otherwise=other.refitted(used, expected) if enough else None,
        rests=float(np.mean(np.abs(wheel.rate) < wheel.slow)),
    )


def _sides(values: Array, voltage: Array, rate: Array, slow: float) -> Array:
    """Between the rows (5, rows − 1): right side of (II) and its derivatives, and the bound of friction at rest."""
    rests = (np.abs(rate) < slow).astype(np.float64)
    return np.vstack([at.right_side(values, voltage, rate, np.sign(rate) * (1.0 - rests)), values[at.COULOMB] * rests])


def _inertial(wheel: WheelRows, values: Array, sign: float) -> tuple[Array, Array]:
    """Left side of (II) per a22 on the windows: as stated, and with `sign` q1 added to the wheel's angle."""
    angle, turn = wheel.accelerations()
    own = values[at.COUPLING] * angle + turn
    return own, own + sign * angle


def _expected(wheel: WheelRows, values: Array, noise: Noise) -> float:
    """Mean square of the left side, per a22, by white noise of the angles alone."""
    power = (float(values[at.COUPLING] * noise.angle) ** 2 + noise.wheel**2) * noise.step
    return power * CURVATURE_POWER * float(np.mean(wheel.windows.half**-3.0))


def _by_constants(rig: Rig, reading: _Reading) -> float:
    """Relative residual of (II), one standard deviation, by the stated uncertainties of its constants.

    The interval contains such a residual, whatever its cause.
    """
    motor, wheel = rig.drive.motor, rig.drive.wheel
    assert motor is not None
    assert wheel is not None
    by_gain, by_rate, by_sign = reading.free.T
    gear, eta, volt = motor.gear_ratio.value, motor.efficiency, motor.torque_per_volt
    scale, (gain, *_) = gear / rig.drive.a22, at.products_of(rig)
    effects = [
        (volt, gain / volt.value * by_gain),
        (eta, gain / eta.value * by_gain),
        (motor.back_emf, scale * eta.value * by_rate),
        (motor.viscous, scale * gear * by_rate),
        (motor.coulomb, scale * by_sign),
        (wheel.inertia, reading.inertial / wheel.inertia.value),
    ]
    parts = [(quantity.std or 0.0) ** 2 * float(np.mean(effect**2)) for quantity, effect in effects]
    return float(np.sqrt(sum(parts) / max(float(np.mean(reading.inertial**2)), 1e-300)))


def free_balance(rig: Rig, signals: Signals, noise: Noise) -> FreeBalance | None:
    """Residuals of equation (II) over the first swings with all constants of the motor fitted, for both readings.

    Its right side is then k u − d q2' − f sgn q2' − h sgn u − c (a dead zone acts as h and c). Windows in which the
    wheel rests determine nothing. None without voltage, and with too few windows.
    """
    log = signals.source[0]
    if signals.wheel is None or log.voltage is None or not np.any(np.diff(log.voltage)):
        return None
    wheel = WheelRows.of(signals, law_windows(signals, QUARTER * signals.motion.half_period), noise, SWINGS)
    if len(wheel.windows) < FEWEST_ROWS:
        return None
    sign = -1.0 if rig.log.wheel_angle_is == "relative" else 1.0
    voltage = wheel.voltage(held=log.drive_held)
    shared = [voltage, np.sign(voltage), np.ones_like(voltage)]
    readings = [
        np.stack([*shared, rate, np.sign(rate), np.abs(rate) < slow])
        for rate, slow in ((wheel.rate, wheel.slow), wheel.otherwise(sign))
    ]
    parts = np.hsplit(wheel.integrals(np.vstack(readings)), 2)
    used = np.maximum(*(part[:, -1] for part in parts)) < RESTLESS * wheel.windows.half
    if np.count_nonzero(used) < FEWEST_ROWS:
        return None
    values, none = at.products_of(rig), np.zeros(len(wheel.windows))
    expected = _expected(wheel, values, noise)
    found = [
        _Reading(inertial, none, none, part[:, :-1]).refitted(used, expected)
        for inertial, part in zip(_inertial(wheel, values, sign), parts, strict=True)
    ]
    return FreeBalance(*found)
