"""The firmware as a process of this machine, built from `firmware/` by its C compiler; its plant is in Python."""

from __future__ import annotations

import hashlib
import os
import shutil
import socket
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

from swingid.errors import DeviceError, UsageError
from swingid.live.guard import Board, Readings

FLAGS = ("-std=c99", "-O2", "-ffp-contract=off")
TOLD, ANSWER = struct.Struct("<IiifII"), struct.Struct("<fI")
"""What goes to the process at a sample and what it answers, see `firmware/hal/native/main.c`."""

START_TIME, BUILD_TIME = 10.0, 120.0


def sources() -> Path | None:
    """The folder `firmware`, beside the package in a wheel and in the repository; None where it is missing."""
    here = Path(__file__).resolve()
    for folder in (here.parents[1] / "firmware", here.parents[3] / "firmware"):
        if (folder / "hal" / "native" / "main.c").is_file():
            return folder
    return None


def compiler() -> str | None:
    """A C compiler of this machine: $CC, cc, gcc or clang."""
    return next(
        (path for name in (os.environ.get("CC", ""), "cc", "gcc", "clang") if (path := shutil.which(name))), None
    )


def obstacle() -> str | None:
    """Why the process can't be built here; None where it can."""
    if sys.platform == "win32":
        return "the firmware as a process needs POSIX"
    if sources() is None:
        return "the firmware's sources are not installed"
    if compiler() is None:
        return "there is no C compiler (cc, gcc or clang)"
    return None


def build() -> Path:
    """The program, built once per version of its sources; UsageError where that is impossible or fails."""
    folder, compiler_path = sources(), compiler()
    if folder is None or compiler_path is None:
        raise UsageError(f"{obstacle()}; use --firmware python", code="no-compiler")
    core = folder / "core"
    files = [*sorted(core.glob("*.c")), folder / "hal" / "native" / "main.c"]
    content = b"".join(path.read_bytes() for path in (*sorted(core.glob("*.h")), *files))
    name = hashlib.sha256(content + " ".join((compiler_path, *FLAGS)).encode()).hexdigest()[:16]
    target = _cache() / f"swingid-native-{name}"
    if target.exists():
        return target
    new = target.with_name(f"{target.name}.{os.getpid()}")
    command = [compiler_path, *FLAGS, f"-I{core}", *map(str, files), "-o", str(new)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=BUILD_TIME, check=False)
    if done.returncode != 0:
        reason = (done.stderr.strip().splitlines() or ["no message"])[0]
        raise UsageError(f"the firmware can't be compiled ({reason}); use --firmware python", code="no-compiler")
    new.replace(target)
    return target


def _cache() -> Path:
    """A folder of this user for what is built."""
    base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "swingid" / "firmware"
    try:
        base.mkdir(parents=True, exist_ok=True)
    except OSError:
        return Path(tempfile.mkdtemp(prefix="swingid-"))
    return base


class NativeProcess:
    """The running process; `exchange` is one of its samples. tcp: its port, 0 for any; None: a pseudo terminal."""

    def __init__(self, board: Board, *, tcp: int | None) -> None:
        where = ["--pty"] if tcp is None else ["--tcp", str(tcp)]
        options = ["--rate", f"{board.rate:.9g}", "--counts", str(board.axis_counts), str(board.wheel_counts)]
        options += ["--limit", f"{board.voltage_limit:.9g}", "--firmware", str(board.firmware), "--live"]
        self._process = subprocess.Popen(
            [str(build()), *where, "--plant", "0", *options],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,  # Ctrl-C is for this program, which ends the process
        )
        self.number = self._process.pid
        assert self._process.stdout is not None
        words = self._process.stdout.readline().split()
        port = self._process.stdout.readline().split()
        if not words or not port:
            assert self._process.stderr is not None
            why = self._process.stderr.read().strip()
            self._process.wait()
            raise DeviceError(f"the firmware's process does not start ({why}); give another --tcp port", code="busy")
        link = words[1]
        self.address = f"serial://{link}" if tcp is None else f"tcp://localhost:{link.rpartition(':')[2]}"
        self._plant = socket.create_connection(("127.0.0.1", int(port[1])), START_TIME)
        self._plant.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._answers = self._plant.makefile("rb")

    def exchange(self, time: int, readings: Readings) -> float:
        """One sample: readings at a device time (us) in, the voltage (V) out; DeviceError where it has ended."""
        packed = TOLD.pack(time, readings.axis, readings.wheel, readings.current, int(readings.valid), 0)
        try:
            self._plant.sendall(packed)
            answer = self._answers.read(ANSWER.size)
        except OSError:
            answer = b""
        if len(answer) < ANSWER.size:
            raise DeviceError("the firmware's process has ended by itself; start the emulator again", code="gone")
        return float(ANSWER.unpack(answer)[0])

    def close(self) -> None:
        """End the process, by the end of its plant."""
        self._answers.close()
        self._plant.close()
        try:
            self._process.wait(START_TIME)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        for pipe in (self._process.stdout, self._process.stderr):
            if pipe is not None:
                pipe.close()
