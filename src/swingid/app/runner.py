"""What acts on the rig, in a process of its own: a page that is closed, slow or dead does not touch it.

The process sends what there is to see as datagrams to this machine, which are lost where they are not read and never
hold it up. Stops come through a pipe that it looks at with each batch of samples; where the page's process has died the
run goes on to its end.
"""

from __future__ import annotations

import json
import multiprocessing
import secrets
import socket
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from swingid.errors import SwingidError

if TYPE_CHECKING:
    from swingid.live.codes import StopMode
    from swingid.live.progress import Progress
    from swingid.model.rig import Rig

LARGEST, KEPT = 60_000, 60_000
"""Bytes of a datagram, and rows that are kept for pages that are opened later: a minute at 1 kHz."""

Kind = Literal["connect", "check", "rehearse", "run"]


@dataclass(frozen=True, slots=True)
class Task:
    """What is to be done.

    address: of the device, "" for the emulator of the rig file. motion, duration (s), until (relative standard
    uncertainty, 0 for never) and out: of a run. clear: a person has looked at a latched fault.
    """

    kind: Kind
    address: str
    rig: str
    motion: str = ""
    duration: float = 25.0
    until: float = 0.0
    out: str = ""
    clear: bool = False


@dataclass
class Seen:
    """What pages show of a task.

    rows: t (s), angle and reference (rad), gain, voltage (V); count: how many came. estimates: swing, time, value,
    standard uncertainty, unit. ended: "ok", "failed", "" while it goes on.
    """

    kind: Kind | None = None
    lines: list[str] = field(default_factory=list)
    rows: deque[list[float]] = field(default_factory=lambda: deque(maxlen=KEPT))
    count: int = 0
    estimates: list[list[Any]] = field(default_factory=list)
    progress: dict[str, Any] = field(default_factory=dict)
    ended: str = ""
    found: dict[str, Any] = field(default_factory=dict)


class Runner:
    """The tasks of one rig, one at a time; `poll` takes in what came since."""

    def __init__(self) -> None:
        self.seen = Seen()
        self.passed: set[Kind] = set()
        self._key = secrets.token_hex(8)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.setblocking(False)
        self._pipe: Connection | None = None
        self._process: multiprocessing.process.BaseProcess | None = None

    @property
    def busy(self) -> bool:
        """Whether a task goes on."""
        return self._process is not None

    def start(self, task: Task) -> None:
        """Begin a task; without effect while another goes on."""
        if self.busy:
            return
        self.seen = Seen(task.kind)
        self.passed.discard(task.kind)
        ours, theirs = multiprocessing.Pipe()
        context = multiprocessing.get_context("spawn")
        address = self._socket.getsockname()
        self._process = context.Process(target=perform, args=(task, theirs, address, self._key), daemon=False)
        self._process.start()
        theirs.close()
        self._pipe = ours

    def stop(self, *, hard: bool = False) -> None:
        """Fade out, or 0 V at once; without a run nothing happens."""
        if self._pipe is not None:
            with suppress(OSError):
                self._pipe.send("hard" if hard else "soft")

    def poll(self) -> None:
        """Take in datagrams and the end of the task."""
        with suppress(BlockingIOError, ConnectionError):
            while True:
                self._take(self._socket.recv(65536))
        if self._process is None or self._pipe is None:
            return
        with suppress(EOFError, OSError):
            while self._pipe.poll():
                name, value = self._pipe.recv()
                if name == "line":
                    self.seen.lines.append(value)
                elif name == "found":
                    self.seen.found = value
                else:
                    self.seen.ended = name
        if self._process.is_alive():
            return
        self._process.join()
        self._pipe.close()
        self.seen.ended = self.seen.ended or "failed"
        if self.seen.ended == "ok" and self.seen.kind is not None:
            self.passed.add(self.seen.kind)
        self._process = self._pipe = None

    def _take(self, data: bytes) -> None:
        try:
            message = json.loads(data)
            if message.pop("key") != self._key:
                return
        except (ValueError, KeyError, AttributeError):
            return
        seen = self.seen
        seen.progress = message["progress"]
        seen.rows.extend(message["rows"])
        seen.count += len(message["rows"])
        if message["estimate"] is not None:
            seen.estimates.append(message["estimate"])

    def close(self) -> None:
        """Leave a run to itself: it goes on to its end, and its journal is whole."""
        self._socket.close()


