"""A large HDF5 file (MATLAB v7.3 is one) some rows at a time, read in the process of `isolated`."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from swingid.errors import InputError
from swingid.recording.formats.arrow import parse_metadata
from swingid.recording.formats.hdf5 import data_sets
from swingid.recording.formats.isolated import UnreadableError, is_installed, read_part_apart
from swingid.recording.formats.table import METADATA_KEY, WIDEST, Table, most_unpacked, resized

if TYPE_CHECKING:
    from swingid.numerics.arrays import Array
    from swingid.recording.formats.table import Columns

MOST = 4_000_000
"""Rows of a compressed chunk, at most: it is unpacked as a whole."""

LAYOUT = 1 << 20
"""Bytes that the names and lengths of the columns may take."""


@dataclass(frozen=True)
class File:
    """An HDF5 file: its path, the length of each column, rows of the largest chunk, metadata."""

    path: str
    lengths: dict[str, int]
    chunk: int
    metadata: dict[str, object]

    @classmethod
    def open(cls, path: str) -> File | None:
        """Look at its data sets; None where it holds none, is damaged, or h5py is missing."""
        if not is_installed("h5py"):
            return None
        try:
            columns, raw = read_part_apart("h5py", f"{__name__}:layout", Path(path), LAYOUT)
        except UnreadableError:
            return None  # reading it whole gives the reason
        lengths = {name: int(values[0]) for name, values in columns.items()}
        chunk = max((int(values[1]) for values in columns.values()), default=1)
        return cls(path, lengths, chunk, parse_metadata(raw)) if lengths and chunk <= MOST else None

    @property
    def rows(self) -> int:
        """Values of the longest column."""
        return max(self.lengths.values())

    def header(self) -> Table:
        """The columns, each with a row of zeros in the place of its own."""
        return Table({name: np.zeros(1) for name in self.lengths}, self.metadata)

    def together(self) -> list[str]:
        """The columns that have a value in every row: the longest."""
        return [name for name, length in self.lengths.items() if length == self.rows]

    def pieces(self, rows: int, columns: list[str]) -> Iterator[Table]:
        """The columns in pieces of `rows` rows; InputError where they differ in length, or the file is damaged."""
        return resized(self._blocks(rows, columns), rows)

    def _blocks(self, rows: int, columns: list[str]) -> Iterator[Table]:
        """The columns in blocks of whole chunks, so that none is unpacked twice."""
        lengths = {name: self.lengths[name] for name in columns}
        first, length = next(iter(lengths.items()))
        other = next((name for name, count in lengths.items() if count != length), None)
        if other is not None:
            message = f"{self.path}: {other!r} has {lengths[other]} values but {first!r} has {length}"
            raise InputError(f"{message}; a log needs one value of each per row.", code="unequal-length")
        step = -(-rows // self.chunk) * self.chunk
        for start in range(0, length, step):
            stop = min(start + step, length)
            size = 8 * len(columns) * (stop - start)
            options = {"columns": columns, "start": start, "stop": stop}
            try:
                block, _ = read_part_apart("h5py", f"{__name__}:rows_of", Path(self.path), size, **options)
            except UnreadableError:
                message = f"{self.path} is not a whole HDF5 file: damaged, or cut off while it was written; save it"
                raise InputError(f"{message} again.", code="not-a-table") from None
            yield Table({name: block[name] for name in columns})


@dataclass(frozen=True)
class _Numbers:
    """A data set of numbers: the item of h5py, the names of its columns, the axis along which its rows are."""

    item: Any
    names: tuple[str, ...]
    axis: int

    @property
    def length(self) -> int:
        """Rows."""
        return int(self.item.shape[self.axis])

    def read(self, start: int, stop: int) -> Array:
        """The rows from `start` to `stop` of each column (columns, rows)."""
        index = [slice(None)] * self.item.ndim
        index[self.axis] = slice(start, stop)
        values = np.moveaxis(np.asarray(self.item[tuple(index)], np.float64), self.axis, -1)
        numbers: Array = np.ascontiguousarray(values.reshape(len(self.names), stop - start))
        return numbers


def layout(path: str) -> tuple[Columns, str]:
    """Return each column's length and the rows of a chunk, and the metadata; for the process of `isolated`."""
    with _opened(path) as file:
        columns: Columns = {}
        spare = most_unpacked(Path(path).stat().st_size)
        for numbers in _numbers_in(file):
            spare -= 8 * int(numbers.item.size)
            if spare < 0:
                raise ValueError("more numbers than the file can hold")
            chunk = 1 if numbers.item.chunks is None else numbers.item.chunks[numbers.axis]
            columns |= {name: np.array([numbers.length, chunk], np.float64) for name in numbers.names}
        raw = file.attrs.get(METADATA_KEY, "{}")
        return columns, raw if isinstance(raw, str) else "{}"


def rows_of(path: str, columns: list[str], start: int, stop: int) -> tuple[Columns, str]:
    """Some rows of some columns; for the process of `isolated`."""
    with _opened(path) as file:
        values: Columns = {}
        for numbers in _numbers_in(file):
            if set(numbers.names) & set(columns):
                values |= dict(zip(numbers.names, numbers.read(start, stop), strict=True))
        return {name: values[name] for name in columns}, "{}"


def _opened(path: str) -> Any:
    return importlib.import_module("h5py").File(path, "r")


def _numbers_in(file: Any) -> Iterator[_Numbers]:
    """The data sets of numbers that are columns, named as `hdf5.extract` names them."""
    for name, item in data_sets(file):
        if item.dtype.kind in "biuf" and (item.size or 0) >= 2:
            long = [axis for axis, length in enumerate(item.shape) if length > 1]
            if len(long) == 1:
                yield _Numbers(item, (name,), long[0])
            elif len(long) == 2 and min(item.shape[axis] for axis in long) <= WIDEST:
                # MATLAB writes its arrays with the axes swapped
                rows, columns = reversed(long) if "MATLAB_class" in item.attrs else long
                upright = item.shape[rows] >= item.shape[columns]
                count, axis = (item.shape[columns], rows) if upright else (item.shape[rows], columns)
                pattern = "{}(:,{})" if upright else "{}({},:)"
                yield _Numbers(item, tuple(pattern.format(name, k) for k in range(1, count + 1)), axis)
