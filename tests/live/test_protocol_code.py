"""docs/protocol.md against the machine and the C core: its code is run, its session is replayed."""

from __future__ import annotations

import math
import re
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import protocol_page as its
from firmware_build import CoreDevice
from live_host import BOARD, PARAMETERS
from protocol_page import namespace, page, shown, table
from swingid.control import law
from swingid.live import codes, frames, guard
from swingid.live.codes import Mode, State, StopMode
from swingid.live.frames import encode
from swingid.live.guard import Readings
from swingid.live.machine import Machine

DEVICES = pytest.mark.parametrize("kind", [Machine, CoreDevice], ids=["python", "c"])
CODE = namespace()


def test_the_frames_of_the_page_are_those_of_the_code() -> None:
    assert CODE["crc16"](b"123456789") == 0x29B1
    rng = np.random.default_rng(3)
    for _ in range(300):
        identifier, size = int(rng.integers(0, 2048)), int(rng.integers(4, 65))
        payload = bytes(rng.choice([0, 0, 1, 255, rng.integers(256)], size=size).astype(np.uint8))
        encoded = CODE["frame"](identifier, payload)
        assert encoded == frames.wrap(identifier, payload)
        assert len(encoded) == len(payload) + 6
        assert CODE["uncobs"](encoded[:-1])[2:-2] == payload
        damaged = rng.bytes(int(rng.integers(1, 60))).replace(b"\0", b"\1")
        ours, theirs = CODE["uncobs"](damaged), frames._codec()
        try:
            assert ours == theirs[1](damaged)
        except theirs[3]:
            assert ours is None
    assert f"longest is {frames.MOST_ENCODED} bytes" in page()


@pytest.mark.parametrize("order", range(5))
def test_the_control_law_of_the_page_is_that_of_the_code_to_the_last_bit(order: int) -> None:
    rng = np.random.default_rng(order)
    for _ in range(30):
        p = np.concatenate([PARAMETERS[:32], rng.uniform(0.5, 2.0, 2 * order + 1)])
        p[guard.CONTROLLER + law.ORDER] = order
        p[guard.CONTROLLER + law.SIGMA0] = 10.0 ** rng.uniform(-2, 1)
        p[guard.CONTROLLER + law.LAMBDA0] = 10.0 ** rng.uniform(0, 2)
        p[guard.CONTROLLER + law.K_TILDE_MAX] = rng.choice([1.1, math.inf])
        p[guard.CONTROLLER + law.ERROR_DECAY] = rng.choice([0.0, 0.5])
        p[guard.CONTROLLER + law.WHEEL_DECAY] = rng.choice([0.0, 0.7])
        p[guard.CONTROLLER + law.DIFFERENTIATE_GAIN] = rng.choice([0.0, 1.0])
        state, mine = np.zeros(law.XI + guard.MOST_ORDER), [0.0] * 8
        state[law.K_TILDE] = mine[0] = 1.0
        wheel = 0.0
        for _ in range(60):
            reference, angle = (float(x) for x in rng.uniform(-0.5, 0.5, 2))
            wheel += float(rng.choice([0.0, *rng.normal(0, 0.1, 2)]))
            voltage = law.compensator_step(reference, angle, wheel, state, p[guard.CONTROLLER :])
            assert CODE["control"](reference, angle, wheel, mine, p.tolist()) == voltage
            assert mine == state.tolist()


