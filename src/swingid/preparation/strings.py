"""What the equation of a body on strings leaves out: its vertical motion, to the next order in the amplitude.

A body on strings rises as it turns, so that its kinetic energy is ½ (J + μ sin² q (h/H)²) q'², μ = m (R r/h)². To first
order in μ and for small angles its period is that of J (1 + μ A²/(2 J)) at the amplitude A.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swingid.format import number, percent
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.result.result import Message
from swingid.uncertainty.budget import Evaluated, systematic
from swingid.units import Quantity

SOURCE = "vertical motion of the body on strings"


@dataclass(frozen=True)
class VerticalMotion:
    """The inertia by which an estimate is too large for the vertical motion, and the largest rise (m)."""

    inertia: float
    rise: float

    @classmethod
    def of(cls, rig: Rig, stiffness: float | None, turning_angles: Array) -> VerticalMotion | None:
        """Return the effect by the amplitudes, weighted by their squares; None without strings, or of unknown height.

        stiffness: κ as identified, None where the rig states it.
        """
        strings = rig.axis.suspension
        if strings is None or not strings.rise or not len(turning_angles):
            return None
        kappa = strings.stiffness.value if isinstance(strings.stiffness, Quantity) else stiffness
        if kappa is None:
            return None
        amplitude = 0.5 * np.abs(np.diff(turning_angles)) if len(turning_angles) > 1 else np.abs(turning_angles)
        square = float(np.sum(amplitude**4) / max(float(np.sum(amplitude**2)), 1e-300))
        angle = float(np.max(amplitude))
        height = strings.height * (1 - np.sqrt(max(1 - strings.shape * (1 - np.cos(angle)), 0.0)))
        return cls(0.5 * kappa * strings.rise * square, float(height))

    def counted(self, evaluated: Evaluated) -> Evaluated:
        """Return the result with the whole effect as a standard uncertainty of the inertia."""
        return evaluated.widened(systematic(SOURCE), "inertia", self.inertia)

    def note(self, inertia: float) -> Message:
        """The note on its size."""
        text = (
            f"the body rises by up to {number(1e3 * self.rise, 'mm', 2)} as it turns on its strings; the equation has "
            f"no energy of that motion, which makes the inertia up to {percent(self.inertia / inertia)} too large, and "
            "counts that as an uncertainty."
        )
        return Message("vertical-motion", text)
