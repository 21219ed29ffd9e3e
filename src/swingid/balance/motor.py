"""Equation (II), the motor's balance, on modulating functions: an independent check of the reading of the wheel angle.

a12 ∫φ'' q1 + a22 ∫φ'' q2 = N ∫φ (M(u, q2') − f2 N q2' − f3 sgn q2')

While the wheel rests, friction is any torque up to f3, and the balance is determined only to within that.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from swingid.balance.windows import law_windows
from swingid.format import left
from swingid.model.rig import Rig
from swingid.model.rig.drive import Motor
from swingid.numerics.arrays import Array, Bools
from swingid.numerics.quadrature import GaussNodes
from swingid.numerics.spline import spline_at, spline_slopes
from swingid.numerics.test_functions import CURVATURE_POWER, project
from swingid.preparation.speed import smooth_speed
from swingid.recording.recording import Recording
from swingid.result.result import Message
from swingid.uncertainty.significance import INDICATED

if TYPE_CHECKING:
    from swingid.balance.rows import Signals, Windows
    from swingid.numerics.blocks import BlockNodes
    from swingid.preparation.noise import Noise


SLOW = 4.0
"""Standard deviations of the wheel's speed below which it is not distinguishable from rest."""

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
    """Equation (II) under one reading of the channels, one value per window.

    inertial: left side; driven: right side, with friction at rest 0; open: bound of friction at rest, ±. free:
    derivatives of the right side by c1 (relative), f2 and f3 (windows, 3).
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
        """Relative residual with c1, f2 and f3 fitted on the windows `used`; noise included.

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
    motor, wheel = rig.drive.motor, signals.wheel
    if motor is None or wheel is None or log.voltage is None or motor.torque_per_volt.value == 0:
        return None
    turning = signals.motion.turning_times
    nodes = signals.nodes.until(turning[SWINGS]) if len(turning) > SWINGS else signals.nodes
    blocks, stamps = len(nodes.rows) - 1, nodes.stamps
    windows = windows.select(windows.centres + windows.half <= nodes.time[-1])
    assert signals.wheel_values is not None
    speed = smooth_speed(stamps, signals.wheel_values[: len(stamps)], noise.wheel, spacing=1.5)
    # the dead zone is not linear, so the torque is computed row by row, held in between, and then gathered into blocks
    middles, late = (stamps[1:] + stamps[:-1]) / 2, signals.encoders.angle.latency.value
    wheel_speed, voltage = speed.at(middles), _voltage(log, late, middles, held=log.drive_held)
    is_relative = rig.log.wheel_angle_is == "relative"
    sign = -1.0 if is_relative else 1.0
    other_speed = wheel_speed + sign * signals.motion.speed.at(middles)
    # speeds that are not distinguishable from rest
    slow, other_slow = SLOW * speed.noise, SLOW * float(np.hypot(speed.noise, signals.motion.speed.noise))
    terms = np.stack([*_terms(motor, voltage, wheel_speed, slow), *_terms(motor, voltage, other_speed, other_slow)])
    columns = [(signals.angle[:blocks], 2), (wheel[:blocks], 2), *((x, 0) for x in nodes.held(terms))]
    part = project(nodes, columns, windows.centres, windows.half)
    a12, a22 = rig.drive.a12, rig.drive.a22
    angle, turn = part[:, 0], part[:, 1]
    stated = _Reading(a12 * angle + a22 * turn, part[:, 2], part[:, 3], part[:, 4:7])
    other = _Reading(a12 * angle + a22 * (turn + sign * angle), part[:, 7], part[:, 8], part[:, 9:12])
    # residual of equation (II) by white noise of the angles alone
    power = ((a12 * noise.angle) ** 2 + (a22 * noise.wheel) ** 2) * noise.step
    expected = power * CURVATURE_POWER * float(np.mean(windows.half**-3.0))
    used = np.maximum(stated.open, other.open) < RESTLESS * np.sqrt(np.mean(stated.inertial**2))
    enough = int(np.count_nonzero(used)) >= FEWEST_ROWS

    def under(voltage: Array) -> float:
        driven = _terms(motor, voltage, wheel_speed, slow)[0]
        against = project(nodes, [(nodes.held(driven[None])[0], 0)], windows.centres, windows.half)[:, 0]
        return replace(stated, driven=against).residual(expected)

    as_stated = stated.residual(expected)
    # the readings differ by half a row, from which a latency of it is not distinguishable
    unsure = max(signals.encoders.angle.latency.std or 0.0, signals.encoders.wheel.latency.std or 0.0)
    explained = INDICATED * _by_constants(rig, stated, wheel_speed, nodes, windows)
    checked = as_stated > max(FINE, explained) and INDICATED * unsure < noise.step / 2
    return MotorBalance(
        as_stated=as_stated,
        otherwise=other.residual(expected),
        turned=under(-voltage) if as_stated > GOOD else np.inf,
        held=log.drive_held,
        held_otherwise=under(_voltage(log, late, middles, held=not log.drive_held)) if checked else np.inf,
        is_relative=is_relative,
        refitted=stated.refitted(used, expected) if enough else None,
        refitted_otherwise=other.refitted(used, expected) if enough else None,
        rests=float(np.mean(np.abs(wheel_speed) < slow)),
    )


