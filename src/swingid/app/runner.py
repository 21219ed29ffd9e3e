"""The steps on one rig, one at a time, each in a process of its own (`app/task.py`), and how each is stopped.

A motor can move in a check and in a run: those are stopped by a Stop to the device. In the other steps none can, so
their processes are ended.
"""

from __future__ import annotations

import json
import os
import queue
import secrets
import socket
import subprocess
import sys
import threading
import time
from collections import deque
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swingid.app.task import PATIENCE, Kind, Task

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

    kind: Kind | None = None
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
        self.passed: set[Kind] = set()
        self.journals: list[str] = []
        self._key = secrets.token_hex(8)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.setblocking(False)
        self._process: subprocess.Popen[bytes] | None = None
        self._lines: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        self._reading: threading.Thread | None = None
        self._until = float("inf")

    @property
    def busy(self) -> bool:
        """Return whether a task goes on."""
        return self._process is not None

    def start(self, task: Task) -> None:
        """Begin a task; without effect while another goes on."""
        if self.busy:
            return
        self.seen = Seen(task.kind, task.out)
        self.passed.discard(task.kind)
        job = {"task": asdict(task), "address": self._socket.getsockname(), "key": self._key}
        # a group of its own: what Ctrl-C in the terminal is to end is for this process to say
        self._process = subprocess.Popen(
            [sys.executable, "-m", "swingid.app.task"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            bufsize=0,
            start_new_session=os.name != "nt",
            creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
        )
        self._send(json.dumps(job))
        self._lines, self._until = queue.SimpleQueue(), float("inf")
        self._reading = threading.Thread(target=_read, args=(self._process, self._lines), daemon=True)
        self._reading.start()

    def stop(self, *, hard: bool = False) -> None:
        """A run fades out, or gives 0 V at once (hard, and a second time); a check gives 0 V; the others end."""
        seen = self.seen
        if self._process is None:
            self._look_elsewhere()
            if self.elsewhere is not None:
                self.asked += 1
                with suppress(OSError):
                    self.elsewhere.ask(hard=hard or self.asked > 1)
            return
        seen.stops += 1
        if seen.kind == "run":
            self._send("hard" if hard or seen.stops > 1 else "soft")
        elif seen.kind == "check":
            self._send("hard")
            self._until = min(self._until, time.monotonic() + 1.5 * PATIENCE)
        else:
            self._end("stopped")

    def poll(self) -> None:
        """Take in datagrams, lines, and the end of the task."""
        with suppress(BlockingIOError, ConnectionError):
            while True:
                self._take(self._socket.recv(65536))
        process, reading = self._process, self._reading
        if process is None or reading is None:
            if time.monotonic() - self._looked > LOOK:
                self._look_elsewhere()
            return
        if time.monotonic() > self._until:
            self._end("stopped: its process did not answer, and without it the firmware gives 0 V")
        over = not reading.is_alive()  # asked before the last lines are taken
        with suppress(queue.Empty):
            while True:
                self._hear(self._lines.get_nowait())
        if not over or process.poll() is None:
            return
        for pipe in (process.stdin, process.stdout):
            with suppress(OSError):
                if pipe is not None:
                    pipe.close()
        self._process = self._reading = None
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
        if self._process is not None and self.seen.kind in ("connect", "rehearse"):
            self._process.kill()
        self._socket.close()

    def words_at_end(self) -> str:
        """What is kept of all runs, and whether one goes on; for a person who has ended the page."""
        kept = [path for path in self.journals if Path(path).exists()]
        going = (self.busy and self.seen.kind == "run") or self.elsewhere is not None
        said = ["the page has ended"]
        if going:
            kept = [path for path in kept if path != self.seen.out]
            what = "was asked to stop and ends" if self.seen.stops or self.asked else "goes on in"
            said.append(
                f"the run {what} {self.seen.out} in a process of its own; swingid stop --hard gives 0 V at once"
            )
        elif self.busy and self.seen.kind == "check":
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
        if seen.ended == "ok" and seen.kind is not None:
            self.passed.add(seen.kind)
        if seen.ended == "stopped" and not seen.lines:
            seen.lines.append("stopped")
        self._look_elsewhere()
        if seen.ended == "died":
            seen.lines.append(DIED[self.elsewhere is not None])

    def _send(self, word: str) -> None:
        if self._process is not None and self._process.stdin is not None:
            with suppress(OSError):
                self._process.stdin.write(word.encode() + b"\n")

    def _end(self, why: str) -> None:
        """End the process of a step in which no motor can move, or that does not answer."""
        if self._process is not None and not self.seen.ended:
            self.seen.ended, self._until = "stopped", float("inf")
            self.seen.lines.append(why)
            self._process.kill()

    def _hear(self, line: bytes) -> None:
        try:
            name, value = json.loads(line)
        except ValueError:  # cut by the end of its process
            return
        if name == "line":
            self.seen.lines.append(str(value))
        elif name == "found":
            self.seen.found = value
            self._note_journal()
        else:
            self.seen.ended = self.seen.ended or name

    def _take(self, data: bytes) -> None:
        try:
            message = json.loads(data)
            if message.pop("key") != self._key:
                return
        except (ValueError, KeyError, AttributeError):
            return
        seen = self.seen
        seen.progress, seen.when = message["progress"], time.monotonic()
        seen.rows.extend(message["rows"])
        seen.count += len(message["rows"])
        if message["estimate"] is not None:
            seen.estimates.append(message["estimate"])
        if seen.count:
            self._note_journal()

    def _note_journal(self) -> None:
        if self.seen.out and self.seen.out not in self.journals:
            self.journals.append(self.seen.out)


DIED = (
    "its process has died; without it the firmware gives 0 V",
    "the process that shows the run has died, and the run goes on: end it by STOP, swingid stop or the emergency stop",
)
"""What a step says whose process was ended from outside, and a run that goes on without it."""


def _read(process: subprocess.Popen[bytes], lines: queue.SimpleQueue[bytes]) -> None:
    """Lines of a process until it ends; read in a thread, as a pipe of Windows cannot be asked without waiting."""
    assert process.stdout is not None
    rest = b""
    with suppress(OSError, ValueError):
        while data := os.read(process.stdout.fileno(), 65536):
            *whole, rest = (rest + data).split(b"\n")
            for line in whole:
                lines.put(line)
