"""Builds the C core with the compiler of this machine, once per test process and source; skips without one."""

from __future__ import annotations

import ctypes
import functools
import hashlib
import math
import shutil
import struct
import subprocess
import tempfile
from pathlib import Path

import pytest

from swingid.live.guard import Board, Readings

FIRMWARE = Path(__file__).resolve().parents[1] / "firmware"
CORE = FIRMWARE / "core"
SIM = FIRMWARE / "hal" / "sim" / "sim.c"
NATIVE = FIRMWARE / "hal" / "native" / "main.c"
LOOP = CORE / "loop.c"
FLAGS = ["-std=c99", "-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]


def compiler() -> str:
    """The C compiler; skips the test where there is none."""
    for name in ("cc", "gcc", "clang"):
        if found := shutil.which(name):
            return found
    pytest.skip("no C compiler (cc, gcc or clang) on PATH, which the tests of the firmware need")


@functools.cache
def folder() -> Path:
    """A folder of this session for what is built."""
    return Path(tempfile.mkdtemp(prefix="swingid-firmware-"))


@functools.cache
def build(sources: tuple[Path, ...], options: tuple[str, ...] = (), suffix: str = "") -> Path:
    """File that the compiler makes of the core and further sources; its path."""
    core = sorted(CORE.glob("*.c")) if NATIVE in sources else sorted({*CORE.glob("*.c")} - {LOOP})
    name = hashlib.sha256(repr((sources, options)).encode()).hexdigest()[:12] + suffix
    target = folder() / name
    command = [compiler(), *FLAGS, *options, f"-I{CORE}", *map(str, core), *map(str, sources), "-o", str(target)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return target


def library(*sources: Path, include: Path | None = None) -> ctypes.CDLL:
    """The core with further sources as a shared library; include: a further folder of headers."""
    more = (f"-I{include}",) if include is not None else ()
    return ctypes.CDLL(str(build(sources, ("-shared", "-fPIC", *more), ".so")))


class CoreDevice:
    """The firmware's core in this process, with the interface of `swingid.live.machine.Machine`; one at a time."""

    def __init__(self, board: Board) -> None:
        self._core = library(SIM)
        self._bytes = (ctypes.c_uint8 * 4096).in_dll(self._core, "sim_bytes")
        self._core.sim_tick.restype = ctypes.c_uint32
        self._core.sim_open(
            ctypes.c_float(board.rate),
            ctypes.c_uint32(board.axis_counts),
            ctypes.c_uint32(board.wheel_counts),
            ctypes.c_float(board.voltage_limit),
            ctypes.c_uint32(board.firmware),
            ctypes.c_float(0.0 if math.isinf(board.most_edges) else board.most_edges),
        )
        self.busy = False

    @property
    def busy(self) -> bool:
        """Whether the host has sent as much as a sample takes."""
        return self._busy

    @busy.setter
    def busy(self, value: bool) -> None:
        self._busy = value
        self._core.sim_busy(int(value))

    def receive(self, data: bytes) -> None:
        for start in range(0, len(data), 4096):
            piece = data[start : start + 4096]
            ctypes.memmove(self._bytes, piece, len(piece))
            self._core.sim_receive(len(piece))

    def tick(self, time: int, readings: Readings) -> float:
        current = struct.unpack("<I", struct.pack("<f", readings.current))[0]
        bits = self._core.sim_tick(
            ctypes.c_uint32(time),
            ctypes.c_int32(readings.axis),
            ctypes.c_int32(readings.wheel),
            ctypes.c_uint32(current),
            int(readings.valid),
        )
        return float(struct.unpack("<f", struct.pack("<I", bits))[0])

    def output(self) -> bytes:
        return bytes(self._bytes[: self._core.sim_output()])

    def message(self, identifier: int, payload: bytes) -> None:
        """A message from a CAN bus."""
        ctypes.memmove(self._bytes, payload, len(payload))
        self._core.sim_message(ctypes.c_uint16(identifier), len(payload))

    def output_message(self) -> tuple[int, bytes] | None:
        """The next message for a CAN bus."""
        identifier = ctypes.c_uint16()
        length = self._core.sim_output_message(ctypes.byref(identifier))
        return None if length < 0 else (identifier.value, bytes(self._bytes[:length]))
