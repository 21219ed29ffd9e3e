"""Which column is likely which channel: by its name, its unit, and by how the columns move with each other.

A guess, to be confirmed by the person who knows the rig; each guess says what it rests on.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from swingid.recording.inspect.candidates import Candidate, Role, among
from swingid.recording.inspect.channel_guesses import (
    counted_from_top,
    guess_angle,
    guess_drive,
    guess_reference,
    guess_wheel,
    guess_wheel_speed,
)
from swingid.recording.inspect.clocks_and_speeds import clocks_beside, guess_speeds, guess_time
from swingid.recording.inspect.names import name_scores, unit_of

if TYPE_CHECKING:
    from swingid.recording.inspect.columns import Column


@dataclass(frozen=True)
class Roles:
    """All guesses of a file, by role, what its other columns seem to be, and the kind of drive that follows.

    zero_up: whether the angle seems to be counted from the top; None where that cannot be told. linear: a position.
    """

    found: dict[str, Role]
    others: dict[str, str] = field(default_factory=dict)
    zero_up: bool | None = None
    linear: bool = False

    def column(self, role: str) -> str | None:
        """The column in a role, None where there is none."""
        return self.found[role].column if role in self.found else None

    @property
    def drive(self) -> str:
        """The kind of drive that the channels speak for."""
        if "wheel_angle" in self.found or "wheel_speed" in self.found:
            return "reaction-wheel"
        return "direct" if "torque" in self.found else "none"


def guess_roles(columns: list[Column]) -> Roles:
    """The likely role of each column. Columns without numbers, and those of another length than most, have none."""
    with np.errstate(over="ignore", invalid="ignore"):  # absurd numbers are no motion, and no cause to print
        return _guess(columns)


def _guess(columns: list[Column]) -> Roles:
    lengths = [len(c.values) for c in columns if c.kind in ("numbers", "whole numbers")]
    usual = max(set(lengths), key=lengths.count) if lengths else 0
    usable = [c for c in columns if c.kind in ("numbers", "whole numbers") and len(c.values) == usual]
    candidates = [Candidate(c, name_scores(c.name), unit_of(c.name, c.unit)) for c in usable]
    found: dict[str, Role] = {}
    others: dict[str, str] = {}
    time = guess_time(candidates, found)
    rest = [c for c in candidates if c is not time]
    moving = [c for c in rest if not c.column.constant]
    others |= {c.name: "does not change" for c in rest if c.column.constant}
    others |= {c.name: "lists, which need a column for each number" for c in columns if _holds_lists(c)}
    beside = clocks_beside(moving)
    others |= beside
    moving = [c for c in moving if c.name not in beside]
    stamps = time.values if time is not None else np.arange(float(usual))
    speeds = guess_speeds(moving, stamps)
    others |= {c.name: f"speed of {of}" for c, of in speeds}
    angle = guess_angle([c for c in moving if not among(c, (s for s, _ in speeds))], found)
    if angle is None:
        return Roles(found, others)
    left = [c for c in moving if c is not angle and not among(c, (s for s, _ in speeds))]
    left = guess_wheel(left, angle, speeds, found)
    left = guess_reference(left, angle, found)
    left = guess_drive(left, found)
    if "wheel_angle" not in found:
        guess_wheel_speed(speeds, angle, found)
    others |= {c.name: "not known" for c in left}
    others = {name: what for name, what in others.items() if name not in {r.column for r in found.values()}}
    linear = found["angle"].unit in ("m", "mm")
    return Roles(found, others, None if linear else counted_from_top(angle, found["angle"].unit), linear)


def _holds_lists(column: Column) -> bool:
    """Whether the cells are texts such as "[0.1, 0.2]"."""
    return column.kind == "text" and any(cell.strip().startswith(("[", "(")) for cell in column.first)
