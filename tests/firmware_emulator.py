"""The core compiled for a Cortex-M and executed by unicorn; skips without unicorn or a compiler."""

from __future__ import annotations

import functools
import importlib.util
import math
import shutil
import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from firmware_build import CORE, FLAGS, LOOP, SIM, folder
from swingid.live.guard import Board, Readings
from swingid.numerics.arrays import Array

MEMORY, SIZE = 0x2000_0000, 1 << 20
STACK, STOP, ARRAYS = MEMORY + SIZE - 4096, MEMORY + SIZE - 16, MEMORY + SIZE // 2
CPUS = {"cortex-m3": "CORTEX_M3", "cortex-m0plus": "CORTEX_M0"}
"""Processors by the name of gcc, and unicorn's; a Cortex-M0+ has the instructions of an M0."""

HERE = SIM.parent

EXACT = importlib.util.find_spec("ziglang") is not None
"""Whether every double has the bits of IEEE 754. Those of gcc's library for processors without doubles have not, where
a power of two less a number that is smaller by 2^33 and more is rounded: 1 unit in the last place, once in 20 000 steps
of a controller of order 2 and more, whose exponentials have such sums.
"""


@functools.cache
def image(cpu: str = "cortex-m3") -> Path:
    """ELF file of the core for a processor, by ziglang, or by arm-none-eabi-gcc where that is not installed."""
    if importlib.util.find_spec("unicorn") is None:
        pytest.skip("unicorn is not installed (pip install 'swingid[cortex]'), which executing for a Cortex-M needs")
    if EXACT:
        name = cpu.replace("-", "_")
        command = [sys.executable, "-m", "ziglang", "cc", "-target", "thumb-freestanding-eabi", f"-mcpu={name}"]
        libraries = []
    elif shutil.which("arm-none-eabi-gcc") is not None:
        command = ["arm-none-eabi-gcc", "-mthumb", f"-mcpu={cpu}", "-mfloat-abi=soft", "-nostartfiles"]
        command, libraries = [*command, "--specs=nano.specs", "--specs=nosys.specs"], ["-lgcc"]
    else:
        pytest.skip("neither ziglang (pip install 'swingid[cortex]') nor arm-none-eabi-gcc is installed")
    target = folder() / f"{cpu}.elf"
    sources = [*sorted({*CORE.glob("*.c")} - {LOOP}), SIM, HERE / "table.c"]
    command += ["-ffreestanding", *FLAGS, f"-I{CORE}", *map(str, sources), "-T", str(HERE / "memory.ld")]
    done = subprocess.run([*command, *libraries, "-o", str(target)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return target


class Emulator:
    """A Cortex-M with the core in its memory, and the interface of `swingid.live.machine.Machine`.

    No UART and no clock: the functions of hal/sim are called one by one. A double is computed in software.
    """

    def __init__(self, board: Board | None = None, cpu: str = "cortex-m3") -> None:
        elf = image(cpu).read_bytes()
        import unicorn
        from unicorn import arm_const

        self._registers = arm_const
        self._cpu: Any = unicorn.Uc(unicorn.UC_ARCH_ARM, unicorn.UC_MODE_THUMB | unicorn.UC_MODE_MCLASS)
        self._cpu.ctl_set_cpu_model(getattr(arm_const, f"UC_CPU_ARM_{CPUS[cpu]}"))
        self._cpu.mem_map(MEMORY, SIZE)
        first, count = struct.unpack_from("<I", elf, 28)[0], struct.unpack_from("<H", elf, 44)[0]
        for i in range(count):  # program headers of an ELF file of 32 bits
            kind, offset, address, _, size = struct.unpack_from("<5I", elf, first + 32 * i)
            if kind == 1 and size:
                self._cpu.mem_write(address, elf[offset : offset + size])
        table = struct.unpack("<6I", bytes(self._cpu.mem_read(MEMORY, 24)))
        self._open, self._receive, self._tick, self._output, self._steps, self._bytes = table
        if board is not None:
            most = 0.0 if math.isinf(board.most_edges) else board.most_edges
            rate, limit, edges = (
                struct.unpack("<I", struct.pack("<f", x))[0] for x in (board.rate, board.voltage_limit, most)
            )
            self._call(self._open, rate, board.axis_counts, board.wheel_counts, limit, board.firmware, edges)

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

    def instructions(self, act: Callable[[], object]) -> int:
        """How many instructions this takes."""
        counted = [0]

        def count(*_: object) -> None:
            counted[0] += 1

        import unicorn

        hook = self._cpu.hook_add(unicorn.UC_HOOK_CODE, count)
        self._cpu.ctl_flush_tb()  # what is translated already would not be counted
        act()
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
