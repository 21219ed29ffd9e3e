"""``swingid compile``, and the same before the first run of a command."""

from __future__ import annotations

import time
from importlib import import_module
from threading import Thread
from typing import Annotated

import typer

from swingid.cli import output
from swingid.cli.failure import keeps
from swingid.cli.progress import bar


def compile(
    tasks: Annotated[
        list[str] | None, typer.Argument(metavar="[TASK]...", help="Methods, simulate, ensemble, …; default: all.")
    ] = None,
    processes: Annotated[
        int | None, typer.Option(min=1, help="Processes side by side; default: one for each processor.")
    ] = None,
) -> None:
    """Compile all kernels beforehand, so that no later command waits: for images and classrooms.

    Once for each version of swingid, numba and processor. Environment variable NUMBA_CACHE_DIR: where they are kept.
    """
    from swingid.numerics.ahead import compile_ahead
    from swingid.numerics.ahead import tasks as listed
    from swingid.numerics.cache import CACHE

    start = time.monotonic()
    with keeps(lambda: f"the kernels that are compiled are kept in {CACHE}; the same command goes on from there"):
        count = compile_ahead(tasks or listed(), Bar(), processes)
    took = f"{count} kernels compiled in {time.monotonic() - start:.0f} s" if count else "all kernels were compiled"
    output.say(f"{took}; they are in {CACHE}")


def compile_first(*tasks: str) -> None:
    """Compile the kernels of some tasks where this version has not done so on this machine yet."""
    from swingid.numerics.ahead import compile_ahead, is_ready

    missing = [task for task in tasks if not is_ready(task)]
    if missing:
        output.say("compiling kernels, once per version (swingid compile does all at once)")
        # what calls the kernels imports numba afterwards, which takes most of a second: meanwhile
        Thread(target=import_module, args=("numba",), daemon=True).start()
        compile_ahead(missing, Bar())


class Bar:
    """Shows on a terminal how much is compiled, and the time left."""

    def __call__(self, part: float, seconds: float) -> None:
        """`part` (0 to 1) took so many seconds."""
        left = f", {output.time_left(seconds / part * (1.0 - part))} left" if 0.1 < part < 1.0 else ""
        text = f"{bar(round(1000 * part), 1000)} kernels, {100 * part:.0f} %{left}"
        output.overwrite(text, last=part >= 1.0 - 1e-9)
