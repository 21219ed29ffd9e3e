"""The motion that a log shows: turning points, frequencies, rest, excitation, and how much of it serves each method."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swingid.errors import UnanswerableError
from swingid.methods.table import DEFAULT, METHODS, Method
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.preparation.motion import Motion, find_motion
from swingid.preparation.noise import Noise
from swingid.preparation.reference import turns_freely
from swingid.preparation.segment import part_of
from swingid.recording.inspect import Check
from swingid.recording.recording import Recording

POINTS = 2**15
"""Points of the even grid whose spectrum is taken."""

SMALL = 0.03
"""Share of the largest amplitude below which a line of the spectrum is left out."""

MOST_LINES = 4
APART = 0.12
"""Lines count as two frequencies where they lie at least so far apart (share)."""

HARMONIC, SAME = 0.4, 0.02
"""A line below this share of the strongest may be its harmonic, if it lies so near (share) to a multiple."""

FEW = 6
"""Turning points below which methods have too few degrees of freedom for an uncertainty."""

GAP = 5.0
"""Steps of the clock beyond which a stretch without rows serves nobody."""

TURNING = ("voltage", "torque")
"""Channels of drives that may turn the axis in one direction, which momentum takes."""

STRONG = 0.1
"""Share of the amplitude that a second frequency needs to distinguish inertia from gravity."""


@dataclass(frozen=True)
class Swings:
    """What there is of motion: the Motion, the part worth using (s), lines of its spectrum (Hz, amplitude in rad or m).

    `part_note`: how the part was chosen.
    """

    motion: Motion
    start: float
    stop: float
    part_note: str
    lines: tuple[tuple[float, float], ...]

    @property
    def rest(self) -> float:
        """Time in s that the axis rests within the part."""
        rests = self.motion.within(self.start, self.stop).rests
        return float((rests[:, 1] - rests[:, 0]).sum()) if len(rests) else 0.0


def read_motion(
    log: Recording, noise: Noise, channel: str | None, *, linear: bool, rig: Rig | None = None
) -> tuple[Swings | None, list[Check]]:
    """The motion of a log and its checks; None where there is none that swings.

    rig: as stated. Where a drive or nothing but friction may turn the body in one direction, that is no fault.
    """
    unit = "m" if linear else "rad"
    try:
        motion = find_motion(log.time, log.angle, noise.angle)
        start, stop, note = part_of(log, motion, channel)
    except UnanswerableError as error:
        turns = channel in TURNING or (rig is not None and turns_freely(rig))
        if error.code != "no-turning-points" or not turns:
            wheel = ", or give --rig with axis.gravity_torque = 0 for a wheel that runs down"
            add = wheel if rig is None and error.code == "no-turning-points" and channel is None else ""
            return None, [Check("motion", "motion", "fault", f"{error.message.rstrip('.')}{add}.")]
        text = "the axis hardly swings back and forth: momentum takes windows that need no turning points"
        text += "." if rig is None else "; log and rig file are not compared."
        return None, [Check("motion", "motion", "note", text)]
    lines = spectrum(log.time, log.angle, start, stop, 1 / (2 * motion.half_period))
    swings = Swings(motion, start, stop, note.message, lines)
    inside = motion.within(start, stop)
    sizes, count = inside.swing_sizes, len(inside.turning_times)
    text = f"{count} turning points from {start:.4g} to {stop:.4g} s, swings of {np.median(sizes):.3g} {unit}"
    text += f" (from {sizes.min():.3g} to {sizes.max():.3g}) that take {inside.half_period:.3g} s each."
    values: dict[str, object] = {
        "turning_points": count,
        "start": start,
        "stop": stop,
        "swing": float(np.median(sizes)),
        "half_period": inside.half_period,
    }
    few = count < FEW
    remedy = f"record a longer motion, of {FEW} swings and more" if few else ""
    checks = [Check("motion", "motion", "advice" if few else "ok", text, remedy, values)]
    if swings.rest > 0.02 * (stop - start):
        text = f"the axis rests {swings.rest:.3g} s of this part, which holds no information on the inertia."
        checks.append(Check("rest", "rest", "note", text, "", {"rest": swings.rest}))
    if channel is not None and not few:
        checks.append(_excitation(swings, unit))
    return swings, checks


def amplitudes(time: Array, angle: Array, start: float, stop: float, main: float) -> tuple[Array, Array]:
    """Amplitude spectrum of the angle from `start` to `stop` (s) under Hann's window: frequencies (Hz), heights.

    main: about the main frequency, Hz; the grid is fine enough for forty times it.
    """
    count = int(min(POINTS, max(256, 2 ** np.ceil(np.log2((stop - start) * main * 160)))))
    even = np.linspace(start, stop, count)
    values = np.interp(even, time, angle)
    window = np.hanning(count)
    values = (values - np.average(values, weights=window)) * window
    frequency: Array = np.asarray(np.fft.rfftfreq(count, (stop - start) / (count - 1)), dtype=np.float64)
    height: Array = 2 * np.abs(np.fft.rfft(values)) / window.sum()
    return frequency, height


def spectrum(time: Array, angle: Array, start: float, stop: float, main: float) -> tuple[tuple[float, float], ...]:
    """The largest lines of the angle's amplitude spectrum: frequency in Hz and amplitude, the largest first.

    main: about the main frequency, Hz; lines are looked for up to forty times it.
    """
    frequency, power = amplitudes(time, angle, start, stop, main)
    peaks = np.flatnonzero((power[1:-1] > power[:-2]) & (power[1:-1] >= power[2:])) + 1
    peaks = peaks[(frequency[peaks] > 1.5 / (stop - start)) & (frequency[peaks] < 40 * main)]
    lines: list[tuple[float, float]] = []
    for k in peaks[np.argsort(-power[peaks])]:
        if lines and power[k] < SMALL * lines[0][1]:
            break
        # the true place and height between the points of the grid, for Hann's window
        left, middle, right = power[k - 1], power[k], power[k + 1]
        beside = max(left, right)
        shift = (2 * beside - middle) / (middle + beside) * (1 if right > left else -1)
        height = middle * _hann_gain(float(shift))
        lines.append((float(frequency[k] + shift * frequency[1]), float(height)))
        if len(lines) == MOST_LINES:
            break
    return tuple(lines)


def _hann_gain(shift: float) -> float:
    """Height of a line over its nearest point, `shift` points away (Hann's window)."""
    if abs(shift) < 1e-9:
        return 1.0
    return float(np.pi * shift * (1 - shift**2) / np.sin(np.pi * shift))


def independent(lines: tuple[tuple[float, float], ...]) -> list[float]:
    """Frequencies (Hz) among the strong lines that are neither near a stronger one nor a weak multiple of it."""
    kept: list[float] = []
    for frequency, height in lines:
        weak = height < HARMONIC * lines[0][1]
        ratios = [frequency / other for other in kept]
        near = any(abs(ratio - 1) < APART for ratio in ratios)
        multiple = weak and any(ratio > 1.5 and abs(ratio - round(ratio)) < SAME * ratio for ratio in ratios)
        if height > STRONG * lines[0][1] and not near and not multiple:
            kept.append(frequency)
    return kept


def _excitation(swings: Swings, unit: str) -> Check:
    shown = ", ".join(f"{f:.3g} Hz ({2 * np.pi * f:.3g} rad/s) with {a:.3g} {unit}" for f, a in swings.lines)
    kept = independent(swings.lines)
    if len(kept) > 1:
        text = f"frequencies {shown}: more than one, so inertia and gravity torque are distinguishable."
    else:
        text = f"frequencies {shown or 'none'}: one motion, in which inertia and gravity torque are collinear"
        text += "; where gravity_torque is unknown, their ratio alone is identifiable."
    if unit == "m":
        text = f"frequencies {shown}."
    return Check("excitation", "frequencies", "note", text, "", {"lines": [list(line) for line in swings.lines]})


@dataclass(frozen=True)
class Service:
    """Seconds of the log that a method can use, 0 where none; why: what takes the rest away."""

    method: str
    seconds: float
    why: str


def services(log: Recording, swings: Swings | None, channel: str | None, rig: Rig | None) -> list[Service]:
    """One line per method; without a rig what its constants allow is left open."""
    return [_service(method, log, swings, channel, rig) for method in METHODS.values()]


def _service(method: Method, log: Recording, swings: Swings | None, channel: str | None, rig: Rig | None) -> Service:
    lacking = _lacking(method, log, channel, rig)
    turns = (channel in TURNING or (rig is not None and turns_freely(rig))) and method.name == DEFAULT
    if swings is None and turns and not lacking:
        part = "all of it" if channel in TURNING else "where it turns, from its greatest speed on"
        return Service(method.name, log.duration, part)
    if swings is None or lacking:
        return Service(method.name, 0.0, lacking or "no motion that swings back and forth")
    start, stop = swings.start, swings.stop
    why = []
    first, last = float(log.time[0]), float(log.time[-1])
    if method.turning_points:
        turning = swings.motion.within(start, stop).turning_times
        start, stop = float(turning[0]), float(turning[-1])
    for seconds, reason in ((start - first, "before"), (last - stop, "after")):
        if seconds > 0.01 * (last - first):
            why.append(f"{seconds:.3g} s {reason} {_what(channel, reason, method)}")
    inside = log.segment(start, stop)
    steps = np.diff(inside.time)
    gaps = steps[steps > GAP * np.median(steps)] if len(steps) else steps
    usable = stop - start - swings.rest - float(gaps.sum())
    if swings.rest > 0:
        why.append(f"{swings.rest:.3g} s at rest")
    if gaps.size:
        why.append(f"{gaps.sum():.3g} s of gaps")
    return Service(method.name, max(usable, 0.0), ", ".join(why) or "all of it")


def not_checked(rig: Rig) -> Check:
    """The check of a rig whose balance holds unknown constants of a motor: there is nothing to compare it with."""
    text = f"rig {rig.name} has a motor on the axis, whose constants identify fits; log and rig file are not compared."
    return Check("balance", "balance", "note", text)


def _what(channel: str | None, reason: str, method: Method) -> str:
    if method.turning_points:
        return "the first turning point" if reason == "before" else "the last turning point"
    if reason == "before":
        return "the free decay" if channel is None else "the motion has settled"
    return "the free decay ends" if channel is None else "the end of the part"


def _lacking(method: Method, log: Recording, channel: str | None, rig: Rig | None) -> str:
    """What a method needs that is not there; "" where nothing is missing."""
    if channel == "wheel_angle" and log.wheel_angle is None:
        return "no wheel angle"
    if channel == "torque" and log.torque is None:
        return "no torque"
    if channel == "voltage" and method.name != DEFAULT:
        return "does not identify a motor on the axis"
    if method.gravity and rig is not None:
        gravity = rig.axis.gravity_torque
        if isinstance(gravity, str) or gravity.value == 0:
            return "needs a gravity torque above 0"
    if method.drive and channel is None:
        return "needs a drive"
    if method.motor == "needed" and channel == "wheel_angle":
        if log.voltage is None:
            return "no voltage"
        motor = None if rig is None else rig.drive.motor
        if rig is not None and (motor is None or motor.torque_per_volt.value == 0):
            return "the rig file has no motor constants"
    return ""
