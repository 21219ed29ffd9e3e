"""What the page computes, as plain data: in a process of its own, so that the page never waits for a method."""

from __future__ import annotations

import asyncio
import multiprocessing
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from swingid.errors import SwingidError
from swingid.identification import identify
from swingid.model.rig import Rig
from swingid.recording.recording import Recording
from swingid.result.result import Result, refusal
from swingid.study.changes import Times, changed

Part = tuple[float, float] | None
Factors = Mapping[str, float]
"""Multiples of constants by their dotted keys."""


class Analyst:
    """Two worker processes, so that a slow method does not hold up a slider."""

    def __init__(self) -> None:
        self._pool = ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn"))

    async def do(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """The value of function(*arguments), computed in the worker; raises what it raises."""
        return await asyncio.get_running_loop().run_in_executor(self._pool, function, *arguments)

    def close(self) -> None:
        """End the workers without waiting for them."""
        workers = list((getattr(self._pool, "_processes", None) or {}).values())
        self._pool.shutdown(wait=False, cancel_futures=True)
        for worker in workers:
            worker.terminate()


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
