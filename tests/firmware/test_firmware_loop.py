"""The loop of the firmware under a host that never stops sending: fuzzed on a board of a script, and over TCP."""

from __future__ import annotations

import contextlib
import re
import select
import shutil
import socket
import subprocess
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from firmware_build import CORE, FIRMWARE, FLAGS, LOOP, compiler
from live_host import RIG, arm_frame, parameter_frames, reference_frames
from swingid.errors import DeviceError
from swingid.live import native
from swingid.live.codes import FaultCode, Mode, State
from swingid.live.devices.table import open_device
from swingid.live.devices.twin import TwinDevice
from swingid.live.emulator import NativeRig, PythonRig
from swingid.live.frames import Decoder, encode
from swingid.live.guard import Board
from swingid.live.machine import LEAST_TAKEN, MOST_TAKEN, most_taken
from swingid.live.native import NativeProcess
from swingid.live.plant import Plant, board_of
from swingid.live.ports import TcpPort

BOARD = board_of(RIG)
needs_native = pytest.mark.skipif(native.obstacle() is not None, reason=f"the firmware's process: {native.obstacle()}")


def test_c_and_python_take_as_many_bytes_of_a_host() -> None:
    text = (CORE / "device.h").read_text()
    assert int(re.findall(r"#define SWINGID_MOST_TAKEN (\d+)", text)[0]) == MOST_TAKEN
    assert "#define SWINGID_LEAST_TAKEN SWINGID_ENCODED(SWINGID_MOST_PAYLOAD)" in text
    assert len(reference_frames([0.1] * 14)) == LEAST_TAKEN
    assert [most_taken(Board(rate=rate)) for rate in (20.0, 333.0, 1000.0, 1e5)] == [10_000, 600, 200, LEAST_TAKEN]


# ---- the loop on a board of a script, firmware/tests/fuzz_loop.c ----


