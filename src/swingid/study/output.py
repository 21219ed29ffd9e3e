"""What a study writes: JSON of its plain data, and notes as lines for a terminal."""

from __future__ import annotations

import json
import textwrap
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from typing import Any

from swingid.result.data import plain
from swingid.table import WIDTH


class Study(ABC):
    """The base of what a study returns: plain data as JSON text."""

    @abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """Plain data with its schema; numbers may be NaN or of numpy."""

    def to_json(self) -> str:
        """The plain data as JSON text; what is not finite is null."""
        return json_text(self.to_dict())


def json_text(data: object) -> str:
    """Data as JSON text, with null for what is not finite."""
    return json.dumps(plain(data), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def noted(notes: Iterable[str]) -> list[str]:
    """Notes as lines, wrapped."""
    return [
        line
        for note in notes
        for line in textwrap.wrap(f"note: {note}", WIDTH, initial_indent="    ", subsequent_indent="      ")
    ]


def counted(codes: Mapping[str, int], runs: int) -> str:
    """Codes with how often each was met."""
    return ", ".join(f"{code} in {n} of {runs}" for code, n in sorted(codes.items(), key=lambda c: (-c[1], c[0])))
