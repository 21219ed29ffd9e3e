"""Builds the C core with the compiler of this machine, once per test session and source; skips without one."""

from __future__ import annotations

import ctypes
import functools
import hashlib
import shutil
import subprocess
import tempfile
from pathlib import Path

import pytest

FIRMWARE = Path(__file__).resolve().parents[1] / "firmware"
CORE = FIRMWARE / "core"
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
    core = sorted(CORE.glob("*.c"))
    name = hashlib.sha256(repr((sources, options)).encode()).hexdigest()[:12] + suffix
    target = folder() / name
    command = [compiler(), *FLAGS, *options, f"-I{CORE}", *map(str, core), *map(str, sources), "-o", str(target)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return target


def library(*sources: Path) -> ctypes.CDLL:
    """The core with further sources as a shared library."""
    return ctypes.CDLL(str(build(sources, ("-shared", "-fPIC"), ".so")))
