"""From an Arrow table to swingid's Table; shared by the formats that pyarrow reads."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from swingid.errors import InputError
from swingid.recording.formats.numerals import plain_cells
from swingid.recording.formats.stamps import over_midnight, seconds_of
from swingid.recording.formats.table import Table

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from swingid.numerics.arrays import Array


def table_from_arrow(
    table: Any,
    name: str,
    raw_metadata: str,
    unreadable_rows: int = 0,
    units: tuple[str, ...] = (),
    decimal: str = ".",
) -> Table:
    """Named columns of a pyarrow.Table; names lose the blanks around them.

    name: the file's, for messages. raw_metadata: JSON text that swingid wrote. unreadable_rows: left out by the reader.
    units: of the columns in their order, from a line below the header. decimal: sign of the numbers in cells of text.
    Raises InputError when two columns have one name, or the file has columns and no row.
    """
    names = [str(column).strip() for column in table.column_names]
    for column in names:
        if names.count(column) > 1:
            raise InputError(f"{name} has two columns named {column!r}; rename one of them.", code="double-column")
    if names and table.num_rows == 0:
        raise InputError(f"{name} has a header but no rows of numbers; log a motion.", code="empty-file")
    stated = {column: unit for column, unit in zip(names, units, strict=False) if unit}
    columns = {}
    for k, column in enumerate(names):
        columns[column], is_time = _array(table.column(k), decimal)
        stated |= {column: "s"} if is_time else {}
    return Table(columns, parse_metadata(raw_metadata), unreadable_rows, stated)


def parse_metadata(raw: str) -> dict[str, object]:
    """The JSON object that swingid wrote into a file; empty for anything else, since metadata are no data."""
    try:
        parsed = json.loads(raw)
    except (ValueError, RecursionError):
        return {}
    return parsed if isinstance(parsed, dict) else {}


def _array(column: Any, decimal: str) -> tuple[Array | NDArray[np.object_], bool]:
    """The cells of a column, and whether they are instants or durations, which are in s then."""
    import pyarrow as pa

    kind = column.type
    if pa.types.is_temporal(kind):
        return _seconds(column), True
    if pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind):
        return _numbers(column.cast(pa.float64(), safe=False)), False
    cells = [None if cell is None else str(cell) for cell in column.to_pylist()]
    seconds = seconds_of(cells)
    if seconds is not None:
        return seconds, True
    return np.array(plain_cells(cells, decimal), dtype=object), False


def _seconds(column: Any) -> Array:
    """Seconds since 1970 of stamps with a date, since midnight of times of day, of durations; NaN where empty."""
    import pyarrow as pa

    kind = column.type
    if pa.types.is_date(kind):
        column = column.cast(pa.timestamp("s"))
        kind = column.type
    whole = column.cast(pa.int32() if pa.types.is_time32(kind) else pa.int64())
    per_second = {"s": 1, "ms": 1e3, "us": 1e6, "ns": 1e9}[kind.unit]
    seconds: Array = _numbers(whole.cast(pa.float64(), safe=False)) / per_second
    return over_midnight(seconds) if pa.types.is_time(kind) else seconds


def _numbers(column: Any) -> Array:
    """A column of doubles, NaN where a cell is empty; not by `to_numpy`, which imports pandas where it is installed."""
    whole = column.fill_null(np.nan) if column.null_count else column
    parts = [np.from_dlpack(chunk) for chunk in whole.chunks]
    return np.concatenate(parts) if parts else np.zeros(0)
