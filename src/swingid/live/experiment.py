"""A whole run on a live rig: connect, rehearse, find the zero, record, follow, end at 0 V; the log is the journal.

with connect("twin://paper") as rig:
    log = rig.run("sine 0.8 rad 8.5 rad/s", duration=25)
"""

from __future__ import annotations

import errno
import math
import os
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from swingid.errors import DeviceError, InputError, SwingidError, UsageError
from swingid.live.codes import StopMode
from swingid.live.devices.twin import TwinDevice
from swingid.live.firmware import named
from swingid.live.guard import Board, Limits, parameters_of
from swingid.live.journal import Journal, Plan, Recorder, require_new
from swingid.live.machine import EMULATED
from swingid.live.preflight import Rehearsed, energy_limit, expected, rehearsed, require_same_rig
from swingid.live.progress import Follower, Progress
from swingid.live.registry import Announced, announced
from swingid.live.rest import WAIT, Channel, at_rest, friction_band
from swingid.live.session import End, Reason, Session
from swingid.live.watch import HostGuard
from swingid.model.rig.inside import ENDING
from swingid.progress import shown

if TYPE_CHECKING:
    from swingid.control.compensator import Compensator
    from swingid.control.references import Reference
    from swingid.live.devices.stream import Stream
    from swingid.live.frames import Frame
    from swingid.live.pace import Pace
    from swingid.model.rig import Rig

LONGEST, MOST_ROWS = 3600.0, 4e6
"""Seconds and samples of a run: an hour, at 1 kHz; the rehearsal keeps every row in memory."""


@dataclass(frozen=True)
class Order:
    """What is to be run.

    motion: the reference. duration (s), fade (s): of the run and of a soft stop. until: relative standard uncertainty
    of the online estimate at which the run stops softly, 0 for never. clear: whether a person has looked at the rig and
    a latched fault may be cleared. wait (s): for the body to hang still. rehearse: whether the twin runs it first.
    """

    motion: Reference
    controller: Compensator
    duration: float = 25.0
    until: float = 0.0
    fade: float = 0.5
    clear: bool = False
    wait: float = WAIT
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
    if not 0.0 < order.duration <= LONGEST:
        text = f"--duration is {order.duration:g} s; give one between 0 and {LONGEST:g} s"
        raise UsageError(text, code="out-of-range")
    if not 0.0 <= order.until < 1.0:
        raise UsageError(f"--until is {order.until:g} of the inertia; write for example 0.05%", code="out-of-range")


def require_rows(order: Order, rate: float) -> None:
    """Raise UsageError for a run of more samples than fit into the rehearsal."""
    if order.duration * rate > MOST_ROWS:
        text = f"--duration {order.duration:g} s is {order.duration * rate:.3g} samples of the device"
        raise UsageError(f"{text}; give at most {MOST_ROWS / rate:.4g} s", code="out-of-range")


