"""A whole run on a live rig: connect, rehearse, find the zero, record, follow, end at 0 V; the log is the journal.

with connect("twin://paper") as rig:
    log = rig.run("sine 0.8 rad 8.5 rad/s", duration=25)
"""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Self

import numpy as np

from swingid.errors import DeviceError, InputError, SwingidError, UsageError
from swingid.live.codes import StopMode
from swingid.live.guard import Board, Limits, parameters_of
from swingid.live.journal import Journal, Plan
from swingid.live.preflight import ENERGY, Rehearsed, expected, rehearsed, require_same_rig, zero_of
from swingid.live.progress import Follower, Progress
from swingid.live.session import End, Reason, Session
from swingid.live.watch import HostGuard

if TYPE_CHECKING:
    from swingid.control.compensator import Compensator
    from swingid.control.references import Reference
    from swingid.live.devices.stream import Stream
    from swingid.live.frames import Frame
    from swingid.model.rig import Rig
    from swingid.recording.recording import Recording

LISTEN = 0.5
"""Seconds for which the rig is looked at before a run."""


@dataclass(frozen=True)
class Order:
    """What is to be run.

    motion: the reference. duration (s), fade (s): of the run and of a soft stop. until: relative standard uncertainty
    of the online estimate at which the run stops softly, 0 for never. clear: whether a person has looked at the rig and
    a latched fault may be cleared. rehearse: whether the twin runs it first.
    """

    motion: Reference
    controller: Compensator
    duration: float = 25.0
    until: float = 0.0
    fade: float = 0.5
    clear: bool = False
    rehearse: bool = True


@dataclass
class Done:
    """What a run left: its end, what the twin had done, the last state, the journal's error, in words."""

    end: End
    rehearsed: Rehearsed | None = None
    progress: Progress | None = None
    journal_error: str = ""
    lost: int = 0
    notes: list[str] = field(default_factory=list)


def required(order: Order) -> None:
    """Raise UsageError for an order that no device can follow."""
    if not 0.0 < order.duration <= 86_400.0:
        raise UsageError(f"--duration is {order.duration:g} s; give one between 0 and a day", code="out-of-range")
    if not 0.0 <= order.until < 1.0:
        raise UsageError(f"--until is {order.until:g} of the inertia; write for example 0.05%", code="out-of-range")


class Conductor:
    """One run from the order to the end, on a stream. rig: the rig file. say: called with a line for people.

    show: called with the `Progress` after each batch of samples, and after each swing.
    """

    def __init__(
        self,
        rig: Rig,
        stream: Stream,
        *,
        say: Callable[[str], None] | None = None,
        show: Callable[[Progress], None] | None = None,
    ) -> None:
        self.rig, self.stream = rig, stream
        self._say = say or (lambda _: None)
        self._show = show or (lambda _: None)
        self.session: Session | None = None

    def run(self, order: Order, out: Path) -> Done:
        """Do it all; raises DeviceError where the run does not begin, and as `rehearsed`."""
        required(order)
        limits = Limits.of(self.rig)
        began = 0 if self.stream.virtual else time.time_ns()
        journal = Journal(out, self.rig, began=began, sync=not self.stream.virtual)
        session = self.session = Session(self.stream, tap=journal.take)
        try:
            return self._run(session, journal, order, limits)
        except SwingidError as error:
            journal.event("refused", error.message)
            raise
        finally:
            session.close()
            journal.close()
            self.session = None

    def stop(self, mode: StopMode, why: str) -> None:
        """Stop the run; from a signal handler or another thread."""
        if self.session is not None:
            self.session.ask_stop(mode, why)

    def _run(self, session: Session, journal: Journal, order: Order, limits: Limits) -> Done:
        name = session.link.name
        board = session.connect()
        self._say(f"{name}: firmware {board.firmware:08x}, {board.rate:g} samples per second, {_counts(board)}")
        require_same_rig(self.rig, board, name)
        if order.clear:
            session.clear()
        session.require_ready()
        twin = None
        if order.rehearse:
            twin = rehearsed(self.rig, order.motion, order.controller, limits, duration=order.duration, rate=board.rate)
            self._say(twin.words())
        limits = zero_of(session.listen(LISTEN), limits, board, name)
        parameters = parameters_of(order.controller, board, limits)
        session.load(parameters)
        rows = max(int(order.duration * board.rate + 1e-9), 1)
        reference = order.motion(np.arange(rows) / board.rate).astype(np.float32).astype(float)
        words = order.motion.describe()
        journal.plan(Plan(parameters, reference, words), firmware=f"{board.firmware:08x}", device=name, rate=board.rate)
        follower = Follower(self.rig, parameters.tolist(), reference.tolist(), order.until, board.rate)
        inertia, gravity = expected(self.rig)
        energy = math.inf if twin is None else ENERGY * twin.energy
        watch = HostGuard(parameters.tolist(), inertia=inertia, gravity_torque=gravity, energy=energy)

        def batch(frames: list[Frame]) -> None:
            progress = follower.feed(frames, session.started)
            try:
                self._show(progress)
            except Exception as error:  # whatever a view does, the run goes on
                self._show = lambda _: None
                follower.notes.append(f"the view has failed ({type(error).__name__}); the run went on without it")
            if progress.reached:
                session.ask_stop(StopMode.SOFT, progress.reached)

        done = session.run(reference, fade=order.fade, watch=watch, on_batch=batch)
        journal.event("end", f"{done.end.reason.value}: {done.end.sentence}")
        return Done(done.end, twin, follower.progress, journal.error, done.lost, list(follower.notes))


