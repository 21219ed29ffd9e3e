"""The steps on one rig, one at a time, each in a process of its own (`app/task.py`), and how each is stopped.

Where a motor can move a step is stopped by a Stop to the device. In the other steps none can, so their processes are
ended.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import time
from collections import deque
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swingid.app.live_steps import ON_RIG, Step
from swingid.app.task import ASKED, PATIENCE, Halt, Task
from swingid.errors import InputError
from swingid.live.codes import StopMode
from swingid.live.ring import Kind, Reader, Record, Ring, Role, started

if TYPE_CHECKING:
    from swingid.live.registry import Found

KEPT = 60_000
"""Rows that are kept for pages that are opened later: a minute at 1 kHz."""

POLLED, LOOK = 0.02, 0.5
"""Seconds between two looks at what came, and for a run that goes on elsewhere."""


@dataclass
class Seen:
    """What pages show of a task.

    rows: t (s), angle and reference (rad), gain, voltage (V), wheel (rad), None for what a step does not have: of a
    check what the device sends, of a rehearsal what the twin does; count: how many came. estimates: swing, time, value,
    standard uncertainty, unit. ended: "ok", "failed", "stopped", "died" where its process said nothing, "" while it
    goes on. stops: how often a stop was asked for. out: the journal of a run. when: the last rows came, on the steady
    clock (s).
    """

    step: Step | None = None
    out: str = ""
    lines: list[str] = field(default_factory=list)
    rows: deque[list[float]] = field(default_factory=lambda: deque(maxlen=KEPT))
    count: int = 0
    estimates: list[list[Any]] = field(default_factory=list)
    progress: dict[str, Any] = field(default_factory=dict)
    ended: str = ""
    stops: int = 0
    when: float = 0.0
    found: dict[str, Any] = field(default_factory=dict)

    @property
    def moves(self) -> bool:
        """Return whether a motor can move in the step."""
        return self.step is not None and self.step.moves


class Runner:
    """The tasks of one rig; `poll` takes in what came since.

    device: its address. journals: those in which something was recorded. elsewhere: a run on this device, or in the
    journal of the last run, that goes on without a process here, because that died or another program began it; asked:
    how often that run was to stop.
    """

    def __init__(self, device: str = "") -> None:
        self.seen, self.device = Seen(), device
        self.elsewhere: Found | None = None
        self.asked = 0
        self._looked = 0.0
        self.passed: set[str] = set()
        self.journals: list[str] = []
        self._process: subprocess.Popen[bytes] | None = None
        self._ring: Ring | None = None
        self._reader: Reader | None = None
        self._until = float("inf")

    @property
    def busy(self) -> bool:
        """Return whether a task goes on."""
        return self._process is not None

    @property
    def moves(self) -> bool:
        """Return whether the motor can have a voltage, as far as is known here."""
        return (self.busy and self.seen.moves) or self.elsewhere is not None

    def start(self, task: Task) -> None:
        """Begin a task; without effect while another goes on."""
        if self.busy:
            return
        self.seen = Seen(ON_RIG[task.kind], task.out)
        self.passed.discard(task.kind)
        try:
            ring = self._ring = Ring()
        except InputError as error:
            self.seen.lines.append(error.message)
            self.seen.ended = "failed"
            return
        ring.hold(Role.VIEW)
        ring.write(Kind.JOB, 0.0, pickle.dumps(task))
        self._reader, self._until = Reader(ring), float("inf")
        self._process = started(ring, "swingid.app.live_steps")

    def stop(self, *, hard: bool = False) -> None:
        """A run fades out, or gives 0 V at once (hard, and a second time); a check gives 0 V; the others end."""
        seen, ring = self.seen, self._ring
        if ring is None or seen.step is None:
            self._look_elsewhere()
            if self.elsewhere is not None:
                self.asked += 1
                with suppress(OSError):
                    self.elsewhere.ask(hard=hard or self.asked > 1)
            return
        seen.stops += 1
        if seen.step.halt is Halt.FADES:
            ring.ask(StopMode.HARD if hard or seen.stops > 1 else StopMode.SOFT, ASKED)
        elif seen.step.halt is Halt.AT_ONCE:
            ring.ask(StopMode.HARD, ASKED)
            self._until = min(self._until, time.monotonic() + 1.5 * PATIENCE)
        else:
            self._end("stopped")

    def poll(self) -> None:
        """Take in what the task says and draws, and its end."""
        process, reader = self._process, self._reader
        if process is None or reader is None:
            if time.monotonic() - self._looked > LOOK:
                self._look_elsewhere()
            return
        if time.monotonic() > self._until:
            self._end("stopped: its process did not answer, and without it the firmware gives 0 V")
        over = process.poll() is not None  # asked before the last records are taken
        for record in reader.read():
            self._take(record)
        if over:
            self._process = None
            self._leave_ring()
            self._finish()

    def _look_elsewhere(self) -> None:
        from swingid.live import registry

        self._looked = time.monotonic()
        journal = os.path.abspath(self.seen.out) if self.seen.out else None
        with suppress(OSError):
            runs = [run for run in registry.runs() if run.entry.journal == journal]
            runs += [run for run in registry.runs() if self.device and run.is_on(self.device)]
            self.elsewhere = next(iter(runs), None)
            self.asked = self.asked if runs else 0

    def finish(self, patience: float) -> None:
        """Wait for the end of the task, for so long (s) at most."""
        until = time.monotonic() + patience
        while self.busy and time.monotonic() < until:
            self.poll()
            time.sleep(POLLED)

    def close(self) -> None:
        """Leave a run to itself: it goes on to its end, and its journal is whole. A step without a motor ends."""
        if self._process is not None and not self.seen.moves:
            self._process.kill()
        self._leave_ring()

    def _leave_ring(self) -> None:
        """Give the ring up, by whose lock a task knows that this process lives."""
        if self._ring is not None:
            self._ring.close()
            self._ring = self._reader = None

    def words_at_end(self) -> str:
        """What is kept of all runs, and whether one goes on; for a person who has ended the page."""
        kept = [path for path in self.journals if Path(path).exists()]
        step = self.seen.step if self.busy else None
        going = (step is not None and step.halt is Halt.FADES) or self.elsewhere is not None
        said = ["the page has ended"]
        if going:
            kept = [path for path in kept if path != self.seen.out]
            what = "was asked to stop and ends" if self.seen.stops or self.asked else "goes on in"
            said.append(
                f"the run {what} {self.seen.out} in a process of its own; swingid stop --hard gives 0 V at once"
            )
        elif step is not None and step.halt is Halt.AT_ONCE:
            said.append("the check gives 0 V")
        if len(kept) > 3:
            said.append(f"kept: {len(kept)} journals, from {kept[0]} to {kept[-1]}")
        elif kept:
            said.append(f"kept: {', '.join(kept)}")
        elif not going:
            said.append("no run was recorded")
        return "; ".join(said)

    def _finish(self) -> None:
        seen = self.seen
        seen.ended = seen.ended or "died"
        if seen.ended == "ok" and seen.step is not None:
            self.passed.add(seen.step.name)
        if seen.ended == "stopped" and not seen.lines:
            seen.lines.append("stopped")
        self._look_elsewhere()
        if seen.ended == "died":
            seen.lines.append(DIED[self.elsewhere is not None])

    def _end(self, why: str) -> None:
        """End the process of a step in which no motor can move, or that does not answer."""
        if self._process is not None and not self.seen.ended:
            self.seen.ended, self._until = "stopped", float("inf")
            self.seen.lines.append(why)
            self._process.kill()

    def _take(self, record: Record) -> None:
        seen = self.seen
        if record.kind is Kind.SAY:
            seen.lines.append(record.data.decode())
        elif record.kind is Kind.SHOWN:
            rows, seen.progress, estimate = pickle.loads(record.data)
            seen.when = time.monotonic()
            seen.rows.extend(rows)
            seen.count += len(rows)
            if estimate is not None:
                seen.estimates.append(estimate)
        elif record.kind is Kind.DONE:
            how, lines, seen.found = pickle.loads(record.data)
            seen.lines += lines[len(seen.lines) :]
            seen.ended = seen.ended or how
        if (seen.count or seen.found) and seen.out and seen.out not in self.journals:
            self.journals.append(seen.out)


DIED = (
    "its process has died; without it the firmware gives 0 V",
    "the process that shows the run has died, and the run goes on: end it by STOP, swingid stop or the emergency stop",
)
"""What a step says whose process was ended from outside, and a run that goes on without it."""
