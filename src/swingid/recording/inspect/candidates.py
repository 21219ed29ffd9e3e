"""A column that may be a channel, and what a guess says of it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from swingid.recording.inspect.likeness import correlation, thin
from swingid.recording.inspect.names import ROLE_UNITS, SPEED_UNITS

if TYPE_CHECKING:
    from swingid.numerics.arrays import Array
    from swingid.recording.inspect.columns import Column


ALIKE = 0.98
"""Correlation of two positions from which on they are one motion: a measured one and its reference."""


@dataclass(frozen=True)
class Role:
    """A column in a role: "time", "angle", "wheel_angle", "wheel_speed", "voltage", "torque" or "reference".

    unit: stated or guessed, "" where unknown; why: what the guess rests on; sure: whether the name says so too.
    """

    role: str
    column: str
    unit: str
    why: str
    sure: bool


@dataclass(frozen=True, eq=False)
class Candidate:
    """A column with its scores by role and the unit that is stated, "" for none."""

    column: Column
    scores: dict[str, float]
    unit: str

    @property
    def name(self) -> str:
        """The column's name."""
        return self.column.name

    @property
    def values(self) -> Array:
        """The column's numbers."""
        return self.column.values


def among(one: Candidate, many: Iterable[Candidate]) -> bool:
    """Whether `one` is among `many`."""
    return any(one is other for other in many)


def fits(candidate: Candidate, role: str) -> float:
    """Score of a role by name and unit; negative where the unit is another quantity's."""
    score = candidate.scores[role]
    if candidate.unit and any(candidate.unit in units for units in ROLE_UNITS.values()):
        score += 2.0 if candidate.unit in ROLE_UNITS[role] else -4.0
    elif candidate.unit in SPEED_UNITS:
        score -= 4.0
    return score - candidate.scores["other"]


def alike(one: Candidate, other: Candidate) -> bool:
    """Whether two columns are one motion, measured or wanted: they go together and equally far."""
    ratio = one.column.span / max(other.column.span, 1e-300)
    return 0.3 < ratio < 3.0 and correlation(thin(one.values), thin(other.values)) > ALIKE
