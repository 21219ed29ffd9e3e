"""A step on the rig, in a process of its own, which a page that is closed, slow or dead does not touch.

``python -m swingid.app.task``: a `Task` comes as JSON on standard input, then a line for each stop; what is said and
how it ended goes out. What is drawn goes as datagrams to this machine, which are lost where they are not read and
never hold a run up. Where the page's server has died a run goes on to its planned end, a check gives 0 V, and a step
without a motor ends.
"""

from __future__ import annotations

import json
import math
import os
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from swingid.errors import SwingidError

if TYPE_CHECKING:
    from swingid.live.codes import StopMode
    from swingid.live.guard import Board
    from swingid.live.progress import Progress
    from swingid.model.rig import Rig
    from swingid.recording.recording import Recording

LARGEST = 60_000
"""Bytes of a datagram."""

TOGETHER, APART = 500, 0.005
"""Rows of a datagram; seconds between two samples that are drawn of a check: a pulse has 16 of them."""

PATIENCE = 2.0
"""Seconds that a check has for its Stop and the answer to it; then its process is ended, and the firmware gives 0 V."""

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


class StoppedError(SwingidError):
    """A check that a person has stopped. No DeviceError, which a run takes for a lost link."""

    exit_code = 5


class View:
    """The way to the page: lines and ends, what is drawn, and stops; it never waits.

    commands, answers: descriptors of the pipes from and to the page's server. address, key: of its datagrams.
    """

    def __init__(self, kind: Kind, commands: int, answers: int, address: tuple[str, int], key: str) -> None:
        self.kind, self.address, self.key = kind, address, key
        self.asked: StopMode | None = None
        self._stop: Callable[[StopMode, str], None] | None = None
        self._told = False
        self._commands, self._answers = commands, answers
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)

    def say(self, line: str) -> None:
        """A line for people."""
        self.send("line", line)
        self._pass_on()

    def send(self, name: str, value: object = None) -> None:
        """What must arrive, of a few hundred bytes; nothing where the page's server has died."""
        with suppress(OSError):
            os.write(self._answers, json.dumps([name, value]).encode() + b"\n")

    def show(self, progress: Progress) -> None:
        """Send the progress and its new rows."""
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
        self._pass_on()

    def draw(self, rows: list[list[Any]], progress: dict[str, Any], estimate: list[Any] | None = None) -> None:
        """Send rows, see `runner.Seen`, and how far it is."""
        message = {"key": self.key, "progress": progress, "rows": rows, "estimate": estimate}
        with suppress(OSError):
            self._socket.sendto(json.dumps(message).encode()[:LARGEST], self.address)

    def listen(self) -> None:
        """Take stops in from now on, in a thread."""
        threading.Thread(target=self._listen, daemon=True).start()

    def pass_stops_to(self, stop: Callable[[StopMode, str], None]) -> None:
        """Who stops the run; called at once where a stop has been asked for."""
        self._stop = stop
        self._pass_on()

    def require_wanted(self) -> None:
        """Raise StoppedError where a stop has been asked for; once, so that the messages that give 0 V can go out."""
        if self.asked is not None and not self._told:
            self._told = True
            raise StoppedError("stopped from the page", code="stopped")

    def _listen(self) -> None:
        from swingid.live.codes import StopMode

        words = b""
        while data := self._read():
            words += data
            *whole, words = words.split(b"\n")
            for word in whole:
                self.asked = StopMode.HARD if word == b"hard" else self.asked or StopMode.SOFT
                self._pass_on()
        if self.kind == "run":
            return
        if self.kind == "check":
            self.asked = StopMode.HARD
            time.sleep(PATIENCE)
        os._exit(1)  # the page's server has died, and nobody waits for this

    def _read(self) -> bytes:
        try:
            return os.read(self._commands, 4096)
        except OSError:
            return b""

    def _pass_on(self) -> None:
        """Again and again: a run takes a stop only from a certain point on, and takes it once."""
        if self.asked is not None and self._stop is not None:
            with suppress(ValueError, OSError, AttributeError):  # the run may just end
                self._stop(self.asked, "stopped from the page")


def perform(task: Task, view: View) -> None:
    """Do a task; errors are lines, and the end "failed", or "stopped"."""
    from swingid.model.rig import Rig

    try:
        rig = Rig.load(task.rig)
        {"connect": _connect, "check": _check, "rehearse": _rehearse, "run": _run}[task.kind](task, rig, view)
    except StoppedError:
        view.send("stopped")
    except SwingidError as error:
        view.say(error.message)
        view.send("failed")
    except MemoryError:
        view.say("there is not enough memory for this; choose a shorter duration, or close other programs")
        view.send("failed")
    except Exception as error:
        view.say(f"this is a bug of swingid, {type(error).__name__} ({error}); please report it")
        view.send("failed")
    else:
        view.send("ok")


