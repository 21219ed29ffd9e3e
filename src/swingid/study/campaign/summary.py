"""A campaign in figures: every method over all runs, at each level of each factor, and what each factor does."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from swingid.numerics.arrays import Array, Bools
from swingid.study.campaign.factors import BASE
from swingid.study.campaign.plan import Plan
from swingid.study.campaign.statistics import Answers, Statistics, statistics_of
from swingid.study.campaign.store import SCHEMA, Store

if TYPE_CHECKING:
    import pyarrow as pa


MOST_LEVELS = 12
"""Levels of a factor beyond which its values are put into `BINS` groups of equal size."""

BINS = 4

LOOP = ("wanted", "tracking", "k_tilde", "settling", "chatter", "saturated")


@dataclass(frozen=True)
class Cell:
    """Figures of one method and quantity, over all runs (factor "") or those at one level of a factor."""

    method: str
    quantity: str
    factor: str
    level: str
    statistics: Statistics


@dataclass(frozen=True)
class Effect:
    """What a factor does to one method: the mean relative error at its levels from lowest to highest, largest RMSE."""

    method: str
    quantity: str
    factor: str
    low: tuple[float, str]
    high: tuple[float, str]
    rmse: tuple[float, str]


@dataclass(frozen=True)
class Summary:
    """The figures of a campaign; `columns` holds the results by column, for pictures."""

    plan: Plan
    trials: int
    failures: Mapping[str, int]
    overall: tuple[Cell, ...]
    by_level: tuple[Cell, ...]
    effects: tuple[Effect, ...]
    loop: Mapping[str, float]
    columns: Mapping[str, NDArray[Any]]

    def of(self, method: str, quantity: str = "inertia") -> Statistics:
        """Figures of one method over all runs."""
        return next(c.statistics for c in self.overall if (c.method, c.quantity) == (method, quantity))

    def at(self, factor: str, level: str, method: str, quantity: str = "inertia") -> Statistics:
        """Figures of one method at one level of a factor."""
        wanted = (factor, level, method, quantity)
        return next(c.statistics for c in self.by_level if (c.factor, c.level, c.method, c.quantity) == wanted)

    def to_dict(self) -> dict[str, Any]:
        """Plain data, schema "swingid.campaign/1"; what is unknown is null."""
        return {
            "schema": SCHEMA,
            "name": self.plan.name,
            "about": self.plan.tables.about,
            "trials": self.trials,
            "points": len(self.plan.points),
            "failures": dict(self.failures),
            "overall": [_cell(cell) for cell in self.overall],
            "by_level": [_cell(cell) for cell in self.by_level],
            "effects": [
                {
                    "method": e.method,
                    "quantity": e.quantity,
                    "factor": e.factor,
                    "lowest_bias": _plain(e.low),
                    "highest_bias": _plain(e.high),
                    "largest_rmse": _plain(e.rmse),
                }
                for e in self.effects
            ],
            "loop": _plain(dict(self.loop)),
        }

    def to_json(self) -> str:
        """The summary as JSON text."""
        return json.dumps(self.to_dict(), indent=2, ensure_ascii=False, allow_nan=False) + "\n"

    def text(self) -> str:
        """Tables to read on a terminal."""
        from swingid.study.campaign.text import tabulate

        return tabulate(self)


def summarise(plan: Plan, folder: str | Path) -> Summary:
    """The figures of a finished campaign. Raises InputError where it is not finished or is another plan's."""
    return summary_of(plan, Store(plan, Path(folder)).table())


