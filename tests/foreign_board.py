"""The board of foreign_device.py: frames, messages, states and samples, from docs/protocol.md alone."""

import struct
from binascii import crc_hqx
from collections import deque
from collections.abc import Callable
from ctypes import c_float
from dataclasses import dataclass, replace
from math import isfinite, nan
from typing import Any

import foreign_law as law
from foreign_law import BAD_VALUE, DONE, GAP, WRONG_SESSION, WRONG_STATE, Law, Limits

SCHEMA = 0x77EC1C78
IDLE, ARMED, RUNNING, STOPPING, FAULT = range(5)
CLAMPED, STARVED, FINISHED, FADING, INVALID, LATE, DROPPED, BAD_FRAME = (1 << bit for bit in range(8))

FROM_HOST = {
    0x010: ("Stop", struct.Struct("<HBB")),
    0x020: ("Heartbeat", struct.Struct("<HH")),
    0x030: ("Clear", struct.Struct("<HH")),
    0x040: ("Who", struct.Struct("<I")),
    0x050: ("Parameters", struct.Struct("<HHHH7d")),
    0x051: ("Reference", struct.Struct("<IBBH14f")),
    0x052: ("Arm", struct.Struct("<HBBHH")),
    0x053: ("Run", struct.Struct("<HH")),
}
IDENTIFIERS = {name: identifier for identifier, (name, _) in FROM_HOST.items()}
TO_HOST = {
    "Fault": (0x011, struct.Struct("<IIBBHf"), ("sequence", "time", "code", "state", "reserved", "value")),
    "Hello": (
        0x041,
        struct.Struct("<IIHBBfIIfHH"),
        (
            *("schema", "firmware", "version", "state", "fault", "rate", "axis_counts", "wheel_counts"),
            *("voltage_limit", "parameter_room", "reference_room"),
        ),
    ),
    "Sample": (
        0x060,
        struct.Struct("<IIiifffHBB"),
        ("sequence", "time", "axis", "wheel", "voltage", "gain", "current", "flags", "state", "fault"),
    ),
    "Ack": (0x061, struct.Struct("<HBBII"), ("message", "status", "state", "next", "value")),
}
LONGEST = 69
QUEUE = 1024
KEPT = 60  # of it, that answers leave to a Sample and a Fault


def f32(value: float) -> float:
    return c_float(value).value


def to_frame(identifier: int, payload: bytes) -> bytes:
    body = identifier.to_bytes(2, "little") + payload
    body += crc_hqx(body, 0xFFFF).to_bytes(2, "little")
    return b"".join([bytes((len(run) + 1,)) + run for run in body.split(b"\0")]) + b"\0"


def from_frame(encoded: bytes) -> tuple[int, bytes] | None:
    """Identifier and payload of what stood between two zeros; None where that is no frame."""
    runs, at = [], 0
    while at < len(encoded):
        end = at + encoded[at]
        if end > len(encoded):
            return None
        runs.append(encoded[at + 1 : end])
        at = end
    body = b"\0".join(runs)
    if len(body) < 4 or crc_hqx(body[:-2], 0xFFFF) != int.from_bytes(body[-2:], "little"):
        return None
    return int.from_bytes(body[:2], "little"), body[2:-2]


@dataclass(frozen=True)
class Build:
    """What Hello says of the board."""

    rate: float = 1000.0
    axis_counts: int = 16384
    wheel_counts: int = 16384
    voltage_limit: float = 10.0
    parameter_room: int = 41
    reference_room: int = 1024
    firmware: int = 0


Fields = dict[str, Any]
Reading = tuple[int, int, int, bool]  # time, axis, wheel, valid


@dataclass
class Flaw:
    """One way to misbehave: functions at the places where a board meets the world. Each may be left out."""

    frame: Callable[["Board", str, Fields], Fields | None] | None = None  # changes a frame; None: it is not sent
    wire: Callable[["Board", bytes], bytes] | None = None  # changes a frame's bytes
    hears: Callable[["Board", str], bool] | None = None  # whether a message reaches the board
    reading: Callable[["Board", Reading], Reading] | None = None
    after: Callable[["Board"], None] | None = None  # changes the board's state after a sample
    output: Callable[["Board", float], float] | None = None  # what the amplifier gives, V
    pace: float = 1.0  # true samples per second, as a share of Hello's rate
    label: float = 1.0  # what `time` advances by, in periods of Hello's rate
    guarded: bool = True


