"""What the page computes, as plain data: in a process of its own, so that the page never waits for a method."""

from __future__ import annotations

import asyncio
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import BrokenExecutor, ProcessPoolExecutor
from functools import lru_cache
from multiprocessing.connection import wait
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from swingid.errors import SwingidError, UnanswerableError
from swingid.identification import identify
from swingid.model.rig import Rig
from swingid.recording.recording import Recording
from swingid.report.style import envelope
from swingid.result.result import Result, refusal
from swingid.study.changes import Times, changed
from swingid.system import interruption_waits

Part = tuple[float, float] | None
Factors = Mapping[str, float]
"""Multiples of constants by their dotted keys."""

STOPPED = "stopped"
"""Code of what a person has ended."""

BINS = 2500
"""Parts of a log whose smallest and largest values are drawn: more than a screen has columns."""


class Analyst:
    """Two worker processes, so that a slow method does not hold up a slider; they end with this process."""

    def __init__(self) -> None:
        self._pool = _pool()

    async def do(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """The value of function(*arguments), computed in a worker; raises what it raises.

        Raises UnanswerableError where `stop`, or something else, has ended the worker.
        """
        pool = self._pool
        try:
            with interruption_waits():  # this starts the workers
                found = asyncio.get_running_loop().run_in_executor(pool, function, *arguments)
            return await found
        except BrokenExecutor:
            if pool is not self._pool:
                raise UnanswerableError("stopped from the page", code=STOPPED) from None
            self.stop()
            text = "a worker process was ended, perhaps for want of memory; free some, or use a shorter part of the log"
            raise UnanswerableError(text, code="lost-workers") from None

    def stop(self) -> None:
        """End all that is being computed."""
        before, self._pool = self._pool, _pool()
        _end(before)

    def close(self) -> None:
        """End the workers without waiting for them."""
        _end(self._pool)


def _pool() -> ProcessPoolExecutor:
    return ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn"), initializer=_end_with_parent)


def _end(pool: ProcessPoolExecutor) -> None:
    for worker in list((getattr(pool, "_processes", None) or {}).values()):
        worker.kill()
    pool.shutdown()  # which waits for nobody: its thread sees that the workers are gone


def _end_with_parent() -> None:
    """End this worker where its parent dies, which no pool does by itself, and not by a Ctrl-C in the terminal."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def watch(sentinel: int) -> None:
        wait([sentinel])
        os._exit(1)

    threading.Thread(target=watch, args=(parent.sentinel,), daemon=True).start()


def sketched(log: str, rig: str) -> dict[str, Any]:
    """What the page draws of a log, thinned: (name, unit, times (n,), values (n,)) of each channel, the angle first;
    first and last time (s), and the duration.
    """
    plant, recording = _loaded(log, rig, (_changed_at(log), _changed_at(rig)))
    linear = plant.axis.kind == "linear"
    channels = [
        ("position", "m", recording.angle) if linear else ("angle", "rad", recording.angle),
        ("voltage", "V", recording.voltage),
        ("force", "N", recording.torque) if linear else ("torque", "N m", recording.torque),
    ]
    t = recording.time
    drawn = [(name, unit, *envelope(t, values, BINS)) for name, unit, values in channels if values is not None]
    return {"channels": drawn, "first": float(t[0]), "last": float(t[-1]), "duration": recording.duration}


def inspected(log: str, rig: str) -> dict[str, Any]:
    """Findings of `swingid inspect`, as its JSON."""
    from swingid.study.inspect import inspect_log

    return inspect_log(log, Rig.load(rig)).to_dict()


def answered(log: str, rig: str, method: str, part: Part, factors: Factors) -> dict[str, Any]:
    """A result as its JSON; a refusal has the status "refused" and its reason in "error"."""
    return _answer(log, rig, method, part, factors).to_dict()


def reported(log: str, rig: str, method: str, part: Part, factors: Factors, ending: str) -> bytes:
    """The report of a result, the content of a file of this ending (".html", ".pdf")."""
    from swingid.report import write_report

    plant, recording = _given(log, rig, part, factors)
    result = _answer(log, rig, method, part, factors)
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"report{ending}"
        write_report(result, recording, plant, path)
        return path.read_bytes()


def _answer(log: str, rig: str, method: str, part: Part, factors: Factors) -> Result:
    try:
        plant, recording = _given(log, rig, part, factors)
        return identify(recording, plant, method)
    except SwingidError as error:
        return refusal(method, error)


def _given(log: str, rig: str, part: Part, factors: Factors) -> tuple[Rig, Recording]:
    plant, recording = _loaded(log, rig, (_changed_at(log), _changed_at(rig)))
    other = {key: Times(factor) for key, factor in factors.items() if factor != 1.0}
    if other:
        plant = changed(plant, other)
        recording = Recording.load(log, plant)
    return plant, recording if part is None else recording.segment(*part)


def _changed_at(path: str) -> int:
    """When a file was changed, ns; 0 for a built-in name and for a file that is gone, which its reader refuses."""
    try:
        return Path(path).stat().st_mtime_ns
    except OSError:
        return 0


@lru_cache(4)
def _loaded(log: str, rig: str, _changed: tuple[int, int]) -> tuple[Rig, Recording]:
    plant = Rig.load(rig)
    return plant, Recording.load(log, plant)
