"""Constant speed to and fro, with rounded corners."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from swingid.control.references.base import inside, require_positive, require_unit
from swingid.errors import UsageError
from swingid.numerics.arrays import Array


@dataclass(frozen=True)
class Triangle:
    """A triangle between +A and -A: `amplitude` A (rad or m), `frequency` (rad/s), `corner` (s) per corner.

    `unit` of A is "rad" or "m".
    In a corner the acceleration is constant, so speed is continuous and turning points are symmetric; on
    the flanks the speed is constant, v = 4 A/(T - corner) with T the period. It starts on the middle of a
    rising flank. `corner` None is a tenth of the period; at half a period the flanks are gone. Raises
    UsageError for values out of range. Shows friction at one speed well, and excites inertia only in the
    corners.
    """

    amplitude: float
    frequency: float
    corner: float | None = None
    unit: str = "rad"

    def __post_init__(self) -> None:
        """Fill in the corner, refuse one that does not fit."""
        require_positive("triangle", amplitude=self.amplitude, frequency=self.frequency)
        require_unit("triangle", self.unit)
        if self.corner is None:
            object.__setattr__(self, "corner", 0.1 * self.period)
        if not 0.0 < self._corner <= 0.5 * self.period:
            sentence = (
                f"Reference triangle: the corner must last between 0 and half a period "
                f"({0.5 * self.period:.6g} s), and is {self._corner} s."
            )
            raise UsageError(sentence, code="bad-reference")

    @property
    def period(self) -> float:
        """Time (s) of one to and fro."""
        return 2.0 * math.pi / self.frequency

    @property
    def _corner(self) -> float:
        return 0.0 if self.corner is None else self.corner

    @property
    def speed(self) -> float:
        """Speed (rad/s or m/s) on the flanks."""
        return 4.0 * self.amplitude / (self.period - self._corner)

    def __call__(self, t: Array) -> Array:
        """Positions at the times t (s)."""
        half = 0.5 * self.period
        number = np.floor(np.asarray(t, dtype=float) / half + 0.5)
        from_middle = np.asarray(t, dtype=float) - number * half
        into_corner = np.maximum(np.abs(from_middle) - 0.5 * (half - self._corner), 0.0)
        way = self.speed * (np.abs(from_middle) - into_corner**2 / self._corner)
        return np.where(number % 2 == 0, 1.0, -1.0) * np.sign(from_middle) * way

    def turning_points(self, duration: float) -> Array:
        """Times (s) inside (0, duration) of the corners' middles."""
        count = math.ceil(max(duration, 0.0) * 2.0 / self.period) + 1
        return inside((np.arange(count, dtype=float) + 0.5) * 0.5 * self.period, duration)

    def peak_speed(self, duration: float) -> float:
        """The speed of the flanks, which the motion starts with."""
        del duration
        return self.speed

    def describe(self) -> str:
        """Words for `parse_reference`."""
        return f"triangle {self.amplitude!r} {self.unit} {self.frequency!r} rad/s {self._corner!r} s"