class Board:
    """The protocol without link and rig: `receive` takes bytes, `sample` a reading, `take` gives what is to be sent."""

    def __init__(self, build: Build, flaw: Flaw | None = None):
        self.build = replace(build, rate=f32(build.rate), voltage_limit=f32(build.voltage_limit))
        self.flaw = flaw or Flaw()
        self.marks: dict[str, Any] = {}  # what a flaw remembers
        self.reset()

    def reset(self) -> None:
        self.state, self.fault, self.closed, self.voltage = IDLE, 0, True, 0.0
        self.sequence = self.begin = self.session = self.once = self.ended = 0
        self.held, self.total = bytearray(), 0
        self.p: tuple[float, ...] = ()
        self.law: Law | None = None
        self.ring = [0.0] * self.build.reference_room
        self.taken, self.used, self.complete = 0, 0, False
        self.fade, self.left, self.last, self.rest = 0, 0, 0.0, 0.0
        self.limits = Limits(self.build.rate, self.build.voltage_limit)
        self.quiet = int(self.build.rate) + 1
        self.seen = False
        self.gain = 0.0
        self.partial, self.busy = bytearray(), False  # busy: set by the link before each sample
        self.queue: deque[bytes] = deque()
        self.queued = 0

    # what comes

    def receive(self, data: bytes) -> None:
        """Bytes of the host, dealt with at once: how many of them a sample may bring is the link's to bound."""
        *whole, rest = data.split(b"\0")
        for piece in whole:
            self.partial += piece[: LONGEST + 1]
            encoded, self.partial = bytes(self.partial), bytearray()
            if encoded and (len(encoded) > LONGEST or not self._frame(encoded)):
                self.once |= BAD_FRAME
        self.partial = (self.partial + rest)[: LONGEST + 1]

    def _frame(self, encoded: bytes) -> bool:
        """Deals with one frame; False: it is none."""
        found = from_frame(encoded)
        if found is None or found[0] not in FROM_HOST:
            return False
        name, layout = FROM_HOST[found[0]]
        if len(found[1]) != layout.size:
            return False
        self.quiet = 0
        if self.flaw.hears is not None and not self.flaw.hears(self, name):
            return True
        fields = layout.unpack(found[1])
        if name == "Heartbeat":
            self.limits.fresh |= fields[0] == self.session
        elif name == "Who":
            self._hello()
        elif name == "Parameters":
            self._answer(name, self._parameters(fields, found[1]), len(self.held) // 8, crc_hqx(self.held, 0xFFFF))
        elif name == "Arm":
            self._answer(name, self._arm(*fields), self.taken, self.build.reference_room)
        elif name == "Reference":
            self._answer(name, self._reference(*fields[:4], fields[4:]), self.taken, self._free())
        elif name == "Run":
            self._answer(name, self._run(fields[0]), self.taken, self.begin)
        else:
            self._answer(name, self._stop(fields[1]) if name == "Stop" else self._clear(), 0, 0)
        return True

    def _answer(self, name: str, status: int, following: int, value: int) -> None:
        fields = {"message": IDENTIFIERS[name], "status": status, "state": self.state}
        self.send("Ack", fields | {"next": following, "value": value})

    def _hello(self) -> None:
        build = self.build
        fields = {"schema": SCHEMA, "firmware": build.firmware, "version": 1, "state": self.state, "fault": self.fault}
        fields |= {"rate": build.rate, "axis_counts": build.axis_counts, "wheel_counts": build.wheel_counts}
        fields |= {"voltage_limit": build.voltage_limit, "parameter_room": build.parameter_room}
        self.send("Hello", fields | {"reference_room": build.reference_room})

    def _free(self) -> int:
        return self.build.reference_room - (self.taken - self.used)

    def _stop(self, mode: int) -> int:
        if self.state == FAULT:
            return WRONG_STATE
        if mode != 1 or self.state == ARMED:
            self.state = IDLE
        elif self.state == RUNNING:
            self.state, self.left = STOPPING, self.fade
        return DONE

    def _clear(self) -> int:
        if self.state != FAULT:
            return WRONG_STATE
        self.state, self.fault = IDLE, 0
        return DONE

    def _parameters(self, fields: tuple[Any, ...], payload: bytes) -> int:
        index, count, total = fields[:3]
        if self.state != IDLE:
            return WRONG_STATE
        if not 1 <= count <= 7 or total > self.build.parameter_room or index + count > total:
            return BAD_VALUE
        if index and (index != len(self.held) // 8 or total != self.total):
            return GAP
        if index == 0:
            self.held, self.total = bytearray(), total
        self.held += payload[8 : 8 + 8 * count]
        return DONE

    def _arm(self, session: int, mode: int, _reserved: int, parameters: int, fade: int) -> int:
        if self.state not in (IDLE, ARMED) or not self.seen:
            return WRONG_STATE
        if mode > 1:
            return BAD_VALUE
        if not self.held or len(self.held) < 8 * self.total:
            return law.NO_PARAMETERS
        p = struct.unpack(f"<{self.total}d", self.held)
        if parameters != crc_hqx(self.held, 0xFFFF) or not law.parameters_fit(p, self.build.rate):
            return law.BAD_PARAMETERS
        if p[9] > self.build.voltage_limit:
            return law.OVER_LIMIT
        self.state, self.session, self.closed, self.fade = ARMED, session, mode == 0, fade
        self.taken, self.used, self.complete, self.ended = 0, 0, False, 0
        self.p, self.law, self.gain = p, Law(p), p[5]
        self.rest = self.last = p[4] if self.closed else 0.0
        self.limits.arm(p)
        return DONE

    def _reference(self, start: int, count: int, last: int, session: int, values: tuple[float, ...]) -> int:
        if self.state not in (ARMED, RUNNING):
            return WRONG_STATE
        if session != self.session:
            return WRONG_SESSION
        if count > 14:
            return BAD_VALUE
        if start != self.taken:
            return GAP
        if self.complete:
            return BAD_VALUE
        if count > self._free():
            return law.FULL
        if not all(map(isfinite, values[:count])):
            return BAD_VALUE
        for value in values[:count]:
            self.ring[self.taken % len(self.ring)] = value
            self.taken += 1
        self.complete = last != 0
        return DONE

    def _run(self, session: int) -> int:
        if self.state not in (ARMED, RUNNING):
            return WRONG_STATE
        if session != self.session:
            return WRONG_SESSION
        if self.state == ARMED:
            if not self.taken:
                return law.NO_REFERENCE
            self.state, self.begin = RUNNING, self.sequence
        return DONE

    # a sample

    def sample(self, time: int, axis: int, wheel: int, valid: bool = True, current: float = nan) -> float:
        """One sample: the voltage (V) to hold up to the next."""
        flaw, limits = self.flaw, self.limits
        if flaw.reading is not None:
            time, axis, wheel, valid = flaw.reading(self, (time, axis, wheel, valid))
        self.seen = True
        limits.track(time, axis, wheel, valid, self.busy)
        if not valid:
            self.once |= INVALID
        if limits.late:
            self.once |= LATE
        if ARMED <= self.state <= STOPPING and flaw.guarded:
            fault, value = limits.verdict(self.voltage, current)
            if fault:
                self._trip(fault, value)
        self.voltage = f32(self._command()) if self.state in (RUNNING, STOPPING) else 0.0
        listened = self.quiet <= int(self.build.rate)
        if listened or ARMED <= self.state <= STOPPING:
            flags = self.once | self.ended | (FADING if self.state == STOPPING else 0)
            self.once = 0
            self._report(time, axis, wheel, current, flags)
        self.quiet += listened
        self.sequence = (self.sequence + 1) & 0xFFFFFFFF
        if flaw.after is not None:
            flaw.after(self)
        return self.voltage if flaw.output is None else flaw.output(self, self.voltage)

    def _trip(self, fault: int, value: float) -> None:
        self.state, self.fault = FAULT, fault
        fields = {"sequence": self.sequence, "time": self.limits.time, "code": fault, "state": FAULT}
        self.send("Fault", fields | {"reserved": 0, "value": f32(value)})

    def _next_reference(self) -> float | None:
        if self.state == RUNNING:
            if self.used < self.taken:
                self.last = self.ring[self.used % len(self.ring)]
                self.used += 1
                return self.last
            self.ended |= FINISHED if self.complete else STARVED
            self.state, self.left = STOPPING, self.fade
        if not self.left:
            return None
        self.left -= 1
        return self.rest + (self.last - self.rest) * self.left / self.fade

    def _command(self) -> float:
        reference, limits = self._next_reference(), self.limits
        if reference is None or self.law is None:
            self.state = IDLE
            return 0.0
        voltage = reference
        if self.closed:
            angle = (limits.axis - limits.zero) * limits.axis_step
            voltage = self.law.voltage(reference, angle, limits.wheel * limits.wheel_step)
            self.gain = self.law.gain
        fault, voltage, clamped = limits.hold(voltage)
        if clamped:
            self.once |= CLAMPED
        if fault and self.flaw.guarded:
            self._trip(fault, voltage)
            return 0.0
        return voltage * self.p[3]

    # what goes

    def _report(self, time: int, axis: int, wheel: int, current: float, flags: int) -> None:
        values = (
            self.sequence,
            time,
            axis,
            wheel,
            self.voltage,
            f32(self.gain),
            current,
            flags,
            self.state,
            self.fault,
        )
        if self.flaw.frame is not None:
            self.send("Sample", dict(zip(TO_HOST["Sample"][2], values, strict=True)))
        else:
            self._queue(0x060, TO_HOST["Sample"][1].pack(*values), QUEUE)

    def send(self, name: str, fields: Fields) -> None:
        identifier, layout, order = TO_HOST[name]
        if self.flaw.frame is not None:
            changed = self.flaw.frame(self, name, fields)
            if changed is None:
                return
            fields = changed
        room = QUEUE if name in ("Sample", "Fault") else QUEUE - KEPT
        self._queue(identifier, layout.pack(*[fields[field] for field in order]), room)

    def _queue(self, identifier: int, payload: bytes, room: int) -> None:
        frame = to_frame(identifier, payload)
        if self.flaw.wire is not None:
            frame = self.flaw.wire(self, frame)
        if self.queued + len(frame) > room:
            self.once |= DROPPED
            return
        self.queue.append(frame)
        self.queued += len(frame)

    def take(self) -> bytes:
        """All that waits to be sent."""
        data = b"".join(self.queue)
        self.queue.clear()
        self.queued = 0
        return data
