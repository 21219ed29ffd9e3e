"""``swingid compile``, and the same before the first run of a command."""

from __future__ import annotations

import time
from importlib import import_module
from threading import Thread
from typing import TYPE_CHECKING, Annotated

import typer

from swingid.cli import output
from swingid.cli.failure import keeps
from swingid.cli.progress import EVERY, bar
from swingid.errors import InputError, SwingidError

if TYPE_CHECKING:
    from swingid.model.rig import Rig
    from swingid.recording.recording import Recording


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
        done = compile_ahead(tasks or listed(), Bar(), processes)
    if done.failed:
        raise InputError(
            f"{len(done.failed)} of {done.kept + len(done.failed)} kernels were not compiled ahead "
            f"({done.failed[0]}); mend that and give the same command, or each run compiles what it calls",
            code="not-compiled",
        )
    what = f"{done.kept} kernel{'' if done.kept == 1 else 's'} compiled in {time.monotonic() - start:.0f} s"
    output.say(f"{what if done.kept else 'no kernel is left to compile'}; they are in {CACHE}{_why_there()}")


def _why_there() -> str:
    """Why the kernels are not in the folder that the environment names; nothing where they are."""
    from swingid.numerics.cache import CACHE, wanted_folder

    wanted = wanted_folder()
    return "" if wanted is None or CACHE.is_relative_to(wanted) else f", because {wanted} cannot be written"


def compile_first(*tasks: str) -> None:
    """Compile the kernels of some tasks where this version has not done so on this machine yet."""
    from swingid.numerics.ahead import compile_ahead, is_ready

    missing = [task for task in dict.fromkeys(tasks) if not is_ready(task)]
    if missing:
        output.say("compiling kernels, once per version (swingid compile does all at once)")
        # what calls the kernels imports numba afterwards, which takes most of a second: meanwhile
        Thread(target=import_module, args=("numba",), daemon=True).start()
        failed = compile_ahead(missing, Bar()).failed
        if failed:
            output.say(f"not all could be compiled ahead ({failed[0]}), so the run compiles what it calls")


def kernels_of(method: str, log: Recording, rig: Rig, wanted: object = None) -> tuple[str, ...]:
    """Tasks of `compile_first` for a method on a log; none where the method refuses it.

    wanted: what is to drive the simulation of output error (its option `input`), None for its own choice.
    """
    if method != "output-error":
        return (method,)
    from swingid.methods.output_error.setup import input_of

    try:
        return (method,) if input_of(wanted, log, rig) == "voltage" else ("output-error-axis",)
    except SwingidError:
        return ()


class Bar:
    """Shows how much is compiled, and the time left: a bar on a terminal, a plain line now and then elsewhere."""

    def __init__(self) -> None:
        self.shown = time.monotonic()

    def __call__(self, part: float, seconds: float) -> None:
        """`part` (0 to 1) took so many seconds."""
        remaining = f", {output.time_left(seconds / part * (1.0 - part))} left" if 0.1 < part < 1.0 else ""
        text = f"{100 * part:.0f} % of the kernels{remaining}"
        now, last = time.monotonic(), part >= 1.0 - 1e-9
        due = now - self.shown > EVERY and not last
        if not output.overwrite(f"{bar(round(1000 * part), 1000)} {text}", last=last) and due:
            self.shown = now
            output.say(text)
