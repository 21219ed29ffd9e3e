"""Motions given by samples or by a function."""

from __future__ import annotations

import csv
from collections.abc import Callable
from io import StringIO
from pathlib import Path

import numpy as np

from swingid.control.references.base import refused, require_positive, sampled_turning_points
from swingid.errors import InputError, UsageError
from swingid.numerics.arrays import Array
from swingid.system import read_file

FEWEST = 4


class Sampled:
    """A motion through samples: `times` (s) strictly rising, `values` (rad or m), at least four of each.

    Between the samples a natural cubic spline, before and after them the first and the last value. `name`
    is what `describe` returns. Raises UsageError for samples that make no motion. Not for steps: a spline
    overshoots them.
    """

    def __init__(self, times: Array, values: Array, name: str = "sampled") -> None:
        """Check and copy the samples, make the spline."""
        from swingid.numerics.spline import spline_slopes

        self.times, self.values = (np.array(channel, dtype=float) for channel in (times, values))
        self.name = name
        if self.times.ndim != 1 or self.times.shape != self.values.shape or self.times.size < FEWEST:
            raise refused(name, f"give as many times as values, {FEWEST} or more")
        if not (np.all(np.isfinite(self.times)) and np.all(np.isfinite(self.values))):
            raise refused(name, "times and values must be finite numbers")
        if not np.all(np.diff(self.times) > 0.0):
            raise refused(name, "times must rise strictly")
        self._slopes = spline_slopes(self.times, self.values)
        for channel in (self.times, self.values, self._slopes):
            channel.flags.writeable = False

    @classmethod
    def load(cls, path: str | Path) -> Sampled:
        """Read a CSV file: first column time (s), second the motion (rad or m), one heading line at most.

        Raises InputError for a file that is missing or holds no such table, naming the row.
        """
        try:
            text = read_file(path).decode("utf-8-sig")
            rows = [row for row in csv.reader(StringIO(text, newline="")) if row]
        except (OSError, UnicodeDecodeError, csv.Error) as error:
            sentence = f"Reference file {str(path)!r} cannot be read as CSV text: give an existing CSV file."
            raise InputError(sentence, code="missing-reference") from error
        points = []
        for number, row in enumerate(rows, start=1):
            try:
                points.append((float(row[0]), float(row[1])))
            except (ValueError, IndexError) as error:
                if number == 1:
                    continue
                sentence = f"Reference file {str(path)!r}, row {number}: needs a time and a position as numbers."
                raise InputError(sentence, code="bad-reference-file") from error
        table = np.array(points).reshape(-1, 2)
        try:
            return cls(table[:, 0], table[:, 1], f"file {path}")
        except UsageError as error:
            raise InputError(error.message, code="bad-reference-file") from error

    def __call__(self, t: Array) -> Array:
        """Positions at the times t (s)."""
        return self._at(t, 0)

    def turning_points(self, duration: float) -> Array:
        """Times (s) inside (0, duration) of the reversals by more than a thousandth of the range."""
        step = 0.25 * float(np.min(np.diff(self.times)))
        return sampled_turning_points(self, duration, max(step, duration * 1e-6))

    def peak_speed(self, duration: float) -> float:
        """Largest speed of the spline over [0, duration], at a sample or where it bends the other way."""
        inner = self.times[(self.times >= 0.0) & (self.times <= duration)]
        ends = np.clip([0.0, max(duration, 0.0)], self.times[0], self.times[-1])
        bends = self._bends()
        bends = bends[(bends > 0.0) & (bends < duration)]
        if self.times[0] > duration or self.times[-1] < 0.0:
            return 0.0
        return float(np.max(np.abs(self._at(np.concatenate([inner, ends, bends]), 1))))

    def describe(self) -> str:
        """The name; `file PATH` can be parsed again."""
        return self.name

    def _at(self, t: Array, derivative: int) -> Array:
        from swingid.numerics.spline import spline_at

        wanted = np.clip(np.asarray(t, dtype=float), self.times[0], self.times[-1])
        flat = wanted.reshape(-1)
        order = np.argsort(flat, kind="stable")
        result: Array = np.empty(flat.shape)
        result[order] = spline_at(self.times, self.values, self._slopes, flat[order], derivative)
        return np.asarray(result.reshape(wanted.shape))

    def _bends(self) -> Array:
        """Times at which the second derivative, linear between samples, is zero."""
        h = np.diff(self.times)
        rise = np.diff(self.values) / h
        first = (6.0 * rise - 4.0 * self._slopes[:-1] - 2.0 * self._slopes[1:]) / h
        last = (-6.0 * rise + 2.0 * self._slopes[:-1] + 4.0 * self._slopes[1:]) / h
        crosses = first * last < 0.0
        part = first[crosses] / (first[crosses] - last[crosses])
        return np.asarray(self.times[:-1][crosses] + part * h[crosses])


class Motion:
    """A motion given by a Python function of time arrays; `step` (s) must be short against its swings.

    Turning points and peak speed are found from values on this step. Raises UsageError for a function that
    does not return one finite position for each time.
    """

    def __init__(self, function: Callable[[Array], Array], name: str = "callable", step: float = 1e-3) -> None:
        """Keep the function; it is called first when a position is needed."""
        require_positive(name, step=step)
        self.function, self.name, self.step = function, name, step

    def __call__(self, t: Array) -> Array:
        """Positions at the times t (s)."""
        t = np.asarray(t, dtype=float)
        values = np.asarray(self.function(t), dtype=float)
        if values.shape != t.shape or not np.all(np.isfinite(values)):
            raise refused(self.name, "the function must return one finite position for each time")
        return values

    def turning_points(self, duration: float) -> Array:
        """Times (s) inside (0, duration) of the reversals by more than a thousandth of the range."""
        return sampled_turning_points(self, duration, self.step)

    def peak_speed(self, duration: float) -> float:
        """Largest central difference over `step` in [0, duration] (s), rad/s or m/s.

        It errs by about step^2 times the third derivative.
        """
        if not duration > 0.0:
            return 0.0
        times = np.linspace(0.0, duration, max(3, int(np.ceil(duration / self.step)) + 1))
        return float(np.max(np.abs(np.gradient(self(times), times, edge_order=2))))

    def describe(self) -> str:
        """The name given with the function."""
        return self.name