def summary_of(plan: Plan, table: pa.Table) -> Summary:
    """The figures of a table of results."""
    columns = {name: table[name].to_numpy() for name in table.column_names}
    pairs = [(m, q) for m in plan.tables.base.methods for q in plan.tables.quantities]
    levels = {name: levels_in(columns[name]) for name in plan.tables.factors}
    by_level = []
    for factor, masks in levels.items():
        for level, mask in masks.items():
            if plan.tables.design == "one-at-a-time" and level == BASE:
                mask = mask & (columns["point"] == 0)  # elsewhere another factor is off its base
            by_level += [_cell_of(columns, m, q, mask, factor, level) for m, q in pairs]
    first = np.unique(columns["trial"], return_index=True)[1]
    failed = columns["code"][first][columns["status"][first] == "failed"]
    return Summary(
        plan,
        len(first),
        {str(code): int((failed == code).sum()) for code in np.unique(failed.astype(str))},
        tuple(_cell_of(columns, m, q, np.ones(len(columns["trial"]), bool)) for m, q in pairs),
        tuple(by_level),
        tuple(_effects(by_level, pairs)),
        {name: _median(columns[name][first]) for name in LOOP},
        columns,
    )


def levels_in(values: NDArray[Any]) -> dict[str, Bools]:
    """Rows at each level of a factor, levels in order; numbers with many values in `BINS` groups of equal size."""
    if values.dtype.kind not in "fi":
        # as the plan has them, which is the order of the first rows
        return {str(level): values == level for level in dict.fromkeys(values.tolist())}
    levels = np.unique(values)
    if len(levels) <= MOST_LEVELS:
        names = [f"{level:.4g}" for level in levels]
        if len(set(names)) < len(names):
            names = [repr(float(level)) for level in levels]
        return {name: values == level for name, level in zip(names, levels, strict=True)}
    edges = np.quantile(levels, np.linspace(0, 1, BINS + 1))
    group = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, BINS - 1)
    return {f"{edges[k]:.3g} … {edges[k + 1]:.3g}": group == k for k in range(BINS)}


def answers_in(columns: Mapping[str, NDArray[Any]], rows: Bools) -> Answers:
    """The answers in some rows."""
    c = {name: columns[name][rows] for name in ("point", "truth", "value", "low", "high", "bound", "code", "warnings")}
    return Answers(
        c["point"],
        c["truth"],
        c["value"],
        (c["high"] - c["low"]) / 2,
        c["bound"],
        tuple(c["code"]),
        tuple(c["warnings"]),
    )


def _cell_of(
    columns: Mapping[str, NDArray[Any]], method: str, quantity: str, rows: Bools, factor: str = "", level: str = ""
) -> Cell:
    own = rows & (columns["method"] == method) & (columns["quantity"] == quantity)
    return Cell(method, quantity, factor, level, statistics_of(answers_in(columns, own), method))


def _effects(cells: Sequence[Cell], pairs: Sequence[tuple[str, str]]) -> Iterator[Effect]:
    """For each factor and method the levels with the lowest and highest bias and the largest RMSE."""
    for method, quantity in pairs:
        own = [c for c in cells if (c.method, c.quantity) == (method, quantity) and c.statistics.answered]
        for factor in dict.fromkeys(c.factor for c in own):
            biases = [(c.statistics.bias[0], c.level) for c in own if c.factor == factor]
            sizes = [(c.statistics.rmse[0], c.level) for c in own if c.factor == factor]
            yield Effect(method, quantity, factor, min(biases), max(biases), max(sizes))


def _median(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else math.nan


def _cell(cell: Cell) -> dict[str, Any]:
    s = cell.statistics
    place = {"method": cell.method, "quantity": cell.quantity}
    if cell.factor:
        place |= {"factor": cell.factor, "level": cell.level}
    figures = {
        "runs": s.runs,
        "answered": s.answered,
        "bias": s.bias[0],
        "bias_standard_error": s.bias[1],
        "rmse": s.rmse[0],
        "rmse_standard_error": s.rmse[1],
        "p95": s.p95,
        "coverage": s.coverage[0],
        "coverage_standard_error": s.coverage[1],
        "median_half_width": s.half_width,
        "half_width_over_rmse": s.width,
        "efficiency": s.efficiency[0],
        "efficiency_standard_error": s.efficiency[1],
        "refusals": s.refusals,
        "warnings": s.warnings,
    }
    return place | {name: _plain(value) for name, value in figures.items()}


def _plain(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, tuple) else value
