"""How far a large log has been read, and how long the rest takes, on standard error."""

from __future__ import annotations

import sys
import time
from contextlib import suppress

from swingid.cli.output import say

EVERY = 10.0
"""Seconds between two lines where standard error is no terminal; a terminal has one line that overwrites itself."""


class Progress:
    """Called with the rows read so far and the rows of the log."""

    def __init__(self) -> None:
        self.first: tuple[float, int] | None = None
        self.told = time.monotonic()

    def __call__(self, rows: int, total: int) -> None:
        """Say how far it is; how long the rest takes is told from the second call on, for the first may compile."""
        now = time.monotonic()
        text = f"{rows / 1e6:.1f} of {total / 1e6:.1f} million rows"
        if self.first is None:
            self.first = now, rows
        elif rows > self.first[1]:
            text += f", {_left((now - self.first[0]) / (rows - self.first[1]) * max(total - rows, 0))} left"
        if sys.stderr is not None and sys.stderr.isatty():
            with suppress(OSError):
                sys.stderr.write(f"\r{text:<60}" + ("\n" if rows >= total else ""))
                sys.stderr.flush()
        elif now - self.told > EVERY:
            self.told = now
            say(text)


def _left(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 100 else f"{seconds / 60:.0f} min"
