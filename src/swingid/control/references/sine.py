"""The sine motion of the paper's experiments."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from swingid.control.references.base import inside, require_positive, require_unit
from swingid.numerics.arrays import Array


@dataclass(frozen=True)
class Sine:
    """A sin(omega t + phase): `amplitude` (rad or m), `frequency` omega (rad/s), `phase` (rad).
    `unit` is that of the amplitude, "rad" or "m".

    y_m1 = 0.8 sin(8.5 t) of section 5. Raises UsageError for an amplitude or frequency that is not positive.
    One frequency cannot tell inertia from gravity torque: use a multisine for both.
    """

    amplitude: float
    frequency: float
    phase: float = 0.0
    unit: str = "rad"

    def __post_init__(self) -> None:
        """Refuse a motion that does not move."""
        require_positive("sine", amplitude=self.amplitude, frequency=self.frequency)
        require_unit("sine", self.unit)

    def __call__(self, t: Array) -> Array:
        """Positions at the times t (s)."""
        return self.amplitude * np.sin(self.frequency * np.asarray(t, dtype=float) + self.phase)

    def turning_points(self, duration: float) -> Array:
        """Times (s) inside (0, duration) at which the phase is an odd multiple of pi/2."""
        if not duration > 0.0:
            return np.empty(0)
        first = math.floor(self.phase / math.pi - 0.5) - 1
        last = math.ceil((self.phase + self.frequency * duration) / math.pi - 0.5) + 1
        times = ((np.arange(first, last + 1, dtype=float) + 0.5) * math.pi - self.phase) / self.frequency
        return inside(times, duration)

    def peak_speed(self, duration: float) -> float:
        """A omega (rad/s or m/s); over a `duration` (s) without passage through zero the larger speed of the ends."""
        full = self.amplitude * self.frequency
        end = self.phase + self.frequency * max(duration, 0.0)
        if math.floor(end / math.pi) >= math.ceil(self.phase / math.pi):
            return full
        return full * max(abs(math.cos(self.phase)), abs(math.cos(end)))

    def describe(self) -> str:
        """Words for `parse_reference`."""
        return f"sine {self.words()}"

    def words(self) -> str:
        """Amplitude, frequency and phase with units."""
        phase = f" {self.phase!r} rad" if self.phase else ""
        return f"{self.amplitude!r} {self.unit} {self.frequency!r} rad/s{phase}"