def _counts(board: Board) -> str:
    wheel = f" and {board.wheel_counts}" if board.wheel_counts else ""
    return f"{board.axis_counts}{wheel} counts per turn, {board.voltage_limit:g} V at most"


def require_usable(done: Done, out: Path | str) -> None:
    """Raise where a run has no log to identify: DeviceError after its end, InputError after that of the journal."""
    end = done.end
    if not end.usable and end.reason is not Reason.HALTED:
        zero = "" if end.seen else " (0 V was not seen, the firmware's guard gives it)"
        text = f"{end.sentence}{zero}; {out} holds the run up to there"
        raise DeviceError(text, code=f"run-{end.reason.value}")
    if done.journal_error:
        text = f"{out} could not be written to its end ({done.journal_error}); make room, and run again"
        raise InputError(text, code="cannot-write")
    if end.reason is Reason.HALTED:
        raise DeviceError(f"{end.sentence}: 0 V at once; {out} holds the run up to there", code="run-halted")


class LiveRig:
    """A device and its rig file, for Python: `connect` makes it.

    rig: the rig file. last: what the last run left, None before.
    """

    def __init__(self, address: str, rig: Rig) -> None:
        self.address, self.rig = address, rig
        self.last: Done | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Each run connects and disconnects by itself, so nothing is left open."""

    def run(
        self,
        reference: str | Reference,
        controller: Compensator | None = None,
        *,
        duration: float = 25.0,
        until: float = 0.0,
        out: str | Path | None = None,
        show: Callable[[Progress], None] | None = None,
        clear: bool = False,
    ) -> Recording:
        """Follow a reference for `duration` (s) and give the log; identify it as any other.

        reference: words as of ``swingid simulate``, or a motion. controller: default the paper's gains. until: relative
        standard uncertainty at which the run stops, 0 for never. out: file of the journal, default none is kept. show:
        called with the progress. clear: clear a latched fault first. Raises DeviceError where the run did not begin or
        ended otherwise than planned (the journal then holds what there is), UsageError where the twin passes a limit.
        """
        from swingid.control.compensator import Compensator as Chosen
        from swingid.control.references import parse_reference
        from swingid.recording.recording import Recording

        motion = parse_reference(reference) if isinstance(reference, str) else reference
        order = Order(motion, controller or Chosen.paper(self.rig), duration, until, clear=clear)
        required(order)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "run.mcap" if out is None else Path(out)
            self.last = Conductor(self.rig, opened(self.address, self.rig), show=show).run(order, path)
            require_usable(self.last, path if out is not None else "no journal")
            return Recording.load(path, self.rig)


def opened(address: str, rig: Rig) -> Stream:
    """The device of an address; "" is the emulator of the rig file."""
    from swingid.live.devices.table import open_device
    from swingid.live.devices.twin import twin_of

    if address:
        return open_device(address)
    device = twin_of(rig)
    device.address = f"twin://{rig.name}"
    return device


def connect(address: str, rig: Rig | str | Path | None = None) -> LiveRig:
    """A live rig for Python, as ``connect("twin://paper")`` or ``connect("/dev/ttyACM0", "rig.toml")``.

    rig: the rig file; of a twin:// it is that of the twin. Raises UsageError where it is missing.
    """
    from swingid.live.devices.stream import split_address
    from swingid.model.rig import Rig as File

    if rig is None:
        if not address.startswith("twin://"):
            raise UsageError(f"{address}: which rig is it? Give connect(address, 'rig.toml')", code="no-rig")
        rig = split_address(address).target
    return LiveRig(address, rig if isinstance(rig, File) else File.load(rig))
