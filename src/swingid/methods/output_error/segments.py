"""A log cut into segments: knots, readings, and the input between knots."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from swingid.errors import UnanswerableError
from swingid.methods.output_error.axis_motion import COURSES
from swingid.methods.output_error.motion import PLAIN, READ_ANGLE, READ_WHEEL
from swingid.methods.output_error.problem import Input, Problem, ends_of
from swingid.numerics.arrays import Array, Bools, Ints
from swingid.numerics.spline import local_cubic, spline_at, spline_slopes
from swingid.preparation.encoders import Encoders
from swingid.preparation.noise import Noise
from swingid.preparation.speed import smooth_speed
from swingid.recording.recording import Recording

_Channel = tuple[Array, float, float]
"""Values, latency (s), standard deviation of the noise."""

FEWEST_ROWS = 12
"""Least number of rows of a segment; shorter ones are excluded."""


def problem_of(
    log: Recording, encoders: Encoders, noise: Noise, source: Input, length: float, longest_gap: float
) -> Problem:
    """Cut a log into segments of about `length` s, also where rows are missing for more than `longest_gap` s.

    A held voltage or torque acts from its stamp; angles are read their declared latency after theirs. Raises
    UnanswerableError where no segment has rows enough.
    """
    channels = [(log.angle, encoders.angle.latency.value, noise.angle)]
    if source == "voltage":
        assert log.wheel_angle is not None
        channels.append((log.wheel_angle, encoders.wheel.latency.value, noise.wheel))
    drives = _Drives.of(log, source, encoders.wheel.latency.value, noise)
    parts = [_segment(log.time, channels, slice(*cut), drives) for cut in _cuts(log.time, length, longest_gap)]
    if not parts:
        raise UnanswerableError(
            f"no stretch of the log without a gap holds {FEWEST_ROWS} rows, as many as its initial values need; record "
            "with fewer gaps or a higher rate.",
            code="too-short",
        )
    knots, flags, measured, wheel, times = (np.concatenate([part[i] for part in parts]) for i in range(5))
    bounds = ends_of([len(part[0]) for part in parts])
    # angles without noise get 1e-8 of their range
    sigma = [max(spread, 1e-8 * float(np.ptp(values))) for values, _, spread in channels]
    return Problem(
        source,
        knots,
        flags,
        bounds,
        ends_of([len(part[2]) for part in parts]),
        drives.at(knots, bounds),
        measured,
        wheel,
        np.where(wheel, sigma[-1], sigma[0]),
        times,
        _starts(log, channels, [part[0][0] for part in parts], length),
        encoders,
    )


def _cuts(time: Array, length: float, longest_gap: float) -> list[tuple[int, int]]:
    """First row and row after the last of each segment: runs without a gap, each cut into equal parts."""
    breaks = np.nonzero(np.diff(time) > longest_gap)[0] + 1
    cuts = []
    for first, last in zip([0, *breaks], [*breaks, len(time)], strict=True):
        count = max(1, round((time[last - 1] - time[first]) / length)) if last > first else 1
        edges = np.searchsorted(time[first:last], np.linspace(time[first], time[last - 1], count + 1)[1:-1]) + first
        for begin, end in zip([first, *edges], [*edges, last], strict=True):
            if end - begin >= FEWEST_ROWS:
                cuts.append((int(begin), int(end)))
    return cuts


def _segment(
    time: Array, channels: list[_Channel], rows: slice, drives: _Drives
) -> tuple[Array, Ints, Array, Bools, Array]:
    """Knots and flags of one segment; its measured values, which are the wheel's, and their instants."""
    readings = [time[rows] + late for _, late, _ in channels]
    begin, end = min(r[0] for r in readings), max(r[-1] for r in readings)
    inside = drives.times[(drives.times > begin) & (drives.times < end)]
    values = np.concatenate([values[rows] for values, _, _ in channels])
    first = readings[0]
    if all(np.array_equal(first, other) for other in readings[1:]) and np.array_equal(first[1:-1], inside):
        count = len(readings)
        order = np.arange(count * len(first)).reshape(count, -1).T.ravel()
        wheel = np.tile([False, True][:count], len(first))
        return first, np.full(len(first), (1 << count) - 1), values[order], wheel, np.repeat(first, count)
    knots = np.unique(np.concatenate([*readings, inside]))
    flags = np.zeros(len(knots), dtype=np.int64)
    for bit, instants in zip((READ_ANGLE, READ_WHEEL), readings, strict=False):
        flags[np.searchsorted(knots, instants)] |= bit
    times = np.concatenate(readings)
    wheel = np.repeat([False, True][: len(readings)], [len(r) for r in readings])
    order = np.argsort(times, kind="stable")
    return knots, flags, values[order], wheel[order], times[order]


