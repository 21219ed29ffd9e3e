"""A case of benchmarks/speed: our time over that of a reference, both measured by turns in one run."""

from __future__ import annotations

import math
import os
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass

for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(_name, "1")  # before numpy is imported: both sides on one thread

Timer = Callable[[], float]
"""Does its work once and returns the seconds it took."""


@dataclass(frozen=True)
class Case:
    """One ratio: `ours` and `reference` by turns, `pairs` times; `asked` is the goal."""

    name: str
    reference_is: str
    ours: Timer
    reference: Timer
    asked: float | None = None
    pairs: int = 9
    warm: bool = True
    """Whether a first call of each is not counted, because it may compile."""


@dataclass(frozen=True)
class Measured:
    """Median ratio of a case, the spread (standard deviation) of its logarithm as that of a median, both times (s)."""

    name: str
    reference_is: str
    ratio: float
    spread: float
    ours: float
    reference: float
    asked: float | None


def processor_time(work: Callable[[], object]) -> Timer:
    """Timer of this process's processor time, all threads: other work on the machine counts little."""

    def timer() -> float:
        start = time.process_time()
        work()
        return time.process_time() - start

    return timer


def measured(case: Case) -> Measured:
    """Pairs by turns, after a first one that is not counted where the case is warm.

    The median of paired ratios, because a pair shares the machine's state of the moment; its spread from the median
    absolute deviation, times 1.253 / sqrt(pairs), the standard deviation of a median of normal values.
    """
    if case.warm:
        case.ours(), case.reference()
    pairs = [(case.ours(), case.reference()) for _ in range(case.pairs)]
    logs = [math.log(ours / reference) for ours, reference in pairs]
    middle = statistics.median(logs)
    deviation = 1.4826 * statistics.median(abs(value - middle) for value in logs)
    ours, reference = (statistics.median(times) for times in zip(*pairs, strict=True))
    spread = 1.253 * deviation / math.sqrt(len(logs))
    return Measured(case.name, case.reference_is, math.exp(middle), spread, ours, reference, case.asked)
