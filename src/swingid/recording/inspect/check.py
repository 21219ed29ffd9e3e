"""One thing that was looked at in a log, and what was found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

Level = Literal["ok", "note", "unknown", "advice", "repair", "fault"]


@dataclass(frozen=True, slots=True)
class Check:
    """A finding of an inspection: a `code` for scripts, a `title` and a sentence of `evidence` with numbers for people.

    level: "ok" nothing is wrong; "note" worth knowing; "unknown" this log cannot tell; "advice" it serves, and would
    serve better after `remedy`; "repair" it serves once `remedy` is stated in the rig file; "fault" it does not serve.
    values: the numbers of the sentence, in SI units. own: what swingid repaired on reading.
    """

    code: str
    title: str
    level: Level
    evidence: str
    remedy: str = ""
    values: Mapping[str, object] = field(default_factory=dict)
    own: str | None = None

    def to_dict(self) -> dict[str, object]:
        """As plain data for JSON."""
        return {
            "code": self.code,
            "title": self.title,
            "level": self.level,
            "evidence": self.evidence,
            "remedy": self.remedy,
            "values": dict(self.values),
            "own_repair": self.own,
        }