def fuzz(folder: Path, core: Path, *arguments: int) -> subprocess.CompletedProcess[str]:
    """What the fuzz of the loop says of a core; its seed, runs, and samples of a run."""
    program = folder / "fuzz-loop"
    options = ["-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    sources = [*map(str, sorted({*core.glob("*.c")} - {core / LOOP.name})), str(FIRMWARE / "tests" / "fuzz_loop.c")]
    command = [compiler(), *FLAGS, *options, f"-I{core}", *sources, "-o", str(program)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return subprocess.run([str(program), *map(str, arguments)], capture_output=True, text=True)


def passes(done: subprocess.CompletedProcess[str]) -> None:
    assert done.returncode == 0, done.stdout + done.stderr
    count, driven, flooded, flooded_driven, faults = map(int, re.findall(r"\d+", done.stdout))
    assert driven > 0.3 * count, done.stdout
    assert flooded > 0.05 * count, done.stdout
    assert flooded_driven > 0.001 * count, done.stdout
    assert faults > 0.001 * count, done.stdout


@pytest.mark.long
def test_a_hundred_thousand_samples_of_the_loop_under_floods(tmp_path: Path) -> None:
    passes(fuzz(tmp_path, CORE, 1, 20, 5000))


@pytest.mark.long
def test_ten_million_samples_of_the_loop_under_floods(tmp_path: Path) -> None:
    for seed in range(2, 12):
        passes(fuzz(tmp_path, CORE, seed, 200, 5000))


BROKEN = {
    "reads without bound": ("loop.c", "most = swingid_most_taken(config);", "most = 4000000;", "more bytes are taken"),
    "believes heartbeats that waited": ("guard.c", "if (!busy) guard", "if (busy || !busy) guard", "100 ms without"),
    "forgets the heartbeat": ("guard.c", ">= (double)guard->death_time", "> 1e10", "100 ms without"),
    "lets answers fill the output": ("device.c", "? 0 : SWINGID_OUTPUT_KEPT", "? 0 : 0", "not see"),
    "arms in a fault": ("device.c", "device->state != IDLE && device->state != ARMED", "0", "forgotten"),
    "does not clamp": ("guard.c", "if (*voltage > limit) *voltage = limit;", "", "limit"),
}


QUICK = ("believes heartbeats that waited",)


@pytest.mark.parametrize("name", [pytest.param(x, marks=() if x in QUICK else pytest.mark.long) for x in BROKEN])
def test_the_fuzz_finds_a_core_that(name: str, tmp_path: Path) -> None:
    file, old, new, words = BROKEN[name]
    core = tmp_path / "core"
    shutil.copytree(CORE, core)
    text = (core / file).read_text()
    assert text.count(old) == 1
    (core / file).write_text(text.replace(old, new))
    done = fuzz(tmp_path, core, 1, 20, 5000)
    assert done.returncode == 1
    assert words in done.stdout


# ---- over TCP, in real time ----


class Noted(Plant):
    """A plant that notes the time (s) and the voltage of its samples."""

    def __init__(self) -> None:
        super().__init__(RIG)
        self.noted: list[tuple[float, float]] = []

    def hold(self, voltage: float) -> None:
        self.noted.append((self.time, voltage))
        super().hold(voltage)


@contextlib.contextmanager
def running(kind: str) -> Iterator[tuple[str, Noted]]:
    """An emulated rig behind a TCP port, a thousand samples a second: its address and its plant."""
    plant, stop = Noted(), threading.Event()
    rig: NativeRig | PythonRig
    if kind == "native":
        rig = NativeRig(plant, NativeProcess(BOARD, tcp=0))
    else:
        rig = PythonRig(TwinDevice(plant, BOARD), TcpPort(0))

    def work() -> None:
        due = time.perf_counter()
        while not stop.is_set():
            rig.step()
            due = max(due + 1e-3, time.perf_counter() - 0.02)
            time.sleep(max(due - time.perf_counter(), 0.0))

    thread = threading.Thread(target=work)
    thread.start()
    try:
        yield rig.address, plant
    finally:
        stop.set()
        thread.join(30)
        rig.close()


def wait_for(what: str, found: object, patience: float = 20.0) -> None:
    assert callable(found)
    until = time.monotonic() + patience
    while not found():
        assert time.monotonic() < until, what
        time.sleep(0.001)


def send_for(connection: socket.socket, data: bytes, seconds: float) -> int:
    """Send without end for so long (s), as fast as it is taken; how many bytes."""
    until, sent = time.monotonic() + seconds, 0
    connection.setblocking(False)
    while time.monotonic() < until:
        if select.select([], [connection], [], 0.01)[1]:
            with contextlib.suppress(BlockingIOError):
                sent += connection.send(data)
    return sent


FLOODS = {
    "garbage": np.random.default_rng(0).bytes(65536),
    "no end of a frame": b"\x55" * 65536,
    "Who": encode("Who") * 6000,
    "heartbeats, then none": encode("Heartbeat", session=7) * 6000,
}


@pytest.mark.parametrize("name", FLOODS)
@pytest.mark.parametrize("kind", ["python", pytest.param("native", marks=needs_native)])
def test_a_flood_over_tcp_neither_stops_the_samples_nor_holds_the_voltage(kind: str, name: str) -> None:
    with running(kind) as (address, plant):
        host, _, port = address.removeprefix("tcp://").rpartition(":")
        with socket.create_connection((host, int(port))) as connection:
            wait_for("no sample is taken", lambda: len(plant.noted) > 5)
            connection.sendall(parameter_frames() + arm_frame(mode=Mode.OPEN_LOOP) + reference_frames([3.0] * 1000))
            connection.sendall(encode("Run", session=7) + encode("Heartbeat", session=7))
            wait_for("no run", lambda: plant.noted[-1][1] == 3.0)
            connection.sendall(encode("Heartbeat", session=7))
            heard = plant.time
            sent = send_for(connection, FLOODS[name], 0.5)
            assert plant.time - heard > 0.1, "hardly a sample in half a second"
            last_sent = plant.time
        driven = [instant for instant, voltage in plant.noted if voltage != 0.0]
        assert driven[-1] < (last_sent if "heartbeats" in name else heard + 0.002) + 0.1
        assert sent > 50_000
        wait_for("no end of the run", lambda: plant.noted[-1][1] == 0.0)
        assert asked_who(address, patience=5.0) == (State.FAULT, FaultCode.HEARTBEAT)


def asked_who(address: str, patience: float) -> tuple[int, int]:
    """State and fault that the next host is told, within `patience` (s): what is left of the one before is bounded."""
    until = time.monotonic() + patience
    while True:
        assert time.monotonic() < until, "no answer to the next host"
        decoder = Decoder()
        with contextlib.suppress(DeviceError), contextlib.closing(open_device(address)) as device:
            device.write(encode("Who"))
            for _ in range(10):
                for frame in decoder.feed(device.read(0.05)):
                    if frame.name == "Hello":
                        return frame.state, frame.fault
