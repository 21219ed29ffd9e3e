"""What differs between operating systems (cores, user, locks, limits of a process); files read and written whole."""

from __future__ import annotations

import getpass
import os
import signal
import stat
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from importlib import import_module
from pathlib import Path
from time import sleep
from typing import TYPE_CHECKING, TypeVar

from swingid.errors import InputError

if TYPE_CHECKING:
    from concurrent.futures import ProcessPoolExecutor

Item = TypeVar("Item")
Found = TypeVar("Found")

END_SIGNALS = tuple(
    signal.Signals[name] for name in ("SIGINT", "SIGTERM", "SIGBREAK", "SIGHUP") if hasattr(signal, name)
)
"""Signals by which this system asks a program to end: Ctrl-C, `kill`, a closed terminal."""

LARGEST_FILE = 1 << 30
"""Bytes of a file or a pipe that are read whole, at most."""

SILENCE = 10.0
"""Seconds without a byte after which a pipe counts as one that nobody writes to or closes."""

CHUNK = 1 << 20
"""Bytes read from a pipe at once."""


def cores() -> int:
    """Processor cores that this process may use; where the system does not say, those of the machine."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def keep_memory() -> None:
    """Let the C library keep what arrays of up to 32 MB give back, where it is glibc, whose default is 128 KB.

    Pages that go back to the system come again as pages of zeros: a tenth of the time of work on many arrays.
    """
    with suppress(ImportError, OSError, AttributeError):
        mallopt = import_module("ctypes").CDLL(None).mallopt
        for parameter, size in ((_MMAP_THRESHOLD, 32 << 20), (_TRIM_THRESHOLD, 1 << 30)):
            mallopt(parameter, size)


_MMAP_THRESHOLD, _TRIM_THRESHOLD = -3, -1
"""Parameters of mallopt (malloc.h of glibc)."""


def forks() -> bool:
    """Return whether processes that this one starts are copies of it; others import the main module again.

    False also where it may start none.
    """
    from multiprocessing import current_process, get_context  # which takes long to import

    return get_context().get_start_method() == "fork" and not current_process().daemon


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


def limit_process(memory: int, seconds: float) -> None:
    """Limit the address space (bytes) of this process, and the time of the processor (s) it may take from now on.

    Where the system cannot (Windows, some containers) nothing is limited.
    """
    with suppress(ImportError, ValueError, OSError):
        resource = import_module("resource")
        resource.setrlimit(resource.RLIMIT_AS, (memory, resource.getrlimit(resource.RLIMIT_AS)[1]))
        used, hard = sum(os.times()[:2]), resource.getrlimit(resource.RLIMIT_CPU)[1]
        resource.setrlimit(resource.RLIMIT_CPU, (int(used + seconds) + 1, hard))


@contextmanager
def interruption_waits() -> Iterator[None]:
    """Let Ctrl-C wait for the end of the block; processes that are started in it never get it.

    A terminal sends it to all processes of a command: what it is to end is for the first one to say. Not on Windows.
    """
    if hasattr(signal, "pthread_sigmask"):
        before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
    else:
        yield


def _begin_work() -> None:
    """Prepare a process of `worker_pool`: keep memory; end with the process that started it, which may be killed."""
    from multiprocessing import connection, parent_process

    keep_memory()
    parent = parent_process()
    assert parent is not None

    def end_with_parent() -> None:
        connection.wait([parent.sentinel])
        os._exit(1)

    threading.Thread(target=end_with_parent, daemon=True).start()


@contextmanager
def worker_pool(count: int) -> Iterator[ProcessPoolExecutor]:
    """Some processes, which end at once where the block ends by an error or Ctrl-C; hand work over at its begin.

    Work is handed over within `interruption_waits`, as that starts the processes. Raises InputError where one of them
    was ended from outside. They keep the memory that arrays give back (`keep_memory`), and end where this one is
    killed.
    """
    from concurrent.futures import BrokenExecutor, ProcessPoolExecutor  # which takes long to import

    pool = ProcessPoolExecutor(count, initializer=_begin_work)
    try:
        yield pool
    except BaseException as error:
        processes = list((getattr(pool, "_processes", None) or {}).values())
        for process in processes:
            process.terminate()
        if isinstance(error, BrokenExecutor):
            message = "a worker process was ended, perhaps for want of memory; free some, then start again."
            raise InputError(message, code="lost-workers") from None
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def map_in_processes(
    function: Callable[[Item], Found], items: Sequence[Item], workers: int | None = None, chunk: int = 1
) -> Iterator[Found]:
    """What the function returns for each item, in order; the first one here, so that kernels are compiled once.

    workers: processes, by default one per core, that end with this one, also at Ctrl-C; each takes `chunk` items at a
    time.
    """
    yield function(items[0])
    count = min(workers or cores(), len(items))
    if count == 1:
        yield from map(function, items[1:])
        return
    with worker_pool(count) as pool:
        with interruption_waits():
            # by `pool.map` the rest would be cancelled at an interruption, by which Python 3.11 may wait for ever:
            # the pool's thread ends by an error of its own where its processes end while cancelled work is left
            parts = range(1, len(items), chunk)
            left = deque(pool.submit(_each, function, items[k : k + chunk]) for k in parts)
        while left:
            yield from left.popleft().result()


def _each(function: Callable[[Item], Found], items: Sequence[Item]) -> list[Found]:
    return [function(item) for item in items]


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
        found = process.communicate()[0].decode().strip()
        return found if process.returncode == 0 else sha256_of(path)

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
