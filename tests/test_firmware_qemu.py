"""The firmware on an emulated board, in lockstep with the twin: startup, tick and UARTs of a Cortex-M of QEMU."""

from __future__ import annotations

import contextlib
import functools
import shutil
import socket
import struct
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from firmware_build import CORE, FIRMWARE, FLAGS, folder
from live_host import RIG, Driver
from swingid import identify
from swingid.control.compensator import Compensator
from swingid.live.codes import FaultCode, Mode, State
from swingid.live.devices.twin import TwinDevice
from swingid.live.guard import Limits, Readings, parameters_of
from swingid.live.plant import Plant, board_of
from swingid.model.rig import Rig
from test_live_twin import frames_of, recording_of

BOARD = board_of(RIG, firmware=77)
PARAMETERS = parameters_of(Compensator.paper(RIG), BOARD, Limits.of(RIG))
HAL = FIRMWARE / "hal" / "qemu"
MACHINES = {
    "mps2-an385": ("-mcpu=cortex-m3",),
    "mps2-an500": ("-mcpu=cortex-m7", "-mfloat-abi=hard", "-mfpu=fpv5-d16"),
}
PROGRAMS = ("qemu-system-arm", "arm-none-eabi-gcc")
MISSING = [name for name in PROGRAMS if shutil.which(name) is None]
INSTALL = "apt-get install gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-system-arm"

pytestmark = pytest.mark.skipif(bool(MISSING), reason=f"{', '.join(MISSING)} not on PATH: {INSTALL}")


@functools.cache
def image(machine: str) -> Path:
    """ELF file of the firmware for a machine; it ticks ten times as often as it samples, so that nothing waits."""
    target = folder() / f"{machine}.elf"
    defines = ["-DFIRMWARE=77", f"-DTICK_RATE={10 * round(BOARD.rate)}"]
    runtime = ["-ffreestanding", "-nostartfiles", "--specs=nano.specs", "--specs=nosys.specs"]
    sources = [*sorted(CORE.glob("*.c")), HAL / "main.c"]
    command = ["arm-none-eabi-gcc", "-mthumb", *MACHINES[machine], *FLAGS, *runtime, *defines, f"-I{CORE}"]
    command += [*map(str, sources), "-T", str(HAL / "memory.ld"), "-o", str(target)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return target


class Emulated:
    """The emulated board with the interface of `Machine`: the plant on its second UART sets the pace."""

    def __init__(self, machine: str) -> None:
        with socket.create_server(("127.0.0.1", 0)) as link, socket.create_server(("127.0.0.1", 0)) as plant:
            link.settimeout(30)
            plant.settimeout(30)
            ports = [f"tcp:127.0.0.1:{server.getsockname()[1]},nodelay=on" for server in (link, plant)]
            serial = [word for port in ports for word in ("-serial", port)]
            command = ["qemu-system-arm", "-M", machine, "-display", "none", "-monitor", "none", *serial]
            self.process = subprocess.Popen([*command, "-kernel", str(image(machine))], stdin=subprocess.DEVNULL)
            self._link, self._plant = link.accept()[0], plant.accept()[0]
        for connection in (self._link, self._plant):
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            connection.settimeout(60)
        self._sent = self._came = self._expected = 0

    def receive(self, data: bytes) -> None:
        self._link.sendall(data)
        self._sent += len(data)

    def tick(self, time: int, readings: Readings) -> float:
        told = (time, readings.axis, readings.wheel, readings.current, int(readings.valid), self._sent % 2**32)
        self._plant.sendall(struct.pack("<IiifII", *told))
        voltage, self._expected = struct.unpack("<fI", exactly(self._plant, 8))
        return float(voltage)

    def output(self) -> bytes:
        data = exactly(self._link, self._expected - self._came)
        self._came = self._expected
        return data

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        self._link.close()
        self._plant.close()


def exactly(connection: socket.socket, size: int) -> bytes:
    data = b""
    while len(data) < size:
        piece = connection.recv(size - len(data))
        assert piece, "the emulated board has ended"
        data += piece
    return data


@contextlib.contextmanager
def emulated(machine: str) -> Iterator[Emulated]:
    device = Emulated(machine)
    try:
        yield device
    finally:
        device.close()


@pytest.mark.parametrize("machine", MACHINES)
def test_the_board_sends_the_bytes_of_the_machine_in_python(machine: str) -> None:
    with emulated(machine) as device:
        frames, found = frames_of(TwinDevice(Plant(RIG), BOARD, machine=device), 1.0)
    assert found == frames_of(TwinDevice(Plant(RIG), BOARD), 1.0)[1]
    assert frames[-1].state == State.IDLE
    assert sum(frame.name == "Sample" and frame.state == State.RUNNING for frame in frames) == 1000


def test_without_a_heartbeat_it_is_0_volts_within_100_ms() -> None:
    with emulated("mps2-an385") as device:
        driver = Driver(device, answers_late=True)
        driver.start([3.0] * 900, PARAMETERS, mode=Mode.OPEN_LOOP)
        assert [driver.tick() for _ in range(5)] == [3.0] * 5
        voltages = [driver.tick(heartbeat=False) for _ in range(110)]
        assert 0.0 in voltages[:100]
        assert not any(voltages[voltages.index(0.0) :])
        assert driver.last("Fault").code == FaultCode.HEARTBEAT


@pytest.mark.long
@pytest.mark.parametrize("name", ["paper", "paper-body"])
def test_the_papers_experiment_over_it_gives_the_twins_inertia(name: str) -> None:
    rig = Rig.load(name)
    assert rig.axis.inertia is not None
    assert board_of(rig, firmware=77) == BOARD
    with emulated("mps2-an500") as device:
        frames, found = frames_of(TwinDevice(Plant(rig), BOARD, machine=device), 25.0)
    assert found == frames_of(TwinDevice(Plant(rig), BOARD), 25.0)[1]
    inertia = identify(recording_of(frames, 25.0), rig, method="momentum").parameters["inertia"]
    low, high = inertia.interval95
    assert low <= rig.axis.inertia.value <= high
    assert abs(inertia.value / rig.axis.inertia.value - 1) < 2e-4
