"""One run: the reference down as there is room, heartbeats, samples up, and how it ended.

A turn sends what is due and reads what has come. The device is at 0 V when its sample says idle or fault, with 0 V;
where no sample comes, its own guard does that within 100 ms. Every run ends: one that the device does not end is
stopped, and a device that does not obey Stop is left, with a sentence that says so.
"""

from __future__ import annotations

from collections.abc import Callable

from swingid.errors import DeviceError
from swingid.live.codes import FaultCode, Flag, State, Status, StopMode, apart
from swingid.live.ends import RESET, End, Reason, Run, fault_words, refusal_words
from swingid.live.frames import Frame, encode
from swingid.live.link import MOST_LOST, TURN, Link
from swingid.live.schema import schema
from swingid.live.seen import ENERGISED, SILENT, Seen
from swingid.live.sending import AGAIN, RETRY, Sending
from swingid.numerics.arrays import Array

__all__ = ["AGAIN", "End", "Reason", "Run", "Running", "Watch"]

BEAT = 0.015
"""Seconds between heartbeats."""

OVERTIME, SLOW = 2.0, 0.01
"""Seconds after the planned end, and share of the run, at which it is stopped: the delays of a link and of its host;
1 % is what the clock of a microcontroller without a crystal is slow by.
"""

STUCK = 3.0
"""Seconds without progress before the run after which it is given up: fifty messages without an answer."""

