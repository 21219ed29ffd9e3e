"""`odrive://` and `simplefoc://`: drives of the makers' documented lines, their plant the twin, in the test's time."""

from __future__ import annotations

import importlib.util
import math
import socket
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from live_host import RIG
from long_cases import quick_first
from swingid.control.compensator import Compensator
from swingid.errors import DeviceError, UsageError
from swingid.live.codes import FaultCode, State
from swingid.live.devices import line_drives
from swingid.live.devices.host_loop import COUNTS
from swingid.live.devices.line_drives import Hil, LineDrive, ODrive, SimpleFoc
from swingid.live.devices.table import open_device
from swingid.live.guard import Board, Limits, parameters_of
from swingid.live.plant import Plant
from swingid.live.running import Reason
from swingid.live.session import Session

_spec = importlib.util.spec_from_file_location(
    "quanser_hil", Path(__file__).resolve().parents[2] / "examples" / "quanser_hil.py"
)
assert _spec is not None
assert _spec.loader is not None
quanser_hil: Any = importlib.util.module_from_spec(_spec)
sys.modules["quanser_hil"] = quanser_hil
_spec.loader.exec_module(quanser_hil)

RIGHT = RIG.changed({"sensors.counts_per_turn": COUNTS})
GAIN, RATE = 0.02, 250.0


class Bench:
    """The time of the test."""

    def __init__(self) -> None:
        self._time = 0.0

    def now(self) -> float:
        return self._time

    def wait(self, seconds: float) -> None:
        self._time += max(seconds, 0.0)


class Lines:
    """A port whose other end answers lines; the plant goes on by a sample with each question for the axis."""

    virtual, address = False, "port"

    def __init__(self) -> None:
        self.plant = Plant(RIGHT, rate=RATE)
        self.volts, self.enabled, self.silent, self.closed = 0.0, False, False, False
        self.told: list[str] = []
        self._out, self._rest = b"", b""

    def write(self, data: bytes) -> None:
        *lines, self._rest = (self._rest + data).split(b"\n")
        for line in lines:
            self.told.append(line.decode())
            answer = self.take(self.told[-1])
            if answer is not None and not self.silent:
                self._out += answer.encode() + b"\r\n"

    def read(self, timeout: float = 0.0) -> bytes:
        out, self._out = self._out, b""
        return out

    def close(self) -> None:
        self.closed = True

    def moved(self) -> tuple[float, float]:
        """Turns of axis and wheel at the next sample."""
        self.plant.hold(self.volts if self.enabled else 0.0)
        found = self.plant.read()
        return found.axis / COUNTS, found.wheel / COUNTS

    def take(self, line: str) -> str | None:
        raise NotImplementedError


class FakeODrive(Lines):
    """Firmware 0.5: f, c, u, r, w of its ASCII protocol."""

    def __init__(self, watchdog: bool = True) -> None:
        super().__init__()
        self.properties = {"axis0.error": "0", "axis0.requested_state": "1"}
        self._watchdog, self._wheel = watchdog, 0.0

    def take(self, line: str) -> str | None:
        word, *rest = line.split()
        if word == "w":
            if "watchdog" not in rest[0] or self._watchdog:
                self.properties[rest[0]] = rest[1]
            self.enabled = self.properties["axis0.requested_state"] == "8"
            return None
        if word == "r":
            return self.properties.get(rest[0], "invalid property")
        if word == "c":
            assert rest[0] == "0"
            self.volts = float(rest[1]) / GAIN
            return None
        if word == "f":
            if rest == ["1"]:
                axis, self._wheel = self.moved()
                return f"{axis:.6f} 0.000000"
            return f"{self._wheel:.6f} 0.000000"
        assert word == "u"
        return None


class FakeSimpleFoc(Lines):
    """The Commander with a motor M in voltage control, and the sketch's own A and W."""

    def __init__(self, watchdog: str | None = "100") -> None:
        super().__init__()
        self.modes: set[str] = set()
        self._watchdog = watchdog

    def take(self, line: str) -> str | None:
        if line == "A":
            return ",".join(f"{2 * math.pi * turns:.6f}" for turns in self.moved())
        if line == "W":
            return self._watchdog
        if line in ("ME0", "ME1"):
            self.enabled = line == "ME1"
        elif line in ("@0", "MC0", "MT0"):
            self.modes.add(line)
        else:
            self.volts = float(line.removeprefix("M"))
        return None


