"""Kernels compiled before they are called: in several processes side by side, with a report of how far that is.

`kernels.json` lists, for each task (a method, the simulation, …), the kernels that it calls from Python, with the types
of their arguments as expressions of numba's and the seconds that compiling took; `tools/list_kernels.py` writes it. A
kernel that is missing there is compiled when it is called, as any kernel would be without this file.

Each process is `python -m swingid.numerics.ahead`: it reads a line per kernel, compiles it into the cache of
`numerics.compiled` and answers with a line.
"""

from __future__ import annotations

import gc
import importlib
import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, TextIO, cast

from swingid.errors import UsageError
from swingid.system import cores

LIST = Path(__file__).with_name("kernels.json")


class Kernel(NamedTuple):
    """A kernel of the list: where it is, the types of its arguments, what compiling it took (s)."""

    module: str
    name: str
    arguments: str
    seconds: float


Report = Callable[[float, float], None]
"""Called with the part that is done (0 to 1) and the seconds since the start."""


def tasks() -> tuple[str, ...]:
    """Names of the tasks whose kernels are listed."""
    return tuple(_listed())


def is_ready(task: str) -> bool:
    """Whether nothing of a task is left to compile: it was done ahead on this machine, or nothing of it is listed."""
    return not _listed().get(task) or _stamp(task).exists()


def compile_ahead(wanted: Iterable[str], report: Report | None = None, processes: int | None = None) -> int:
    """Compile the listed kernels of some tasks that are not in the cache yet; returns how many kernels were compiled.

    processes: how many work side by side, by default one for each processor. Kernels that fail here are compiled when
    they are called, and fail there with their reason. Raises UsageError for a task that is not listed.
    """
    listed, wanted = _listed(), list(wanted)
    if unknown := [task for task in wanted if task not in listed]:
        text = f"there are no kernels named {', '.join(unknown)}; there are {', '.join(listed)}"
        raise UsageError(text, code="unknown-kernels")
    missing = [task for task in wanted if not is_ready(task)]
    kernels = sorted({kernel for task in missing for kernel in listed[task]}, key=lambda kernel: -kernel.seconds)
    if not kernels:
        return 0
    count = min(processes or cores(), len(kernels))
    start, whole, done = time.monotonic(), sum(kernel.seconds for kernel in kernels), 0.0
    with _workers(count) as workers, ThreadPoolExecutor(count) as threads:
        free = list(workers)

        def made(kernel: Kernel) -> Kernel:
            worker = free.pop()
            try:
                _compile_by(worker, kernel)
            finally:
                free.append(worker)
            return kernel

        jobs = [threads.submit(made, kernel) for kernel in kernels]
        try:
            for job in as_completed(jobs):
                done += job.result().seconds
                if report is not None:
                    report(done / whole, time.monotonic() - start)
        except BaseException:  # also Ctrl-C: what is in the cache stays there
            threads.shutdown(wait=False, cancel_futures=True)
            for worker in workers:
                worker.kill()  # else the threads wait for its answer
            raise
    for task in missing:
        _stamp(task).touch()
    return len(kernels)


def word(kind: Any) -> str:
    """A numba type as the expression that makes it; ValueError for one that has none."""
    from numba import types

    if isinstance(kind, types.FunctionType):
        return f"FunctionType({word(kind.signature.return_type)}({', '.join(map(word, kind.signature.args))}))"
    if isinstance(kind, types.UniTuple):
        return f"UniTuple({word(kind.dtype)}, {kind.count})"
    if isinstance(kind, types.BaseTuple):
        return f"Tuple(({''.join(word(member) + ', ' for member in kind.types)}))"
    text = repr(kind)
    if _evaluated(text) != kind:
        raise ValueError(text)
    return text


def _evaluated(text: str) -> Any:
    from numba import types

    try:
        return eval(text, dict(vars(types)))  # of our own list
    except (SyntaxError, NameError, TypeError):
        return None


@cache
def _listed() -> dict[str, list[Kernel]]:
    content = json.loads(LIST.read_text(encoding="utf-8"))
    return {task: [Kernel(*entry) for entry in entries] for task, entries in content.items()}


def _stamp(task: str) -> Path:
    from swingid.numerics.cache import CACHE

    return CACHE / f"ready-{task}"


@contextmanager
def _workers(count: int) -> Iterator[list[subprocess.Popen[str]]]:
    command = [sys.executable, "-m", "swingid.numerics.ahead"]
    workers = [
        subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, bufsize=1
        )
        for _ in range(count)
    ]
    try:
        yield workers
    finally:
        for worker in workers:
            worker.kill()  # what it has answered is in the cache; its own end takes most of a second
            worker.communicate()


def _compile_by(worker: subprocess.Popen[str], kernel: Kernel) -> None:
    stdin, stdout = cast("TextIO", worker.stdin), cast("TextIO", worker.stdout)
    with suppress(OSError):  # the process has ended
        stdin.write(json.dumps(kernel) + "\n")
        stdout.readline()


def work() -> None:
    """What a process does: compile each kernel it reads, until the input ends."""
    gc.disable()  # the compiler's many objects are searched for cycles in vain, a tenth of the time
    for line in sys.stdin:
        kernel = Kernel(*json.loads(line))
        try:
            function = getattr(importlib.import_module(kernel.module), kernel.name)
            function.compile(tuple(_evaluated(f"[{kernel.arguments}]")))
            print("compiled", flush=True)
        except Exception as error:  # the kernel is compiled when it is called, and fails there with its reason
            print(f"not compiled: {error!r}".splitlines()[0], flush=True)


if __name__ == "__main__":
    work()
