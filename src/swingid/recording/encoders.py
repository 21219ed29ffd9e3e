"""Readings of encoders whose once-per-turn nonlinearity is known, straightened."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from swingid.recording.recording import Finding, Recording

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from swingid.model.rig import Rig

REPAIR = "encoders"
ROUNDS = 8
"""Newton steps at most; each squares an error that is below 0.5 rad at first."""

EXACT = 1e-15


def straightened(log: Recording, rig: Rig) -> Recording:
    """The log with the nonlinearity taken off that the rig file states (sensors.nonlinearity_cosine and _sine).

    Unchanged where the file states none, where it was done before, and where the repair "encoders" is switched off. A
    note in the findings says so. Not for a log whose angles are those of the motion already.
    """
    if any(finding.repair == REPAIR for finding in log.findings):
        return log
    changed, said = {}, []
    for channel, values in (("angle", log.angle), ("wheel", log.wheel_angle)):
        sensor = rig.sensors.of("angle" if channel == "angle" else "wheel")
        alpha, beta = sensor.cosine.value, sensor.sine.value
        if values is None or (alpha == 0 and beta == 0):
            continue
        changed["angle" if channel == "angle" else "wheel_angle"] = true_angles(values, alpha, beta)
        said.append(f"{np.degrees(np.hypot(alpha, beta)):.2g}° of the {channel}'s")
    if not changed:
        return log
    text = f"the encoders' nonlinearity that the rig file states was taken off: {' and '.join(said)} once per turn."
    return replace(log, **changed, findings=(*log.findings, Finding("encoders", text, "note", REPAIR)))


def true_angles(readings: NDArray[np.float64], alpha: float, beta: float) -> NDArray[np.float64]:
    """The angles q (rad) of readings q + alpha cos q + beta sin q; hypot(alpha, beta) must be below 1."""
    q = np.array(readings, dtype=np.float64)
    for _ in range(ROUNDS):
        cosine, sine = np.cos(q), np.sin(q)
        step = (q + alpha * cosine + beta * sine - readings) / (1 - alpha * sine + beta * cosine)
        q -= step
        if np.max(np.abs(step), initial=0.0) < EXACT * max(1.0, float(np.max(np.abs(q), initial=0.0))):
            break
    return q
