"""The firmware as a process on a pseudo terminal and a TCP port: the bytes of the machine in Python."""

from __future__ import annotations

import contextlib
import os
import socket
import struct
import subprocess
import sys
from collections.abc import Iterator

import numpy as np
import pytest

from firmware_build import NATIVE, build
from live_host import Driver, encode, experiment
from swingid.control.compensator import Compensator
from swingid.control.references.parse import parse_reference
from swingid.live.codes import FaultCode, Mode, State
from swingid.live.devices.twin import TwinDevice
from swingid.live.frames import Frame
from swingid.live.guard import Board, Limits, Readings, parameters_of
from swingid.live.plant import Plant, board_of
from swingid.model.rig import Rig

if sys.platform == "win32":
    pytest.skip("pseudo terminals are POSIX", allow_module_level=True)

RIG = Rig.load("paper")
BOARD = board_of(RIG, firmware=77)
SINE = parse_reference("sine 0.8 rad 8.5 rad/s")


class NativeDevice:
    """The process, with the interface of `Machine`: in lockstep, so that it can be compared byte by byte."""

    def __init__(self, board: Board, link: str) -> None:
        program = build((NATIVE,))
        options = ["--rate", f"{board.rate:g}", "--counts", str(board.axis_counts), str(board.wheel_counts)]
        options += ["--limit", f"{board.voltage_limit:g}", "--firmware", str(board.firmware)]
        where = ["--pty"] if link == "pty" else ["--tcp", "0"]
        self.process = subprocess.Popen([str(program), *where, "--plant", "0", *options], stdout=subprocess.PIPE)
        assert self.process.stdout is not None
        address = self.process.stdout.readline().decode().split()[1]
        port = int(self.process.stdout.readline().split()[1])
        self._plant = socket.create_connection(("127.0.0.1", port))
        self._plant.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._lost = False
        if link == "pty":
            self._link = os.open(address, os.O_RDWR | os.O_NOCTTY)
        else:
            self._address = address.split(":")
            self.plug_in()
        self._sent = self._came = self._expected = 0

    def plug_in(self) -> None:
        self._socket = socket.create_connection((self._address[0], int(self._address[1])))
        self._link = self._socket.fileno()
        self._lost = False

    def unplug(self) -> None:
        self._socket.close()
        self._lost = True

    def receive(self, data: bytes) -> None:
        self._sent += os.write(self._link, data)

    def tick(self, time: int, readings: Readings) -> float:
        valid = int(readings.valid)
        told = struct.pack("<IiifII", time, readings.axis, readings.wheel, readings.current, valid, self._sent)
        self._plant.sendall(told)
        answer = b""
        while len(answer) < 8:
            answer += self._plant.recv(8 - len(answer))
        voltage, self._expected = struct.unpack("<fI", answer)
        return float(voltage)

    def output(self) -> bytes:
        data = b""
        if self._lost:
            self._came = self._expected
        while self._came < self._expected:
            piece = os.read(self._link, self._expected - self._came)
            self._came += len(piece)
            data += piece
        return data

    def close(self) -> None:
        self._plant.close()
        assert self.process.wait(10) == 0
        assert self.process.stdout is not None
        self.process.stdout.close()
        if hasattr(self, "_socket"):
            self._socket.close()
        else:
            os.close(self._link)


@contextlib.contextmanager
def native(link: str) -> Iterator[NativeDevice]:
    device = NativeDevice(BOARD, link)
    try:
        yield device
    finally:
        if device.process.poll() is None and sys.exc_info()[0] is not None:
            device.process.kill()
        device.close() if sys.exc_info()[0] is None else device.process.wait()


def run(machine: NativeDevice | None, seconds: float, seed: int = 0) -> tuple[list[Frame], bytes]:
    parameters = parameters_of(Compensator.paper(RIG), BOARD, Limits.of(RIG))
    reference = SINE(np.arange(int(seconds * 1000)) / 1000.0)
    return experiment(TwinDevice(Plant(RIG, seed=seed), BOARD, machine=machine), parameters, reference)


@pytest.mark.parametrize("link", ["pty", "tcp"])
def test_the_process_sends_the_bytes_of_the_machine_in_python(link: str) -> None:
    with native(link) as device:
        frames, found = run(device, 2.0)
    assert found == run(None, 2.0)[1]
    assert frames[-1].state == State.IDLE
    assert sum(frame.name == "Sample" and frame.state == State.RUNNING for frame in frames) == 2000


@pytest.mark.long
@pytest.mark.parametrize("link", ["pty", "tcp"])
def test_the_papers_experiment_twice_gives_the_same_bytes(link: str) -> None:
    expected = run(None, 25.0, seed=4)[1]
    for _ in range(2):
        with native(link) as device:
            assert run(device, 25.0, seed=4)[1] == expected


def test_an_unplugged_host_is_0_volts_in_100_ms_and_the_next_one_finds_the_fault() -> None:
    with native("tcp") as device:
        driver = Driver(device, answers_late=True)
        driver.start([3.0] * 900, parameters_of(Compensator.paper(RIG), BOARD, Limits.of(RIG)), mode=Mode.OPEN_LOOP)
        assert [driver.tick() for _ in range(5)] == [3.0] * 5
        device.unplug()
        voltages = [driver.tick(heartbeat=False) for _ in range(120)]
        assert 0.0 in voltages[:100]
        assert not any(voltages[voltages.index(0.0) :])
        device.plug_in()
        driver.tick(heartbeat=False)
        driver.tell(encode("Who"))
        driver.tick()
        assert (driver.last("Hello").state, driver.last("Hello").fault) == (State.FAULT, FaultCode.HEARTBEAT)


@pytest.mark.parametrize("options", [[], ["--pty", "--tcp", "0", "--plant", "0"], ["--pty"], ["--rate", "x"], ["--x"]])
def test_wrong_options_are_refused(options: list[str]) -> None:
    done = subprocess.run([str(build((NATIVE,))), *options], capture_output=True, text=True, timeout=10)
    assert done.returncode == 2
    assert "swingid-native" in done.stderr
