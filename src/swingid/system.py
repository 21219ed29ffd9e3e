"""Files read and written whole, locked and hashed; the user, and what a bug report needs."""

from __future__ import annotations

import getpass
import os
import stat
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from importlib import import_module
from pathlib import Path
from time import sleep
from typing import TYPE_CHECKING

from swingid.errors import InputError
from swingid.processes import interruption_waits

if TYPE_CHECKING:
    pass


LARGEST_FILE = 1 << 30
"""Bytes of a file or a pipe that are read whole, at most."""


SILENCE = 10.0
"""Seconds without a byte after which a pipe counts as one that nobody writes to or closes."""


CHUNK = 1 << 20
"""Bytes read from a pipe at once."""


def user() -> str:
    """Something that distinguishes the users of a machine, fit for the name of a folder."""
    if hasattr(os, "getuid"):
        return str(os.getuid())
    try:
        name = getpass.getuser()
    except (OSError, ImportError, KeyError):
        name = "user"
    return "".join(letter if letter.isalnum() else "-" for letter in name)


@contextmanager
def locked(path: Path, *, wait: bool) -> Iterator[None]:
    """Hold the lock of a file, which is made; it ends with the process. Without `wait` OSError where another has it.

    By flock on POSIX, by msvcrt.locking on Windows; a system that has neither has no lock.
    """
    with path.open("w") as file:
        try:
            fcntl = import_module("fcntl")
        except ImportError:
            _lock_windows(file.fileno(), wait=wait)
        else:
            fcntl.flock(file, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        yield


def _lock_windows(descriptor: int, *, wait: bool) -> None:
    try:
        msvcrt = import_module("msvcrt")
    except ImportError:
        return
    while True:
        try:
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
            return
        except OSError:
            if not wait:
                raise
        sleep(0.1)


def is_file(path: str | Path) -> bool:
    """Return whether a path is a regular file, which has a size and can be read twice; False where it cannot be
    seen.
    """
    try:
        return Path(path).is_file()
    except (OSError, ValueError):
        return False


def read_file(path: str | Path, most: int = LARGEST_FILE) -> bytes:
    """The bytes of a regular file, or of a pipe that ends.

    Raises InputError for a device, a terminal or a socket, and for a pipe that brings more than `most` bytes or is
    silent for longer than `SILENCE`; OSError and ValueError as `Path.read_bytes`.
    """
    path = Path(path)
    mode = path.stat().st_mode
    if stat.S_ISREG(mode) or stat.S_ISDIR(mode):
        return path.read_bytes()
    if not stat.S_ISFIFO(mode):
        raise InputError(f"{path} is a device, not a file; give the path of a file.", code="not-a-file")
    return _read_pipe(path, most)


def read_input(path: str | Path, *, missing: str, folder: tuple[str, str], most: int = LARGEST_FILE) -> bytes:
    """Read a file as `read_file` does, with InputError for every way in which a path can be wrong.

    missing: what to do where there is no file. folder: code of the error for a folder, and what to do.
    """
    name = str(path) if str(path).isprintable() else repr(str(path))
    try:
        return read_file(path, most)
    except FileNotFoundError:
        raise InputError(f"{name} does not exist; {missing}.", code="missing-file") from None
    except IsADirectoryError:
        raise InputError(f"{name} is a folder; {folder[1]}.", code=folder[0]) from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"{name} cannot be read: {reason}.", code="unreadable-file") from None


def sha256_of(path: str | Path, stopped: Callable[[], bool] = lambda: False) -> str:
    """SHA-256 of a file; InputError where it cannot be read. Of its begin only where `stopped` becomes true."""
    import hashlib

    digest = hashlib.sha256()
    try:
        with Path(path).open("rb", buffering=0) as stream:
            while not stopped() and (chunk := stream.read(8 * CHUNK)):
                digest.update(chunk)
        return digest.hexdigest()
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}.", code="unreadable-file") from None


HASH = """
import hashlib, sys
digest = hashlib.sha256()
with open(sys.argv[1], "rb", buffering=0) as stream:
    while chunk := stream.read(1 << 20):
        digest.update(chunk)
print(digest.hexdigest())
"""


