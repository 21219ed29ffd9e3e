"""Known errors of the encoders, and which of them are corrected: decided here once, for methods, streams and batches.

A known nonlinearity is corrected in the readings here. A known latency is not, for it depends on the clock that a
method uses: `Encoders` contains the latency that is to be corrected, 0 where its correction is switched off.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from swingid.model.rig.encoder_kinds import DELAY
from swingid.model.rig.sensors import Sensor
from swingid.numerics.spline import spline_at, spline_slopes
from swingid.preparation.beat import ages, on_rows
from swingid.recording.findings import Kind
from swingid.recording.recording import Finding, Recording
from swingid.units import Quantity

if TYPE_CHECKING:
    from swingid.model.rig import Rig
    from swingid.numerics.arrays import Array
    from swingid.preparation.rate import Level

Origin = Literal["stated", "found", "switched off"]
Channel = Literal["angle", "wheel"]

REPAIR, LATENCY = "encoders", "latency"
LATENCY_LEFT, UNKNOWN = "latency-left", "large-nonlinearity"

ROUNDS = 8
"""Newton steps at most; each squares an error that is below 0.5 rad at first."""

EXACT = 1e-15

UNEVEN = 0.5
"""Steps differ by more of a row where rows were lost, which is no beat."""

FIRST_ORDER = float(np.radians(0.2))
"""Nonlinearity (rad) up to which its effect on the balance is linear: with 0.5° the coverage is too low."""


@dataclass(frozen=True)
class Correction:
    """A known error of a channel, or excluded rows, and its origin.

    channel: "angle", "wheel" or "rows". kind: "latency" (s), "nonlinearity_cosine", "nonlinearity_sine" (rad), "zero"
    (the angle at which the body hangs, rad), "push" (its torque; None where it is not known any more) from `start` to
    `stop` (s). standard_uncertainty: None where exact or not known. origin: "stated" in the rig file, "found" in the
    log, or "switched off": known, but not corrected.
    """

    channel: Literal["angle", "wheel", "rows"]
    kind: Literal["latency", "nonlinearity_cosine", "nonlinearity_sine", "zero", "push"]
    value: float | None
    standard_uncertainty: float | None
    unit: str
    origin: Origin
    start: float | None = None
    stop: float | None = None

    def as_dict(self) -> dict[str, object]:
        """Plain data for the provenance of a result."""
        spanned = self.start is not None
        return {name: value for name, value in asdict(self).items() if spanned or name not in ("start", "stop")}


@dataclass(frozen=True)
class Encoders:
    """The encoders of a prepared log: latencies that are still to be corrected, and declared uncertainties.

    level: what is unknown of an angle that is the integral of a rate; None of one that was measured. channels: that the
    rig has; against the others the `last` may be late.
    """

    angle: Sensor
    wheel: Sensor
    level: Level | None = None
    channels: tuple[Channel, ...] = ("angle",)

    @property
    def last(self) -> Channel:
        """The channel that is read last: the wheel's angle, or the angle beside a torque."""
        return self.channels[-1]

    def of_channel(self, channel: Channel) -> Sensor:
        """The encoder of a channel."""
        return self.angle if channel == "angle" else self.wheel

    @classmethod
    def of(cls, rig: Rig, log: Recording | None = None) -> Encoders:
        """Take the errors as the rig file declares them; latencies 0 where their correction is switched off for `log`.

        Where it states no latency, the last channel that is read may be late against the other by `DELAY` samples of
        `log`. What is the integral of a rate, or the place on a straight axis, has no error that repeats with a turn.
        """
        angle, wheel = rig.sensors.of("angle"), rig.sensors.of("wheel")
        if rig.log.has_rate_alone or rig.axis.kind == "linear":
            angle = replace(angle, cosine=Quantity(0.0), sine=Quantity(0.0), twice=0.0)
        declared = cls(angle, wheel, channels=("angle",) if rig.drive.wheel is None else ("angle", "wheel"))
        if log is None:
            return declared
        delay = 0.0 if rig.sensors.says_latency else DELAY / log.rate
        declared = declared.changed(declared.last, delay=delay)
        return declared.on_time() if LATENCY in log.repairs_off else declared

    def with_latency(self, channel: Channel, value: float, std: float | None) -> Encoders:
        """The same with another latency (s) of one channel."""
        return self.changed(channel, latency=Quantity(value, std))

    def changed(self, channel: Channel, **changes: Any) -> Encoders:
        """The same with changes of the encoder of one channel."""
        sensor = replace(self.of_channel(channel), **changes)
        return replace(self, angle=sensor) if channel == "angle" else replace(self, wheel=sensor)

    def on_time(self) -> Encoders:
        """The same without latencies, as after their correction; their uncertainty stays."""
        angle = self.with_latency("angle", 0.0, self.angle.latency.std)
        return angle.with_latency("wheel", 0.0, self.wheel.latency.std)


