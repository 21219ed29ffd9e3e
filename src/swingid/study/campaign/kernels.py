"""Kernels are compiled in a process of their own before any trial is done.

A kernel that was just compiled and the same one loaded from the cache may round differently (the compiler sees other
functions to merge it with), so that no result comes from a process that compiles: the bytes of the results would depend
on which process was the first.
"""

from __future__ import annotations

import hashlib
import json
import pickle
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from swingid.study.campaign.plan import Plan

PROGRAM = (
    "import sys; from swingid.study.campaign.kernels import compile_kernels; compile_kernels(sys.stdin.buffer.read())"
)


def ensure_compiled(plan: Plan) -> None:
    """Have all kernels that a plan calls compiled and cached, once per machine, version and kind of plan."""
    _ensure(_kind(plan), pickle.dumps(plan))


def are_compiled(plan: Plan) -> bool:
    """Whether the kernels of a plan are in this machine's cache."""
    return _marker(_kind(plan)).exists()


def _marker(kind: str) -> Path:
    from swingid.numerics.compiled import CACHE

    return CACHE / f"campaign-{kind}"


@cache
def _ensure(kind: str, pickled: bytes) -> None:
    import fcntl

    marker = _marker(kind)
    if marker.exists():
        return
    with marker.with_name("campaign.lock").open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)  # of several workers of a machine one compiles, the others wait
        if not marker.exists():
            subprocess.run([sys.executable, "-c", PROGRAM], input=pickled, capture_output=True, check=False)
            marker.touch()


def compile_kernels(pickled: bytes) -> None:
    """Run one trial at each kind of point of a plan, for the kernels' sake."""
    from swingid.study.campaign.trial import block_rows

    plan: Plan = pickle.loads(pickled)
    for trial in _kinds_of_trials(plan):
        block_rows(plan, [trial])


def _kinds_of_trials(plan: Plan) -> list[int]:
    """The first trial with each level of each factor that is no number: numbers change no kernel."""
    wanted = {(name, str(label)) for p in plan.points for name, label in p.labels.items() if isinstance(label, str)}
    chosen = [0]
    for trial in range(plan.trials):
        if not wanted:
            break
        labels = plan.points[plan.place(trial)[0]].labels
        new = wanted & {(name, str(label)) for name, label in labels.items()}
        if new:
            wanted -= new
            chosen.append(trial)
    return sorted(set(chosen))


def _kind(plan: Plan) -> str:
    """What decides which kernels a plan calls, as a short name: everything but numbers."""
    tables = plan.tables.model_dump(mode="json", include={"base", "methods", "bound"})
    factors = {
        factor.key: [v for v in factor.values or () if isinstance(v, str)] for factor in plan.tables.factors.values()
    }
    levels = [factor.levels for factor in plan.tables.factors.values()]
    kind = json.dumps(_without_numbers([tables, factors, levels]), sort_keys=True)
    return hashlib.sha256(kind.encode()).hexdigest()[:16]


def _without_numbers(value: object) -> object:
    if isinstance(value, dict):
        return {str(key): _without_numbers(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_without_numbers(item) for item in value]
    return None if isinstance(value, int | float) and not isinstance(value, bool) else value
