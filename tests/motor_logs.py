"""Tests of the wheel's motor on the twin: rod clamped by a friction that never lets go, voltages without control."""

from __future__ import annotations

import numpy as np

from swingid.model.rig import Rig
from swingid.simulation import simulate

PAPER = Rig.builtin("paper")
ETA, GEAR = 0.9, 4.4
TRUE = {
    "motor.gain": ETA * 52.04e-4,
    "motor.damping": ETA * 3.697e-6 + GEAR * 3.687e-5,
    "motor.breakaway_positive": 302.02e-5 + 5.485e-4,
    "motor.breakaway_negative": 302.02e-5 + 2.996e-4,
    "motor.torque_per_volt": 52.04e-4,
    "motor.back_emf": 3.697e-6,
    "motor.viscous": 3.687e-5,
    "motor.coulomb": 302.02e-5,
    "motor.dead_zone.positive": 5.485e-4,
    "motor.dead_zone.negative": -2.996e-4,
}
"""The paper's motor, section 5, as a calibration names it."""

PRODUCTS = tuple(TRUE)[:4]
BLANK = {f"drive.motor.{key}": None for key in ("torque_per_volt", "back_emf", "viscous", "coulomb", "dead_zone")}
"""Changes that leave a rig without motor constants."""

OFF = {
    "drive.motor.torque_per_volt": 1.05 * 52.04e-4,
    "drive.motor.back_emf": 1.05 * 3.697e-6,
    "drive.motor.viscous": 0.95 * 3.687e-5,
    "drive.motor.coulomb": 0.95 * 302.02e-5,
    "drive.motor.dead_zone": [-2.85e-4, 5.76e-4],
}
"""Changes that make every motor constant 5 % wrong."""


IDEAL = {"nonlinearity": 0, "latency": 0}
"""Encoders of which it is stated that they have neither."""


def multisine(duration=10.0, rate=1000.0, phase=0.0):
    """A voltage of four frequencies, up to 8.5 V."""
    time = np.arange(int(duration * rate) + 1) / rate
    parts = ((3.0, 1.1), (2.5, 2.9), (2.0, 7.3), (1.0, 19.0))
    return sum(a * np.sin(w * time + 1.7 * k + phase) for k, (a, w) in enumerate(parts))


def given(sensors=None, **changes):
    """What calibration is told of the rig: nothing of inertia or friction of the axis."""
    return PAPER.changed({"axis.inertia": None, "axis.friction": None, "sensors": IDEAL | (sensors or {})} | changes)


def clamped_rig(sensors=None, **changes):
    """The twin's rig with its rod clamped."""
    return PAPER.changed({"axis.friction": {"coulomb": 10.0}, "sensors": IDEAL | (sensors or {})} | changes)


def clamped(voltage=None, sensors=None, rate=1000.0, seed=0, **changes):
    """A log of the clamped twin under `voltage`, by default the multisine of 10 s."""
    drive = multisine(rate=rate) if voltage is None else voltage
    duration = (len(drive) - 1) / rate
    return simulate(clamped_rig(sensors, **changes), duration=duration, rate=rate, drive=drive, seed=seed)
