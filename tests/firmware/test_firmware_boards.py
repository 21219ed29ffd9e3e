"""The boards' part of the firmware: encoders by their data sheets, and that the sketches compile and link."""

from __future__ import annotations

import ctypes
import itertools
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from firmware_build import CORE, FIRMWARE, FLAGS, compiler, library
from long_cases import quick_first

ENCODERS = FIRMWARE / "hal" / "encoders"


@pytest.fixture(scope="module")
def core() -> ctypes.CDLL:
    return library(FIRMWARE / "tests" / "encoders.c", include=ENCODERS)


@pytest.mark.parametrize("bits", [10, 14, 16])
def test_turns_are_counted_through_all_wraps(core: ctypes.CDLL, bits: int) -> None:
    rng = np.random.default_rng(bits)
    most = 2 ** (bits - 1) - 1
    true = 2**31 - 40 * most  # wraps at 32 bits, too
    total = ctypes.c_int32(true).value
    core.extend.argtypes = [ctypes.c_int32, ctypes.c_uint32, ctypes.c_int]
    for _ in range(500):
        true += int(rng.integers(-most // 2, most + 1))
        total = core.extend(total, true % 2**bits, bits)
        assert total == ctypes.c_int32(true % 2**32).value


def test_an_as5048a_answer_with_wrong_parity_or_error_is_no_reading(core: ctypes.CDLL) -> None:
    found = ctypes.c_uint16()
    for value in (0, 1, 0x1234, 0x3FFF, 0x2AAA):
        even = value | (value.bit_count() % 2) << 15
        assert core.angle(even, ctypes.byref(found)) == 1
        assert found.value == value
        for bit in range(16):
            assert core.angle(even ^ 1 << bit, ctypes.byref(found)) == 0
        error = value | 1 << 14
        assert core.angle(error | (error.bit_count() % 2) << 15, ctypes.byref(found)) == 0


def test_quadrature_counts_four_edges_a_pulse_both_ways(core: ctypes.CDLL) -> None:
    forth = [0b00, 0b01, 0b11, 0b10, 0b00]
    assert [core.step(one, other) for one, other in itertools.pairwise(forth)] == [1] * 4
    back = forth[::-1]
    assert [core.step(one, other) for one, other in itertools.pairwise(back)] == [-1] * 4
    assert [core.step(x, x) for x in range(4)] == [0] * 4
    assert [core.step(x, x ^ 3) for x in range(4)] == [0] * 4


def test_the_core_needs_no_library(tmp_path: Path) -> None:
    """No heap, no libm: what the core calls is itself, the board, and copies that a compiler may put in."""
    if shutil.which("nm") is None:
        pytest.skip("nm is not on PATH")
    sources = [str(path) for path in sorted(CORE.glob("*.c"))]
    subprocess.run([compiler(), *FLAGS, "-fno-stack-protector", f"-I{CORE}", "-c", *sources], cwd=tmp_path, check=True)
    objects = [str(path) for path in tmp_path.glob("*.o")]
    assert len(objects) == len(sources)
    listed = subprocess.run(["nm", "-u", *objects], capture_output=True, text=True, check=True).stdout
    names = {line.split()[-1].removeprefix("_") for line in listed.splitlines() if re.match(r"\s+U ", line)}
    assert {name for name in names if not name.startswith(("swingid_", "hal_"))} <= {
        "memcpy",
        "memset",
        "memmove",
        "GLOBAL_OFFSET_TABLE_",
    }


BOARDS = ("ARDUINO_ARCH_SAM", "ARDUINO_ARCH_SAMD", "ARDUINO_ARCH_ESP32", "ARDUINO_ARCH_RP2040")
BOARDS += ("__IMXRT1062__", "ARDUINO_ARCH_STM32")
PWM, DIRECTION = 9, 8


def arduino(target: Path, *defines: str) -> subprocess.CompletedProcess[str]:
    """Compile the sketch with the stubs in the place of a board's core."""
    for name in ("c++", "g++", "clang++"):
        if found := shutil.which(name):
            break
    else:
        pytest.skip("no C++ compiler (c++, g++ or clang++) on PATH")
    sketch, stub = FIRMWARE / "hal" / "arduino" / "swingid" / "swingid.ino", FIRMWARE / "tests" / "stub"
    paths = [f"-I{path}" for path in (CORE, ENCODERS, stub)]
    options = ["-std=c++17", "-Wall", "-Wextra", "-Werror", *(f"-D{name}" for name in defines), "-x", "c++"]
    command = [found, *options, *paths, str(sketch), str(stub / "board.cpp"), "-o", str(target)]
    return subprocess.run(command, capture_output=True, text=True)


@pytest.mark.parametrize("board", quick_first(2, BOARDS))
def test_the_arduino_sketch_has_a_watchdog_that_samples_alone_feed(board: str, tmp_path: Path) -> None:
    done = arduino(tmp_path / "sketch", board)
    assert done.returncode == 0, done.stderr
    said = subprocess.run([str(tmp_path / "sketch")], capture_output=True, text=True, check=True).stdout.splitlines()
    begun, hung, interrupted = said.index("loop 500"), said.index("hung"), said.index("interrupt")
    assert "watchdog 50" in said[:begun]
    outputs = [line for line in said[:begun] if line.split()[0] in ("level", "mode", "duty", "bits")]
    assert outputs[:2] == [f"level {PWM} 0", f"level {DIRECTION} 0"], "the bridge is not off before all else"
    assert f"duty {PWM} 0" in outputs
    assert not [line for line in outputs if line.startswith(f"duty {PWM}") and line != f"duty {PWM} 0"]
    samples = [int(line.split()[1]) for line in said if line.startswith("sample")]
    assert np.diff(samples).mean() == pytest.approx(2000, rel=0.02)
    fed = [int(line.split()[1]) for line in said[begun:hung] if line.startswith("fed")]
    assert max(np.diff(fed)) < 20_000  # us, of 31 ms that SAMD makes of 50
    assert min(np.diff(fed)) > 10_000
    assert f"duty {PWM} 512" in said
    assert not [line for line in said[hung:interrupted] if line.startswith("fed")], "fed without a sample"
    assert {"received", "sent"}.isdisjoint(said)
    if board == "ARDUINO_ARCH_ESP32":
        assert said[interrupted + 1 :] == [f"level {PWM} 0", f"level {DIRECTION} 0", f"plain {PWM}"]


def test_the_arduino_sketch_sends_where_the_core_never_tells_its_room(tmp_path: Path) -> None:
    done = arduino(tmp_path / "sketch", BOARDS[0], "ROOM=0")
    assert done.returncode == 0, done.stderr
    said = subprocess.run([str(tmp_path / "sketch")], capture_output=True, text=True, check=True).stdout.splitlines()
    assert "sent" not in said  # the board counts what is not 64 bytes


def test_the_arduino_sketch_refuses_a_board_whose_watchdog_it_does_not_know(tmp_path: Path) -> None:
    done = arduino(tmp_path / "sketch", "ARDUINO_ARCH_NRF52")
    assert done.returncode != 0
    assert "No watchdog is known of this board" in done.stderr


def test_the_makefile_builds_the_process(tmp_path: Path) -> None:
    if shutil.which("make") is None:
        pytest.skip("make is not on PATH")
    shutil.copytree(FIRMWARE, tmp_path / "firmware", ignore=shutil.ignore_patterns("build"))
    command = ["make", "-C", str(tmp_path / "firmware"), f"CC={compiler()}"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "firmware" / "build" / "swingid-native").is_file()
