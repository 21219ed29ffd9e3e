"""The core compiled for a Cortex-M3 and executed by unicorn; skips without the packages ziglang and unicorn."""

from __future__ import annotations

import functools
import importlib.util
import struct
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from firmware_build import CORE, FLAGS, LOOP, SIM, folder
from swingid.live.guard import Board, Readings
from swingid.numerics.arrays import Array

MEMORY, SIZE = 0x2000_0000, 1 << 20
STACK, STOP, ARRAYS = MEMORY + SIZE - 4096, MEMORY + SIZE - 16, MEMORY + SIZE // 2
TARGET = ["-target", "thumb-freestanding-eabi", "-mcpu=cortex_m3", "-ffreestanding"]


@functools.cache
def image() -> Path:
    """ELF file of the core for a Cortex-M3."""
    for package in ("ziglang", "unicorn"):
        if importlib.util.find_spec(package) is None:
            pytest.skip(
                f"{package} is not installed (pip install 'swingid[cortex]'), which executing for a Cortex-M3 needs"
            )
    target, here = folder() / "cortex-m3.elf", SIM.parent
    sources = [*sorted({*CORE.glob("*.c")} - {LOOP}), SIM, here / "table.c"]
    command = [sys.executable, "-m", "ziglang", "cc", *TARGET, *FLAGS, f"-I{CORE}", *map(str, sources)]
    done = subprocess.run([*command, "-T", str(here / "memory.ld"), "-o", str(target)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return target


class Emulator:
    """A Cortex-M3 with the core in its memory, and the interface of `swingid.live.machine.Machine`.

    No UART and no clock: the functions of hal/sim are called one by one. A double is computed in software.
    """

    def __init__(self, board: Board | None = None) -> None:
        elf = image().read_bytes()
        import unicorn
        from unicorn import arm_const

        self._registers = arm_const
        self._cpu: Any = unicorn.Uc(unicorn.UC_ARCH_ARM, unicorn.UC_MODE_THUMB | unicorn.UC_MODE_MCLASS)
        self._cpu.ctl_set_cpu_model(arm_const.UC_CPU_ARM_CORTEX_M3)
        self._cpu.mem_map(MEMORY, SIZE)
        first, count = struct.unpack_from("<I", elf, 28)[0], struct.unpack_from("<H", elf, 44)[0]
        for i in range(count):  # program headers of an ELF file of 32 bits
            kind, offset, address, _, size = struct.unpack_from("<5I", elf, first + 32 * i)
            if kind == 1 and size:
                self._cpu.mem_write(address, elf[offset : offset + size])
        table = struct.unpack("<6I", bytes(self._cpu.mem_read(MEMORY, 24)))
        self._open, self._receive, self._tick, self._output, self._steps, self._bytes = table
        if board is not None:
            rate, limit = (struct.unpack("<I", struct.pack("<f", x))[0] for x in (board.rate, board.voltage_limit))
            self._call(self._open, rate, board.axis_counts, board.wheel_counts, limit, board.firmware)

    def _call(self, function: int, *arguments: int) -> int:
        """Call a function by the ARM procedure call standard; its result."""
        for i, value in enumerate(arguments[:4]):
            self._cpu.reg_write(getattr(self._registers, f"UC_ARM_REG_R{i}"), value % 2**32)
        for i, value in enumerate(arguments[4:]):
            self._cpu.mem_write(STACK + 4 * i, struct.pack("<I", value % 2**32))
        self._cpu.reg_write(self._registers.UC_ARM_REG_SP, STACK)
        self._cpu.reg_write(self._registers.UC_ARM_REG_LR, STOP | 1)
        self._cpu.emu_start(function | 1, STOP)
        return int(self._cpu.reg_read(self._registers.UC_ARM_REG_R0))

    def receive(self, data: bytes) -> None:
        for start in range(0, len(data), 4096):
            piece = data[start : start + 4096]
            self._cpu.mem_write(self._bytes, piece)
            self._call(self._receive, len(piece))

    def instructions(self, data: bytes) -> int:
        """How many instructions it takes to receive these bytes."""
        counted = [0]

        def count(*_: object) -> None:
            counted[0] += 1

        import unicorn

        hook = self._cpu.hook_add(unicorn.UC_HOOK_CODE, count)
        self.receive(data)
        self._cpu.hook_del(hook)
        return counted[0]

    def tick(self, time: int, readings: Readings) -> float:
        current = struct.unpack("<I", struct.pack("<f", readings.current))[0]
        bits = self._call(self._tick, time, readings.axis, readings.wheel, current, int(readings.valid))
        return float(struct.unpack("<f", struct.pack("<I", bits))[0])

    def output(self) -> bytes:
        size = self._call(self._output)
        return bytes(self._cpu.mem_read(self._bytes, size)) if size else b""

    def steps(self, inputs: Array, state: Array, parameters: Array) -> tuple[Array, Array]:
        """Voltages (n,) and states (n, 8) of so many controller steps."""
        count, width = len(inputs), len(state)
        places, place = [], ARRAYS
        for array in (inputs, state, parameters, np.zeros(count), np.zeros((count, width))):
            data = np.ascontiguousarray(array).tobytes()
            self._cpu.mem_write(place, data)
            places.append(place)
            place += len(data)
        assert place < STACK - 4096
        self._call(self._steps, count, *places)
        voltages = np.frombuffer(bytes(self._cpu.mem_read(places[3], 8 * count)))
        states = np.frombuffer(bytes(self._cpu.mem_read(places[4], 8 * count * width)))
        return voltages, states.reshape(count, width)