@dataclass(frozen=True)
class _Drives:
    """The input: held values from `times` on, of a voltage or a torque, or cubics as `axis_motion` has them."""

    times: Array
    held: Array | None
    cubics: tuple[tuple[Array, Array, Array] | None, ...] = (None, None, None)
    volts: bool = False

    @classmethod
    def of(cls, log: Recording, source: Input, wheel_late: float, noise: Noise) -> _Drives:
        if source == "wheel":
            assert log.wheel_angle is not None
            times = log.time + wheel_late
            wheel = (times, log.wheel_angle, spline_slopes(times, log.wheel_angle))
            speed = smooth_speed(times, log.wheel_angle, noise.wheel)
            smooth = (speed.grid, speed.speed, spline_slopes(speed.grid, speed.speed))
            return cls(times, None, (wheel, smooth, None))
        if source == "none":
            return cls(log.time, None)
        values = log.voltage if source == "voltage" else log.torque
        assert values is not None
        if source == "torque" and not log.drive_held:
            return cls(log.time, None, (None, None, (log.time, values, spline_slopes(log.time, values))))
        if not log.drive_held:
            # a measured value holds for half a row before and after it
            times, values = _without_gaps(log.time, values)
            return cls(np.append(times[0], (times[1:] + times[:-1]) / 2), values, volts=True)
        return cls(*_without_gaps(log.time, values), volts=source == "voltage")

    def at(self, knots: Array, bounds: Ints) -> Array:
        """The input from each knot on, see `motion.motion_steps`; the wheel's angle counts from a segment's start."""
        commands = np.zeros(len(knots))
        if self.held is not None:
            before = np.searchsorted(self.times, knots, side="right") - 1
            commands = self.held[np.clip(before, 0, len(self.held) - 1)]
        if self.volts:
            return np.column_stack([commands, np.zeros_like(commands)])
        courses = np.zeros((len(knots), COURSES, 4))
        courses[:, -1, 0] = commands
        steps = np.append(np.diff(knots), 0.0)
        # after a segment's last knot nothing is computed
        steps[bounds[1:] - 1] = 0.5 * float(np.median(steps))
        for which, cubic in enumerate(self.cubics):
            if cubic is not None:
                courses[:, which] = _cubics(cubic, knots, steps)
        for first, last in pairwise(bounds):
            courses[first:last, 0, 0] -= courses[first, 0, 0]
        return np.hstack([np.zeros((len(knots), PLAIN)), courses.reshape(len(knots), -1)])


def _cubics(cubic: tuple[Array, Array, Array], knots: Array, steps: Array) -> Array:
    """Coefficients (n, 4) of the spline's cubic from each knot on, over `steps` (s)."""
    values, slopes = spline_at(*cubic, knots, 0), spline_at(*cubic, knots, 1)
    ends, end_slopes = spline_at(*cubic, knots + steps, 0), spline_at(*cubic, knots + steps, 1)
    rise = (ends - values) / steps
    return np.column_stack(
        [values, slopes, (3 * rise - 2 * slopes - end_slopes) / steps, (slopes + end_slopes - 2 * rise) / steps**2]
    )


def _without_gaps(time: Array, values: Array) -> tuple[Array, Array]:
    """Instants and held values, with those of lost rows put on a straight line."""
    steps = np.diff(time)
    step = float(np.median(steps))
    lost = np.rint(steps / step).astype(np.int64) - 1
    if not np.any(lost > 0):
        return time, values
    times = [time]
    for k in np.nonzero(lost > 0)[0]:
        times.append(time[k] + steps[k] * np.arange(1, lost[k] + 1) / (lost[k] + 1))
    every = np.sort(np.concatenate(times))
    return every, np.interp(every, time, values)


def _starts(log: Recording, channels: list[_Channel], instants: list[float], length: float) -> Array:
    """Angle and speed of each channel at the segments' starts, from local cubics."""
    width = max(8.0 / log.rate, min(0.03 * length, 0.03))
    at = np.array(instants)
    states = np.column_stack([local_cubic(log.time + late, values, at, width) for values, late, _ in channels])
    return states if np.isfinite(states).all() else np.nan_to_num(states)