def corrected(log: Recording, rig: Rig) -> tuple[Recording, Encoders, tuple[Correction, ...]]:
    """The log with known nonlinearities corrected, its encoders, and the decision on each known error.

    With notes in the findings of the log. A correction that was made before is not repeated.
    """
    encoders = Encoders.of(rig, log)
    log, late = _latencies(log, rig)
    by_log = "calibrate" in log.done
    origin: Origin = "switched off" if REPAIR in log.repairs_off else "found" if by_log else "stated"
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


def _latencies(log: Recording, rig: Rig) -> tuple[Recording, list[Correction]]:
    """The log with a note of the known latencies, and the decision on each. A free decay does not depend on them."""
    channels: dict[Channel, Sensor] = {"angle": rig.sensors.of("angle")}
    if log.wheel_angle is not None and rig.drive.wheel is not None:
        channels["wheel"] = rig.sensors.of("wheel")
    late = {name: sensor.latency for name, sensor in channels.items() if sensor.latency.value}
    if rig.drive.channel is None or not late:
        return log, []
    off = LATENCY in log.repairs_off
    words = {"angle": "angle", "wheel": "wheel's angle"}
    shown = " and ".join(f"{1e3 * latency.value:.4g} ms of the {words[name]}" for name, latency in late.items())
    text = f"the known latency, {shown}, was not corrected." if off else f"the known latency was corrected: {shown}."
    note = Finding(LATENCY_LEFT, text, "note") if off else Finding(LATENCY, text, "note", LATENCY)
    if note not in log.findings:
        log = replace(log, findings=(*log.findings, note))
    origin: Origin = "switched off" if off else "stated"
    corrections = [
        Correction(name, "latency", latency.value, latency.std, "s", origin) for name, latency in late.items()
    ]
    return log, corrections


def straightened(log: Recording, encoders: Encoders, *, rotary: bool) -> Recording:
    """The log with the known nonlinearity of its encoders corrected, with a note of it.

    Unchanged where none is known, where it was done before, and where the repair "encoders" is switched off. A warning
    where a large one of a rotary axis' encoder is declared without values.
    """
    if REPAIR in log.done | log.repairs_off:
        return log
    log = replace(_polled(log, encoders.wheel), done=log.done | {REPAIR})
    sizes: list[str] = []
    true: dict[str, Any] = {}
    for name, field, sensor in (("angle", "angle", encoders.angle), ("wheel", "wheel_angle", encoders.wheel)):
        readings, (alpha, beta) = getattr(log, field), (sensor.cosine.value, sensor.sine.value)
        if readings is not None and (alpha or beta):
            true[field] = true_angles(readings, alpha, beta)
            sizes.append(f"{np.degrees(np.hypot(alpha, beta)):.2g}° of the {name}'s")
    unknown = _unknown(encoders.angle) if rotary else []
    if not sizes:
        return replace(log, findings=(*log.findings, *unknown)) if unknown else log
    text = f"the encoders' known nonlinearity was corrected: {' and '.join(sizes)} once per turn."
    return replace(log, findings=(*log.findings, Finding("encoders", text, "note", REPAIR), *unknown), **true)


def _polled(log: Recording, sensor: Sensor) -> Recording:
    """The log with the wheel's angle at its rows where it was polled in beat with them, with a note of it."""
    if log.wheel_angle is None or log.wheel_speed is not None or len(log.time) < 2:
        return log
    if np.ptp(np.diff(log.time)) * log.rate > UNEVEN:
        return log
    age = ages(log.wheel_angle, sensor.resolution)
    if age is None:
        return log
    text = (
        "the wheel's angle is polled by another clock than the rows are, and is older and younger in turn by "
        f"{1e3 * np.ptp(age) / log.rate:.2g} ms; it was moved to its rows."
    )
    finding = Finding("wheel-polled", text, "note", REPAIR)
    return replace(log, wheel_angle=on_rows(log.wheel_angle, age), findings=(*log.findings, finding))


def _unknown(sensor: Sensor) -> list[Finding]:
    """A warning for a large nonlinearity of the axis' encoder that is declared without values."""
    if sensor.calibrated or sensor.assumed or sensor.nonlinearity <= FIRST_ORDER * (1 + 1e-9):
        return []
    text = (
        f"the rig file declares {np.degrees(sensor.nonlinearity):.2g}° of nonlinearity of the angle's encoder without "
        f"values; methods use it to first order, which is valid up to {np.degrees(FIRST_ORDER):.2g}°, so estimate them "
        "with swingid calibrate --encoders."
    )
    return [Finding(UNKNOWN, text, "warning", kind=Kind.ENCODER_NONLINEARITY)]


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