class Follower:
    """The page's device beside a `Machine`: messages go to the machine, and what they do is done as the page says."""

    def __init__(self) -> None:
        self.machine, self.decoder = Machine(BOARD), frames.Decoder()
        self.d = SimpleNamespace(output=bytearray())
        CODE["reset"](self.d)

    def tell(self, name: str, **values: Any) -> None:
        self.machine.receive(encode(name, **values))
        (ack,) = self.decoder.feed(self.machine.output()) or [None]
        self.d.quiet = 0
        state = self.d.state
        if name == "Heartbeat" and values["session"] == self.d.session:
            self.d.fresh = True
        if ack is None or ack.status != codes.Status.DONE:
            return
        d = self.d
        if name == "Parameters":
            if values["index"] == 0:
                d.parameters, d.total = [], values["total"]
            d.parameters = d.parameters + list(values["value"])
        elif name == "Arm":
            CODE["arm"](d, values["session"], Mode(values["mode"]).name.lower(), values["fade"])
        elif name == "Reference":
            for value in values["value"]:
                d.reference[d.taken % 1024] = float(np.float32(value))
                d.taken += 1
            d.complete = values["last"] != 0
        elif name == "Run" and state == "armed":
            d.state, d.begin = "running", d.sequence
        elif name == "Clear":
            d.state, d.fault = "idle", "none"
        elif name == "Stop" and (values["mode"] != StopMode.SOFT or state == "armed"):
            d.state = "idle"
        elif name == "Stop" and state == "running":
            d.state, d.left = "stopping", d.fade
        assert State(ack.state).name.lower() == d.state

    def sample(self, time: int, readings: Readings) -> str:
        mine = CODE["sample"](self.d, time, readings.axis, readings.wheel, readings.current, readings.valid)
        assert mine == self.machine.tick(time, readings)
        assert bytes(self.d.output) == self.machine.output()
        self.d.output.clear()
        return str(self.d.fault)


DRIVEN = ("axis_frozen", "wheel_frozen", "no wheel")


def troubled(p: np.ndarray, trouble: str, rng: np.random.Generator) -> None:
    """Limits of the guard that this fault passes before any other."""
    p[guard.START_GAIN], p[guard.REST] = rng.uniform(0, 5), rng.uniform(-0.1, 0.1)
    p[guard.SPEED_SPAN], p[guard.VOLTAGE_SIGN] = rng.integers(1, 32), rng.choice([-1.0, 1.0])
    p[guard.CURRENT_LIMIT], p[guard.FROZEN_VOLTAGE] = 2.0, 5.0 if trouble in DRIVEN else 20.0
    p[guard.FROZEN_SAMPLES] = rng.integers(1, 5)
    p[guard.SATURATED_SAMPLES] = rng.integers(0, 5) if trouble == "voltage" else 1000
    if trouble == "angle":
        p[guard.ANGLE_LIMIT] = 0.05
    if trouble == "no wheel":
        p[guard.WHEEL_STEP] = 0.0
    if trouble == "not finite":
        p[guard.CONTROLLER + law.ALPHA], p[guard.CONTROLLER + law.SIGMA0] = 1e300, 1e300
        p[guard.CONTROLLER + law.LIMIT] = math.inf


def reading(axis: int, wheel: int, trouble: str, rng: np.random.Generator) -> Readings:
    """The next sample's readings, in trouble or, where it is "", not."""
    axis += {"axis_frozen": 0, "angle": 30, "speed": 60, "axis_jump": 400}.get(trouble, int(rng.integers(-3, 4)))
    wheel += {"wheel_frozen": 0, "no wheel": 0, "wheel_speed": 1400, "wheel_jump": 9000}.get(
        trouble, int(rng.integers(1, 10))
    )
    current = float(rng.choice([3.0, -3.0])) if trouble == "current" else float(rng.choice([0.5, math.nan]))
    return Readings(guard.apart(axis, 0), guard.apart(wheel, 0), current, trouble != "encoder")


