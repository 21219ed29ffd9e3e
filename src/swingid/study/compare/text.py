"""A comparison as tables for a terminal."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

from swingid.format import number, percent, plus_minus
from swingid.study.terminal import NO_BREAK, WIDTH, aligned

if TYPE_CHECKING:
    from swingid.result.result import Result
    from swingid.study.compare.comparison import Comparison, Trial


def tabulate(comparison: Comparison) -> str:
    """Per log: inertia ± standard uncertainty, what it rests on, time, error against the truth; friction; verdict."""
    return "\n\n".join(_of_log(comparison, log) for log in comparison.logs)


def _of_log(comparison: Comparison, log: str) -> str:
    trials = comparison.of(log)
    known = any(trial.truth is not None for trial in trials)
    headings = ["method", "inertia", "relative", "rests on", "time", *(["error"] if known else [])]
    lines = [f"[[{log}]]", *aligned([headings, *(answer_cells(trial)[: len(headings)] for trial in trials)])]
    lines += ["", *aligned([["method", "friction"], *([t.method, friction_text(t.result)] for t in trials)])]
    lines += [""] + [line for v in comparison.verdicts if v.log == log for line in _wrapped(f"verdict: {v.message}")]
    for trial in trials:
        if trial.result.error is not None:
            lines += _wrapped(f"{trial.method}: {trial.result.error.message}")
        lines += [line for w in trial.result.warnings for line in _wrapped(f"{trial.method}, {w.code}: {w.message}")]
    return "\n".join(lines)


def answer_cells(trial: Trial, *, fine: bool = False) -> list[str]:
    """Method, inertia, relative uncertainty, assumptions, time, error against the truth."""
    rests = trial.assumptions.words()
    seconds = f"{1e3 * trial.seconds:.3g} ms" if trial.seconds < 1 else number(trial.seconds, "s", 3)
    if "inertia" not in trial.result.parameters:
        return [trial.method, "refused", "", rests, seconds, ""]
    inertia = trial.result.inertia
    u = inertia.standard_uncertainty
    spread = "" if u is None else percent(u / abs(inertia.value), fine=fine)
    value = plus_minus(inertia.value, u, inertia.unit, fine=fine)
    if trial.error is None:
        return [trial.method, value, spread, rests, seconds, ""]
    outside = " (outside the interval)" if trial.covered is False else ""
    return [trial.method, value, spread, rests, seconds, percent(trial.error, sign=True, fine=fine) + outside]


def friction_text(result: Result, *, fine: bool = False) -> str:
    """The identified friction parameters, 'viscous 1.144e-3 ± …, coulomb …'."""
    named = [(name, p) for name, p in result.parameters.items() if name not in ("inertia", "gravity_torque")]
    friction = [
        f"{name} {plus_minus(p.value, p.standard_uncertainty, p.unit, fine=fine)}"
        for name, p in named
        if "." not in name
    ]
    return ", ".join(item.replace(" ", NO_BREAK) for item in friction) or "none"


def _wrapped(text: str) -> list[str]:
    return textwrap.wrap(text, WIDTH, initial_indent="    ", subsequent_indent="      ", break_on_hyphens=False)
