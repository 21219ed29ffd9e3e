"""A step on the rig in a process of its own, which a page that is closed, slow or dead does not touch.

A ring in memory (`live/ring.py`) joins both: its first record is the `Task`; what is said, drawn and how it ended goes
into it without waiting, stops come by it. Where the page's server has died a run goes on to its planned end, a check
gives 0 V, and a step without a motor ends.
"""

from __future__ import annotations

import os
import pickle
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, Any

from swingid.errors import SwingidError
from swingid.live.codes import StopMode
from swingid.live.ring import Kind, Ring, Role

if TYPE_CHECKING:
    from swingid.live.progress import Progress

LOOK = 0.01
"""Seconds between two looks for a stop, and whether the page's server lives."""

PATIENCE = 2.0
"""Seconds that a check has for its Stop and the answer to it; then its process is ended, and the firmware gives 0 V."""

ASKED = "stopped from the page"


@dataclass(frozen=True, slots=True)
class Task:
    """What is to be done.

    kind: name of the step. address: of the device, "" for the emulator of the rig file. motion, duration (s), until
    (relative standard uncertainty, 0 for never) and out: of a run. clear: a person has looked at a latched fault.
    """

    kind: str
    address: str
    rig: str
    motion: str = ""
    duration: float = 25.0
    until: float = 0.0
    out: str = ""
    clear: bool = False


class Halt(Enum):
    """How STOP ends a step."""

    ENDS = "no motor can move: its process is ended"
    AT_ONCE = "0 V"
    FADES = "the motion fades out; a second time 0 V at once"


class StoppedError(SwingidError):
    """A check that a person has stopped. No DeviceError, which a run takes for a lost link."""

    exit_code = 5


class View:
    """The way to the page through a ring: lines and how it ends, what is drawn, and stops; it never waits.

    lines: all that was said. found: what a run leaves.
    """

    def __init__(self, ring: Ring) -> None:
        self.ring = ring
        self.lines: list[str] = []
        self.found: dict[str, Any] = {}
        self._stop: Callable[[StopMode, str], None] | None = None
        self._told = False

    def say(self, line: str) -> None:
        """A line for people."""
        self.lines.append(line)
        self.ring.write(Kind.SAY, 0.0, line.encode())

    def show(self, progress: Progress) -> None:
        """Draw the progress and its new rows."""
        rows = [[row.t, row.q1, row.ym, row.k, row.u, row.q2] for row in progress.new]
        estimate = None
        if progress.fresh and progress.estimate is not None:
            online, inertia = progress.estimate, progress.estimate.inertia
            estimate = [online.swing, online.time, inertia.value, inertia.standard_uncertainty, inertia.unit]
        shown = {
            "state": progress.state.name.lower(),
            **{name: getattr(progress, name) for name in ("time", "left", "tracking", "gain", "voltage", "limit")},
        }
        self.draw(rows, shown, estimate)

    def draw(self, rows: list[list[Any]], progress: dict[str, Any], estimate: list[Any] | None = None) -> None:
        """Rows, see `runner.Seen`, and how far it is."""
        self.ring.write(Kind.SHOWN, 0.0, pickle.dumps((rows, progress, estimate)))

    def finish(self, how: str) -> None:
        """How it ended; with all that was said, for a page that was slow."""
        self.ring.write(Kind.DONE, 0.0, pickle.dumps((how, self.lines, self.found)))

    def watch(self, halt: Halt) -> None:
        """Pass stops on from now on, in a thread, and end as `halt` says where the page's server has died."""
        threading.Thread(target=self._watch, args=(halt,), daemon=True).start()

    def pass_stops_to(self, stop: Callable[[StopMode, str], None]) -> None:
        """Who stops the run; called at once where a stop has been asked for."""
        self._stop = stop
        self._pass_on()

    def require_wanted(self) -> None:
        """Raise StoppedError where a stop has been asked for; once, so that the messages that give 0 V can go out."""
        if self.ring.asked is not None and not self._told:
            self._told = True
            raise StoppedError(ASKED, code="stopped")

    def _pass_on(self) -> None:
        """Again and again: a run takes a stop only from a certain point on, and takes it once."""
        asked = self.ring.asked
        if asked is not None and self._stop is not None:
            with suppress(ValueError, OSError, AttributeError):  # the run may just end
                self._stop(*asked)

    def _watch(self, halt: Halt) -> None:
        lives = True
        while lives:
            lives = self.ring.held(Role.VIEW)  # looked for first: a stop that came before its death counts
            self._pass_on()
            time.sleep(LOOK)
        if halt is Halt.FADES:
            return
        if halt is Halt.AT_ONCE:
            self.ring.ask(StopMode.HARD, ASKED)
            time.sleep(PATIENCE)
        os._exit(1)  # the page that would read its end has gone