Watch = Callable[[list[Frame]], str | None]


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
        self._link, self._number, self._fade = link, number, fade
        self._rate, self._watch, self._on_batch = hello.rate, watch, on_batch
        now = link.clock()
        self._sending = Sending(number, reference.tolist(), int(hello.reference_room), now)
        self._seen = Seen(link.name, hello.rate, len(reference), now)
        self.start: int | None = None
        self._asked: tuple[StopMode, str, Reason] | None = None
        self._asked_at = self._stop_sent = self._run_sent = self._beaten = -1e9
        self._obeys = False
        self._began, self._bad = now, link.bad
        self._run_first: float | None = None
        self._run_from: int | None = None
        self._run_answer: Frame | None = None
        self._due_at = self._faulted = 1e18
        self._beats = 0
        self._end: End | None = None
        self._fault_value: tuple[int, float] | None = None
        ids = {name: message.id for name, message in schema().by_name.items()}
        self._reference_id, self._run_id, self._stop_id = ids["Reference"], ids["Run"], ids["Stop"]

    def go(self) -> Run:
        """Turns until the device is at 0 V, or nothing more can be seen of it; raises what the link's hook raises."""
        while self._end is None:
            self._link.each_turn()
            try:
                frames = self._link.turn(self._due(), TURN)
            except DeviceError as error:
                self._end = End(Reason.LOST, error.message, seen=False)
                break
            self._take(frames)
            if self._end is None:
                self._check_time()
        if not self._end.seen:
            self.abandon()
        samples = [f for f in self._seen.samples if self.start is not None and apart(f.sequence, self.start) >= 0]
        moved = self.start is not None or bool(self._seen.states - {State.IDLE, State.ARMED})
        return Run(samples, self.start or 0, self._end, self._seen.lost, moved)

    def ask_stop(self, mode: StopMode, why: str, reason: Reason | None = None) -> None:
        """Stop at the next turn; a hard stop replaces a soft one that waits."""
        if self._asked is None or (mode is StopMode.HARD and self._asked[0] is StopMode.SOFT):
            known = reason or (Reason.STOPPED if mode is StopMode.SOFT else Reason.HALTED)
            self._asked, self._asked_at, self._stop_sent = (mode, why, known), self._link.clock(), -1e9
            self._obeys = False

    def abandon(self) -> None:
        """Send a hard stop without waiting for an answer; never raises."""
        self._link.halt(self._number)

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
            used = 0 if self.start is None else self._seen.number(self.start)
            out += self._sending.blocks(now, used)
            if self.start is None and self._sending.primed and now - self._run_sent >= RETRY:
                out += encode("Run", session=self._number) * AGAIN
                self._run_sent = now
                if self._run_first is None:
                    self._run_first = now
                    self._run_from = None if self._seen.last is None else self._seen.last.sequence
        return out

    def _take(self, frames: list[Frame]) -> None:
        """Answers, faults and samples of a turn."""
        batch, new = [], []
        for frame in frames:
            if frame.name == "Sample":
                batch.append(frame)
                is_new, wrong = self._seen.take(frame, self._link.clock(), self.start)
                if self._seen.restarted:
                    self.ask_stop(StopMode.HARD, RESET.format(self._link.name), Reason.RESET)
                if wrong:
                    self.ask_stop(StopMode.HARD, wrong, Reason.PROTOCOL)
                if is_new:
                    new.append(frame)
            elif frame.name == "Ack":
                self._acknowledge(frame)
            elif frame.name == "Fault":
                self._fault_value = frame.code, frame.value
                if self.start is not None and apart(frame.sequence, self.start) >= 0:
                    self._faulted = min(self._faulted, self._link.clock())
        if not batch:
            return
        if self._on_batch is not None:
            self._on_batch(batch)
        if self._watch is not None and self.start is not None and (why := self._watch(batch)) is not None:
            self.ask_stop(StopMode.HARD, why, Reason.GUARD)
        end: End | None = None
        for frame in new:
            end = end or self._ended(frame)
            if end is not None and frame.voltage:
                text = f"{self._link.name} says that it has ended the run, and its samples state {frame.voltage:.3g} V"
                self.ask_stop(StopMode.HARD, text, Reason.PROTOCOL)
                end = None
        self._end = end

    def _acknowledge(self, ack: Frame) -> None:
        name, asked = self._link.name, self._asked is not None
        if ack.message == self._stop_id:
            self._obeys = asked
        elif ack.message == self._run_id:
            self._run_answer = ack
            if ack.status == Status.DONE:
                self._begin(ack.value)
            elif ack.status != Status.NO_REFERENCE and ack.state == State.IDLE and not asked:
                self.ask_stop(StopMode.HARD, RESET.format(name), Reason.RESET)
            elif ack.state == State.RUNNING and self.start is None:
                text = f"{name} runs, though it answers Run by: {refusal_words(ack.status)}; build its firmware anew"
                self.ask_stop(StopMode.HARD, text, Reason.PROTOCOL)
        elif ack.message == self._reference_id:
            wrong = self._sending.acknowledge(ack, self._link.clock())
            if wrong:
                self.ask_stop(StopMode.HARD, f"{name} {wrong}; its firmware is faulty: build it anew", Reason.PROTOCOL)

    def _begin(self, start: int) -> None:
        """Take the answer of Run, which must lie near the samples seen since it was asked for."""
        last = self._seen.last
        if start == self.start or last is None or self._run_first is None:
            return  # Run is sent again until there are samples to compare with; an answer to none is none
        low = apart(start, last.sequence if self._run_from is None else self._run_from)
        high = apart(start, last.sequence)
        if self.start is not None or low < -self._seen.near or high > SILENT * self._rate + self._seen.near:
            text = f"{self._link.name} states sample {start} as the start of the run, and its samples are at "
            text += f"{last.sequence}; its firmware is faulty: build it anew"
            self.ask_stop(StopMode.HARD, text, Reason.PROTOCOL)
            return
        self.start = start
        planned = (len(self._sending) + self._fade) / self._rate
        self._due_at = self._link.clock() + planned * (1 + SLOW) + OVERTIME

    def _ended(self, frame: Frame) -> End | None:
        """The end that a new sample shows, None while the run goes on."""
        name, start = self._link.name, self.start
        if frame.state == State.FAULT:
            value = self._fault_value
            passed = value[1] if value is not None and value[0] == frame.fault else 0.0
            code = FaultCode(frame.fault) if frame.fault in set(FaultCode) else FaultCode.NONE
            said = fault_words(frame.fault, passed)
            return End(Reason.FAULT, f"{name}: the guard of the firmware ended the run at 0 V: {said}", code)
        if frame.state != State.IDLE:
            return None
        if self._asked is not None:
            # samples from before Arm may still come: the answer to Stop comes before those after it
            sure = self._obeys or self._link.clock() - self._asked_at > SILENT
            return End(self._asked[2], self._asked[1]) if sure else None
        if start is None:
            return self._early(frame)
        used = apart(frame.sequence, start)
        return None if used < 0 else self._idle(used)

    def _idle(self, used: int) -> End:
        """The end of a device that is idle after so many samples, though nobody has asked for it."""
        name, planned = self._link.name, len(self._sending)
        if not self._seen.states & set(ENERGISED):
            return End(Reason.PROTOCOL, f"{name} answers Run and stays idle; its firmware is faulty: build it anew")
        if self._seen.flags & Flag.FINISHED:
            return End(Reason.FINISHED, "the reference has come to its end")
        if self._seen.flags & Flag.STARVED:
            if self._link.clock() - self._sending.advanced > SILENT + self._fade / self._rate:
                return End(Reason.STARVED, f"{name} {self._sending.obstacle()}, so it ran out of it")
            text = f"{name} had no reference left, so the host was late: close other programs, or run on a faster link"
            return End(Reason.STARVED, text)
        if used >= planned:
            text = f"{name} is idle after all {planned} samples and has not said that the reference is at its end (the "
            return End(Reason.PROTOCOL, f"{text}flag FINISHED); build its firmware anew")
        text = f"{name} was stopped by another host after {used} of {planned} samples; let one program at a time use it"
        return End(Reason.TAKEN, text)

    def _early(self, frame: Frame) -> End | None:
        """Idle before Run was answered: old samples at first; later the device has been reset or stopped."""
        if self._link.clock() - self._began < SILENT or frame.flags & (Flag.FINISHED | Flag.STARVED):
            return None
        if self._seen.states == {State.IDLE}:
            text = f"{self._link.name} answers Arm and stays idle; its firmware is faulty: build it anew"
            return End(Reason.PROTOCOL, text)
        return End(Reason.RESET, RESET.format(self._link.name))

    def _check_time(self) -> None:
        """Ends that no sample shows: silence, an answer that does not come, a run that does not end."""
        now, name = self._link.clock(), self._link.name
        if now - self._seen.when > SILENT:
            self._end = End(Reason.LOST, self._seen.still(), seen=False)
        elif self._asked is not None:
            self._check_stop(now)
        elif now - self._faulted > SILENT:
            code = FaultCode.NONE if self._fault_value is None else self._fault_value[0]
            text = f"{name} reports a fault and goes on: {fault_words(code)}"
            self.ask_stop(StopMode.HARD, text, Reason.PROTOCOL)
        elif self.start is None:
            self._check_begin(now)
        elif now > self._due_at:
            planned = len(self._sending) / self._rate
            text = f"{name} does not end its run: {planned:.4g} s were planned, and it is {self._seen.running_words()} "
            text += f"{OVERTIME:g} s after that, at sample {self._seen.number(self.start)} of {len(self._sending)}"
            self.ask_stop(StopMode.HARD, text, Reason.ENDLESS)

    def _check_begin(self, now: float) -> None:
        """Give up a run that does not begin, by a sentence that names the message without an answer."""
        first, name = self._run_first, self._link.name
        since = self._sending.advanced if first is None else first
        if now - since < STUCK:
            return
        if self._lossy():
            text = f"{name} did not begin the run; the link loses too many frames: look after cable and rate"
            self.ask_stop(StopMode.HARD, text, Reason.LOST)
            return
        what = self._sending.obstacle()
        if first is not None:
            ack = self._run_answer
            answer = "no answer to Run" if ack is None else f"it answers Run by: {refusal_words(ack.status)}"
            what = f"does not begin the run: {answer}"
        self.ask_stop(StopMode.HARD, f"{name} {what} in {STUCK:g} s; build its firmware anew", Reason.PROTOCOL)

    def _lossy(self) -> bool:
        """Return whether the link, up or down, loses more than a run can do with."""
        seen, bad = self._seen, self._link.bad - self._bad
        up = (bad + seen.missed) > MOST_LOST * (bad + seen.missed + len(seen.samples))
        return up or seen.damaged > MOST_LOST * (self._beats + self._sending.messages)

    def _check_stop(self, now: float) -> None:
        assert self._asked is not None
        mode, why, reason = self._asked
        patience = SILENT + (self._fade / self._rate if mode is StopMode.SOFT else 0.0)
        if now - self._asked_at < patience + 0.5:
            return
        if mode is StopMode.SOFT:
            self.ask_stop(StopMode.HARD, why, reason)
            return
        kept = reason in (Reason.ENDLESS, Reason.PROTOCOL)
        missing = f"is {self._seen.running_words()} after Stop" if self._obeys else "does not answer to Stop"
        text = f"{why}; {self._link.name} {missing}: switch the supply of the motor off"
        self._end = End(reason if kept else Reason.LOST, text, seen=False)
