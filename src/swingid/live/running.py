"""One run: the reference down as there is room, heartbeats, samples up, and how it ended.

A turn sends what is due and reads what has come. The device is at 0 V when its sample says idle or fault; where no
sample comes, its own guard does that within 100 ms.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import StrEnum

from swingid.errors import DeviceError
from swingid.live.codes import FaultCode, Flag, State, Status, StopMode
from swingid.live.frames import Frame, encode
from swingid.live.link import TURN, Link
from swingid.live.schema import schema
from swingid.numerics.arrays import Array

BLOCK, WINDOW, PER_TURN = 14, 36, 12
"""Reference samples in a message; messages without an answer at most, a device holds the answers to forty; messages in
one turn.
"""

BEAT, RETRY, SILENT = 0.015, 0.06, 0.5
"""Seconds between heartbeats, until reference or Stop are sent again, and without a sample until the link is lost."""

AGAIN = 2
"""How often a message goes out at once that must not keep step with a link that loses every n-th frame."""

Watch = Callable[[list[Frame]], str | None]


class Reason(StrEnum):
    """Why a run ended."""

    FINISHED = "finished"
    STOPPED = "stopped"
    HALTED = "halted"
    GUARD = "guard"
    FAULT = "fault"
    STARVED = "starved"
    LOST = "lost"
    RESET = "reset"
    TAKEN = "taken"


@dataclass(frozen=True)
class End:
    """Why a run ended, in a word and in a sentence; fault: of the device's guard; seen: whether a sample with 0 V came
    after it, else the device's own guard gives it unseen.
    """

    reason: Reason
    sentence: str
    fault: FaultCode = FaultCode.NONE
    seen: bool = True

    @property
    def usable(self) -> bool:
        """Whether the samples up to the end are a planned experiment, or a part of one."""
        return self.reason in (Reason.FINISHED, Reason.STOPPED)


@dataclass(frozen=True)
class Run:
    """What a run left: all its Sample frames from reference 0 on, the sequence of that one, its end, and how many
    samples got lost on the way.
    """

    samples: list[Frame]
    start: int
    end: End
    lost: int = 0


@dataclass
class Progress:
    """Where the reference stands: accepted by the device, sent, when an answer last moved it on, and the place to which
    sending has gone back after a gap.
    """

    accepted: int = 0
    sent: int = 0
    moved: float = 0.0
    back: int = -1


@dataclass
class Seen:
    """What samples have shown."""

    samples: list[Frame] = field(default_factory=list)
    last: Frame | None = None
    when: float = 0.0
    lost: int = 0


class Running:
    """A run from Arm's answer on; see `Session.run`."""

    def __init__(
        self,
        link: Link,
        number: int,
        reference: Array,
        hello: Frame,
        fade: int,
        watch: Watch | None,
        on_batch: Callable[[list[Frame]], None] | None,
    ) -> None:
        self._link, self._number, self._reference = link, number, reference.tolist()
        self._rate, self._room_size, self._fade = hello.rate, hello.reference_room, fade
        self._watch, self._on_batch = watch, on_batch
        now = link.clock()
        self._progress = Progress(moved=now)
        self._seen = Seen(when=now)
        self.start: int | None = None
        self._asked: tuple[StopMode, str, Reason] | None = None
        self._asked_at = self._stop_sent = self._run_sent = self._beaten = -1e9
        self._began = now
        self._beats = 0
        self._end: End | None = None
        self._fault_value: tuple[FaultCode, float] | None = None
        ids = {name: message.id for name, message in schema().by_name.items()}
        self._reference_id, self._run_id = ids["Reference"], ids["Run"]

    def go(self) -> Run:
        """Turns until the device is at 0 V, or nothing more can be seen of it."""
        while self._end is None:
            try:
                frames = self._link.exchange(self._due(), TURN)
            except DeviceError as error:
                self._end = End(Reason.LOST, error.message, seen=False)
                break
            self._take(frames)
            if self._end is None:
                self._check_time()
        if self._end.reason is Reason.LOST:
            self.abandon()
        samples = [] if self.start is None else _from(self._seen.samples, self.start)
        return Run(samples, self.start or 0, self._end, self._seen.lost)

    def ask_stop(self, mode: StopMode, why: str, reason: Reason | None = None) -> None:
        """Stop at the next turn; a hard stop replaces a soft one that waits."""
        if self._asked is None or (mode is StopMode.HARD and self._asked[0] is StopMode.SOFT):
            known = reason or (Reason.STOPPED if mode is StopMode.SOFT else Reason.HALTED)
            self._asked, self._asked_at, self._stop_sent = (mode, why, known), self._link.clock(), -1e9

    def abandon(self) -> None:
        """Send a hard stop without waiting for an answer; never raises."""
        for _ in range(3):
            try:
                self._link.send("Stop", session=self._number, mode=StopMode.HARD)
            except DeviceError:
                return

    def _due(self) -> bytes:
        """The bytes of this turn: Stop before all else, a heartbeat, reference, Run."""
        now, out = self._link.clock(), b""
        if self._asked is not None and now - self._stop_sent >= RETRY:
            out += encode("Stop", session=self._number, mode=self._asked[0]) * AGAIN
            self._stop_sent = now
        if now - self._beaten >= BEAT:
            self._beats = (self._beats + 1) % 65536
            out += encode("Heartbeat", session=self._number, count=self._beats)
            self._beaten = now
        if self._asked is None:
            out += self._blocks(now)
            if self.start is None and self._primed() and now - self._run_sent >= RETRY:
                out += encode("Run", session=self._number) * AGAIN
                self._run_sent = now
        return out

    def _primed(self) -> bool:
        """Whether the device holds all that it can, or the whole reference."""
        full = self._room_size - 2 * BLOCK
        return self._progress.accepted >= min(len(self._reference), int(full))

    def _used(self) -> int:
        """How many samples of the reference the device has used, as far as its samples have come."""
        if self.start is None or self._seen.last is None:
            return 0
        return max(_apart(self._seen.last.sequence, self.start) + 1, 0)

    def _blocks(self, now: float) -> bytes:
        """The next messages of the reference, from where the device wants them."""
        at, total = self._progress, len(self._reference)
        times = 1
        if at.sent > at.accepted and now - at.moved >= RETRY:
            at.sent, at.moved, times = at.accepted, now, AGAIN
        out = b""
        for _ in range(PER_TURN):
            part = self._reference[at.sent : at.sent + BLOCK]
            room = self._room_size - (at.sent - min(self._used(), at.accepted))
            if not part or len(part) > room or at.sent - at.accepted >= WINDOW * BLOCK:
                break
            ends = at.sent + len(part) >= total
            values = {"start": at.sent, "count": len(part), "last": int(ends), "session": self._number}
            out += encode("Reference", value=tuple(part), **values) * times
            times = 1
            if at.sent == at.accepted:
                at.moved = now
            at.sent += len(part)
        return out

    def _take(self, frames: list[Frame]) -> None:
        """Answers, faults and samples of a turn."""
        batch = []
        for frame in frames:
            if frame.name == "Sample":
                batch.append(frame)
                self._count(frame)
            elif frame.name == "Ack":
                self._acknowledge(frame)
            elif frame.name == "Fault" and frame.code in set(FaultCode):
                self._fault_value = FaultCode(frame.code), frame.value
        if not batch:
            return
        if self._on_batch is not None:
            self._on_batch(batch)
        if self._watch is not None and self.start is not None and (why := self._watch(batch)) is not None:
            self.ask_stop(StopMode.HARD, why, Reason.GUARD)
        for frame in batch:
            if self._end is None:
                self._end = self._ended(frame)

    def _count(self, frame: Frame) -> None:
        seen = self._seen
        if seen.last is not None:
            gap = _apart(frame.sequence, seen.last.sequence)
            if gap <= 0:
                if gap < -int(self._rate):
                    self._end = self._end or End(Reason.RESET, RESET.format(self._link.name))
                return
            seen.lost += (gap - 1) if self.start is not None else 0
        seen.last, seen.when = frame, self._link.clock()
        seen.samples.append(frame)

    def _acknowledge(self, ack: Frame) -> None:
        at = self._progress
        if ack.message == self._run_id:
            if ack.status == Status.DONE:
                self.start = ack.value
            elif ack.status != Status.NO_REFERENCE and ack.state == State.IDLE and self._asked is None:
                self._end = self._end or End(Reason.RESET, RESET.format(self._link.name))
        elif ack.message == self._reference_id and ack.status in (Status.DONE, Status.GAP, Status.FULL):
            if ack.next > at.accepted:
                at.accepted, at.moved = min(ack.next, len(self._reference)), self._link.clock()
                at.sent = max(at.sent, at.accepted)
            if ack.status == Status.GAP and at.back != at.accepted and ack.next == at.accepted:
                at.sent = at.back = at.accepted

    def _ended(self, frame: Frame) -> End | None:
        """The end that a sample shows, None while the run goes on."""
        name = self._link.name
        if frame.state == State.FAULT:
            code = FaultCode(frame.fault) if frame.fault in set(FaultCode) else FaultCode.NONE
            value = self._fault_value
            known = f" ({value[1]:.4g})" if value is not None and value[0] is code and value[1] else ""
            said = FAULTS.get(code, f"code {frame.fault}")
            return End(Reason.FAULT, f"{name}: the guard of the firmware ended the run at 0 V: {said}{known}", code)
        if frame.state != State.IDLE or (self.start is None and self._asked is None):
            return self._early(frame) if frame.state == State.IDLE else None
        if self.start is not None and self._asked is None and _apart(frame.sequence, self.start) < 0:
            return None  # from before the run
        if self._asked is not None:
            return End(self._asked[2], self._asked[1])
        if frame.flags & Flag.FINISHED:
            return End(Reason.FINISHED, "the reference has come to its end")
        if frame.flags & Flag.STARVED:
            text = f"{name} had no reference left, so the host was late: close other programs, or run on a faster link"
            return End(Reason.STARVED, text)
        return End(Reason.TAKEN, f"{name} was stopped by another host; let one program at a time use it")

    def _early(self, frame: Frame) -> End | None:
        """Idle before Run was answered: old samples at first; later the device has been reset or stopped."""
        if self._link.clock() - self._began < SILENT or frame.flags & (Flag.FINISHED | Flag.STARVED):
            return None
        return End(Reason.RESET, RESET.format(self._link.name))

    def _check_time(self) -> None:
        """Ends that no sample shows: silence, an answer to Run or Stop that does not come."""
        now, name = self._link.clock(), self._link.name
        if now - self._seen.when > SILENT:
            text = f"{name} has sent no sample for {SILENT:g} s: it hangs, or the link is cut; its guard gives 0 V"
            self._end = End(Reason.LOST, f"{text}; look after cable and supply, connect again", seen=False)
        elif self._asked is not None:
            self._check_stop(now)
        elif self.start is None and now - self._began > 10.0 + 0.002 * self._room_size:
            self._end = End(Reason.LOST, f"{name} did not begin the run; the link loses too many frames", seen=False)

    def _check_stop(self, now: float) -> None:
        assert self._asked is not None
        mode, why, reason = self._asked
        patience = SILENT + (self._fade / self._rate if mode is StopMode.SOFT else 0.0)
        if now - self._asked_at < patience + 0.5:
            return
        if mode is StopMode.SOFT:
            self.ask_stop(StopMode.HARD, why, reason)
        else:
            text = f"{self._link.name} does not answer to Stop; switch the supply of the motor off"
            self._end = End(Reason.LOST, text, seen=False)