class Conductor:
    """One run from the order to the end, on a stream. rig: the rig file. say: called with a line for people.

    show: called with the `Progress` after each batch of samples, and after each swing. For a run in several processes
    (`live/processes.py`): recorder makes what keeps the run, default a journal; follow: whether estimates are made
    here; asked: a stop that somebody has asked for elsewhere; rest: called before and in work between two turns of the
    link that takes its time; pace: the turns of the loop.
    """

    def __init__(
        self,
        rig: Rig,
        stream: Stream,
        *,
        say: Callable[[str], None] | None = None,
        show: Callable[[Progress], None] | None = None,
        recorder: Callable[[Path], Recorder] | None = None,
        follow: bool = True,
        asked: Callable[[], tuple[StopMode, str] | None] | None = None,
        rest: Callable[[], None] | None = None,
        pace: Pace | None = None,
    ) -> None:
        self.rig, self.stream = rig, stream
        self._recorder, self._follow, self._asked, self._pace = recorder or self._journal, follow, asked, pace
        self._say = say or (lambda _: None)
        self._show = show or (lambda _: None)
        self._rest = rest or (lambda: None)
        self._entry: Announced | None = None
        self.session: Session | None = None
        self._stop: tuple[StopMode, str] | None = None

    def run(self, order: Order, out: Path) -> Done:
        """Do it all; raises DeviceError where the run does not begin, and as `rehearsed`."""
        required(order)
        limits = Limits.of(self.rig)
        if isinstance(
            self.stream, TwinDevice
        ):  # its counts and output have the model's signs, whatever those of a board
            limits = replace(limits, axis_sign=1, wheel_sign=1, voltage_sign=1)
        journal = self._recorder(out)
        session = self.session = Session(self.stream, tap=journal.take)
        session.link.pace, session.link.each_turn = self._pace, self._each_turn
        span = {"duration": order.duration, "fade": order.fade}
        with announced(self.stream.address, out, **span) as self._entry:
            try:
                done = self._run(session, journal, order, limits)
                self._entry.ended = f"{done.end.sentence}: {done.end.zero}"
                return done
            except SwingidError as error:
                journal.event("refused", error.message)
                self._entry.ended = error.message
                raise
            finally:
                session.close()
                journal.close()
                self.session = self._stop = self._entry = None

    def stop(self, mode: StopMode, why: str) -> None:
        """Stop the run; from a signal handler or another thread."""
        if self._stop is None or mode is StopMode.HARD:
            self._stop = mode, why
        if self.session is not None:
            self.session.ask_stop(mode, why)

    def _stop_asked(self) -> tuple[StopMode, str] | None:
        """The stop that somebody has asked for, here or elsewhere; a hard one first."""
        elsewhere = None if self._asked is None else self._asked()
        command = None if self._entry is None else self._entry.asked()
        reasons = [reason for reason in (self._stop, elsewhere, command) if reason is not None]
        return max(reasons, key=lambda reason: reason[0] is StopMode.HARD, default=None)

    def _each_turn(self) -> None:
        """Pass a stop on to the run; before it begins it is its end (DeviceError)."""
        if self.session is not None and self.session.running:
            asked = self._stop_asked()
            if asked is not None:
                self.session.ask_stop(*asked)
        else:
            self._require_wanted()

    def _between(self, _done: int = 0, _total: int = 0) -> None:
        """Work that takes its time goes on, while nobody wants a stop."""
        self._rest()
        self._require_wanted()

    def _require_wanted(self) -> None:
        """Raise DeviceError where a stop was asked for before the run began."""
        asked = self._stop_asked()
        if asked is not None:
            raise _not_begun(asked[1])

    def _journal(self, out: Path) -> Recorder:
        began = 0 if self.stream.virtual else time.time_ns()
        require_new(out)  # not where a process of its own records
        return Journal(out, self.rig, began=began, sync=not self.stream.virtual)

    def _run(self, session: Session, journal: Recorder, order: Order, limits: Limits) -> Done:
        name = session.link.name
        board = session.connect()
        wheel = f" and {board.wheel_counts}" if board.wheel_counts else ""
        counts = f"{board.axis_counts}{wheel} counts per turn, {board.voltage_limit:g} V at most"
        self._say(f"{name}: firmware {named(board.firmware)}, {board.rate:g} samples per second, {counts}")
        require_same_rig(self.rig, board, name)
        require_rows(order, board.rate)
        if order.clear:
            session.clear()
        session.require_ready()
        self._between()
        twin = None
        if order.rehearse:
            span = {"duration": order.duration, "rate": board.rate, "fade": order.fade}
            with shown(self._between):
                twin = rehearsed(self.rig, order.motion, order.controller, limits, **span)
            self._say(twin.words())
        body, _ = at_rest(session, self.rig, board, wait=order.wait, say=self._say, wanted=self._require_wanted)
        limits = replace(limits, axis_zero=round(body.zero))
        parameters = parameters_of(order.controller, board, limits)
        session.load(parameters)
        rows = max(int(order.duration * board.rate + 1e-9), 1)
        reference = order.motion(np.arange(rows) / board.rate).astype(np.float32).astype(float)
        words = order.motion.describe()
        journal.plan(Plan(parameters, reference, words), **self._facts(board, body, name))
        self._between()
        planned = parameters.tolist(), reference.tolist()
        follower = Follower(self.rig, *planned, order.until, board.rate, self._show)
        inertia, gravity = expected(self.rig)
        energy = math.inf if twin is None else energy_limit(twin, self.rig)
        watch = HostGuard(parameters.tolist(), inertia=inertia, gravity_torque=gravity, energy=energy)

        def batch(frames: list[Frame]) -> None:
            if self._follow and (reached := follower.look(frames, session.started)):
                session.ask_stop(StopMode.SOFT, reached)

        self._require_wanted()
        done = session.run(reference, fade=order.fade, watch=watch, on_batch=batch)
        if not done.moved and done.end.reason in (Reason.STOPPED, Reason.HALTED):
            raise _not_begun(done.end.sentence)
        journal.event("end", f"{done.end.reason.value}: {done.end.sentence}")
        return Done(done.end, twin, follower.progress, journal.error, done.lost, list(follower.notes))

    def _facts(self, board: Board, body: Channel, name: str) -> dict[str, object]:
        """What a reader of the journal wants to know of the device, and how well the zero is known (rad)."""
        spread = math.hypot(body.spread, friction_band(self.rig))
        facts = {
            "firmware": f"{board.firmware:08x}",
            "device": name,
            "rate": board.rate,
            "zero_spread": f"{spread:.3g}",
        }
        return facts | ({"emulated": 1} if board.firmware in EMULATED.values() else {})


