"""The state machine of a device: frames in, one sample after the other, frames out.

idle → armed → running → stopping → idle; a fault is latched until Clear. The reference implementation:
``firmware/core/device.c`` makes the same decisions and the same bytes (`tests/live/test_live_machine.py`). A board, or
the twin in its place, calls `receive` with what came from the host, `tick` once per sample, applies the voltage that
it returns, and sends what `output` gives.
"""

from __future__ import annotations

import math
import zlib
from functools import cache

import numpy as np

from swingid.control import law
from swingid.control.law import compensator_step
from swingid.live import guard as at
from swingid.live.codes import FaultCode, Flag, Mode, State, Status, StopMode
from swingid.live.frames import MOST_ENCODED, Decoder, Frame, checksum, encode
from swingid.live.guard import Board, Guard, Readings
from swingid.live.schema import schema

VERSION = 1
EMULATED = {kind: zlib.crc32(f"swingid {kind} {VERSION}".encode()) for kind in ("twin", "native")}
"""Hashes that the firmware of an emulated rig states, which moves by its own clock."""

REFERENCE_ROOM, OUTPUT_ROOM = 1024, 1024
"""Samples of the reference and bytes of output that a device holds."""

MOST_TAKEN, LEAST_TAKEN = 200_000, MOST_ENCODED + 1
"""Bytes that a device takes from its host per second at most, in a sample at least; why: `firmware/core/device.h`."""

ENERGISED = (State.ARMED, State.RUNNING, State.STOPPING)


def single(x: float) -> float:
    """X rounded to 32 bits, infinite beyond their range."""
    with np.errstate(over="ignore"):
        return float(np.float32(x))


def most_taken(board: Board) -> int:
    """Bytes that a device takes from its host between two samples at most; what comes faster waits."""
    return max(int(MOST_TAKEN / float(np.float32(board.rate))), LEAST_TAKEN)


@cache
def _sizes() -> dict[str, int]:
    """Bytes of each message on a line: identifier, check, COBS's byte and the zero are six."""
    return {name: message.length + 6 for name, message in schema().by_name.items()}


@cache
def _room_for(name: str) -> int:
    """Bytes of output that a message may fill; answers leave room for one Sample and one Fault."""
    return OUTPUT_ROOM - (0 if name in ("Sample", "Fault") else _sizes()["Sample"] + _sizes()["Fault"])


