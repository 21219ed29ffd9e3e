"""A host in a few lines, for tests of devices: the frames of a run, and a board that ticks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import pytest

from swingid.control.compensator import Compensator
from swingid.live.codes import Mode, Status
from swingid.live.frames import Decoder, Frame, checksum, encode
from swingid.live.guard import Board, Limits, Readings, parameters_of
from swingid.live.schema import schema
from swingid.model.rig import Rig

for package in ("cantools", "cobs", "fastcrc"):
    pytest.importorskip(package, reason=f"{package} is not installed: pip install 'swingid[live]'")

RIG = Rig.load("paper")
BOARD = Board()
LIMITS = Limits.of(RIG)
PARAMETERS = parameters_of(Compensator.paper(RIG), BOARD, LIMITS)
PERIOD = 1000  # us
STILL = Readings(0, 0)
RUN = schema().by_name["Run"].id


class Device(Protocol):
    """What the firmware's core and its twin in Python have in common."""

    busy: bool

    def receive(self, data: bytes) -> None: ...

    def tick(self, time: int, readings: Readings) -> float: ...

    def output(self) -> bytes: ...


def parameter_frames(parameters: Any = PARAMETERS) -> bytes:
    total = len(parameters)
    parts = [parameters[i : i + 7] for i in range(0, total, 7)]
    return b"".join(
        encode("Parameters", index=7 * i, count=len(part), total=total, value=tuple(part))
        for i, part in enumerate(parts)
    )


def arm_frame(parameters: Any = PARAMETERS, **values: Any) -> bytes:
    crc = checksum(np.asarray(parameters).tobytes())
    return encode("Arm", **{"session": 7, "mode": Mode.CLOSED_LOOP, "parameters": crc, "fade": 50, **values})


def reference_frames(samples: Any, *, session: int = 7, start: int = 0, last: bool = True) -> bytes:
    samples = [float(np.float32(x)) for x in samples]
    out = b""
    for i in range(0, len(samples), 14):
        part = samples[i : i + 14]
        ends = last and i + 14 >= len(samples)
        out += encode("Reference", start=start + i, count=len(part), last=int(ends), session=session, value=tuple(part))
    return out


@dataclass
class Driver:
    """A host and a board around a device: time goes on by a period per tick.

    answers_late: answers come with the next sample, as from a process.
    """

    device: Device
    time: int = 0
    answers_late: bool = False

    def __post_init__(self) -> None:
        self.decoder = Decoder()
        self.frames: list[Frame] = []

    def tell(self, data: bytes) -> None:
        for frame in data.split(b"\0")[:-1]:  # one by one: a device holds the answers to some forty
            self.device.receive(frame + b"\0")
            self.frames += self.decoder.feed(self.device.output())

    def tick(self, readings: Readings = STILL, *, heartbeat: bool = True, step: int = PERIOD) -> float:
        if heartbeat:
            self.device.receive(encode("Heartbeat", session=7))
        self.time = (self.time + step) % 2**32
        voltage = self.device.tick(self.time, readings)
        self.frames += self.decoder.feed(self.device.output())
        return voltage

    def last(self, name: str) -> Frame:
        return next(frame for frame in reversed(self.frames) if frame.name == name)

    def start(self, samples: Any, parameters: Any = PARAMETERS, **arm: Any) -> None:
        self.tick()
        self.tell(parameter_frames(parameters) + arm_frame(parameters, **arm) + reference_frames(samples))
        self.tell(encode("Run", session=7))
        if self.answers_late:  # it takes so many bytes per sample
            while not any(frame.name == "Ack" and frame.message == RUN for frame in self.frames):
                self.tick()
            return
        assert [frame.status for frame in self.frames if frame.name == "Ack"] == [Status.DONE] * (
            2 + -(-len(parameters) // 7) + -(-len(samples) // 14)
        )


class Stream(Protocol):
    """A connection to a device."""

    def write(self, data: bytes) -> None: ...

    def read(self, timeout: float = 0.0) -> bytes: ...


def experiment(stream: Stream, parameters: Any, samples: Any, *, fade: int = 100) -> tuple[list[Frame], bytes]:
    """A whole run over a stream: parameters, arm, reference as there is room, heartbeats; all frames and bytes."""
    decoder, frames, data = Decoder(), [], bytearray()

    def talk(out: bytes, timeout: float = 0.002) -> None:
        stream.write(out)
        came = stream.read(timeout)
        data.extend(came)
        frames.extend(decoder.feed(came))

    samples = [float(np.float32(x)) for x in samples]
    talk(encode("Who"))
    talk(parameter_frames(parameters))
    talk(arm_frame(parameters, fade=fade))
    sent, start = 0, None
    while not (start is not None and frames[-1].name == "Sample" and frames[-1].state in (0, 4)):
        out = encode("Heartbeat", session=7)
        if sent < len(samples):
            status = next((f for f in reversed(frames) if f.name == "Ack" and f.message == 0x51), None)
            wanted = 0 if status is None else status.next
            room = 1024 if status is None else status.value
            for _ in range(min(8, room // 14)):
                part = samples[wanted : wanted + 14]
                if part:
                    out += reference_frames(part, start=wanted, last=wanted + 14 >= len(samples))
                wanted += len(part)
            sent = wanted
        if start is None and sent >= min(len(samples), 500):
            out += encode("Run", session=7)
            start = True
        talk(out, 0.016)
    assert decoder.bad == 0
    return frames, bytes(data)
