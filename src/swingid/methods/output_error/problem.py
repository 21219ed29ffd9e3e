"""The log as an output-error problem: segments, knots, what is read where, and the prediction of it.

Multiple shooting without continuity: every segment has initial values of its own, so neither a long nor an unstable
log lets an error grow, and the work rises in proportion to the log.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

from swingid.errors import UnanswerableError
from swingid.methods.output_error.axis_motion import axis_motion
from swingid.methods.output_error.axis_step import COURSES, SPEED, TORQUE, WHEEL
from swingid.methods.output_error.motor_motion import READ_ANGLE, READ_WHEEL, motor_motion
from swingid.methods.output_error.unknowns import Entries
from swingid.numerics.arrays import Array, Bools, Ints
from swingid.numerics.spline import local_cubic, spline_at, spline_slopes
from swingid.preparation.encoders import Encoders
from swingid.preparation.noise import Noise
from swingid.preparation.speed import smooth_speed
from swingid.recording.recording import Recording

Input = Literal["voltage", "wheel", "torque", "none"]

LONGEST_STEP = 2e-3
"""Longest step (s) of the axis' integration; with 20 rad/s its error is 1e-9 of the motion."""

FEWEST_ROWS = 12
"""Rows of a segment below which it is left out."""


@dataclass(frozen=True)
class Prediction:
    """Angles at the readings (r,), their rates and their derivatives (r, m); finite says whether the motion was."""

    outputs: Array
    rates: Array
    slopes: Array
    finite: bool


@dataclass(frozen=True)
class Problem:
    """Segments of a log with their readings, in order of time; a reading is one angle of one channel at one instant.

    measured (r,), wheel (r,) true where the reading is the wheel's, sigma (r,) its standard deviation, times (r,).
    bounds (k + 1,): first knot of each segment; rows (k + 1,): its first reading. starts (k, 2 or 4): initial values
    as the angles show them. commands (n,) or courses (n, 3, 4): what drives the axis from each knot on.
    """

    input: Input
    knots: Array
    flags: Ints
    bounds: Ints
    rows: Ints
    commands: Array
    courses: Array
    measured: Array
    wheel: Bools
    sigma: Array
    times: Array
    starts: Array
    encoders: Encoders

    @property
    def states(self) -> int:
        """Initial values per segment."""
        return int(self.starts.shape[1])

    def predict(
        self, p: Array, entries: Entries, states: Array, unknowns: int, longest: float = LONGEST_STEP
    ) -> Prediction:
        """Readings under the constants p, and their derivatives by initial values and `unknowns` columns of entries."""
        count = len(self.measured)
        found = np.zeros(count), np.zeros(count), np.zeros((count, self.states + unknowns))
        if self.input == "voltage":
            finite = motor_motion(self.knots, self.commands, self.flags, self.bounds, states, p, entries, found)
        else:
            finite = axis_motion(self.knots, self.courses, self.flags, self.bounds, states, p, entries, longest, found)
        return Prediction(*found, finite=bool(finite))

    def part(self, chosen: list[int]) -> Problem:
        """The problem of some of the segments."""
        knots = np.concatenate([np.arange(self.bounds[s], self.bounds[s + 1]) for s in chosen])
        rows = np.concatenate([np.arange(self.rows[s], self.rows[s + 1]) for s in chosen])
        return Problem(
            self.input,
            self.knots[knots],
            self.flags[knots],
            _edges([self.bounds[s + 1] - self.bounds[s] for s in chosen]),
            _edges([self.rows[s + 1] - self.rows[s] for s in chosen]),
            self.commands[knots],
            self.courses[knots] if len(self.courses) else self.courses,
            self.measured[rows],
            self.wheel[rows],
            self.sigma[rows],
            self.times[rows],
            self.starts[chosen],
            self.encoders,
        )


def _edges(lengths: list[int]) -> Ints:
    return np.concatenate([[0], np.cumsum(np.array(lengths, dtype=np.int64))])


