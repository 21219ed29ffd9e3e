"""A sum of sines: the motion that tells inertia from gravity torque."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swingid.control.references.base import crossings
from swingid.control.references.sine import Sine
from swingid.errors import UsageError
from swingid.numerics.arrays import Array


@dataclass(frozen=True)
class Multisine:
    """The sum of `parts`, each a `Sine` in the same unit. Raises UsageError for no part, mixed units
    or two parts of one frequency.
    """

    parts: tuple[Sine, ...]

    def __post_init__(self) -> None:
        """Refuse an empty sum and a sum of angles and lengths."""
        object.__setattr__(self, "parts", tuple(self.parts))
        if not self.parts:
            raise UsageError("Reference multisine: give at least one part.", code="bad-reference")
        if len({part.unit for part in self.parts}) > 1:
            raise UsageError("Reference multisine: rad and m cannot be added.", code="bad-reference")
        if len({part.frequency for part in self.parts}) < len(self.parts):
            sentence = "Reference multisine: two parts have the same frequency; write them as one part."
            raise UsageError(sentence, code="bad-reference")

    @property
    def unit(self) -> str:
        """Unit of the positions."""
        return self.parts[0].unit

    def __call__(self, t: Array) -> Array:
        """Positions at the times t (s)."""
        return self._derivative(t, 0)

    def turning_points(self, duration: float) -> Array:
        """Times (s) inside (0, duration) at which the speed changes sign; all of them (see `crossings`)."""
        return self._crossings(1, duration)

    def peak_speed(self, duration: float) -> float:
        """Largest speed over [0, duration], at one of its ends or where the acceleration changes sign."""
        times = np.concatenate([[0.0, max(duration, 0.0)], self._crossings(2, duration)])
        return float(np.max(np.abs(self._derivative(times, 1))))

    def describe(self) -> str:
        """Words for `parse_reference`."""
        return "multisine " + " + ".join(part.words() for part in self.parts)

    def _derivative(self, t: Array, order: int) -> Array:
        t = np.asarray(t, dtype=float)
        total = np.zeros_like(t)
        for part in self.parts:
            factor = part.amplitude * part.frequency**order
            total += factor * np.sin(part.frequency * t + part.phase + 0.5 * np.pi * order)
        return total

    def _crossings(self, order: int, duration: float) -> Array:
        """Sign changes of a derivative; its own derivatives are bounded by the sum of the parts'."""
        slope, bend = (sum(part.amplitude * part.frequency ** (order + more) for part in self.parts) for more in (1, 2))
        return crossings(
            lambda t: self._derivative(t, order),
            lambda t: self._derivative(t, order + 1),
            slope,
            bend,
            0.0,
            duration,
        )
