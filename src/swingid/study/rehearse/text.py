"""A rehearsal as a table for a terminal."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from swingid.format import percent
from swingid.study.terminal import aligned, noted

if TYPE_CHECKING:
    from swingid.study.rehearse.rehearsal import Expectation, Rehearsal

HEADINGS = ("method", "RMSE", "bias", "95 % of errors", "95 % interval", "covers", "answers")


def tabulate(rehearsal: Rehearsal) -> str:
    """One line per method: relative errors and half-widths to expect of the inertia; then refusals and notes."""
    rows = [HEADINGS, *(_cells(e, rehearsal.runs) for e in rehearsal.expectations)]
    lines = [f"[[{rehearsal.runs} runs of the twin of {rehearsal.rig}: relative error of the inertia to expect]]"]
    lines += aligned(rows)
    lines.append("")
    for e in rehearsal.expectations:
        lines += [_told(e.method, "refused", e.refusals, rehearsal.runs)] if e.refusals else []
        lines += [_told(e.method, "warned", e.warnings, rehearsal.runs)] if e.warnings else []
    lines += noted(rehearsal.notes)
    return "\n".join(lines).rstrip()


def _cells(e: Expectation, runs: int) -> tuple[str, ...]:
    if not e.answered:
        return (e.method, "", "", "", "", "", f"0 of {runs}")
    known = math.isfinite(e.half_width)
    share, error = e.coverage
    return (
        e.method,
        percent(e.rmse),
        percent(e.bias, sign=True),
        f"within {percent(e.p95)}",
        f"± {percent(e.half_width)}" if known else "unknown",
        f"{100 * share:.0f} ± {100 * error:.0f} %" if known else "",
        f"{e.answered} of {runs}",
    )


def _told(method: str, what: str, codes: dict[str, int], runs: int) -> str:
    listed = ", ".join(f"{code} in {count} of {runs}" for code, count in sorted(codes.items(), key=lambda c: -c[1]))
    return f"    {method} {what}: {listed}"
