"""What every file format gives: named columns, as they stand in the file."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

#: Where swingid keeps its metadata inside a file: the CSV comment's prefix, the key of a Parquet schema.
METADATA_KEY = "swingid"


@dataclass(frozen=True)
class Table:
    """Columns of a file by name, float64 arrays or, where cells hold text, object arrays (str and None).

    `metadata` is what swingid wrote into the file, empty for other files; `unreadable_rows` counts rows with
    the wrong number of cells, which the reader left out.
    """

    columns: Mapping[str, NDArray[np.float64] | NDArray[np.object_]]
    metadata: Mapping[str, object] = field(default_factory=dict)
    unreadable_rows: int = 0

    def numbers(self, name: str) -> tuple[NDArray[np.float64], str | None]:
        """Column `name` as float64, NaN where a cell is no number; and the first text among the numbers."""
        column = self.columns[name]
        if column.dtype != object:
            return column.astype(np.float64, copy=False), None
        values = np.full(len(column), np.nan)
        first_text: str | None = None
        for row, cell in enumerate(column):
            try:
                values[row] = float(cell) if cell is not None else np.nan
            except (TypeError, ValueError):
                first_text = first_text or str(cell).strip()[:40] or None
        return values, first_text