def session_of(trouble: str, rng: np.random.Generator) -> set[str]:
    """Random messages and samples with a trouble; the faults that came. Both devices give the same bytes."""
    both, p, came = Follower(), PARAMETERS.copy(), set()
    troubled(p, trouble, rng)
    time, axis, wheel = int(rng.integers(2**32)), int(rng.integers(-(2**31), 2**31)), int(rng.integers(-(2**31), 2**31))
    p[guard.AXIS_ZERO] = axis
    volts = 12.0 if trouble == "voltage" else 8.0 if trouble in DRIVEN else 1.0
    for step in range(390):
        turn = step % 130
        if turn == 1:
            both.tell("Clear", session=0)
            for i in range(0, 35, 7):
                both.tell("Parameters", index=i, count=7, total=35, value=tuple(p[i : i + 7].tolist()))
            mode = Mode.CLOSED_LOOP if trouble == "not finite" else Mode.OPEN_LOOP if volts > 1 else rng.integers(2)
            crc = frames.checksum(p.astype("<f8").tobytes())
            both.tell("Arm", session=7, mode=int(mode), parameters=crc, fade=int(rng.integers(0, 9)))
        elif turn in (3, 4, 5):
            value = tuple(rng.uniform(0.9, 1.0, 14) * volts)
            last = int(turn == 5 and rng.random() < 0.5)
            both.tell("Reference", start=both.d.taken, count=14, last=last, session=7, value=value)
        elif turn == 7 and trouble != "heartbeat":
            both.tell("Run", session=7)
            if rng.random() < 0.2:
                both.tell("Stop", session=0, mode=StopMode.SOFT)  # before a reference was used
        elif rng.random() < 0.003:
            both.tell("Stop", session=0, mode=int(rng.integers(3)))
        if turn == 1 or (step and trouble != "heartbeat" and rng.random() < 0.4):
            both.tell("Heartbeat", session=int(rng.choice([7, 7, 7, 8])))
        now = trouble if turn > 15 and step < 300 else ""
        time = (time + (1501 if now == "overrun" else 1000)) % 2**32
        readings = reading(axis, wheel, now, rng)
        axis, wheel = readings.axis, readings.wheel
        both.machine.busy = both.d.busy = bool(rng.random() < 0.3)
        came.add(both.sample(time, readings))
    return came


def test_the_page_falls_silent_when_the_machine_does() -> None:
    both = Follower()
    for step in range(1300):
        if step == 200:
            both.tell("Clear", session=0)
        both.sample(1000 * step, Readings(step, 0))
    assert both.d.sequence == 1300


FAULTS = {one.name.lower(): one.name.lower() for one in codes.FaultCode}
TROUBLES = {**FAULTS, "not finite": "voltage", "no wheel": "none"}


@pytest.mark.parametrize("trouble", TROUBLES)
def test_the_sample_of_the_page_gives_the_bytes_of_the_machine(trouble: str) -> None:
    came: set[str] = set()
    for seed in range(6):
        came |= session_of(trouble, np.random.default_rng(seed))
    assert came >= {"none", TROUBLES[trouble]}
    assert trouble != "no wheel" or "wheel_frozen" not in came


def test_faults_stand_in_the_order_in_which_they_are_decided() -> None:
    code = its.sections()
    check = code[code.index("def check(") : code.index("def within(")]
    rows = [row["fault"] for row in table("Guard", "order")]
    assert [name for name in re.findall(r'return "(\w+)"', check) if name != "none"] == rows[:-1]
    assert rows[-1] == "voltage"
    assert set(rows) == {one.name.lower() for one in codes.FaultCode} - {"none"}
    assert [int(row["order"]) for row in table("Guard", "order")] == list(range(1, len(rows) + 1))


@DEVICES
def test_the_session_on_the_page_is_what_a_device_does(kind: Any) -> None:
    """The lines of the page, read as a second implementer reads them."""
    device, sent, out = kind(BOARD), b"", b""
    lines = shown("session").splitlines()
    kinds = {"Sample": 0, "Ack": 0, "Hello": 0}
    for i, line in enumerate(lines):
        if line[:1] not in "><=" or not line:
            continue
        data = b"".join(bytes.fromhex(more) for more in _indented(lines[i + 1 :]))
        if line[0] == ">":
            device.receive(data)
            out += device.output()
        elif line[0] == "=":
            numbers_of_line = [int(x) for x in re.findall(r"(?:time|axis|wheel) (-?\d+)", line)]
            volts = device.tick(numbers_of_line[0], Readings(*numbers_of_line[1:]))
            assert float(line.split(": ")[1].removesuffix(" V")) == volts
            out += device.output()
        else:
            sent += data
            kinds[line[2:].split(":")[0]] += 1
    assert sent == out
    assert kinds["Hello"] == 1
    assert min(kinds.values()) > 0
    assert kinds["Sample"] == 10


def _indented(lines: list[str]) -> list[str]:
    end = next((i for i, line in enumerate(lines) if not line.startswith("  ")), len(lines))
    return lines[:end]