@dataclass
class View:
    """The child's side: lines and ends through the pipe, what is drawn as datagrams; it never waits."""

    pipe: Connection
    address: tuple[str, int]
    key: str
    stop: Callable[[StopMode, str], None] = lambda _mode, _why: None

    def __post_init__(self) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)

    def say(self, line: str) -> None:
        """A line for people."""
        self.send("line", line)

    def send(self, name: str, value: object = None) -> None:
        """What must arrive, of a few hundred bytes; nothing where the page's process has died."""
        with suppress(OSError):
            self.pipe.send((name, value))

    def show(self, progress: Progress) -> None:
        """Send the progress and its new rows, and look for a stop."""
        rows = [[row.t, row.q1, row.ym, row.k, row.u] for row in progress.new]
        estimate = None
        if progress.fresh and progress.estimate is not None:
            found, own = progress.estimate, progress.estimate.inertia
            estimate = [found.swing, found.time, own.value, own.standard_uncertainty, own.unit]
        shown = {
            "state": progress.state.name.lower(),
            **{name: getattr(progress, name) for name in ("time", "left", "tracking", "gain", "voltage", "limit")},
        }
        message = {"key": self.key, "progress": shown, "rows": rows, "estimate": estimate}
        with suppress(OSError):
            self._socket.sendto(json.dumps(message).encode()[:LARGEST], self.address)
        self.look()

    def look(self) -> None:
        """Act on a stop that came."""
        from swingid.live.codes import StopMode

        with suppress(EOFError, OSError):
            while self.pipe.poll():
                hard = self.pipe.recv() == "hard"
                self.stop(StopMode.HARD if hard else StopMode.SOFT, "stopped from the page")


def perform(task: Task, pipe: Connection, address: tuple[str, int], key: str) -> None:
    """Do a task, in the process that was started for it; errors are lines, and the end "failed"."""
    from swingid.model.rig import Rig

    view = View(pipe, address, key)
    try:
        rig = Rig.load(task.rig)
        {"connect": _connect, "check": _check, "rehearse": _rehearse, "run": _run}[task.kind](task, rig, view)
    except SwingidError as error:
        view.say(error.message)
        view.send("failed")
    except KeyboardInterrupt:
        view.say("ended by Ctrl-C")
        view.send("failed")
    else:
        view.send("ok")


def _connect(task: Task, rig: Rig, view: View) -> None:
    """Who is there, and whether it is the rig of the rig file."""
    from swingid.live.experiment import opened
    from swingid.live.preflight import require_same_rig
    from swingid.live.session import Session

    with Session(opened(task.address, rig)) as session:
        board = session.connect()
        wheel = f", {board.wheel_counts} of the wheel" if board.wheel_counts else ""
        view.say(f"{session.link.name}: firmware {board.firmware:08x}, {board.rate:g} samples per second")
        view.say(f"{board.axis_counts} counts per turn of the axis{wheel}; {board.voltage_limit:g} V at most")
        require_same_rig(rig, board, session.link.name)


def _check(task: Task, rig: Rig, view: View) -> None:
    """Whether it hangs still and its signs hold, by the pulses of `swingid commission`; nothing is written."""
    from swingid.errors import InputError
    from swingid.live.commission import commission
    from swingid.live.experiment import opened
    from swingid.live.session import Session

    with Session(opened(task.address, rig)) as session:
        session.connect()
        if task.clear:
            session.clear()
        if rig.drive.kind != "reaction-wheel":
            session.require_ready()
            view.say("signs are not checked: that needs a reaction wheel")
            return
        found = commission(session, rig, progress=view.say)
    for line in found.lines():
        view.say(line)
    wrong = [name for name in ("wheel_sign", "voltage_sign") if getattr(found, name) != getattr(rig.device, name)]
    if wrong:
        text = f"{task.rig}: device.{' and device.'.join(wrong)} must be the other sign; swingid commission writes it"
        raise InputError(text, code="wrong-sign")


def _order(task: Task, rig: Rig) -> Any:
    from swingid.control.compensator import Compensator
    from swingid.control.references import reference_for
    from swingid.live.experiment import Order, required

    order = Order(reference_for(task.motion, rig), Compensator.paper(rig), task.duration, task.until, clear=task.clear)
    required(order)
    return order


def _rehearse(task: Task, rig: Rig, view: View) -> None:
    from swingid.live.guard import Limits
    from swingid.live.preflight import rehearsed

    order, limits = _order(task, rig), Limits.of(rig)
    view.say("the twin runs it …")
    span = {"duration": order.duration, "rate": 1000.0, "fade": order.fade}
    found = rehearsed(rig, order.motion, order.controller, limits, **span)
    view.say(found.words())
    view.say("within the limits of the guard")


def _run(task: Task, rig: Rig, view: View) -> None:
    from swingid.live.experiment import require_usable
    from swingid.live.interrupt import stopping
    from swingid.live.processes import conductor_of

    conductor = conductor_of(rig, task.address, say=view.say, show=view.show)
    view.stop = conductor.stop
    with stopping(conductor.stop):
        done = conductor.run(_order(task, rig), Path(task.out))
    view.say(f"{done.end.sentence}: 0 V; wrote {task.out}")
    view.send("found", {"journal": task.out, "lost": done.lost, "reason": done.end.reason.value})
    require_usable(done, task.out)
