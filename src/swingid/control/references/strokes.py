"""Smooth symmetric strokes with a dwell at each end."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from swingid.control.references.base import inside, require_positive, require_unit
from swingid.errors import UsageError
from swingid.numerics.arrays import Array

PEAK = 15.0 / 8.0
"""Peak speed of the quintic 10 s^3 - 15 s^4 + 6 s^5, in the middle, in units of way per time."""


@dataclass(frozen=True)
class Strokes:
    """Rest to rest between +A and -A, with a dwell at each end.

    `amplitude` A in rad or m, `stroke_time` each way and `dwell` in s. Each stroke is the quintic of least
    jerk, at rest and without acceleration at both ends (Flash and Hogan 1985). The first stroke goes from 0
    to +A in the same time, so no step is asked of a body at rest at t = 0. `unit` of A is "rad" or "m". Raises
    UsageError for an amplitude or stroke time that is not positive, or a negative dwell. The axis may stick in a dwell:
    prefer a sine on a bearing with much static friction.
    """

    amplitude: float
    stroke_time: float
    dwell: float = 0.0
    unit: str = "rad"

    def __post_init__(self) -> None:
        """Refuse a motion that does not move."""
        require_positive("strokes", amplitude=self.amplitude, stroke_time=self.stroke_time)
        require_unit("strokes", self.unit)
        if not 0.0 <= self.dwell < math.inf:
            sentence = f"Reference strokes: the dwell must not be negative, and is {self.dwell}."
            raise UsageError(sentence, code="bad-reference")

    def __call__(self, t: Array) -> Array:
        """Positions at the times t (s)."""
        start, way, s = self._phase(t)
        return start + way * s**3 * (10.0 + s * (6.0 * s - 15.0))

    def turning_points(self, duration: float) -> Array:
        """Times (s) inside (0, duration) of the middles of the dwells."""
        cycle = self.stroke_time + self.dwell
        count = math.ceil(max(duration, 0.0) / cycle) + 1
        return inside(self.stroke_time + 0.5 * self.dwell + cycle * np.arange(count, dtype=float), duration)

    def peak_speed(self, duration: float) -> float:
        """15/8 of the way per stroke time, once the middle of the second, longer stroke is reached."""
        middles = 0.5 * self.stroke_time + (self.stroke_time + self.dwell) * np.arange(2)
        times = np.concatenate([middles[middles < duration], [max(duration, 0.0)]])
        _, way, s = self._phase(times)
        return float(np.max(np.abs(way) * 30.0 * (s * (1.0 - s)) ** 2) / self.stroke_time)

    def describe(self) -> str:
        """Words for `parse_reference`."""
        return f"strokes {self.amplitude!r} {self.unit} {self.stroke_time!r} s {self.dwell!r} s"

    def _phase(self, t: Array) -> tuple[Array, Array, Array]:
        """Where the stroke of each time begins, its signed way, and the part 0 ... 1 of its time gone."""
        cycle = self.stroke_time + self.dwell
        t = np.maximum(np.asarray(t, dtype=float), 0.0)
        number = np.floor(t / cycle)
        s = np.minimum((t - number * cycle) / self.stroke_time, 1.0)
        sign = np.where(number % 2 == 0, 1.0, -1.0)
        start = np.where(number == 0, 0.0, -sign * self.amplitude)
        way = sign * self.amplitude * np.where(number == 0, 1.0, 2.0)
        return start, way, s