def _not_begun(why: str) -> DeviceError:
    """The error of a run that somebody stopped before anything moved."""
    return DeviceError(f"{why}, before the run began; nothing has moved", code="stopped")


def require_usable(done: Done, out: Path | str) -> None:
    """Raise where a run has no log to identify: DeviceError after its end, InputError after that of the journal."""
    end = done.end
    if not end.usable and end.reason is not Reason.HALTED:
        zero = "" if end.seen else f" ({end.zero})"
        raise DeviceError(f"{end.sentence}{zero}; {kept(done, out)}", code=f"run-{end.reason.value}")
    if done.journal_error:
        remedy = NO_ROOM.get(done.journal_error)
        text = f"{out} could not be written to its end ({done.journal_error}); "
        text += f"{remedy}, and run again" if remedy else f"swingid identify {out} takes the log up to there"
        if TOO_FAST in done.journal_error:
            text = f"{out} lacks a part of the run ({done.journal_error}): something floods the link, or this computer "
            text += f"stood still; swingid identify {out} takes what it holds"
        raise InputError(text, code="cannot-write")
    if end.reason is Reason.HALTED:
        raise DeviceError(f"{end.sentence}: 0 V at once; {kept(done, out)}", code="run-halted")


TOO_FAST = "bytes came faster than they could be written"
"""What a journal's error says where only a part of the run is missing in it."""


def kept(done: Done, out: Path | str) -> str:
    """What is left of a run that ended otherwise than planned, in words."""
    if str(out).endswith(ENDING) and not done.journal_error and not Path(out).exists():
        return "no sample of the run came, so there is no log"
    whole = f"{out} holds the run up to there"
    if TOO_FAST in done.journal_error:
        return f"{whole}, but for a part ({done.journal_error})"
    return f"{out} ends before that ({done.journal_error})" if done.journal_error else whole


NO_ROOM = {
    os.strerror(getattr(errno, name)): remedy
    for name, remedy in {
        "ENOSPC": "make room",
        "EDQUOT": "make room within your quota",
        "EFBIG": "raise the limit of a file's size (ulimit -f)",
    }.items()
    if name in errno.errorcode.values()
}
"""What to do where the system says why it takes no more of a file."""


def opened(address: str, rig: Rig) -> Stream:
    """The device of an address; "" is the emulator of the rig file."""
    from swingid.live.devices.table import open_device
    from swingid.live.devices.twin import twin_of

    if address:
        return open_device(address)
    device = twin_of(rig)
    device.address = f"twin://{rig.name}"
    return device
