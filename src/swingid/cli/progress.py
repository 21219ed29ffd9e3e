"""Progress of long work on standard error: a bar on a terminal, a plain line now and then elsewhere."""

from __future__ import annotations

import time

from swingid.cli.output import overwrite, say, time_left

EVERY = 10.0
"""Seconds between two lines where standard error is no terminal; a terminal has one line that overwrites itself."""

WIDTH = 20
"""Places of the bar."""


class Progress:
    """Called with what is done and the whole, in `scale` of the unit; shows the share, and how long the rest takes.

    The time left is known from the second call with something done on, for what comes first may compile kernels.
    """

    def __init__(self, unit: str, scale: float = 1.0) -> None:
        self.unit, self.scale = unit, scale
        self.first: tuple[float, int] | None = None
        self.shown = time.monotonic()

    def __call__(self, done: int, total: int) -> None:
        """Report how far it is."""
        now = time.monotonic()
        text = f"{self._number(done)} of {self._number(total)} {self.unit}"
        if self.first is not None and done > self.first[1]:
            remaining = (now - self.first[0]) / (done - self.first[1]) * max(total - done, 0)
            text += f", {time_left(remaining)} left" if done < total else ""
        elif self.first is None and done > 0:
            self.first = now, done
        if not overwrite(f"{bar(done, total)} {text}", last=done >= total) and now - self.shown > EVERY:
            self.shown = now
            say(text)

    def _number(self, value: int) -> str:
        return f"{value}" if self.scale == 1.0 else f"{value / self.scale:.1f}"


class Steps:
    """Called with what comes next, in words, `total` times; shows it with the time left, all steps taken alike."""

    def __init__(self, total: int) -> None:
        self.total, self.done = total, 0
        self.first = time.monotonic()

    def __call__(self, words: str) -> None:
        """Report the step that begins now."""
        now = time.monotonic()
        if self.done == 1:
            self.first = now  # the first step may compile kernels
        text = f"{words}, step {self.done + 1} of {self.total}"
        if self.done > 1:
            text += f", {time_left((now - self.first) / (self.done - 1) * (self.total - self.done))} left"
        if not overwrite(f"{bar(self.done, self.total)} {text}", last=False):
            say(text)
        self.done += 1


def bar(done: int, total: int) -> str:
    """The share that is done as a bar."""
    full = WIDTH * min(done, total) // max(total, 1)
    return f"[{'#' * full}{'.' * (WIDTH - full)}]"