class Samples:
    """Draws what a device sends while nothing runs, from the bytes on its link: see `runner.Seen.rows`.

    most: seconds that it takes at most.
    """

    def __init__(self, view: View, most: float) -> None:
        from swingid.live.frames import Decoder

        self.view, self.most = view, most
        self.board: Board | None = None
        self.signs = (1, 1, 1)
        self._decoder = Decoder()
        self._first: tuple[int, int, int] | None = None
        self._next = 0.0

    def tap(self, came: bool, _: float, data: bytes) -> None:
        """Bytes of the link; came: from the device."""
        board = self.board
        if not came or board is None:
            return
        rows = []
        for frame in self._decoder.feed(data):
            if frame.name != "Sample":
                continue
            now = frame.time, frame.axis, frame.wheel
            self._first = self._first or now
            time, axis, wheel = (_change(a, b) for a, b in zip(now, self._first, strict=True))
            if (t := 1e-6 * time) >= self._next:
                self._next = t + APART
                angle = 2 * math.pi * self.signs[0] * axis / board.axis_counts
                turned = 2 * math.pi * self.signs[1] * wheel / board.wheel_counts if board.wheel_counts else None
                rows.append([t, angle, None, None, self.signs[2] * frame.voltage, turned])
        if rows:
            t = rows[-1][0]
            self.view.draw(rows, {"time": t, "left": max(self.most - t, 0.0)})


def _change(now: int, before: int) -> int:
    """The difference of two numbers of 32 bits that wrap around."""
    return (now - before + 2**31) % 2**32 - 2**31


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
    """Return whether it hangs still and its signs hold, by the pulses of `swingid commission`; nothing is written."""
    from swingid.errors import InputError
    from swingid.live.commission import commission
    from swingid.live.experiment import opened
    from swingid.live.pulses import LEAD, PULSE, SHARES, TAIL_TIME
    from swingid.live.rest import listening_time
    from swingid.live.session import Session

    pulses = len(SHARES) + 1  # with that of the guard
    samples = Samples(view, listening_time(rig) + pulses * (LEAD + 2 * PULSE + TAIL_TIME))
    with Session(opened(task.address, rig), tap=samples.tap) as session:
        session.link.each_turn = view.require_wanted
        try:
            samples.board = session.connect()
            device = rig.device
            samples.signs = device.axis_sign, device.wheel_sign, device.voltage_sign
            if task.clear:
                session.clear()
            if rig.drive.wheel is None:
                session.require_ready()
                view.say("signs are not checked: that needs a reaction wheel")
                return
            commissioning = commission(session, rig, progress=view.say)
        except StoppedError:
            if session.hello is not None:
                session.stop()  # until the device answers; the end of the session sends it again
            view.say("stopped: 0 V")
            raise
    for line in commissioning.lines():
        view.say(line)
    wrong = [
        name for name in ("wheel_sign", "voltage_sign") if getattr(commissioning, name) != getattr(rig.device, name)
    ]
    if wrong:
        text = f"{task.rig}: device.{' and device.'.join(wrong)} must be the other sign; swingid commission writes it"
        raise InputError(text, code="wrong-sign")
    view.say("it hangs still, and its signs are those of the rig file")


def _rehearse(task: Task, rig: Rig, view: View) -> None:
    from swingid.app.order import order_of
    from swingid.live.guard import Limits
    from swingid.live.preflight import rehearsed

    order, limits = order_of(task.motion, task.duration, task.until, rig), Limits.of(rig)
    view.say("the twin runs it …")
    rate = 1000.0

    def seen(log: Recording) -> None:
        for rows in _in_pieces(log, every=max(1, round(rate * APART))):
            view.draw(rows, {})

    span = {"duration": order.duration, "rate": rate, "fade": order.fade}
    rehearsal = rehearsed(rig, order.motion, order.controller, limits, seen, **span)
    view.say(rehearsal.words())
    view.say("within the limits of the guard")


def _in_pieces(log: Recording, every: int) -> Iterator[list[list[Any]]]:
    """Every n-th row of a log of the twin, as many together as a datagram takes."""
    import numpy as np

    columns = [log.time, log.angle, log.reference, None, log.voltage, log.wheel_angle]
    count = len(log.time)
    thin = [[None] * count if column is None else np.round(column, 5).tolist() for column in columns]
    rows = [list(row) for row in zip(*thin, strict=True)][::every]
    for start in range(0, len(rows), TOGETHER):
        yield rows[start : start + TOGETHER]


def _run(task: Task, rig: Rig, view: View) -> None:
    from swingid.app.order import order_of
    from swingid.live.experiment import require_usable
    from swingid.live.interrupt import stopping
    from swingid.live.processes import conductor_of

    order = order_of(task.motion, task.duration, task.until, rig, clear=task.clear)
    if view.asked is not None:
        raise StoppedError("stopped from the page", code="stopped")
    conductor = conductor_of(rig, task.address, say=view.say, show=view.show)
    view.pass_stops_to(conductor.stop)
    with stopping(conductor.stop):
        done = conductor.run(order, Path(task.out))
    zero = "0 V" if done.end.seen else "0 V was not seen, the firmware's guard gives it"
    view.say(f"{done.end.sentence}: {zero}; wrote {task.out}")
    view.send("found", {"journal": task.out, "seen": done.end.seen})
    require_usable(done, task.out)


def main() -> None:
    """Read the task, do it."""
    # the pipe of this process alone: those that a run starts must not keep it open
    answers = os.dup(1)
    os.dup2(2, 1)
    given = b""
    while not given.endswith(b"\n") and (byte := os.read(0, 1)):
        given += byte
    job: Any = json.loads(given)
    task = Task(**job["task"])
    view = View(task.kind, 0, answers, tuple(job["address"]), job["key"])
    view.listen()
    perform(task, view)


if __name__ == "__main__":
    main()
