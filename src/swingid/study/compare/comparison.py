"""All methods on the same logs: each one's answer, its time, what it takes for granted, and whether they agree."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from swingid.errors import InputError, UnanswerableError
from swingid.identification import METHODS, identify
from swingid.model.rig import Rig
from swingid.recording.recording import Recording
from swingid.result.result import Result, refusal
from swingid.study.compare.agreement import Verdict, verdict
from swingid.study.compare.assumptions import Assumptions, assumptions

SCHEMA = "swingid.compare/1"


@dataclass(frozen=True)
class Trial:
    """One method on one log: its result, refused or not, its wall time in s with kernels loaded, its assumptions."""

    log: str
    method: str
    result: Result
    seconds: float
    assumptions: Assumptions
    truth: float | None

    @property
    def error(self) -> float | None:
        """Relative error of the inertia against the twin's truth, None for real logs and refusals."""
        if self.truth is None or "inertia" not in self.result.parameters:
            return None
        return self.result.inertia.value / self.truth - 1

    @property
    def covered(self) -> bool | None:
        """Whether the 95 % interval holds the truth; None where either is unknown."""
        if self.error is None or self.truth is None or self.result.inertia.interval95 is None:
            return None
        low, high = self.result.inertia.interval95
        return low <= self.truth <= high


@dataclass(frozen=True)
class Comparison:
    """Trials, log by log and method by method, and what they say of each other."""

    trials: tuple[Trial, ...]
    verdicts: tuple[Verdict, ...]

    @property
    def logs(self) -> tuple[str, ...]:
        """Names of the logs in their order."""
        return tuple(dict.fromkeys(trial.log for trial in self.trials))

    def of(self, log: str) -> tuple[Trial, ...]:
        """Trials of one log."""
        return tuple(trial for trial in self.trials if trial.log == log)

    def to_dict(self) -> dict[str, object]:
        """Plain data, schema "swingid.compare/1": the results as `identify` writes them, each with time and truth."""
        results = []
        for trial in self.trials:
            extra = {
                "seconds": trial.seconds,
                "assumptions": vars(trial.assumptions),
                "truth": trial.truth,
                "relative_error": trial.error,
            }
            results.append(trial.result.to_dict() | {"log": trial.log, "comparison": extra})
        return {"schema": SCHEMA, "results": results, "verdicts": [vars(verdict) for verdict in self.verdicts]}

    def to_json(self) -> str:
        """The comparison as JSON text."""
        return json.dumps(self.to_dict(), indent=2, ensure_ascii=False, allow_nan=False) + "\n"

    def summary(self) -> str:
        """Tables to read on a terminal."""
        from swingid.study.compare.text import tabulate

        return tabulate(self)


def compare(logs: Recording | Sequence[Recording], rig: Rig, methods: Sequence[str] | None = None) -> Comparison:
    """Put every method, or the named ones, on the same logs.

    A method that refuses a log is a trial with its reason, not an error. Raises UsageError for an unknown method,
    UnanswerableError where every method refuses every log.
    """
    several = [logs] if isinstance(logs, Recording) else list(logs)
    trials = tuple(trial for k, log in enumerate(several) for trial in _trials(log, rig, methods, k))
    if all(trial.result.status == "refused" for trial in trials):
        reason = trials[0].result.error
        raise UnanswerableError(
            f"no method finds an inertia; {trials[0].method} says: {reason.message if reason else 'nothing.'}",
            code="all-refused" if reason is None else reason.code,
        )
    verdicts = [verdict(log, [t for t in trials if t.log == log]) for log in dict.fromkeys(t.log for t in trials)]
    return Comparison(trials, tuple(verdicts))


def _trials(log: Recording, rig: Rig, methods: Sequence[str] | None, index: int) -> Iterator[Trial]:
    name = log.source.path or f"log {index + 1}"
    for method in dict.fromkeys(methods or METHODS):
        result, seconds = _timed(log, rig, method)
        yield Trial(name, method, result, seconds, assumptions(method, rig, result), _truth(log))


def _timed(log: Recording, rig: Rig, method: str) -> tuple[Result, float]:
    """The result and the time it takes, timed again where a first run is short or has compiled kernels."""
    seconds = float("inf")
    result: Result | None = None
    for _ in range(2):
        compiled = _kernels()
        begin = time.perf_counter()
        try:
            result = identify(log, rig, method)
        except (UnanswerableError, InputError) as error:
            result = refusal(method, error)
        seconds = min(seconds, time.perf_counter() - begin)
        if seconds > LONG and _kernels() == compiled:
            break
    assert result is not None
    return result, seconds


LONG = 2.0
"""A first run longer than this (s) is repeated for the sake of its time only where it compiled kernels."""


def _kernels() -> int:
    """Number of compiled kernels on disk."""
    from swingid.numerics.compiled import CACHE

    return sum(1 for _ in CACHE.rglob("*.nbc"))


def _truth(log: Recording) -> float | None:
    """The inertia that a twin's log was made with: for the comparison after the fact, no method is told."""
    truth = log.metadata.get("truth")
    inertia = truth.get("inertia") if isinstance(truth, dict) else None
    return float(inertia) if isinstance(inertia, int | float) and inertia > 0 else None