def _apart(one: int, other: int) -> int:
    """Difference of two sequences, which wrap at 32 bits."""
    return (one - other + 2**31) % 2**32 - 2**31


def _from(samples: list[Frame], start: int) -> list[Frame]:
    return [frame for frame in samples if _apart(frame.sequence, start) >= 0]


RESET = "{} has started again in the middle of the run (its supply, or its watchdog); look after its supply, run again"

FAULTS = {
    FaultCode.HEARTBEAT: "no heartbeat of the host for 100 ms (us)",
    FaultCode.ANGLE: "the angle passed its limit (rad)",
    FaultCode.SPEED: "the speed of the axis passed its limit (rad/s)",
    FaultCode.WHEEL_SPEED: "the speed of the wheel passed its limit (rad/s)",
    FaultCode.VOLTAGE: "the voltage stayed at its limit for too long (V)",
    FaultCode.CURRENT: "the current passed its limit (A)",
    FaultCode.AXIS_FROZEN: "the encoder of the axis did not move under voltage: cable, or a held axis (samples)",
    FaultCode.WHEEL_FROZEN: "the encoder of the wheel did not move under voltage: cable, motor or amplifier (samples)",
    FaultCode.AXIS_JUMP: "the encoder of the axis jumped (counts)",
    FaultCode.WHEEL_JUMP: "the encoder of the wheel jumped (counts)",
    FaultCode.OVERRUN: "a sample came late in the firmware",
    FaultCode.ENCODER: "an encoder gave no reading (samples)",
}
