"""What every file format gives: named columns, as they stand in the file."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from swingid.recording.formats.cells import is_stamp, seconds_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from swingid.numerics.arrays import Array

    Columns = dict[str, Array | NDArray[np.object_]]


#: Where swingid keeps its metadata inside a file: the CSV comment's prefix, the key of a Parquet schema.
METADATA_KEY = "swingid"


_UNIT = re.compile(r"^(?P<name>.*?\S)\s*[\[(](?P<unit>[^\[\]()=]{1,12})[\])]$")


def split_unit(column: str) -> tuple[str, str]:
    """Name and unit of a header cell: "theta [deg]" gives ("theta", "deg"), "x(:,2)" stays as it is."""
    match = _UNIT.match(column)
    if match is None or not re.search(r"[A-Za-z°%µ]", match["unit"]):
        return column, ""
    return match["name"], match["unit"].strip()


MOST_BYTES, MOST_TIMES = 32 << 20, 100
"""A file may unpack to so many bytes, and this many times its own size; more is damage, or no log."""


def most_unpacked(size: int) -> int:
    """Bytes that the numbers in a file of so many bytes may have."""
    return MOST_BYTES + MOST_TIMES * size


@dataclass(frozen=True)
class Table:
    """Columns of a file by name, float64 arrays or, where cells hold text, object arrays (str and None).

    `metadata` is what swingid wrote into the file, empty for other files; `unreadable_rows` counts rows with
    the wrong number of cells, which the reader left out. `units`: by column, from a line of units below the header.
    """

    columns: Mapping[str, Array | NDArray[np.object_]]
    metadata: Mapping[str, object] = field(default_factory=dict)
    unreadable_rows: int = 0
    units: Mapping[str, str] = field(default_factory=dict)

    def find(self, name: str) -> str | None:
        """The column called `name`: exactly, else the only one that is so but for a unit such as " [deg]" or " (V)"."""
        if name in self.columns:
            return name
        bare = [column for column in self.columns if split_unit(column)[0] == name]
        return bare[0] if len(bare) == 1 else None

    def unit(self, column: str) -> str:
        """The unit that the header states for a column, in its row of units or its name; "" where it states none."""
        return self.units.get(column, "") or split_unit(column)[1] or ("s" if self._has_stamps(column) else "")

    def _has_stamps(self, column: str) -> bool:
        """Return whether the cells are times of day or dates, which `numbers` gives in s."""
        cells = self.columns[column]
        if cells.dtype != object:
            return False
        return is_stamp(str(next((cell for cell in cells if cell), "")))

    def numbers(self, name: str) -> tuple[Array, str | None]:
        """Column `name` as float64, NaN where a cell is no number; and the first text among the numbers.

        Times of day and dates are in s, see `cells.seconds_of`.
        """
        column = self.columns[name]
        if column.dtype != object:
            return column.astype(np.float64, copy=False), None
        if self._has_stamps(name):
            stamps = seconds_of([None if cell is None else str(cell) for cell in column])
            if stamps is not None:
                return stamps, None
        values = np.full(len(column), np.nan)
        first_text: str | None = None
        for row, cell in enumerate(column):
            try:
                values[row] = float(cell) if cell is not None else np.nan
            except (TypeError, ValueError):
                first_text = first_text or str(cell).strip()[:40] or None
        return values, first_text


@dataclass(frozen=True)
class PartFile(ABC):
    """A file that is read in pieces: path, rows (of text about so many), columns with a row of zeros each."""

    path: str
    rows: int
    columns: Table

    @classmethod
    @abstractmethod
    def open(cls, path: str) -> PartFile | None:
        """Look at a file; None where it cannot be read so."""

    def header(self) -> Table:
        """The columns, each with a row of zeros in the place of its own."""
        return self.columns

    def together(self) -> list[str]:
        """The columns that have a value in every row."""
        return list(self.columns.columns)

    @abstractmethod
    def pieces(self, rows: int, columns: list[str]) -> Iterator[Table]:
        """The columns in pieces of about `rows` rows; raises InputError where the file cannot be read."""


def header_of(names: Iterable[str], metadata: Mapping[str, object], units: Mapping[str, str] | None = None) -> Table:
    """A table with these columns, each with a row of zeros."""
    return Table({name: np.zeros(1) for name in names}, metadata, 0, units or {})


def stacked(pieces: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The rows of pieces with the same columns, one below the other; no column of no piece."""
    return {name: np.concatenate([piece[name] for piece in pieces]) for name in (pieces[0] if pieces else ())}


def resized(tables: Iterable[Table], rows: int) -> Iterator[Table]:
    """The rows of tables with the same columns of numbers, `rows` in each, so that a log in any format is cut alike."""
    waiting: list[Mapping[str, Any]] = []
    count = 0
    for table in tables:
        waiting.append(table.columns)
        count += len(next(iter(table.columns.values())))
        if count < rows:
            continue
        joined = stacked(waiting)
        full = count // rows * rows
        for begin in range(0, full, rows):
            yield Table({name: values[begin : begin + rows] for name, values in joined.items()})
        waiting, count = [{name: values[full:] for name, values in joined.items()}], count - full
    if count:
        yield Table(stacked(waiting))


WIDEST = 64
"""A matrix with more columns than this is a picture or a table of something else."""


def add_vectors(columns: Columns, name: str, array: NDArray[Any]) -> None:
    """Add a real array of one or two dimensions (others are left out) to `columns`.

    A vector keeps its name, a matrix gives ``name(:,2)``, or ``name(2,:)`` where its rows are longer.
    """
    if array.dtype.kind not in "biuf" or array.size < 2:
        return
    values = np.squeeze(array.astype(np.float64))
    if values.ndim == 1:
        columns[name] = values
    elif values.ndim == 2 and min(values.shape) <= WIDEST:
        if values.shape[0] >= values.shape[1]:
            columns.update({f"{name}(:,{k})": column for k, column in enumerate(values.T, start=1)})
        else:
            columns.update({f"{name}({k},:)": row for k, row in enumerate(values, start=1)})


def flat(row: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """The cells of nested objects, as ``outer.inner``; lists are left out."""
    cells: dict[str, Any] = {}
    for key, value in row.items():
        if isinstance(value, dict):
            cells |= flat(value, f"{prefix}{key}.")
        elif not isinstance(value, list):
            cells[prefix + str(key)] = value
    return cells


def columns_of(rows: Sequence[Mapping[str, Any]]) -> Columns:
    """Columns over all keys that occur in rows of cells; a row without a key has no number there."""
    columns: Columns = {}
    for name in dict.fromkeys(key for row in rows for key in row):
        cells = [row.get(name) for row in rows]
        if all(cell is None or isinstance(cell, int | float) for cell in cells):
            columns[name] = np.array([number_of(cell) for cell in cells])
        else:
            columns[name] = np.array([None if cell is None else str(cell) for cell in cells], dtype=object)
    return columns


def number_of(cell: float | None) -> float:
    """A cell as a double; NaN for none, and for an integer of hundreds of digits."""
    try:
        return np.nan if cell is None else float(cell)
    except OverflowError:
        return np.nan
