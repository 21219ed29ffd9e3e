"""A host's session with a device: who it is, its parameters, and runs of a reference or of voltages.

    with Session(open_device("twin://paper")) as session:
        board = session.connect()
        session.load(parameters_of(controller, board, limits))
        run = session.run(reference)

Works on any stream (`devices/stream.py`). Messages that get lost are sent again until the device's answers show that
they came: Acks carry what it wants next. What one turn of a run does is in `live/running.py`.
"""

from __future__ import annotations

import math
import secrets
from collections.abc import Callable
from typing import TYPE_CHECKING, Self

import numpy as np

from swingid.control import law
from swingid.errors import DeviceError, UsageError
from swingid.live.codes import FaultCode, Mode, State, Status, StopMode
from swingid.live.ends import End, Reason, Run, refusal_words, state_words, unknown_state
from swingid.live.frames import Frame, checksum, encode
from swingid.live.guard import CONTROLLER, Board
from swingid.live.link import TURN, Link, Tap
from swingid.live.running import Running
from swingid.live.schema import schema
from swingid.live.sending import BLOCK, RETRY

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from swingid.live.devices.stream import Stream
    from swingid.live.running import Watch
    from swingid.numerics.arrays import Array

__all__ = ["End", "Reason", "Run", "Session"]

PATIENCE, AGAIN = 2.0, 0.04
"""Seconds that a device has for an answer, and after which a message is sent again."""

PART = 7
"""Parameters in a message."""


