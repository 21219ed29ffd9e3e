"""Tables that are in memory already: a mapping of arrays, or anything with the Arrow stream interface."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from swingid.errors import UsageError
from swingid.recording.formats.arrow import table_from_arrow
from swingid.recording.formats.table import Table


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
        if array.ndim != 1:
            message = f"column {str(name)!r} has {array.ndim} dimensions; a column is one-dimensional"
            raise UsageError(f"{message}.", code="not-a-column")
        if array.dtype.kind in "Mm":  # instants and durations of NumPy
            array = array.astype(f"{array.dtype.kind}8[ns]").astype(np.int64) / 1e9
            units[str(name)] = "s"
        columns[str(name)] = array.astype(np.float64 if array.dtype.kind in "biuf" else object)
    return Table(columns, units=units)