class Machine:
    """A device without its hardware. board: what it is; its numbers count as rounded to 32 bits.

    What calls it passes on `most_taken` bytes of the host per sample at most, and sets `busy` where they are as many:
    more may wait, so a heartbeat counts from the last sample at which none did.
    """

    def __init__(self, board: Board) -> None:
        self.board = board
        self.guard = Guard(board)
        self.state, self.fault, self.mode = State.IDLE, FaultCode.NONE, Mode.CLOSED_LOOP
        self.sequence = self.start = 0
        self.session = 0
        self.voltage = 0.0
        self.controller = np.zeros(law.XI + at.MOST_ORDER)
        self._decoder = Decoder(from_host=True)
        self._output = bytearray()
        self._flags = self._ended = Flag(0)
        self._rate = float(np.float32(board.rate))
        self.busy = False
        self._quiet = int(self._rate) + 1
        self._known: list[float] = []
        self._total = 0
        self._check = checksum(b"")
        self._gains = np.zeros(0)
        self._reference: list[float] = []
        self._next_out = 0
        self._complete = False
        self._fade = self._fade_left = 0
        self._last_reference = 0.0

    def receive(self, data: bytes) -> None:
        """Bytes from the host, in any pieces."""
        bad = self._decoder.bad
        for frame in self._decoder.feed(data):
            self._quiet = 0
            getattr(self, f"_on_{frame.name.lower()}")(frame)
        if self._decoder.bad > bad:
            self._flags |= Flag.BAD_FRAME

    def output(self) -> bytes:
        """All bytes for the host since the last call."""
        taken = bytes(self._output)
        self._output.clear()
        return taken

    def tick(self, time: int, readings: Readings) -> float:
        """One sample at a device time (us, 32 bits, wrapping): the voltage (V) to apply up to the next one."""
        self.guard.track(time, readings, busy=self.busy)
        if not readings.valid:
            self._flags |= Flag.INVALID
        if self.guard.late:
            self._flags |= Flag.LATE
        if self.state in ENERGISED:
            fault, value = self.guard.check(readings, self._known, self.voltage)
            if fault is not FaultCode.NONE:
                self.trip(fault, value)
        self.voltage = single(self._command()) if self.state in (State.RUNNING, State.STOPPING) else 0.0
        listened = self._quiet <= int(self._rate)
        if self.state in ENERGISED or listened:
            self._send_sample(time, readings)
        self._quiet += listened
        self.sequence = (self.sequence + 1) % 2**32
        return self.voltage

    def trip(self, fault: FaultCode, value: float) -> None:
        """0 V and a latched fault."""
        self.state, self.fault = State.FAULT, fault
        time, number = self.guard.time, single(value)
        self._send("Fault", sequence=self.sequence, time=time, code=fault, state=self.state, value=number)

    def _send(self, name: str, **values: float) -> None:
        """A frame for the host; one that has no room left is dropped whole and reported by a flag."""
        if len(self._output) + _sizes()[name] > _room_for(name):
            self._flags |= Flag.DROPPED
        else:
            self._output += encode(name, **values)

    def _answer(self, message: str, status: Status, following: int = 0, value: int = 0) -> None:
        number = schema().by_name[message].id
        self._send("Ack", message=number, status=status, state=self.state, next=following, value=value)

    def _send_sample(self, time: int, readings: Readings) -> None:
        flags = self._flags | self._ended
        if self.state is State.STOPPING:
            flags |= Flag.FADING
        self._flags = Flag(0)
        self._send(
            "Sample",
            sequence=self.sequence,
            time=time,
            axis=readings.axis,
            wheel=readings.wheel,
            voltage=self.voltage,
            gain=single(self.controller[law.K_TILDE]),
            current=readings.current,
            flags=flags,
            state=self.state,
            fault=self.fault,
        )

    def _on_who(self, frame: Frame) -> None:
        del frame
        board = self.board
        self._send(
            "Hello",
            schema=schema().hash,
            firmware=board.firmware,
            version=VERSION,
            state=self.state,
            fault=self.fault,
            rate=board.rate,
            axis_counts=board.axis_counts,
            wheel_counts=board.wheel_counts,
            voltage_limit=board.voltage_limit,
            parameter_room=board.parameter_room,
            reference_room=REFERENCE_ROOM,
        )

    def _on_heartbeat(self, frame: Frame) -> None:
        if frame.session == self.session:
            self.guard.fresh = True

    def _on_stop(self, frame: Frame) -> None:
        if self.state is State.FAULT:
            self._answer("Stop", Status.WRONG_STATE)
            return
        if frame.mode != StopMode.SOFT or self.state is State.ARMED:
            self.state = State.IDLE
        elif self.state is State.RUNNING:
            self._begin_fade()
        self._answer("Stop", Status.DONE)

    def _on_clear(self, frame: Frame) -> None:
        del frame
        latched = self.state is State.FAULT
        if latched:
            self.state, self.fault = State.IDLE, FaultCode.NONE
        self._answer("Clear", Status.DONE if latched else Status.WRONG_STATE)

    def _on_parameters(self, frame: Frame) -> None:
        status = self._take_parameters(frame)
        self._answer("Parameters", status, len(self._known), self._check)

    def _take_parameters(self, frame: Frame) -> Status:
        if self.state is not State.IDLE:
            return Status.WRONG_STATE
        index, count, total = frame.index, frame.count, frame.total
        if not 1 <= count <= len(frame.value) or total > self.board.parameter_room or index + count > total:
            return Status.BAD_VALUE
        if index == 0:
            self._known, self._total, self._check = [], total, checksum(b"")
        if index != len(self._known) or total != self._total:
            return Status.GAP
        self._known += frame.value[:count]
        self._check = checksum(np.array(frame.value[:count], dtype="<f8").tobytes(), self._check)
        return Status.DONE

    def _on_arm(self, frame: Frame) -> None:
        status = self._arm(frame)
        self._answer("Arm", status, len(self._reference), REFERENCE_ROOM)

    def _arm(self, frame: Frame) -> Status:
        if self.state not in (State.IDLE, State.ARMED) or not self.guard.seen:
            return Status.WRONG_STATE
        if frame.mode > Mode.OPEN_LOOP:
            return Status.BAD_VALUE
        if self._total == 0 or len(self._known) != self._total:
            return Status.NO_PARAMETERS
        parameters = np.array(self._known)
        if frame.parameters != self._check or not at.valid(parameters, self.board):
            return Status.BAD_PARAMETERS
        if parameters[at.VOLTAGE_LIMIT] > single(self.board.voltage_limit):
            return Status.OVER_LIMIT
        if not at.counts(parameters, self.board):
            return Status.TOO_FAST
        self._gains = parameters[at.CONTROLLER :]
        self.controller[:] = 0.0
        self.controller[law.K_TILDE] = parameters[at.START_GAIN]
        self.session, self.mode, self._fade = frame.session, Mode(frame.mode), frame.fade
        self._reference, self._next_out, self._complete = [], 0, False
        self._ended = Flag(0)
        self._last_reference = self._rest()
        self.guard.arm()
        self.state = State.ARMED
        return Status.DONE

    def _room(self) -> int:
        return REFERENCE_ROOM - (len(self._reference) - self._next_out)

    def _on_reference(self, frame: Frame) -> None:
        status = self._take_reference(frame)
        self._answer("Reference", status, len(self._reference), self._room())

    def _take_reference(self, frame: Frame) -> Status:
        if self.state not in (State.ARMED, State.RUNNING):
            return Status.WRONG_STATE
        if frame.session != self.session:
            return Status.WRONG_SESSION
        if frame.count > len(frame.value):
            return Status.BAD_VALUE
        if frame.start != len(self._reference):
            return Status.GAP
        if self._complete:
            return Status.BAD_VALUE
        if frame.count > self._room():
            return Status.FULL
        values = frame.value[: frame.count]
        if not all(map(math.isfinite, values)):
            return Status.BAD_VALUE
        self._reference += values
        self._complete = frame.last != 0
        return Status.DONE

    def _on_run(self, frame: Frame) -> None:
        status = Status.DONE
        if self.state not in (State.ARMED, State.RUNNING):
            status = Status.WRONG_STATE
        elif frame.session != self.session:
            status = Status.WRONG_SESSION
        elif self.state is State.ARMED and not self._reference:
            status = Status.NO_REFERENCE
        elif self.state is State.ARMED:
            self.state, self.start = State.RUNNING, self.sequence
        self._answer("Run", status, len(self._reference), self.start)

    def _rest(self) -> float:
        return 0.0 if self.mode is Mode.OPEN_LOOP else self._known[at.REST]

    def _begin_fade(self) -> None:
        self.state, self._fade_left = State.STOPPING, self._fade

    def _next_reference(self) -> float | None:
        """The reference of this sample, faded at the end of a run; None: the run is over."""
        if self.state is State.RUNNING:
            if self._next_out < len(self._reference):
                self._last_reference = self._reference[self._next_out]
                self._next_out += 1
                return self._last_reference
            self._ended |= Flag.FINISHED if self._complete else Flag.STARVED
            self._begin_fade()
        if self._fade_left == 0:
            return None
        self._fade_left -= 1
        rest = self._rest()
        return rest + (self._last_reference - rest) * self._fade_left / self._fade

    def _command(self) -> float:
        """Voltage (V) of this sample; 0 where the run is over or the guard has tripped."""
        reference = self._next_reference()
        if reference is None:
            self.state = State.IDLE
            return 0.0
        p, voltage = self._known, reference
        if self.mode is Mode.CLOSED_LOOP:
            angle, wheel_angle = self.guard.angle(p), self.guard.wheel_angle(p)
            voltage = compensator_step(reference, angle, wheel_angle, self.controller, self._gains)
        voltage, clamped, fault = self.guard.within(voltage, p)
        if clamped:
            self._flags |= Flag.CLAMPED
        if fault is not FaultCode.NONE:
            self.trip(fault, voltage)
            return 0.0
        return voltage * p[at.VOLTAGE_SIGN]
