"""A campaign in figures: every method over all runs, at each level of each factor, and what each factor does."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from swingid.format import percent
from swingid.numerics.arrays import Array, Bools
from swingid.study.campaign.plan import BASE, Plan
from swingid.study.campaign.store import SCHEMA, Store
from swingid.study.campaign.trust import fault_factors, trust_of, trust_tables
from swingid.study.output import Study, counted, noted
from swingid.study.trials import Columns, Expectation
from swingid.table import Column, Table

if TYPE_CHECKING:
    import pyarrow as pa


HEADINGS = ("RMSE", "bias", "covers", "half-width/RMSE", "efficiency", "answers")

MOST_LEVELS = 12
"""Levels of a factor beyond which its values are put into `BINS` groups of equal size."""

BINS = 4

LOOP = ("wanted", "tracking", "k_tilde", "settling", "chatter", "saturated")


@dataclass(frozen=True)
class Statistics:
    """Figures of one method. Errors and widths are relative to the truth; each with its standard error, NaN if unknown.

    coverage: share of the 95 % intervals that contain the true value, with its binomial error (Agresti and Coull).
    width: median half-width over RMSE, 1.96 where intervals are right and errors normal. efficiency: Cramér and Rao's
    variance over the mean squared error, 1 at best. Over several points, each error counts in its own point's median
    half-width and its own run's bound.
    """

    runs: int
    answered: int
    bias: tuple[float, float]
    rmse: tuple[float, float]
    p95: float
    coverage: tuple[float, float]
    half_width: float
    width: float
    efficiency: tuple[float, float]
    refusals: dict[str, int] = field(default_factory=dict)
    warnings: dict[str, int] = field(default_factory=dict)


def statistics_of(columns: Columns, method: str = "") -> Statistics:
    """The figures of some rows of one method and quantity."""
    seen = Expectation.of(method, columns)
    known = seen.errors[np.isfinite(seen.errors)]
    rmse, spread = seen.rmse, _error_of_mean(known**2)
    return Statistics(
        runs=len(seen.errors),
        answered=seen.answered,
        bias=(seen.bias, _error_of_mean(known)),
        rmse=(rmse, spread / (2 * rmse) if len(known) > 1 and rmse > 0 else float("nan")),
        p95=seen.p95,
        coverage=seen.coverage,
        half_width=seen.half_width,
        width=_width(columns),
        efficiency=_efficiency(columns),
        refusals=seen.refusals,
        warnings=seen.warnings,
    )


def _error_of_mean(values: Array) -> float:
    return float(np.std(values, ddof=1) / np.sqrt(len(values))) if len(values) > 1 else float("nan")


def _width(columns: Columns) -> float:
    """Median half-width over the root mean square of the errors."""
    half_widths = (columns["high"] - columns["low"]) / 2
    widths = np.full(len(half_widths), np.nan)
    for point in np.unique(columns["point"]):
        of_point = (columns["point"] == point) & np.isfinite(half_widths)
        if of_point.any():
            widths[of_point] = np.median(half_widths[of_point])
    shares = ((columns["value"] - columns["truth"]) / widths)[widths > 0]
    size = float(np.mean(shares**2)) if len(shares) else 0.0
    return size**-0.5 if size > 0 else float("nan")


def _efficiency(columns: Columns) -> tuple[float, float]:
    """Least mean squared error over that of the errors, and its standard error."""
    off = (columns["value"] - columns["truth"]) / columns["bound"]
    squares = off[np.isfinite(columns["value"])] ** 2
    if not len(squares) or not np.isfinite(squares).all() or not np.mean(squares) > 0:
        return float("nan"), float("nan")
    mean = float(np.mean(squares))
    return 1 / mean, _error_of_mean(squares) / mean**2


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
class Summary(Study):
    """The figures of a campaign; `columns` holds the results by column, for pictures."""

    plan: Plan
    trials: int
    failures: Mapping[str, int]
    overall: tuple[Cell, ...]
    by_level: tuple[Cell, ...]
    effects: tuple[Effect, ...]
    loop: Mapping[str, float]
    columns: Columns

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
            "failures": self.failures,
            "overall": [_cell(cell) for cell in self.overall],
            "by_level": [_cell(cell) for cell in self.by_level],
            "effects": [
                {
                    "method": e.method,
                    "quantity": e.quantity,
                    "factor": e.factor,
                    "lowest_bias": e.low,
                    "highest_bias": e.high,
                    "largest_rmse": e.rmse,
                }
                for e in self.effects
            ],
            "loop": self.loop,
            "trust": trust_of(self.plan, self.columns),
        }

    def refusals_and_warnings(self) -> Iterator[tuple[str, str]]:
        """Count for each method over all runs what it did, and with which codes how often."""
        for cell in self.overall:
            s = cell.statistics
            for what, codes in (("refused", s.refusals), ("warned", s.warnings)):
                if codes:
                    yield f"{cell_name(cell)} {what}", counted(codes, s.runs)

    def text(self) -> str:
        """Figures of every method for a terminal: over all runs, then at each level of each factor."""
        plan = self.plan
        lines = [f"[[{plan.name}: {self.trials} runs of the twin, relative errors]]"]
        lines += statistics_table(self.overall).lines()
        for factor in plan.tables.factors:
            cells = [cell for cell in self.by_level if cell.factor == factor and factor not in fault_factors(plan)]
            if cells:
                lines += ["", f"[[by {factor}]]"]
                lines += statistics_table(cells, factor).lines()
        for table in trust_tables(plan, self.columns):
            lines += ["", *table.lines()]
        lines += ["", *noted(f"{what}: {codes}" for what, codes in self.refusals_and_warnings())]
        if self.failures:
            lines += noted([f"runs without a log: {counted(self.failures, self.trials)}"])
        return "\n".join(lines).rstrip()


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
        {name: median_of(columns[name][first]) for name in LOOP},
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


def _cell_of(columns: Columns, method: str, quantity: str, rows: Bools, factor: str = "", level: str = "") -> Cell:
    of_cell = rows & (columns["method"] == method) & (columns["quantity"] == quantity)
    picked = {name: values[of_cell] for name, values in columns.items()}
    return Cell(method, quantity, factor, level, statistics_of(picked, method))


def _effects(cells: Sequence[Cell], pairs: Sequence[tuple[str, str]]) -> Iterator[Effect]:
    """Return for each factor and method the levels with the lowest and highest bias and the largest RMSE."""
    for method, quantity in pairs:
        answered = [c for c in cells if (c.method, c.quantity) == (method, quantity) and c.statistics.answered]
        for factor in dict.fromkeys(c.factor for c in answered):
            biases = [(c.statistics.bias[0], c.level) for c in answered if c.factor == factor]
            sizes = [(c.statistics.rmse[0], c.level) for c in answered if c.factor == factor]
            yield Effect(method, quantity, factor, min(biases), max(biases), max(sizes))


def median_of(values: Array) -> float:
    """Median of the finite values, NaN where there are none."""
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else math.nan


NAMES = {"half_width": "median_half_width", "width": "half_width_over_rmse"}
"""Statistics by their key in JSON, where that is another."""


def _cell(cell: Cell) -> dict[str, Any]:
    """Method, quantity, level and statistics, each of these that has a standard error with it."""
    values: dict[str, Any] = {"method": cell.method, "quantity": cell.quantity}
    if cell.factor:
        values |= {"factor": cell.factor, "level": cell.level}
    for field_name, value in vars(cell.statistics).items():
        name = NAMES.get(field_name, field_name)
        values |= {name: value[0], f"{name}_standard_error": value[1]} if isinstance(value, tuple) else {name: value}
    return values


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


def statistics_table(cells: Sequence[Cell], factor: str = "", *, fine: bool = False) -> Table:
    """The figures of every method, at each level of `factor` where one is given; `fine` for pages."""
    entries = [figures(cell.statistics) for cell in cells]
    headings = [heading for k, heading in enumerate(HEADINGS) if any(row[k] for row in entries)]
    rows = [(cell_name(c), *figures(c.statistics, headings, fine=fine)) for c in cells]
    numbers = tuple(Column(heading, "number", True) for heading in headings)
    if not factor:
        return Table((Column("method"), *numbers), tuple(rows))
    before = ["", *(cell.level for cell in cells)] if fine else [""] * len(cells)  # a page names a level once
    levels = [("" if c.level == b else c.level, *row) for c, b, row in zip(cells, before, rows, strict=False)]
    return Table((Column(factor, "level"), Column("method"), *numbers), tuple(levels), title=factor)
