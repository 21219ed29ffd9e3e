"""A sine whose frequency sweeps a band up and down."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from swingid.control.references.base import crossings, inside, require_positive, require_unit
from swingid.numerics.arrays import Array


@dataclass(frozen=True)
class Chirp:
    """A sin(phase) with a frequency from `low` to `high` (rad/s) in `sweep` (s), and back, and so on.

    `amplitude` A in rad or m. The frequency is linear in time within a sweep and never leaves the band;
    phase and frequency are continuous. `low` may exceed `high` (downward first). Raises UsageError for
    values that are not positive. Its turning points are only nearly symmetric (the frequency changes): slow
    sweeps serve the momentum method better.
    """

    amplitude: float
    low: float
    high: float
    sweep: float
    unit: str = "rad"

    def __post_init__(self) -> None:
        """Refuse a motion that does not move."""
        require_positive(
            "chirp",
            amplitude=self.amplitude,
            low_frequency=self.low,
            high_frequency=self.high,
            sweep=self.sweep,
        )
        require_unit("chirp", self.unit)

    def __call__(self, t: Array) -> Array:
        """Positions at the times t (s)."""
        return self.amplitude * np.sin(self._phase(t)[0])

    def turning_points(self, duration: float) -> Array:
        """Times (s) inside (0, duration) at which the phase is an odd multiple of pi/2, sweep by sweep."""
        times = []
        whole = 0.5 * (self.low + self.high) * self.sweep
        for number in range(math.ceil(max(duration, 0.0) / self.sweep)):
            first, last = (self.low, self.high) if number % 2 == 0 else (self.high, self.low)
            start = number * whole
            levels = np.arange(math.ceil(start / math.pi - 0.5), math.ceil((start + whole) / math.pi - 0.5))
            ahead = (levels + 0.5) * math.pi - start
            # start + first s + (last - first) s^2/(2 sweep), without cancellation for equal frequencies too
            reach = np.sqrt(first**2 + 2.0 * (last - first) / self.sweep * ahead)
            times.append(number * self.sweep + 2.0 * ahead / (first + reach))
        return inside(np.concatenate(times), duration) if times else np.empty(0)

    def peak_speed(self, duration: float) -> float:
        """Largest speed over [0, duration]: at an end, a joint of sweeps or zero acceleration."""
        rate, top = abs(self.high - self.low) / self.sweep, max(self.low, self.high)
        slope = self.amplitude * (3.0 * top * rate + top**3)
        bend = self.amplitude * (3.0 * rate**2 + 6.0 * top**2 * rate + top**4)
        candidates = [np.array([0.0, max(duration, 0.0)])]
        for number in range(math.ceil(max(duration, 0.0) / self.sweep)):
            start, stop = number * self.sweep, min((number + 1) * self.sweep, duration)
            inner = crossings(
                partial(self._acceleration, number), partial(self._jerk, number), slope, bend, start, stop
            )
            candidates += [inner, np.array([start, stop])]
        phase, frequency, _ = self._phase(np.concatenate(candidates))
        return float(np.max(np.abs(self.amplitude * frequency * np.cos(phase))))

    def describe(self) -> str:
        """Words for `parse_reference`."""
        band = f"{self.low!r} rad/s {self.high!r} rad/s"
        return f"chirp {self.amplitude!r} {self.unit} {band} {self.sweep!r} s"

    def _phase(self, t: Array, number: float | Array | None = None) -> tuple[Array, Array, Array]:
        """Phase (rad), frequency (rad/s) and its rate (rad/s^2) after the law of sweep `number`."""
        t = np.asarray(t, dtype=float)
        number = np.floor(t / self.sweep) if number is None else np.asarray(number, dtype=float)
        s = t - number * self.sweep
        up = number % 2 == 0
        rate = np.where(up, 1.0, -1.0) * (self.high - self.low) / self.sweep
        first = np.where(up, self.low, self.high)
        start = number * 0.5 * (self.low + self.high) * self.sweep
        return start + s * (first + 0.5 * rate * s), first + rate * s, rate

    def _acceleration(self, number: int, t: Array) -> Array:
        phase, frequency, rate = self._phase(t, number)
        return self.amplitude * (rate * np.cos(phase) - frequency**2 * np.sin(phase))

    def _jerk(self, number: int, t: Array) -> Array:
        phase, frequency, rate = self._phase(t, number)
        slow = 3.0 * rate * frequency * np.sin(phase)
        return -self.amplitude * (slow + frequency**3 * np.cos(phase))