def _by_constants(rig: Rig, reading: _Reading, rate: Array, nodes: BlockNodes, windows: Windows) -> float:
    """Relative residual of (II), one standard deviation, by the stated uncertainties of its constants.

    rate: the wheel's speed between the rows, rad/s. The interval contains such a residual, whatever its cause.
    """
    motor, wheel = rig.drive.motor, rig.drive.wheel
    assert motor is not None
    gear = motor.gear_ratio.value
    drag = np.stack([rate, np.sign(rate)])
    by_rate, by_sign = project(nodes, [(x, 0) for x in nodes.held(drag)], windows.centres, windows.half).T
    emf = gear * motor.efficiency.value * by_rate
    effects = [
        (motor.torque_per_volt, reading.free[:, 0] / motor.torque_per_volt.value),
        (motor.efficiency, reading.free[:, 0] / motor.efficiency.value),
        (motor.back_emf, emf),
        (motor.viscous, gear**2 * by_rate),
        (motor.coulomb, gear * by_sign),
    ]
    if wheel is not None:
        effects.append((wheel.inertia, reading.inertial / wheel.inertia.value))
    parts = [(quantity.std or 0.0) ** 2 * float(np.mean(effect**2)) for quantity, effect in effects]
    return float(np.sqrt(sum(parts) / max(float(np.mean(reading.inertial**2)), 1e-300)))


def free_balance(rig: Rig, signals: Signals, noise: Noise) -> FreeBalance | None:
    """Residuals of equation (II) over the first swings with all constants of the motor fitted, for both readings.

    Its right side is then k u − d q2' − f sgn q2' − h sgn u − c (a dead zone acts as h and c). Windows in which the
    wheel rests determine nothing. None without voltage, and with too few windows.
    """
    log, wheel = signals.source[0], signals.wheel
    if wheel is None or signals.wheel_values is None or log.voltage is None or not np.any(np.diff(log.voltage)):
        return None
    turning = signals.motion.turning_times
    nodes = signals.nodes.until(turning[SWINGS]) if len(turning) > SWINGS else signals.nodes
    blocks, stamps = len(nodes.rows) - 1, nodes.stamps
    windows = law_windows(signals, QUARTER * signals.motion.half_period)
    windows = windows.select(windows.centres + windows.half <= nodes.time[-1])
    if len(windows) < FEWEST_ROWS:
        return None
    speed = smooth_speed(stamps, signals.wheel_values[: len(stamps)], noise.wheel, spacing=1.5)
    middles, late = (stamps[1:] + stamps[:-1]) / 2, signals.encoders.angle.latency.value
    rate, voltage = speed.at(middles), _voltage(log, late, middles, held=log.drive_held)
    sign = -1.0 if rig.log.wheel_angle_is == "relative" else 1.0
    other = rate + sign * signals.motion.speed.at(middles)
    slow, other_slow = SLOW * speed.noise, SLOW * float(np.hypot(speed.noise, signals.motion.speed.noise))
    shared = np.stack([voltage, np.sign(voltage), np.ones_like(voltage)])
    own = np.stack([rate, np.sign(rate), np.abs(rate) < slow, other, np.sign(other), np.abs(other) < other_slow])
    held = nodes.held(np.vstack([shared, own]))
    columns = [(signals.angle[:blocks], 2), (wheel[:blocks], 2), *((x, 0) for x in held)]
    part = project(nodes, columns, windows.centres, windows.half)
    used = np.maximum(part[:, 7], part[:, 10]) < RESTLESS * windows.half
    if np.count_nonzero(used) < FEWEST_ROWS:
        return None
    a12, a22, (angle, turn) = rig.drive.a12, rig.drive.a22, part[:, :2].T
    none = np.zeros(len(windows))
    power = ((a12 * noise.angle) ** 2 + (a22 * noise.wheel) ** 2) * noise.step
    expected = power * CURVATURE_POWER * float(np.mean(windows.half**-3.0))
    readings = (
        _Reading(a12 * angle + a22 * moved, none, none, np.hstack([part[:, 2:5], part[:, k : k + 2]]))
        for moved, k in ((turn, 5), (turn + sign * angle, 8))
    )
    return FreeBalance(*(one.refitted(used, expected) for one in readings))


def _voltage(log: Recording, late: float, middles: Array, *, held: bool) -> Array:
    """The voltage between the rows, on the clock of the angle: one that is read `late` (s) meets a later voltage."""
    assert log.voltage is not None
    count = len(middles)
    if held:
        moved = log.voltage[:, None] if late == 0.0 else GaussNodes(log.time, 2).hold(log.voltage, late)
        means: Array = moved[:count].mean(axis=1)
        return means
    return spline_at(log.time, log.voltage, spline_slopes(log.time, log.voltage), middles + late, 0)


def _terms(motor: Motor, voltage: Array, rate: Array, slow: float) -> tuple[Array, ...]:
    """Between the rows: right side of (II), bound of friction at rest, and derivatives of the side by c1, f2, f3."""
    gear, coulomb = motor.gear_ratio.value, motor.coulomb.value
    rests = (np.abs(rate) < slow).astype(np.float64)
    direction: Array = np.sign(rate) * (1.0 - rests)
    torque = motor_torque(motor, voltage, rate)
    strength: Array = motor.efficiency.value * motor.torque_per_volt.value * voltage * (torque != 0.0)
    driven: Array = gear * (torque - motor.viscous.value * gear * rate - coulomb * direction)
    return driven, gear * coulomb * rests, gear * strength, rate, direction
