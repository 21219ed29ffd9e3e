"""From Arrow tables, and tables that are in memory already, to swingid's Table."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from swingid.errors import InputError, UsageError
from swingid.recording.formats.cells import over_midnight, plain_cells, seconds_of
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
    *,
    shared: bool = False,
) -> Table:
    """Named columns of a pyarrow.Table; names lose the blanks around them.

    name: the file's, for messages. raw_metadata: JSON text that swingid wrote. unreadable_rows: left out by the reader.
    units: of the columns in their order, from a line below the header. decimal: sign of the numbers in cells of text.
    shared: columns may be memory of Arrow, not to be written to. Raises InputError when two columns have one name, or
    the file has columns and no row.
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
        columns[column], is_time = _array(table.column(k), decimal, shared=shared)
        stated |= {column: "s"} if is_time else {}
    return Table(columns, parse_metadata(raw_metadata), unreadable_rows, stated)


def parse_metadata(raw: str) -> dict[str, object]:
    """The JSON object that swingid wrote into a file; empty for anything else, since metadata are no data."""
    try:
        parsed = json.loads(raw)
    except (ValueError, RecursionError):
        return {}
    return parsed if isinstance(parsed, dict) else {}


def _array(column: Any, decimal: str, *, shared: bool) -> tuple[Array | NDArray[np.object_], bool]:
    """The cells of a column, and whether they are instants or durations, which are in s then."""
    import pyarrow as pa

    kind = column.type
    if pa.types.is_temporal(kind):
        return _seconds(column), True
    if pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind):
        return numbers_of(column, shared=shared), False
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
    seconds: Array = numbers_of(whole) / per_second
    return over_midnight(seconds) if pa.types.is_time(kind) else seconds


def numbers_of(column: Any, *, shared: bool = False) -> Array:
    """A column of numbers as doubles, NaN where a cell is empty.

    Not by `to_numpy`, which imports pandas where it is installed. shared: of one chunk the memory of Arrow itself.
    """
    import pyarrow as pa

    if column.type != pa.float64():  # a cast imports pyarrow.compute, which takes long
        column = column.cast(pa.float64(), safe=False)
    whole = column.fill_null(np.nan) if column.null_count else column
    parts = [np.from_dlpack(chunk) for chunk in whole.chunks]
    if shared and len(parts) == 1:
        return parts[0].astype(np.float64, copy=False)
    return np.concatenate(parts) if parts else np.zeros(0)


def table_of(data: Any) -> Table:
    """The table of a mapping of one-dimensional arrays by name, or of a pandas, polars or Arrow table.

    The latter are whatever has ``__arrow_c_stream__`` (the Arrow PyCapsule interface). Raises UsageError for anything
    else and for arrays that are no columns.
    """
    if hasattr(data, "__arrow_c_stream__"):
        import pyarrow as pa

        return table_from_arrow(pa.table(data), "the table", "{}")
    if not isinstance(data, Mapping):
        message = (
            f"a log in memory is a mapping of arrays or an Arrow, pandas or polars table, not {type(data).__name__}"
        )
        raise UsageError(f"{message}.", code="not-a-table")
    columns = {}
    units: dict[str, str] = {}
    for name, values in data.items():
        array = np.asarray(values)
        if np.ma.isMaskedArray(values):  # whose mask `asarray` drops
            array = np.where(np.ma.getmaskarray(values), np.nan, array.astype(np.float64))
        if array.ndim != 1:
            message = f"column {str(name)!r} has {array.ndim} dimensions; a column is one-dimensional"
            raise UsageError(f"{message}.", code="not-a-column")
        if array.dtype.kind in "Mm":  # instants and durations of NumPy
            array = array.astype(f"{array.dtype.kind}8[ns]").astype(np.int64) / 1e9
            units[str(name)] = "s"
        columns[str(name)] = array.astype(np.float64 if array.dtype.kind in "biuf" else object)
    return Table(columns, units=units)
