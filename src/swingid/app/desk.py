"""What all pages beside one live rig share: the runner, who controls, what was asked for last."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from swingid.app.analysis import Analyst
from swingid.app.live_steps import ON_RIG
from swingid.app.runner import Runner

STALE = 15.0
"""Seconds without a sign of the page that controls, after which another one may."""


@dataclass(frozen=True)
class Fields:
    """What is written in the fields: reference, duration (s), stop at this relative uncertainty (%)."""

    motion: Any = "sine 0.8 rad 8.5 rad/s"
    duration: Any = 25.0
    until: Any = 0.0


@dataclass
class Desk:
    """What all pages of one rig share: the runner, who controls, what was asked for last, what was rehearsed."""

    rig: str
    address: str
    folder: Path
    analyst: Analyst
    runner: Runner = field(init=False)
    controller: str = ""
    seen: float = 0.0
    fields: Fields = field(default_factory=Fields)
    rehearsed: Fields | None = None

    def __post_init__(self) -> None:
        self.runner = Runner(self.address)

    def controls(self, page: str) -> bool:
        """Return whether this page controls; the first one does, and another after that one is gone."""
        now = time.monotonic()
        if not self.controller or (self.controller != page and now - self.seen > STALE):
            self.controller = page
        if self.controller == page:
            self.seen = now
            return True
        return False

    def opened(self) -> dict[str, bool]:
        """Which steps may be begun."""
        return {name: self.runner.passed.issuperset(step.after) for name, step in ON_RIG.items()}

    def new_journal(self) -> str:
        """A file that is not there yet."""
        name = time.strftime("run-%Y%m%d-%H%M%S")
        paths = (self.folder / f"{name}{tail}.mcap" for tail in ("", *(f"-{k}" for k in range(2, 1000))))
        return str(next(path for path in paths if not path.exists()))
