"""How late the angles are read after the voltage acts, from the motor's balance, row (II).

    a12 ∫φ'' q1 + a22 ∫φ'' q2 = N ∫φ (M(u(t + δ), q2') − f2 N q2' − f3 sgn q2')

A latency that both angles share cancels in row (I); against the voltage it shows. The torque per volt and the friction
of the motor are left free, so that constants which are a little off do not pass for a latency. While the wheel rests,
friction is any torque up to f3, and about a reversal a smoothed speed does not know when friction jumps; there both
sides are left out.
"""

from __future__ import annotations

import numpy as np

from swingid.balance.fits import LAG
from swingid.balance.motor import SLOW, motor_torque
from swingid.balance.rows import Signals, Windows
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.numerics.regression import fit_linear
from swingid.numerics.test_functions import project, project_impulses
from swingid.preparation.noise import Noise
from swingid.preparation.speed import smooth_speed
from swingid.recording.recording import Recording

STEPS = 3

RESTING = 0.3
"""Share of a window in which the wheel may rest."""

FEWEST = 20

GOOD = 0.05
"""Share of the inertial side that may be left for the balance to be that of this motor."""


def voltage_latency(
    log: Recording, rig: Rig, signals: Signals, windows: Windows, noise: Noise
) -> tuple[float, float] | None:
    """δ (s) beyond what the rig file says, and its standard uncertainty, from rows on `windows`.

    None without voltage or motor constants, where the wheel rests too often, and where row (II) does not close.
    """
    motor = rig.drive.motor
    if motor is None or signals.wheel is None or signals.wheel_values is None or log.voltage is None:
        return None
    if motor.torque_per_volt.value == 0:
        return None
    nodes, stamps = signals.nodes, signals.nodes.stamps
    speed = smooth_speed(stamps, signals.wheel_values, noise.wheel, spacing=1.5)
    middles = (stamps[1:] + stamps[:-1]) / 2
    rate = speed.at(middles)
    rests = _about_rests(stamps, rate, SLOW * speed.noise, speed.half_width)
    turns = 1.0 - rests
    axis = signals.motion.speed
    resting = rests * (rig.drive.a12 * axis.acceleration(middles) + rig.drive.a22 * speed.acceleration(middles))
    kept = project(nodes, [(nodes.held(rests[None])[0], 0)], windows.centres, windows.half)[:, 0]
    windows = windows.select(kept < RESTING * windows.half)
    if len(windows) < FEWEST:
        return None
    part = project(nodes, [(signals.angle, 2), (signals.wheel, 2)], windows.centres, windows.half)
    inertial = rig.drive.a12 * part[:, 0] + rig.drive.a22 * part[:, 1]
    gear, gain = motor.gear_ratio.value, motor.efficiency.value * motor.torque_per_volt.value
    direction = np.sign(rate) * turns
    friction = gear * (motor.viscous.value * gear * rate + motor.coulomb.value * direction)
    late, found = rig.sensors.of("angle").latency.value, 0.0
    for _ in range(STEPS):
        voltage = _held_between(log, late + found)
        torque = motor_torque(motor, voltage, rate)
        active = (torque != 0.0) * turns
        driven = resting + turns * (gear * torque - friction)
        terms = np.stack([driven, gear * gain * voltage * active, turns * rate, direction])
        columns = project(nodes, [(x, 0) for x in nodes.held(terms)], windows.centres, windows.half)
        steps = gear * gain * _steps(log, late + found, active, windows)
        solved = fit_linear(np.column_stack([steps, columns[:, 1:]]), inertial - columns[:, 0])
        found += float(solved.values[0])
    if float(np.std(solved.residuals)) > GOOD * float(np.std(inertial)):
        return None
    return found, float(np.sqrt(solved.covariance(LAG)[0, 0]))


def _about_rests(stamps: Array, rate: Array, slow: float, reach: float) -> Array:
    """1 between rows at which the wheel rests or turns around, and within `reach` (s), where its speed is smoothed."""
    slow_here = np.abs(rate) < slow
    slow_here[1:] |= rate[1:] * rate[:-1] <= 0
    counted = np.append(0, np.cumsum(slow_here))
    first = np.searchsorted(stamps, stamps[:-1] - reach)
    last = np.minimum(np.searchsorted(stamps, stamps[1:] + reach), len(rate))
    result: Array = (counted[last] > counted[first]).astype(np.float64)
    return result


def _held_between(log: Recording, late: float) -> Array:
    """Mean voltage between the rows, `late` (s) after them."""
    assert log.voltage is not None
    steps = np.diff(log.time)
    means = log.voltage[:-1] if log.drive_held else (log.voltage[1:] + log.voltage[:-1]) / 2
    whole = np.append(0.0, np.cumsum(means * steps))
    result: Array = np.diff(np.interp(log.time + late, log.time, whole)) / steps
    return result


def _steps(log: Recording, late: float, active: Array, windows: Windows) -> Array:
    """∫φ u'(t + late) dt where the motor is outside its dead zone: a held voltage changes in steps at the rows."""
    assert log.voltage is not None
    if log.drive_held:
        instants, changes, weight = log.time[1:-1], np.diff(log.voltage[:-1]), (active[1:] + active[:-1]) / 2
    else:
        instants, changes, weight = (log.time[1:] + log.time[:-1]) / 2, np.diff(log.voltage), active
    return project_impulses(instants - late, changes * weight, windows.centres, windows.half)