AHEAD = 64 << 20
"""Bytes from which on the SHA-256 of a file is begun before it is known what the file holds."""


@contextmanager
def sha256_begun(path: str | Path) -> Iterator[Callable[[], str] | None]:
    """What waits for the SHA-256 of a large file, which a process computes from now on; it ends with the block.

    None for a file that is small or cannot be seen. The process is a Python without packages, ready at once, and needs
    nothing of this one, which may import and start other processes meanwhile.
    """
    try:
        large = Path(path).stat().st_size > AHEAD
        command = [sys.executable, "-I", "-S", "-c", HASH, str(path)]
        with interruption_waits():
            process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) if large else None
    except (OSError, ValueError, TypeError):  # TypeError: no executable is known
        process = None
    if process is None:
        yield None
        return

    @cache
    def wait() -> str:
        digest = process.communicate()[0].decode().strip()
        return digest if process.returncode == 0 else sha256_of(path)

    with process:
        try:
            yield wait
        finally:
            process.kill()


def _read_pipe(path: Path, most: int) -> bytes:
    """What a pipe brings until it is closed, read in a thread, for opening one waits for a writer."""
    chunks: list[bytes] = []
    failed: list[OSError] = []
    arrived, stop = threading.Event(), threading.Event()

    def read() -> None:
        try:
            with path.open("rb", buffering=0) as stream:
                while not stop.is_set() and (chunk := stream.read(CHUNK)):
                    chunks.append(chunk)
                    arrived.set()
        except OSError as error:
            failed.append(error)

    reading = threading.Thread(target=read, daemon=True)
    reading.start()
    waited = 0.0
    while reading.is_alive():
        reading.join(0.05)
        waited = 0.0 if arrived.is_set() else waited + 0.05
        arrived.clear()
        if sum(map(len, chunks)) > most:
            stop.set()
            raise InputError(f"{path} is a pipe that brings more than {most} bytes; give a file.", code="endless")
        if waited > SILENCE and reading.is_alive():
            stop.set()
            raise InputError(
                f"{path} is a pipe that nobody has written to or closed for {SILENCE:g} s; close it, or give a file.",
                code="endless",
            )
    if failed:
        raise failed[0]
    return b"".join(chunks)


WRITTEN: list[Path] = []
"""The files that `write_whole` has written in this process, or this command."""


def write_whole(target: Path, content: bytes) -> None:
    """Write a file that appears whole or not at all (a device or a pipe as it is, a link where it leads).

    Raises InputError that names the file and the reason, BrokenPipeError where a pipe's reader went away.
    """
    partial = None
    try:
        place = Path(os.path.realpath(target))
        if place.exists() and not place.is_file():
            place.write_bytes(content)
            return
        partial = place.with_name(f".{place.name[:200]}.{os.getpid()}.part")
        partial.write_bytes(content)
        partial.replace(place)
        partial = None
        WRITTEN.append(target)
    except BrokenPipeError:
        raise
    except OSError as error:
        raise InputError(f"cannot write {target}: {error.strerror or error}.", code="cannot-write") from None
    finally:
        if partial is not None:  # also after Ctrl-C
            with suppress(OSError):
                partial.unlink(missing_ok=True)


def keep_traceback(error: Exception, arguments: Sequence[str]) -> str | None:
    """Write what a bug report needs to the temporary folder; returns the path, None where that fails.

    arguments: the command.
    """
    import platform
    import tempfile
    import traceback

    try:
        version = sys.modules["swingid"].__version__
    except Exception:
        version = "unknown"
    lines = [
        f"swingid {version}, Python {platform.python_version()}, {platform.platform()}",
        f"swingid {' '.join(arguments)}",
        "",
        *traceback.format_exception(error),
    ]
    try:
        with tempfile.NamedTemporaryFile(
            "w", prefix="swingid-bug-", suffix=".txt", delete=False, encoding="utf-8", errors="backslashreplace"
        ) as file:
            file.write("\n".join(lines))
    except OSError:
        return None
    return file.name