def problem_of(
    log: Recording, encoders: Encoders, noise: Noise, source: Input, length: float, longest_gap: float
) -> Problem:
    """Cut a log into segments of about `length` s, also where rows are missing for more than `longest_gap` s.

    A held voltage or torque acts from its stamp; angles are read their declared latency after theirs. Raises
    UnanswerableError where no segment has rows enough.
    """
    late, wheel_late = encoders.angle.latency.value, encoders.wheel.latency.value
    sigma = (_floor(noise.angle, log.angle), 1.0)
    drives = _Drives.of(log, source, wheel_late, noise)
    if source == "voltage":
        assert log.wheel_angle is not None
        sigma = (sigma[0], _floor(noise.wheel, log.wheel_angle))
    parts = []
    for first, last in _cuts(log.time, length, longest_gap):
        rows = slice(first, last)
        readings = [log.time[rows] + late]
        if source == "voltage":
            readings.append(log.time[rows] + wheel_late)
        parts.append(_segment(log, rows, readings, drives, source))
    if not parts:
        raise UnanswerableError(
            f"no stretch of the log without a gap holds {FEWEST_ROWS} rows, as many as its initial values need; record "
            "with fewer gaps or a higher rate.",
            code="too-short",
        )
    knots, flags, measured, wheel, times = (np.concatenate([part[i] for part in parts]) for i in range(5))
    commands, courses = drives.at(knots, _edges([len(part[0]) for part in parts]))
    return Problem(
        source,
        knots,
        flags,
        _edges([len(part[0]) for part in parts]),
        _edges([len(part[2]) for part in parts]),
        commands,
        courses,
        measured,
        wheel,
        np.where(wheel, sigma[1], sigma[0]),
        times,
        _starts(log, [part[0][0] for part in parts], length, late, wheel_late, source),
        encoders,
    )


def _floor(sigma: float, values: Array) -> float:
    """Noise of a channel; angles without any are weighed by 1e-8 of their range."""
    return max(sigma, 1e-8 * float(np.ptp(values)))


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
    log: Recording, rows: slice, readings: list[Array], drives: _Drives, source: Input
) -> tuple[Array, Ints, Array, Bools, Array]:
    """Knots and flags of one segment; its measured values, which are the wheel's, and their instants."""
    begin, end = min(r[0] for r in readings), max(r[-1] for r in readings)
    inside = drives.times[(drives.times > begin) & (drives.times < end)]
    knots = np.unique(np.concatenate([*readings, inside]))
    flags = np.zeros(len(knots), dtype=np.int64)
    for bit, instants in zip((READ_ANGLE, READ_WHEEL), readings, strict=False):
        flags[np.searchsorted(knots, instants)] |= bit
    values = [log.angle[rows]]
    if source == "voltage":
        assert log.wheel_angle is not None
        values.append(log.wheel_angle[rows])
    times = np.concatenate(readings)
    wheel = np.repeat([False, True][: len(readings)], [len(r) for r in readings])
    order = np.argsort(times, kind="stable")
    return knots, flags, np.concatenate(values)[order], wheel[order], times[order]


@dataclass(frozen=True)
class _Drives:
    """What drives the axis: held values from `times` on, or cubics through values at `times`."""

    times: Array
    held: Array | None
    cubics: tuple[tuple[Array, Array, Array] | None, ...]

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
            return cls(log.time, None, (None, None, None))
        values = log.voltage if source == "voltage" else log.torque
        assert values is not None
        if source == "torque" and not log.drive_held:
            return cls(log.time, None, (None, None, (log.time, values, spline_slopes(log.time, values))))
        if not log.drive_held:
            # what was measured stands for the time about it, half a row each way
            times, values = _without_gaps(log.time, values)
            return cls(np.append(times[0], (times[1:] + times[:-1]) / 2), values, (None, None, None))
        return cls(*_without_gaps(log.time, values), (None, None, None))

    def at(self, knots: Array, bounds: Ints) -> tuple[Array, Array]:
        """Commands from each knot on, and the cubics between knots; the wheel's angle counts from a segment's start."""
        commands = np.zeros(len(knots))
        if self.held is not None:
            before = np.searchsorted(self.times, knots, side="right") - 1
            commands = self.held[np.clip(before, 0, len(self.held) - 1)]
        courses = np.zeros((len(knots), COURSES, 4))
        courses[:, TORQUE, 0] = commands
        steps = np.append(np.diff(knots), 0.0)
        # behind a segment's last knot nothing moves
        steps[bounds[1:] - 1] = 0.5 * float(np.median(steps))
        for which, cubic in zip((WHEEL, SPEED, TORQUE), self.cubics, strict=True):
            if cubic is not None:
                courses[:, which] = _cubics(cubic, knots, steps)
        for first, last in pairwise(bounds):
            courses[first:last, WHEEL, 0] -= courses[first, WHEEL, 0]
        return commands, courses


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


def _starts(
    log: Recording, instants: list[float], length: float, late: float, wheel_late: float, source: Input
) -> Array:
    """Angle and speed of each channel at the segments' starts, from local cubics."""
    at = np.array(instants)
    width = max(8.0 / log.rate, min(0.03 * length, 0.03))
    found = [local_cubic(log.time + late, log.angle, at, width)]
    if source == "voltage":
        assert log.wheel_angle is not None
        found.append(local_cubic(log.time + wheel_late, log.wheel_angle, at, width))
    states = np.column_stack(found)
    if not np.isfinite(states).all():
        states = np.nan_to_num(states)
    return states
