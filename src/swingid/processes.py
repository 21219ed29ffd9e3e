"""Processes: cores, what a system lets them take, signals that end them, and work that several share."""

from __future__ import annotations

import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
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
    """Prepare a process of `worker_pool`: keep memory; end with the process that started it."""
    keep_memory()
    end_with_parent()


def end_with_parent() -> None:
    """End this process of a pool where the one that started it is killed, which no pool does by itself."""
    from multiprocessing import connection, parent_process

    parent = parent_process()
    assert parent is not None

    def watch() -> None:
        connection.wait([parent.sentinel])
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


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
        end_workers(pool)
        if isinstance(error, BrokenExecutor):
            message = "a worker process was ended, perhaps for want of memory; free some, then start again."
            raise InputError(message, code="lost-workers") from None
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def end_workers(pool: ProcessPoolExecutor) -> None:
    """End the processes of a pool at once, whatever they do.

    One that ends while it sends a result leaves a part of it in the pipe, and the pool's thread waits for the rest as
    long as anybody could write it: so the end that this process holds is closed.
    """
    for process in list((getattr(pool, "_processes", None) or {}).values()):
        process.kill()
    with suppress(AttributeError, OSError):
        pool._result_queue._writer.close()  # type: ignore[attr-defined]


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
            futures = deque(pool.submit(_each, function, items[k : k + chunk]) for k in parts)
        while futures:
            yield from futures.popleft().result()


def _each(function: Callable[[Item], Found], items: Sequence[Item]) -> list[Found]:
    return [function(item) for item in items]
