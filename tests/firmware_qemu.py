"""The firmware built for an emulated board and executed by QEMU; skips without its programs."""

from __future__ import annotations

import functools
import shutil
import socket
import struct
import subprocess
from pathlib import Path

import pytest

from firmware_build import CORE, FIRMWARE, FLAGS, folder
from swingid.live.guard import Readings

HAL, CORTEX = FIRMWARE / "hal" / "qemu", FIRMWARE / "hal" / "cortex"
MACHINES = {
    "mps2-an385": ("-mcpu=cortex-m3",),
    "mps2-an500": ("-mcpu=cortex-m7", "-mfloat-abi=hard", "-mfpu=fpv5-d16"),
}
PROGRAMS = ("qemu-system-arm", "arm-none-eabi-gcc")
MISSING = [name for name in PROGRAMS if shutil.which(name) is None]
INSTALL = "apt-get install gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-system-arm"


@functools.cache
def image(machine: str) -> Path:
    """ELF file of the firmware for a machine; it ticks at 10 kHz, so that nothing waits."""
    if MISSING:
        pytest.skip(f"{', '.join(MISSING)} not on PATH ({INSTALL}), which executing for {machine} needs")
    target = folder() / f"{machine}.elf"
    defines = ["-DFIRMWARE=77", "-DTICK_RATE=10000"]
    runtime = ["-ffreestanding", "-fno-builtin", "-nostdlib", f"-I{CORTEX}", f"-L{FIRMWARE}"]
    sources = [*sorted(CORE.glob("*.c")), HAL / "main.c"]
    command = ["arm-none-eabi-gcc", "-mthumb", *MACHINES[machine], *FLAGS, *runtime, *defines, f"-I{CORE}"]
    command += [*map(str, sources), "-T", str(HAL / "memory.ld"), "-lgcc", "-o", str(target)]
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