class Card:
    """Quanser's board as its documentation describes it, the rig behind it; dog: whether its watchdog has expired."""

    def __init__(self, lines: FakeHil) -> None:
        self._lines, self.expired, self.started = lines, False, 0.0

    def watchdog_set_analog_expiration_state(self, channels: Any, count: int, states: Any) -> None:
        assert (list(channels), count, list(states)) == ([0], 1, [0.0])

    watchdog_set_digital_expiration_state = watchdog_set_analog_expiration_state

    def watchdog_start(self, timeout: float) -> None:
        self.started = timeout

    def watchdog_reload(self) -> bool:
        return not self.expired

    def watchdog_clear(self) -> None:
        self.expired = False

    def read_encoder(self, channels: Any, count: int, buffer: Any) -> None:
        assert (list(channels), count) == ([1, 0], 2)
        axis, wheel = self._lines.moved()
        buffer[0], buffer[1] = round(axis * COUNTS), round(wheel * COUNTS)

    def write_analog(self, channels: Any, count: int, buffer: Any) -> None:
        self._lines.volts = buffer[0]

    def write_digital(self, lines: Any, count: int, buffer: Any) -> None:
        self._lines.enabled = bool(buffer[0])


class FakeHil(Lines):
    """The program examples/quanser_hil.py with its board."""

    def __init__(self, limit: float = 10.0) -> None:
        super().__init__()
        self.card, self._limit = Card(self), limit
        self.board = quanser_hil.Board(self.card, axis=1, wheel=0)

    def take(self, line: str) -> str | None:
        return quanser_hil.answer(self.board, line, (COUNTS, COUNTS), self._limit)


def hil(lines: Lines) -> LineDrive:
    return Hil(lines, "hil://bench:8700", RATE, steady=Bench())


def odrive(lines: Lines) -> LineDrive:
    board = Board(RATE, COUNTS, COUNTS, 10.0, 6)
    return ODrive(lines, "odrive://port", board, nm_per_volt=GAIN, motor=0, axis=1, steady=Bench())


def simplefoc(lines: Lines) -> LineDrive:
    return SimpleFoc(lines, "simplefoc://port", Board(RATE, COUNTS, COUNTS, 10.0, 7), steady=Bench())


MAKERS = {"odrive": (FakeODrive, odrive), "simplefoc": (FakeSimpleFoc, simplefoc), "hil": (FakeHil, hil)}


def session_on(name: str) -> tuple[Any, Any, Session]:
    fake, maker = MAKERS[name]
    lines = fake()
    device: Any = maker(lines)
    device.virtual, device.clock = True, device._steady.now
    session = Session(device)
    board = session.connect()
    session.load(parameters_of(Compensator.paper(RIGHT, sample_time=1 / RATE), board, Limits.of(RIGHT)))
    return lines, device, session


@pytest.mark.parametrize("name", MAKERS)
def test_a_run_follows_its_reference_and_lets_go_at_its_end(name: str) -> None:
    lines, device, session = session_on(name)
    assert not lines.enabled
    reference = 0.3 * np.sin(8.5 * np.arange(round(6 * RATE)) / RATE)
    run = session.run(reference)
    assert run.end.reason is Reason.FINISHED, run.end.sentence
    angle = np.array([sample.axis for sample in run.samples]) * 2 * math.pi / COUNTS
    late = slice(round(4 * RATE), round(6 * RATE))
    assert np.sqrt(np.mean((angle[late] - reference[late]) ** 2)) < 0.25 * 0.3
    assert not lines.enabled
    assert lines.volts == 0.0
    session.close()
    assert lines.closed
    assert device.machine.state is State.IDLE


@pytest.mark.parametrize("name", MAKERS)
def test_a_drive_that_stops_answering_ends_the_run_without_torque(name: str) -> None:
    lines, device, session = session_on(name)

    def silence(_: object) -> None:
        lines.silent = device.machine.state is State.RUNNING

    run = session.run(0.3 * np.sin(np.arange(1000) * 0.034), on_batch=silence)
    assert run.end.fault is FaultCode.ENCODER
    assert not lines.enabled


NOISE = (
    "\xff\x00?",
    "1e308 1e308",
    "1e308,1e308,1e308",
    "1e999 0 0",
    "nan nan nan",
    "1",
    "",
    "9e15,9e15,0",
    "1 2 3 4 5",
)


