"""A loop at absolute deadlines in a process of its own: how late its turns were, and what keeps others out of it."""

from __future__ import annotations

import gc
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import numpy as np

PERIOD = 0.005
"""Seconds of a turn of the host's loop: three heartbeats are on the way when one is due."""

KEPT = 200_000
"""Latenesses kept: the last twenty minutes."""


class Pace:
    """Waits for the deadlines k times `period` (s) after the first; what was missed is left out."""

    def __init__(self, period: float = PERIOD) -> None:
        self.period = period
        self._due = time.perf_counter()
        self._late = np.zeros(KEPT)
        self.turns = self.missed = 0

    def wait(self) -> None:
        """Sleep until the next deadline."""
        now = time.perf_counter()
        if now < self._due:
            time.sleep(self._due - now)
            now = time.perf_counter()
        late = now - self._due
        self._late[self.turns % KEPT] = late
        self.turns += 1
        behind = int(late / self.period)
        self.missed += behind
        self._due += (behind + 1) * self.period

    def restart(self) -> None:
        """Begin again: what was before did not keep a rate."""
        self._due, self.turns, self.missed = time.perf_counter(), 0, 0

    def percentile(self, share: float) -> float:
        """Lateness (s) that this share of the turns did not exceed; 0 before the first."""
        known = self._late[: min(self.turns, KEPT)]
        return float(np.quantile(known, share)) if len(known) else 0.0

    def words(self) -> str:
        """One line for people."""
        late = ", ".join(f"{100 * p:g} % {1e3 * self.percentile(p):.2g} ms" for p in (0.5, 0.99, 0.999))
        return f"{self.turns} turns of {1e3 * self.period:g} ms, late by at most: {late}; {self.missed} left out"


@contextmanager
def alone(*others: int) -> Iterator[bool]:
    """No garbage collection and, where the system permits, SCHED_FIFO for this process; gives whether it does.

    others: processes by their number that go first with it.
    """
    gc.collect()
    gc.freeze()
    collecting = gc.isenabled()
    gc.disable()
    first = False
    if hasattr(os, "sched_setscheduler"):
        for process in (0, *others):
            with suppress(OSError):
                os.sched_setscheduler(process, os.SCHED_FIFO, os.sched_param(10))
                first = True
    try:
        yield first
    finally:
        if first:
            for process in (0, *others):
                with suppress(OSError):
                    os.sched_setscheduler(process, os.SCHED_OTHER, os.sched_param(0))
        gc.unfreeze()
        if collecting:
            gc.enable()