class Session:
    """One host on one device. name: of the device in messages, default its address; tap: sees every byte (`link.Tap`).

    number: tells this host's messages from another's on the same device (1 to 65535); 1 on virtual time, so that a
    run repeats to the byte, else random.
    """

    def __init__(
        self, stream: Stream, *, name: str | None = None, tap: Tap | None = None, number: int | None = None
    ) -> None:
        self.link = Link(stream, name, tap)
        self.number = number or (1 if stream.virtual else 1 + secrets.randbelow(65535))
        self.hello: Frame | None = None
        self._check: int | None = None
        self._running: Running | None = None
        self._closed = self._cleared = False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """0 V, then the end of the connection; never raises."""
        if self._closed:
            return
        self._closed = True
        try:
            if self.hello is not None:
                self.link.halt(self.number, 1)
        finally:
            self.link.stream.close()

    def connect(self, patience: float = PATIENCE) -> Board:
        """Ask who the device is, for up to `patience` (s); its board.

        Raises DeviceError where nothing answers, where what comes is no frame, for firmware of another schema, and for
        one whose Hello states what no run can work with (code "bad-hello").
        """
        frame = self._answer("Hello", encode("Who", schema=schema().hash), patience)
        if frame is None:
            raise self._no_hello()
        self._met(frame)
        return Board(frame.rate, frame.axis_counts, frame.wheel_counts, frame.voltage_limit, frame.firmware)

    def _met(self, frame: Frame) -> None:
        """Keep a Hello that a run can work with; raises as `connect`."""
        if frame.schema != schema().hash:
            text = f"{self.link.name} has firmware {frame.firmware:08x} of another version of the link (schema "
            text += f"{frame.schema:08x}, this host {schema().hash:08x}); build firmware and host from one version"
            raise DeviceError(text, code="other-firmware")
        facts = ("firmware", "rate", "axis_counts", "wheel_counts", "voltage_limit", "parameter_room", "reference_room")
        if self.hello is not None and any(getattr(frame, x) != getattr(self.hello, x) for x in facts):
            text = f"{self.link.name} states other values in its Hello than a moment ago; connect again, or build its "
            raise DeviceError(f"{text}firmware anew", code="bad-hello")
        wrong = wrong_hello(frame, virtual=self.link.stream.virtual)
        if wrong:
            text = f"{self.link.name} says in its Hello that it has {wrong}; correct its firmware"
            raise DeviceError(text, code="bad-hello")
        self.hello = frame

    def _no_hello(self) -> DeviceError:
        name, link = self.link.name, self.link
        if link.frames > link.bad:
            return DeviceError(
                f"{name} sends frames and does not answer Who; build its firmware anew", code="no-answer"
            )
        if link.bad or link.bytes_in:
            text = f"{name} sends bytes that are no frames of swingid; check the baud rate, and that its firmware is "
            text += "that of firmware/, or name a csv:// device for one that prints"
            return DeviceError(text, code="no-frames")
        text = f"{name} does not answer; check its supply and the cable, and that its firmware is running"
        if name.startswith("tcp://"):
            text += ", and that no other host is connected to that port"
        return DeviceError(text, code="no-answer")

    @property
    def started(self) -> int | None:
        """Sequence of the sample of reference 0 in the present run, once it is known."""
        return None if self._running is None else self._running.start

    @property
    def running(self) -> bool:
        """Return whether a run goes on, which `ask_stop` ends."""
        return self._running is not None

    def require_ready(self) -> None:
        """Raise DeviceError unless the device is idle: a latched fault is for a person to clear, a run is another's."""
        frame = self._answer("Hello", encode("Who", schema=schema().hash), PATIENCE)
        if frame is None:
            raise self._no_hello()
        self._met(frame)
        name = self.link.name
        if frame.state not in set(State):
            raise DeviceError(unknown_state(name, frame.state), code="unknown-state")
        if frame.state == State.FAULT:
            word = FaultCode(frame.fault).name.lower() if frame.fault in set(FaultCode) else str(frame.fault)
            text = f"{name} holds a fault ({word}) of an earlier run; look at the rig, then clear it (--clear)"
            if self._cleared:
                text = f"{name} holds the fault {word} after Clear, too; start it again, or build it anew"
            raise DeviceError(text, code="latched-fault")
        if frame.state != State.IDLE:
            text = f"{name} is {state_words(frame.state)} for another host; stop that one first"
            raise DeviceError(text, code="in-use")

    def load(self, parameters: ArrayLike) -> None:
        """Send the parameters of guard and controller (`guard.parameters_of`); DeviceError where they don't arrive."""
        values = np.asarray(parameters, float)
        total, sent = len(values), 0
        if self.hello is not None and total > self.hello.parameter_room:
            order, most = ((n - LEAST_PARAMETERS) // 2 for n in (total, self.hello.parameter_room))
            text = f"the controller is of order {order}, and {self.link.name} computes order {most} at most in a "
            text += f"sample ({total} parameters, room for {self.hello.parameter_room}); "
            text += "choose one of lower relative degree"
            raise DeviceError(text, code="order-too-high")
        # a device that had some already starts again at index 0
        deadline = self.link.clock() + PATIENCE + 0.05 * total
        while sent < total:
            part = values[sent : sent + PART].tolist()
            out = encode("Parameters", index=sent, count=len(part), total=total, value=tuple(part))
            ack = self._acknowledged("Parameters", out)
            if ack.status not in (Status.DONE, Status.GAP) or self.link.clock() > deadline:
                raise self._refused("Parameters", ack)
            if ack.next > total or (ack.status == Status.DONE and not ack.next):
                text = f"{self.link.name} acknowledges {ack.next} parameters where {total} were sent"
                raise DeviceError(f"{text}; its firmware is faulty: build it anew", code="refused-by-device")
            sent = ack.next
        self._check = checksum(values.astype("<f8").tobytes())

    def listen(self, seconds: float) -> list[Frame]:
        """Sample frames of this long (s) without a run: the body as it hangs. DeviceError where none come."""
        frames: list[Frame] = []
        until, asked = self.link.clock() + seconds, -1.0
        while (now := self.link.clock()) < until:
            out = b""
            if now - asked >= AGAIN:
                out, asked = encode("Heartbeat", session=self.number), now
            came = self.link.exchange(out, min(TURN, max(until - now, 1e-6)))
            frames += [frame for frame in came if frame.name == "Sample"]
            driven = next((f for f in came if f.name == "Sample" and f.state == State.IDLE and f.voltage), None)
            if driven is not None:
                text = f"{self.link.name} is idle and states {driven.voltage:.3g} V; switch the supply of the motor off"
                raise DeviceError(f"{text}, and build its firmware anew", code="voltage-at-rest")
        if not frames:
            raise self.link.lost(f"no sample came in {seconds:g} s")
        return frames

    def run(
        self,
        samples: ArrayLike,
        *,
        mode: Mode = Mode.CLOSED_LOOP,
        fade: float = 0.5,
        watch: Watch | None = None,
        on_batch: Callable[[list[Frame]], None] | None = None,
    ) -> Run:
        """Arm, send the samples as the device wants them, and read until it is at 0 V.

        samples: the reference (rad, closed loop) or voltages (V, open loop), one per sample of the device. fade: length
        of a soft stop (s). watch: the host's guard: called with each batch of Sample frames, a
        sentence from it is a hard stop. on_batch: called with each batch; may call `ask_stop`. What the device's guard,
        the link or a person ends is no exception: see `Run.end`. Raises DeviceError where the run does not begin.
        """
        if self._check is None or self.hello is None:
            raise UsageError("a run needs connect() and load(parameters) before it", code="no-parameters")
        wanted: Array = np.asarray(samples, np.float32).astype(float)
        if wanted.ndim != 1 or not len(wanted) or not np.isfinite(wanted).all():
            raise UsageError("the samples of a run are one row of finite numbers", code="bad-reference")
        if self.link.pace is not None:
            self.link.pace.restart()
        steps = min(round(fade * self.hello.rate), 65535)
        arm = encode("Arm", session=self.number, mode=mode, parameters=self._check, fade=steps)
        arm += encode("Heartbeat", session=self.number)  # where the answer gets lost it is armed and waits for one
        ack = self._acknowledged("Arm", arm)
        if ack.status != Status.DONE:
            raise self._refused("Arm", ack)
        self._running = Running(self.link, self.number, wanted, self.hello, steps, watch, on_batch)
        try:
            return self._running.go()
        except BaseException:
            self._running.abandon()
            raise
        finally:
            self._running = None

    def ask_stop(self, mode: StopMode = StopMode.SOFT, why: str = "a stop was asked for") -> None:
        """Stop the run at its next turn; from a callback or a signal handler. Without a run nothing happens."""
        if self._running is not None:
            self._running.ask_stop(mode, why)

    def stop(self, mode: StopMode = StopMode.HARD) -> None:
        """Send Stop until the device answers; for a device that is not in a `run` of this session."""
        self._acknowledged("Stop", encode("Stop", session=self.number, mode=mode))

    def clear(self) -> None:
        """Leave the latched state of a fault, after a person has looked at the rig; without a fault nothing happens."""
        self._acknowledged("Clear", encode("Clear", session=self.number))
        self._cleared = True

    def _answer(self, name: str, out: bytes, patience: float, message: int | None = None) -> Frame | None:
        """The first frame of this name (an Ack: to this message), the bytes sent again and again; None after a time."""
        start, sent = self.link.clock(), -1.0
        while (now := self.link.clock()) - start < patience:
            again = now - sent >= AGAIN
            sent = now if again else sent
            for frame in self.link.exchange(out if again else b"", TURN):
                if frame.name == name and (message is None or frame.message == message):
                    return frame
        return None

    def _acknowledged(self, name: str, out: bytes) -> Frame:
        """The Ack to a message; DeviceError without one."""
        ack = self._answer("Ack", out, PATIENCE, schema().by_name[name].id)
        if ack is None:
            raise self.link.lost(f"no answer to {name} in {PATIENCE:g} s")
        return ack

    def _refused(self, name: str, ack: Frame) -> DeviceError:
        """The error of a device that does not take a message."""
        word = refusal_words(ack.status)
        if ack.status == Status.DONE:
            word = f"it wants part {ack.next} again and again"
        if self.link.lossy:
            word = "the link loses too many frames"
        return DeviceError(f"{self.link.name} does not take {name}: {word}", code="refused-by-device")


def wrong_hello(hello: Frame, *, virtual: bool = False) -> str:
    """What no run can work with in a device's Hello, in words; "" for nothing. virtual: time waits for the host."""
    rate, limit = hello.rate, hello.voltage_limit
    if not LEAST_RATE <= rate <= MOST_RATE:
        return f"{rate:g} samples per second, where a run needs {LEAST_RATE:g} to {MOST_RATE:g}"
    for name, counts, least in (("axis", hello.axis_counts, 1), ("wheel", hello.wheel_counts, 0)):
        if not least <= counts <= MOST_COUNTS:
            return f"{counts} counts per turn of the {name}, where a run needs {least} to {MOST_COUNTS}"
    if not 0.0 < limit < math.inf:
        return f"a voltage limit of {limit:g} V, where a run needs one above 0"
    if hello.parameter_room < LEAST_PARAMETERS:
        return f"room for {hello.parameter_room} parameters, where a run needs {LEAST_PARAMETERS}"
    least = 3 * BLOCK if virtual else max(3 * BLOCK, math.ceil(BRIDGED * rate))
    if hello.reference_room < least:
        return f"room for {hello.reference_room} samples of the reference, where a run at {rate:g} Hz needs {least}"
    return ""


LEAST_RATE, MOST_RATE = 20.0, 100_000.0
"""Samples per second: two in the 100 ms of the guard's heartbeat; 4 MB/s on the line."""

MOST_COUNTS = 2**31 - 1
"""Counts per turn: a turn fits into a counter of 32 bits with a sign."""

LEAST_PARAMETERS = CONTROLLER + law.ALPHA + 1
"""Of the guard and the smallest controller."""

BRIDGED = RETRY + 2 * TURN
"""Seconds that the reference in the device must last: until a block that was lost is sent again, and has come."""
