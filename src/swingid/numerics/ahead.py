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
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import cache
from pathlib import Path
from queue import SimpleQueue
from threading import Thread
from typing import Any, NamedTuple, TextIO, cast

from swingid.errors import UsageError
from swingid.processes import cores

PACKAGE = Path(__file__).resolve().parents[1]
LIST = Path(__file__).with_name("kernels.json")


class Kernel(NamedTuple):
    """A kernel of the list: where it is, the types of its arguments, what compiling it took (s)."""

    module: str
    name: str
    arguments: str
    seconds: float


class Compiled(NamedTuple):
    """How many kernels were compiled and kept, and why others were not, a sentence each."""

    kept: int
    failed: tuple[str, ...]


Report = Callable[[float, float], None]
"""Called with the part that is done (0 to 1) and the seconds since the start."""

KEPT = "kept"
"""What a process answers where all is well; else the reason."""

ENDED = "the process that compiled it has ended"
"""What stands in the place of an answer that does not come."""

PROGRAM = "import sys; sys.path.append(sys.argv[1]); from swingid.numerics.ahead import work; work()"
"""What a process runs: the package of this one, nothing out of the folder in which the user happens to be."""


def tasks() -> tuple[str, ...]:
    """Names of the tasks whose kernels are listed."""
    return tuple(_listed())


def is_ready(task: str) -> bool:
    """Return whether nothing of a task is left to compile: it was done ahead on this machine, or nothing of it is
    listed.
    """
    return not _listed().get(task) or _stamp(task).exists()


def compile_ahead(wanted: Iterable[str], report: Report | None = None, processes: int | None = None) -> Compiled:
    """Compile the listed kernels of some tasks that are not in the cache yet.

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
        return Compiled(0, ())
    answers = _compiled(kernels, report or (lambda part, seconds: None), min(processes or cores(), len(kernels)))
    for task in missing:
        if all(answers[kernel] == KEPT for kernel in listed[task]):
            with suppress(OSError):  # a folder for reading alone
                _stamp(task).touch()
    failed = tuple(f"{kernel.name}: {answer}" for kernel, answer in answers.items() if answer != KEPT)
    return Compiled(len(kernels) - len(failed), failed)


def _compiled(kernels: list[Kernel], report: Report, count: int) -> dict[Kernel, str]:
    """The answer for each kernel of `count` processes, which end with this function, also at Ctrl-C."""
    start, whole, done = time.monotonic(), sum(kernel.seconds for kernel in kernels), 0.0
    waiting, given, answers = deque(kernels), SimpleQueue[tuple[Kernel, str]](), dict[Kernel, str]()
    processes: list[subprocess.Popen[str]] = []

    def serve(process: subprocess.Popen[str] | None) -> None:
        """Have a process compile kernels one by one; where it dies, another one takes the next kernel."""
        while waiting:
            try:
                kernel = waiting.popleft()
            except IndexError:  # another thread has taken the last one
                return
            try:
                if process is None:
                    processes.append(process := _process())
                answer = _asked(process, kernel)
            except OSError as error:
                answer = f"no process could be started ({error.strerror})"
            except Exception as error:  # whatever it is: the other thread waits for an answer
                answer = f"{type(error).__name__}: {error}"
            process = None if answer == ENDED else process
            given.put((kernel, answer))

    for _ in range(count):
        with suppress(OSError):  # the first kernel has the reason
            processes.append(_process())
    first = [*processes, *[None] * (count - len(processes))]
    threads = [Thread(target=serve, args=[process]) for process in first]
    report(0.0, 0.0)
    try:
        for thread in threads:
            thread.start()
        while len(answers) < len(kernels):
            kernel, answer = given.get()
            answers[kernel], done = answer, done + kernel.seconds
            report(done / whole, time.monotonic() - start)
    finally:  # also at Ctrl-C: what has been answered is in the cache, and their own end takes most of a second
        waiting.clear()
        for process in processes:
            process.kill()
        for thread in threads:
            if thread.is_alive():
                thread.join()
        for process in processes:
            with suppress(OSError):  # what was not written to its input
                process.communicate()
    return answers


def _asked(process: subprocess.Popen[str], kernel: Kernel) -> str:
    """Its answer for a kernel, or `ENDED`."""
    stdin, stdout = cast("TextIO", process.stdin), cast("TextIO", process.stdout)
    with suppress(OSError):  # the process has ended
        stdin.write(json.dumps(kernel) + "\n")
        return stdout.readline().strip() or ENDED
    return ENDED


def _process() -> subprocess.Popen[str]:
    command = [sys.executable, "-P", "-c", PROGRAM, str(PACKAGE.parent)]
    return subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, bufsize=1
    )


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
    from swingid.numerics.cache import CACHE, machine

    return CACHE / f"ready-{task}-{machine()}"


def work() -> None:
    """What a process does: compile each kernel it reads, until the input ends."""
    gc.disable()  # the compiler's many objects are searched for cycles in vain, a tenth of the time
    for line in sys.stdin:
        kernel = Kernel(*json.loads(line))
        try:
            answer = _kept(kernel)
        except Exception as error:  # the kernel is compiled when it is called, and fails there with its reason
            answer = f"not compiled: {error!r}"
        print(" ".join(answer.split()), flush=True)


def _kept(kernel: Kernel) -> str:
    """Compile a kernel into the cache; `KEPT`, or why it is not there."""
    import numba

    if numba.config.DISABLE_JIT:
        return "NUMBA_DISABLE_JIT is set, which runs kernels in Python"
    from swingid.numerics.cache import CACHE
    from swingid.numerics.kept import NOT_KEPT

    function = getattr(importlib.import_module(kernel.module), kernel.name)
    NOT_KEPT.clear()
    function.compile(tuple(_evaluated(f"[{kernel.arguments}]")))
    return f"{CACHE} cannot be written: {NOT_KEPT[0]}" if NOT_KEPT else KEPT


if __name__ == "__main__":
    work()
