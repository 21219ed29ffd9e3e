"""The columns of a file as they stand there: type, unit, range, first values, the grid that the values lie on.

The steps of an angle can show its unit (`unit_of_steps`), see `recording.grid`.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Literal

import numpy as np

from swingid.recording.grid import grid_of, is_decimal, unit_of_step

if TYPE_CHECKING:
    from swingid.numerics.arrays import Array, Bools
    from swingid.recording.formats.table import Table


SHOWN = 3
SAMPLE = 20_000
"""Rows from which the usual range of a column is estimated."""

MANY_DIGITS = 1e7
"""Numbers that are shown with all their digits from here on, such as seconds since 1970."""

FAR, FEWEST, MANY = 20.0, 50, 0.005
"""Usual ranges from the middle beyond which a single number is an outlier; the rows, and the share, for it."""

FLAT = 20
"""Rows in a run at one extreme value from which on the value is a limit and no peak."""


@dataclass(frozen=True, eq=False)
class Column:
    """One column, in the units of the file.

    values (n,): NaN where a cell is no number, or a single outlier far outside of all others (`outliers` of them;
    low and high are without). kind: "whole numbers", "numbers", "text", "empty". step: the grid on
    which the values lie, 0 where there is none. first: of the file, as text. changes: share of rows that differ from
    the row before. at_low, at_high: share of the rows that stand at the lowest and at the highest value in runs.
    """

    name: str
    unit: str
    kind: Literal["whole numbers", "numbers", "text", "empty"]
    values: Array
    first: tuple[str, ...]
    missing: int
    low: float
    high: float
    step: float
    changes: float
    at_low: float
    at_high: float
    outliers: int = 0

    @property
    def constant(self) -> bool:
        """Return whether all numbers are one number."""
        return self.kind in ("numbers", "whole numbers") and self.low == self.high

    @property
    def span(self) -> float:
        """The lowest to the highest value, as text; 0 for a column without numbers."""
        return self.high - self.low if np.isfinite(self.high - self.low) else 0.0

    def to_dict(self) -> dict[str, object]:
        """Return plain data for JSON, without the values."""
        kept = (field.name for field in fields(self) if field.name != "values")
        return {name: getattr(self, name) for name in kept} | {"first": list(self.first)}


def describe(table: Table) -> list[Column]:
    """All columns of a file's table, in its order."""
    return [_column(table, name) for name in table.columns]


def _column(table: Table, name: str) -> Column:
    raw = table.columns[name]
    values, text = table.numbers(name)
    good = np.isfinite(values)
    missing = int(len(values) - np.count_nonzero(good))
    far = _far_outside(values)
    outliers = int(np.count_nonzero(far))
    if outliers:
        values = np.where(far, np.nan, values)
        good &= ~far
    finite = values if good.all() else values[good]
    first = tuple(
        str(cell) if raw.dtype == object else f"{cell:.{7 if abs(cell) < MANY_DIGITS else 14}g}" for cell in raw[:SHOWN]
    )
    unit = table.unit(name)
    if not finite.size:
        return Column(name, unit, "text" if text else "empty", values, first, missing, np.nan, np.nan, 0, 0, 0, 0)
    low, high = float(finite.min()), float(finite.max())
    whole = bool((finite[:10_000] == np.round(finite[:10_000])).all() and (finite == np.round(finite)).all())
    return Column(
        name=name,
        unit=unit,
        kind="whole numbers" if whole else "numbers",
        values=values,
        first=first,
        missing=missing,
        low=low,
        high=high,
        step=grid_of(finite),
        changes=float(np.mean(finite[1:] != finite[:-1])) if finite.size > 1 else 0.0,
        at_low=_share_of_runs(finite == low),
        at_high=_share_of_runs(finite == high),
        outliers=outliers,
    )


def _far_outside(values: Array) -> Bools:
    """Single numbers far outside of all others: faults of the logger, which would spoil every estimate of a size."""
    sample = values[:: max(1, len(values) // SAMPLE)]
    sample = sample[np.isfinite(sample)]
    none = np.zeros(len(values), dtype=bool)
    if sample.size < FEWEST:
        return none
    low, high = np.quantile(sample, (0.005, 0.995))
    if not low < high:
        return none
    with np.errstate(over="ignore", invalid="ignore"):
        far = np.abs(values - (low + high) / 2) > FAR * (high - low)
    alone = far.copy()
    alone[1:] &= ~far[:-1]
    alone[:-1] &= ~far[1:]
    return alone if np.count_nonzero(far) < MANY * len(values) else none


def _share_of_runs(there: Bools) -> float:
    """Share of rows in runs of at least three rows that are `there`."""
    if np.count_nonzero(there) < 3 or there.all():
        return 0.0
    edges = np.flatnonzero(np.diff(np.concatenate(([False], there, [False])).astype(np.int8)))
    lengths = edges[1::2] - edges[::2]
    return float(lengths[lengths >= 3].sum() / len(there))


def steps_seen(column: Column) -> bool:
    """Return whether the values lie on the grid of an encoder, and not on that of the digits that were written."""
    return column.step > 0 and (column.kind == "whole numbers" or not is_decimal(column.step))


def unit_of_steps(column: Column) -> tuple[str, int]:
    """`unit_of_step` of a column's steps."""
    return unit_of_step(column.step) if column.kind != "whole numbers" and steps_seen(column) else ("", 0)
