"""Readings of encoders whose once-per-turn nonlinearity is known, straightened."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from swingid.recording.latency import with_latency_told
from swingid.recording.recording import Finding, Recording

if TYPE_CHECKING:
    from swingid.model.rig import Rig
    from swingid.model.rig.sensors import Sensor
    from swingid.numerics.arrays import Array

REPAIR = "encoders"
UNKNOWN = "large-nonlinearity"

ROUNDS = 8
"""Newton steps at most; each squares an error that is below 0.5 rad at first."""

EXACT = 1e-15

FIRST_ORDER = float(np.radians(0.2))
"""Nonlinearity (rad) up to which its effect on the balance is linear: with 0.5° intervals cover too little."""


def straightened(log: Recording, rig: Rig) -> Recording:
    """The log with the nonlinearity taken off that the rig file states (sensors.nonlinearity_cosine and _sine).

    Unchanged where the file states none, where it was done before, and where the repair "encoders" is switched off. A
    note in the findings says so; a warning, where a large one of the axis' encoder is declared without values. What the
    file states of latencies is told as well, see `latency`. Not for a log whose angles are those of the motion already.
    """
    log = with_latency_told(log, rig)
    if any(finding.repair == REPAIR or finding.code == UNKNOWN for finding in log.findings):
        return log
    angle, wheel, said = log.angle, log.wheel_angle, []
    axis, other = rig.sensors.of("angle"), rig.sensors.of("wheel")
    if axis.cosine.value or axis.sine.value:
        angle = true_angles(angle, axis.cosine.value, axis.sine.value)
        said.append(f"{_size(axis)} of the angle's")
    if wheel is not None and (other.cosine.value or other.sine.value):
        wheel = true_angles(wheel, other.cosine.value, other.sine.value)
        said.append(f"{_size(other)} of the wheel's")
    unknown = _unknown(axis) if rig.axis.kind == "rotary" else []
    if not said:
        return replace(log, findings=(*log.findings, *unknown)) if unknown else log
    text = f"the encoders' known nonlinearity was taken off: {' and '.join(said)} once per turn."
    found = (*log.findings, Finding("encoders", text, "note", REPAIR), *unknown)
    return replace(log, angle=angle, wheel_angle=wheel, findings=found)


def _unknown(sensor: Sensor) -> list[Finding]:
    """A warning for the axis' encoder of a large nonlinearity, of whose values none was found."""
    if sensor.calibrated or sensor.nonlinearity <= FIRST_ORDER * (1 + 1e-9):
        return []
    text = (
        f"the rig file declares {np.degrees(sensor.nonlinearity):.2g}° of nonlinearity of the angle's encoder without "
        f"values; methods take that to first order, which serves up to {np.degrees(FIRST_ORDER):.2g}°, so find them "
        "with swingid calibrate --encoders."
    )
    return [Finding(UNKNOWN, text, "warning")]


def _size(sensor: Sensor) -> str:
    return f"{np.degrees(np.hypot(sensor.cosine.value, sensor.sine.value)):.2g}°"


def true_angles(readings: Array, alpha: float, beta: float) -> Array:
    """The angles q (rad) of readings q + alpha cos q + beta sin q; hypot(alpha, beta) must be below 1."""
    q = np.array(readings, dtype=np.float64)
    for _ in range(ROUNDS):
        cosine, sine = np.cos(q), np.sin(q)
        step = (q + alpha * cosine + beta * sine - readings) / (1 - alpha * sine + beta * cosine)
        q -= step
        if np.max(np.abs(step), initial=0.0) < EXACT * max(1.0, float(np.max(np.abs(q), initial=0.0))):
            break
    return q
