"""What is known of the encoders, and what of it is taken off: decided here once, for every method.

A known nonlinearity is taken off the readings here. A known latency is not, for what is late depends on the clock that
a method takes: `Encoders` holds the latency that is to be taken off, 0 where that is switched off.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from swingid.model.rig.sensors import Sensor
from swingid.numerics.spline import spline_at, spline_slopes
from swingid.recording.findings import Kind
from swingid.recording.recording import Finding, Recording

if TYPE_CHECKING:
    from swingid.model.rig import Rig
    from swingid.numerics.arrays import Array

Origin = Literal["stated", "found", "switched off"]
Channel = Literal["angle", "wheel"]

REPAIR, LATENCY = "encoders", "latency"
LATENCY_LEFT, UNKNOWN = "latency-left", "large-nonlinearity"

ROUNDS = 8
"""Newton steps at most; each squares an error that is below 0.5 rad at first."""

EXACT = 1e-15

FIRST_ORDER = float(np.radians(0.2))
"""Nonlinearity (rad) up to which its effect on the balance is linear: with 0.5° intervals cover too little."""


@dataclass(frozen=True)
class Correction:
    """A known error of a channel, or rows that are left out, and who says so.

    channel: "angle", "wheel" or "rows". kind: "latency" (s), "nonlinearity_cosine", "nonlinearity_sine" (rad), "push"
    (its torque; None where it is not known any more) from `start` to `stop` (s). std: standard uncertainty, None: exact
    or not known. origin: "stated" in the rig file, "found" in the log, or "switched off": known, but not taken off.
    """

    channel: Literal["angle", "wheel", "rows"]
    kind: Literal["latency", "nonlinearity_cosine", "nonlinearity_sine", "push"]
    value: float | None
    std: float | None
    unit: str
    origin: Origin
    start: float | None = None
    stop: float | None = None

    def as_dict(self) -> dict[str, object]:
        """Plain data for the provenance of a result."""
        found: dict[str, object] = {
            "channel": self.channel,
            "kind": self.kind,
            "value": self.value,
            "standard_uncertainty": self.std,
            "unit": self.unit,
            "origin": self.origin,
        }
        return found if self.start is None else found | {"start": self.start, "stop": self.stop}


@dataclass(frozen=True)
class Encoders:
    """The encoders of a prepared log: what is still to be taken off (latency) and what stays uncertain."""

    angle: Sensor
    wheel: Sensor

    @classmethod
    def of(cls, rig: Rig) -> Encoders:
        """As the rig file declares them."""
        return cls(rig.sensors.of("angle"), rig.sensors.of("wheel"))

    def with_latency(self, channel: Channel, value: float, std: float | None) -> Encoders:
        """The same with another latency (s) of one channel."""
        changed = replace(getattr(self, channel), latency=type(self.angle.latency)(value, std))
        return replace(self, **{channel: changed})

    def on_time(self) -> Encoders:
        """The same without latencies, as after they were taken off; their uncertainty stays."""
        angle = self.with_latency("angle", 0.0, self.angle.latency.std)
        return angle.with_latency("wheel", 0.0, self.wheel.latency.std)


def corrected(log: Recording, rig: Rig) -> tuple[Recording, Encoders, tuple[Correction, ...]]:
    """The log with known nonlinearities taken off, its encoders, and what was decided of each known error.

    Notes in the findings of the log say so. What was done before is not done again.
    """
    encoders = Encoders.of(rig)
    log, encoders, late = _latencies(log, rig, encoders)
    by_log = any(one.repair == "calibrate" and one.code != "repair-off" for one in log.findings)
    origin: Origin = "switched off" if is_off(log, REPAIR) else "found" if by_log else "stated"
    channels: list[tuple[Channel, Sensor]] = [("angle", encoders.angle)]
    if log.wheel_angle is not None:
        channels.append(("wheel", encoders.wheel))
    bent = [
        Correction(channel, f"nonlinearity_{name}", part.value, part.std, "rad", origin)  # type: ignore[arg-type]
        for channel, sensor in channels
        for name, part in sensor.parts.items()
        if part.value
    ]
    return straightened(log, encoders, rotary=rig.axis.kind == "rotary"), encoders, (*late, *bent)


def is_off(log: Recording, repair: str) -> bool:
    """Whether a repair of the log is switched off."""
    return any(one.code == "repair-off" and one.repair == repair for one in log.findings)


def _latencies(log: Recording, rig: Rig, encoders: Encoders) -> tuple[Recording, Encoders, list[Correction]]:
    """A note of the known latencies; the encoders with those that are to be taken off.

    Where the repair is switched off they are 0, and their uncertainty stays. In a free decay nothing feels a latency.
    """
    channels: dict[Channel, Sensor] = {"angle": encoders.angle}
    if log.wheel_angle is not None and rig.drive.kind == "reaction-wheel":
        channels["wheel"] = encoders.wheel
    late = {name: sensor.latency for name, sensor in channels.items() if sensor.latency.value}
    if rig.drive.kind == "none" or not late:
        return log, encoders, []
    off = is_off(log, LATENCY)
    words = {"angle": "angle", "wheel": "wheel's angle"}
    shown = " and ".join(f"{1e3 * one.value:.4g} ms of the {words[name]}" for name, one in late.items())
    text = f"the known latency, {shown}, was not taken off." if off else f"the known latency was taken off: {shown}."
    found = Finding(LATENCY_LEFT, text, "note") if off else Finding(LATENCY, text, "note", LATENCY)
    if found not in log.findings:
        log = replace(log, findings=(*log.findings, found))
    origin: Origin = "switched off" if off else "stated"
    corrections = [Correction(name, "latency", one.value, one.std, "s", origin) for name, one in late.items()]
    return log, encoders.on_time() if off else encoders, corrections


def straightened(log: Recording, encoders: Encoders, *, rotary: bool) -> Recording:
    """The log with the nonlinearity taken off that is known of its encoders, with a note of it.

    Unchanged where none is known, where it was done before, and where the repair "encoders" is switched off. A warning
    where a large one of a rotary axis' encoder is declared without values.
    """
    if any(finding.repair == REPAIR or finding.code == UNKNOWN for finding in log.findings):
        return log
    angle, wheel, said = log.angle, log.wheel_angle, []
    axis, other = encoders.angle, encoders.wheel
    if axis.cosine.value or axis.sine.value:
        angle = true_angles(angle, axis.cosine.value, axis.sine.value)
        said.append(f"{_size(axis)} of the angle's")
    if wheel is not None and (other.cosine.value or other.sine.value):
        wheel = true_angles(wheel, other.cosine.value, other.sine.value)
        said.append(f"{_size(other)} of the wheel's")
    unknown = _unknown(axis) if rotary else []
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
    return [Finding(UNKNOWN, text, "warning", kind=Kind.ENCODER_NONLINEARITY)]


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


def moved(time: Array, values: Array, late: float) -> Array:
    """A channel that was read `late` seconds after its stamps, at the stamps; by its cubic spline."""
    if late == 0.0:
        return values
    return spline_at(time, values, spline_slopes(time, values), time - late, 0)


def on_stamps(log: Recording, encoders: Encoders) -> Recording:
    """The log with each angle as it was at its stamp; at the stamps the voltage acts."""
    late, wheel_late = encoders.angle.latency.value, encoders.wheel.latency.value
    if late == 0 and (wheel_late == 0 or log.wheel_angle is None):
        return log
    wheel = None if log.wheel_angle is None else moved(log.time, log.wheel_angle, wheel_late)
    return replace(log, angle=moved(log.time, log.angle, late), wheel_angle=wheel)
