"""Fits of the same log that judge the chosen one: other laws, other cut-offs, friction at the reversals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swingid.balance.choice import impulse_left
from swingid.methods.equation_error.laws import Law
from swingid.methods.equation_error.scatter import Fitted, rms
from swingid.numerics.arrays import Array
from swingid.preparation.motion import Motion
from swingid.uncertainty.budget import Source, systematic
from swingid.uncertainty.significance import DETECTED


@dataclass(frozen=True)
class Judged:
    """The chosen fit with its law, and what judges it.

    laws: fits with the other laws that may be, and how likely each is. cutoffs: by name. impulse: standard uncertainty
    (N m s or N s) of what the correction of the turning points leaves at each reversal. memory: column of such an
    impulse in the rows.
    """

    chosen: Fitted
    law: Law
    laws: tuple[tuple[Law, Fitted, float], ...]
    cutoffs: dict[str, Fitted]
    impulse: float
    memory: Array
    motion: Motion

    @property
    def between_laws(self) -> float:
        """Spread of the inertia over the laws that may be, about the chosen one, each as likely as it is."""
        own = self.chosen.fit.a11
        return float(np.sqrt(sum(weight * (other.fit.a11 - own) ** 2 for _, other, weight in self.laws)))

    @property
    def common(self) -> list[tuple[Source, str, float]]:
        """Type A errors that the scatter does not show: alike in all rows, or, of the inertia, seen by other fits."""
        found = self.chosen.common(self.motion)
        found["choice of the friction law"] = self.between_laws
        if "memory" not in self.chosen.fit.unknowns:
            found["timing of the turning points"] = (
                abs(float(self.chosen.fit.fit.influence[0] @ self.memory)) * self.impulse
            )
        for name, other in self.cutoffs.items():
            found[f"disagreement: {name}"] = self.chosen.contradicted(other, self.motion)
        entries = [(systematic(source), "inertia", spread) for source, spread in found.items()]
        for name in self.chosen.scale.unknown:
            own = self.chosen.common(self.motion, name)
            entries += [(systematic(source), name, spread) for source, spread in own.items()]
        return entries


def spread_of(fit: Fitted, unknown: str, motion: Motion) -> float:
    """Standard uncertainty of an unknown from the scatter, the sensors' noise and the place of the encoder's grid."""
    own = np.eye(len(fit.fit.unknowns))[fit.fit.unknowns.index(unknown)]
    spread = float(np.sqrt(fit.variance(own)))
    if fit.noise.resolution > 0:
        spread = float(np.hypot(spread, rms(fit.grid_effects(motion, unknown))))
    return spread


def remembered(fit: Fitted, motion: Motion, impulse: float) -> tuple[bool, float]:
    """Whether a fit with a memory of friction sees one, and how uncertain the impulse at each reversal is without it.

    impulse: what the correction of the turning points may leave.
    """
    spread = spread_of(fit, "memory", motion)
    found = abs(fit.fit.value("memory"))
    return found > DETECTED * spread, impulse_left(impulse, found, spread)
