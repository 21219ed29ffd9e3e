"""A campaign as tables for a terminal and for the page."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

from swingid.format import percent
from swingid.study.terminal import aligned, noted

if TYPE_CHECKING:
    from swingid.study.campaign.statistics import Statistics
    from swingid.study.campaign.summary import Cell, Summary

HEADINGS = ("RMSE", "bias", "covers", "half-width/RMSE", "efficiency", "answers")


def tabulate(summary: Summary) -> str:
    """Figures of every method over all runs, then at each level of each factor."""
    plan = summary.plan
    lines = [f"[[{plan.name}: {summary.trials} runs of the twin, relative errors]]"]
    lines += _table(("method",), summary.overall, lambda cell: (cell_name(cell),))
    for factor in plan.tables.factors:
        cells = [cell for cell in summary.by_level if cell.factor == factor]
        if cells:
            lines += ["", f"[[by {factor}]]"]
            lines += _table((factor, "method"), cells, lambda cell: (cell.level, cell_name(cell)))
    lines.append("")
    for cell in summary.overall:
        s = cell.statistics
        for what, codes in (("refused", s.refusals), ("warned", s.warnings)):
            if codes:
                lines += noted([f"{cell_name(cell)} {what}: {counted(codes, s.runs)}"])
    if summary.failures:
        lines += noted([f"runs without a log: {counted(summary.failures, summary.trials)}"])
    return "\n".join(lines).rstrip()


def cell_name(cell: Cell) -> str:
    """The method, and the quantity where it is not the inertia."""
    return cell.method if cell.quantity == "inertia" else f"{cell.method}, {cell.quantity}"


def figures(s: Statistics, headings: Sequence[str] = HEADINGS, *, fine: bool = False) -> tuple[str, ...]:
    """The figures as cells of a table, empty where unknown; `fine` for pages."""
    known = s.answered > 0
    cells = {
        "RMSE": percent(s.rmse[0], fine=fine) if known else "",
        "bias": percent(s.bias[0], sign=True, fine=fine) if known else "",
        "covers": share(s.coverage),
        "half-width/RMSE": f"{s.width:.2f}" if math.isfinite(s.width) else "",
        "efficiency": share(s.efficiency),
        "answers": f"{s.answered} of {s.runs}",
    }
    return tuple(cells[heading] for heading in headings)


def share(value: tuple[float, float]) -> str:
    """A share in per cent with its standard error."""
    if not math.isfinite(value[0]):
        return ""
    if 0.0 < value[0] < 5e-4:
        return "< 0.1 %"
    digits = 1 if value[1] < 0.005 else 0
    error = f" ± {100 * value[1]:.{digits}f}" if math.isfinite(value[1]) else ""
    return f"{100 * value[0]:.{digits}f}{error} %"


def counted(codes: Mapping[str, int], runs: int) -> str:
    """Codes with how often each was met."""
    return ", ".join(f"{code} in {n} of {runs}" for code, n in sorted(codes.items(), key=lambda c: (-c[1], c[0])))


def told_headings(cells: Sequence[Cell]) -> tuple[str, ...]:
    """The headings of which at least one cell has something to say."""
    rows = [figures(cell.statistics) for cell in cells]
    return tuple(h for k, h in enumerate(HEADINGS) if any(row[k] for row in rows))


def _table(names: tuple[str, ...], cells: Sequence[Cell], name: Callable[[Cell], tuple[str, ...]]) -> list[str]:
    headings = told_headings(cells)
    return aligned([(*names, *headings), *((*name(c), *figures(c.statistics, headings)) for c in cells)])
