"""A large log read in parts: each identified by the ordinary method in a process of its own, then pooled.

A part's result does not depend on where or when it is computed, so that of the log is the same for any number of
processes.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from threading import Event

import numpy as np

from swingid.errors import InputError, SwingidError, UsageError
from swingid.methods.table import METHODS, Method
from swingid.numerics.arrays import median, quantile
from swingid.pooling.parts import Part, combine_parts
from swingid.pooling.runs import GRAVITY
from swingid.processes import cores, forks, interruption_waits, worker_pool
from swingid.recording.large import LARGE, LargeLog
from swingid.recording.recording import Recording
from swingid.result.result import Result
from swingid.system import sha256_of

MOST_WORKERS = 4
"""Processes that identify parts, at most: so many keep up with one that reads."""

Identify = Callable[[Recording], Result]
Read = tuple[int, Recording | SwingidError]
HandOver = Callable[["Recording | SwingidError", int], Callable[[], Part]]
"""Takes a part and its rows of the file; what it returns gives the result, and waits for it."""


def require_in_parts(log: LargeLog, method: Method) -> None:
    """Raise UsageError where a method does not read logs of this size."""
    if not method.in_parts:
        able = [other.name for other in METHODS.values() if other.in_parts]
        message = f"{log.path} has {log.rows} rows, which {method.name} does not read in parts; take a part of it with "
        message += f"--part FROM:TO (up to {LARGE} rows), or the method {' or '.join(able)}."
        raise UsageError(message, code="too-large")


def identify_large(log: LargeLog, identify_one: Identify) -> Result:
    """Identify a large log part by part in bounded memory; the parts are pooled like several logs.

    identify_one: from a recording to its result; it can be pickled. Raises InputError where the file cannot be used;
    where no part has a number, the error of the first.
    """
    parts: list[Part] = []
    stop = Event()
    workers = min(log.workers or (cores() if forks() else 1), MOST_WORKERS)
    with _identifying(identify_one, workers) as hand_over, ThreadPoolExecutor(2) as threads, ended_by(stop):
        digest = log.digest or threads.submit(sha256_of, log.path, stop.is_set).result
        ahead = workers + 1 if workers > 1 else 0
        for rows, part in _in_order(_read_ahead(log, threads, stop), hand_over, ahead):
            parts.append(part)
            if log.progress is not None:
                log.progress(rows, log.rows)
        sha256 = digest()
    if not parts:
        raise InputError(f"{log.path} has no rows of numbers in the part that is to be used.", code="empty-file")
    result = combine_parts(parts)
    return replace(result, provenance=result.provenance | {"log": log.path, "log_sha256": sha256})


def _read_ahead(log: LargeLog, threads: ThreadPoolExecutor, stop: Event) -> Iterator[Read]:
    """The parts, each read while the one before is worked on."""
    iterator = log.parts(stop.is_set)
    ahead = threads.submit(next, iterator, None)
    while (read := ahead.result()) is not None:
        ahead = threads.submit(next, iterator, None)
        yield read


def _in_order(parts: Iterable[Read], hand_over: HandOver, ahead: int) -> Iterator[tuple[int, Part]]:
    """Each part's result, with the rows read up to its end; `ahead` more parts are handed over meanwhile."""
    waiting: deque[tuple[int, Callable[[], Part]]] = deque()
    before = 0
    for rows, recording in parts:
        waiting.append((rows, hand_over(recording, rows - before)))
        before = rows
        if len(waiting) > ahead:
            done, result = waiting.popleft()
            yield done, result()
    for done, result in waiting:
        yield done, result()


@contextmanager
def _identifying(identify_one: Identify, workers: int) -> Iterator[HandOver]:
    """What identifies parts: processes, which start now, before this one has threads; this process where it is one."""
    if workers == 1:
        yield lambda recording, rows: partial(_part, recording, rows, identify_one)
        return
    with worker_pool(workers) as pool:

        def hand_over(recording: Recording | SwingidError, rows: int) -> Callable[[], Part]:
            with interruption_waits():
                return pool.submit(_part, recording, rows, identify_one).result

        with interruption_waits():
            pool.submit(int)
        yield hand_over


@contextmanager
def ended_by(stop: Event) -> Iterator[None]:
    """Set the event where the block ends by an error or Ctrl-C, for the threads that would go on."""
    try:
        yield
    except BaseException:
        stop.set()
        raise


def _part(recording: Recording | SwingidError, rows: int, identify_one: Callable[[Recording], Result]) -> Part:
    if not isinstance(recording, Recording):
        return Part(float("nan"), float("nan"), rows, 1, recording)
    start, stop = float(recording.time[0]), float(recording.time[-1])
    try:
        result = identify_one(recording)
        return Part(start, stop, rows, recording.averaged, result, _smear(recording, result))
    except UsageError:
        raise
    except SwingidError as error:
        return Part(start, stop, rows, recording.averaged, error)


def _smear(log: Recording, result: Result) -> float:
    """Relative error of the inertia, at most, by averaging rows: of the terms that are not linear in the angles.

    The mean of sin q1 (and of friction) over a block of width w is that of the mean angle less (q1' w)²/24 of it
    (Taylor); the gravity is b/(J ω²) times the inertia's term.
    """
    if log.averaged == 1:
        return 0.0
    steps = np.diff(log.time)
    peak = quantile(np.abs(np.diff(log.angle) / steps), 0.99)
    frequency = 2 * peak / max(float(np.ptp(log.angle)), 1e-300)
    width = median(steps)
    gravity, known = result.parameters.get("gravity_torque"), result.origin.constants.get(GRAVITY)
    b = gravity.value if gravity is not None else known.value if known is not None else 0.0
    size = peak if b else frequency  # without gravity the motion's size is none in angles
    share = abs(b) / max(abs(result.inertia.value) * frequency**2, 1e-300)
    return (size * width) ** 2 / 24 * max(1.0, share)