@pytest.mark.parametrize("often", quick_first(1, [2, 1, 97]))
@pytest.mark.parametrize("noise", NOISE)
@pytest.mark.parametrize("name", MAKERS)
def test_noise_on_the_line_ends_a_run_without_torque_or_costs_a_sample(name: str, noise: str, often: int) -> None:
    """One answer of `often`: single ones are bridged or end the run, but are no errors of the program."""
    lines, device, session = session_on(name)
    answers, sound = 0, lines.take

    def damaged(line: str) -> str | None:
        nonlocal answers
        answer = sound(line)
        if answer is None or device.machine.state is not State.RUNNING:
            return answer
        answers += 1
        return noise if answers % often == 0 else answer

    lines.take = damaged
    run = session.run(0.1 * np.sin(np.arange(600) * 0.034))
    assert answers > 0
    ended = run.end.reason is Reason.LOST or run.end.fault is not FaultCode.NONE
    assert ended or (often > 1 and run.end.reason is Reason.FINISHED)
    assert not lines.enabled
    assert lines.volts == 0.0


def test_an_error_of_an_odrive_ends_the_run() -> None:
    lines, device, session = session_on("odrive")

    def trip(_: object) -> None:
        if device.machine.state is State.RUNNING:
            lines.properties["axis0.error"] = "2048"

    run = session.run(0.3 * np.sin(np.arange(1000) * 0.034), on_batch=trip)
    assert run.end.reason is Reason.LOST
    assert "0x800" in run.end.sentence
    session.close()
    assert not lines.enabled


def test_an_odrive_is_enabled_after_a_wait_for_its_host_but_not_with_another_error() -> None:
    lines, device, _ = session_on("odrive")
    lines.properties["axis0.error"] = "2048"
    device._drive_by(0.0)
    assert lines.enabled
    lines, device, _ = session_on("odrive")
    lines.properties["axis0.error"] = "64"
    with pytest.raises(DeviceError, match="0x40"):
        device._drive_by(0.0)
    assert not lines.enabled


@pytest.mark.parametrize(
    ("maker", "lines"),
    [
        (odrive, FakeODrive(watchdog=False)),
        (simplefoc, FakeSimpleFoc(watchdog="2000")),
        (simplefoc, FakeSimpleFoc(None)),
        (hil, FakeHil(limit=0.0)),
    ],
)
def test_a_drive_without_a_watchdog_is_refused(maker: Any, lines: Lines, monkeypatch: Any) -> None:
    monkeypatch.setattr(line_drives, "PATIENCE", 0.01)
    with pytest.raises(DeviceError) as error:
        maker(lines)
    assert error.value.code == "no-watchdog"


def test_a_board_whose_watchdog_has_expired_is_off_until_it_is_enabled_again() -> None:
    lines = FakeHil()
    assert lines.card.started == 0.1
    for line in ("E,1", "U,3"):
        assert lines.take(line) is None
    assert (lines.enabled, lines.volts) == (True, 3.0)
    lines.card.expired = True
    lines.take("U,3")
    assert (lines.enabled, lines.volts, lines.card.expired) == (False, 3.0, False)
    lines.take("U,1e9")
    assert lines.volts == 10.0
    for line in ("E,1", "nonsense"):
        lines.take(line)
    assert (lines.enabled, lines.volts) == (False, 0.0)


def test_lines_of_csv_on_tcp() -> None:
    """The program's own server on a port of this machine: what it says of itself, and that a silent host is off."""
    lines = FakeHil()
    with socket.create_server(("127.0.0.1", 0)) as listening:

        def serve(port: socket.socket = listening) -> None:
            with suppress(OSError):  # the test's end closes the port
                quanser_hil.serve(lines.board, port, (4096, 8192), 8.0)

        threading.Thread(target=serve, daemon=True).start()
        device = open_device(f"hil://127.0.0.1:{listening.getsockname()[1]}?rate=100")
        board: Any = device
        assert (board.board.axis_counts, board.board.wheel_counts, board.board.voltage_limit) == (4096, 8192, 8.0)
        board._tell("E,1", "U,2")
        until = time.monotonic() + 5.0
        while not lines.enabled and time.monotonic() < until:
            time.sleep(0.01)
        assert lines.enabled
        while lines.enabled and time.monotonic() < until:  # nothing more is sent
            time.sleep(0.01)
        assert (lines.enabled, lines.volts) == (False, 0.0)
        device.close()


@pytest.mark.parametrize(
    "address",
    [
        "odrive:///dev/nothing",
        "odrive:///dev/nothing?nm_per_volt=0.1&motor=1",
        "odrive:///dev/nothing?nm_per_volt=0.1&rate=5000",
        "simplefoc:///dev/nothing?limit=0",
        "simplefoc:///dev/nothing?nm_per_volt=1",
        "hil://bench:8700?rate=5000",
        "hil://bench",
    ],
)
def test_bad_addresses_are_refused(address: str) -> None:
    with pytest.raises(UsageError) as error:
        open_device(address)
    assert error.value.code == "bad-address"
