"""HDF5, and with it MATLAB v7.3: every vector of numbers in the file, by its path; by the package h5py.

A file is read whole or some rows at a time, in the process of `isolated`.
"""

from __future__ import annotations

import importlib
import io
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from swingid.errors import InputError
from swingid.recording.formats.arrow import parse_metadata
from swingid.recording.formats.isolated import UnreadableError, is_installed, read_apart, read_part_apart, require
from swingid.recording.formats.table import METADATA_KEY, WIDEST, PartFile, Table, header_of, most_unpacked, resized

if TYPE_CHECKING:
    from swingid.numerics.arrays import Array
    from swingid.recording.formats.table import Columns

ENDINGS = (".h5", ".hdf5")
MAGIC = b"\x89HDF\r\n\x1a\n"

MOST_REFERENCES = 1000
"""Cells or structs with more elements than this are no signals of one log: a recorder has some hundred at most."""

DAMAGED = "is not a whole HDF5 file: damaged, or cut off while it was written; save it again."

DEPTH = 16
"""Of groups and references in each other; a damaged file could refer without end."""


def read(content: bytes, name: str) -> Table:
    """Data sets as columns: a vector as ``group.dataset``, a matrix as its columns (MATLAB stores them as rows).

    What MATLAB keeps by reference is named as in MATLAB: ``cell{2}``, and ``s(2).field`` of several structs.

    Raises InputError for a damaged file, one without vectors, and where h5py is missing.
    """
    if not is_installed("h5py"):
        require("h5py", "h5py", name, "an HDF5 file (MATLAB v7.3 is one)")
    try:
        columns, raw = read_apart("h5py", f"{__name__}:extract", content)
    except UnreadableError:
        raise InputError(f"{name} {DAMAGED}", code="not-a-table") from None
    if not columns:
        message = f"{name} holds no vectors of numbers, only scalars, texts or objects; save plain arrays."
        raise InputError(message, code="not-a-table")
    return Table(columns, parse_metadata(raw))


def extract(
    path: str, columns: list[str] | None = None, start: int = 0, stop: int | None = None
) -> tuple[Columns, str]:
    """Columns of a file, all or some, and of all or some rows, and metadata; for the process of `isolated`.

    There, for damage makes the library loop for ever.
    """
    values: Columns = {}
    with _opened(path) as file:
        for numbers in _numbers_in(file, path):
            if columns is None or set(numbers.names) & set(columns):
                rows = numbers.read(start, numbers.length if stop is None else stop)
                named = zip(numbers.names, rows, strict=True)
                values |= {name: row for name, row in named if columns is None or name in columns}
        return values, _metadata(file)


MOST = 4_000_000
"""Rows of a compressed chunk, at most: it is unpacked as a whole."""

LAYOUT = 1 << 20
"""Bytes that the names and lengths of the columns may take."""


@dataclass(frozen=True)
class File(PartFile):
    """An HDF5 file some rows at a time: the length of each column, rows of the largest chunk."""

    lengths: dict[str, int]
    chunk: int

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
        if not lengths or chunk > MOST:
            return None
        return cls(path, max(lengths.values()), header_of(lengths, parse_metadata(raw)), lengths, chunk)

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
                block, _ = read_part_apart("h5py", f"{__name__}:extract", Path(self.path), size, **options)
            except UnreadableError:
                raise InputError(f"{self.path} {DAMAGED}", code="not-a-table") from None
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
    columns: Columns = {}
    with _opened(path) as file:
        for numbers in _numbers_in(file, path):
            chunk = 1 if numbers.item.chunks is None else numbers.item.chunks[numbers.axis]
            columns |= {name: np.array([numbers.length, chunk], np.float64) for name in numbers.names}
        return columns, _metadata(file)


def _metadata(file: Any) -> str:
    raw = file.attrs.get(METADATA_KEY, "{}")
    return raw if isinstance(raw, str) else "{}"


def _opened(path: str) -> Any:
    return importlib.import_module("h5py").File(path, "r")


def _numbers_in(file: Any, path: str) -> Iterator[_Numbers]:
    """The data sets of numbers that are columns: vectors, and matrices, of which MATLAB swaps the axes.

    Raises ValueError where they have more numbers than the file can hold.
    """
    spare = most_unpacked(Path(path).stat().st_size)
    for name, item in data_sets(file):
        if item.dtype.kind not in "biuf" or (item.size or 0) < 2:
            continue
        long = [axis for axis, length in enumerate(item.shape) if length > 1]
        if len(long) == 1:
            names: tuple[str, ...] = (name,)
            axis = long[0]
        elif len(long) == 2 and min(item.shape[axis] for axis in long) <= WIDEST:
            rows, columns = reversed(long) if "MATLAB_class" in item.attrs else long
            upright = item.shape[rows] >= item.shape[columns]
            count, axis = (item.shape[columns], rows) if upright else (item.shape[rows], columns)
            pattern = "{}(:,{})" if upright else "{}({},:)"
            names = tuple(pattern.format(name, k) for k in range(1, count + 1))
        else:
            continue
        spare -= 8 * int(item.size)
        if spare < 0:
            raise ValueError("more numbers than the file can hold")
        yield _Numbers(item, names, axis)


def data_sets(group: Any, prefix: str = "", above: tuple[Any, ...] = ()) -> Iterator[tuple[str, Any]]:
    """The data sets of a group (of h5py), of the groups in it and of its references, each with its path.

    Links and references that lead nowhere are passed over, groups and references that contain the one that leads to
    them, and texts and empty arrays of MATLAB.
    """
    h5py: Any = importlib.import_module("h5py")
    above = (*above, group)
    for key in group:
        is_link = not isinstance(group.get(key, getlink=True), h5py.HardLink)
        item = group.get(key) if is_link else group[key]
        if isinstance(item, h5py.Dataset):
            yield from _arrays(item, prefix, key, above)
        elif isinstance(item, h5py.Group) and not key.startswith("#") and item not in above:
            yield from data_sets(item, f"{prefix}{key}.", above)


def _arrays(item: Any, prefix: str, key: str, above: tuple[Any, ...]) -> Iterator[tuple[str, Any]]:
    """A data set called `prefix` + `key`, or those to which it refers: the cells of MATLAB, a field of several structs.

    The field of struct k of `s` is called ``s(k).field``, by its `Name` where it has one (``s.Name``, the rest behind
    it where that is not `Data`), cell k of `c` ``c{k}``.
    """
    h5py: Any = importlib.import_module("h5py")
    kind = bytes(item.attrs.get("MATLAB_class", b""))
    if kind == b"char" or "MATLAB_empty" in item.attrs:
        return
    if h5py.check_ref_dtype(item.dtype) is not h5py.Reference:
        yield prefix + key, item
        return
    if not item.size or item.size > MOST_REFERENCES or item in above or len(above) > DEPTH:
        return
    above = (*above, item)
    is_field = kind != b"cell" and prefix.endswith(".")
    titles = _titles(item) if is_field else []
    for k, reference in enumerate(item[()].ravel(), start=1):
        name = f"{prefix[:-1]}({k}).{key}" if is_field else f"{prefix}{key}{{{k}}}"
        if titles:
            name = f"{prefix}{titles[k - 1]}" + ("" if key == "Data" else f".{key}")
        target = item.file[reference] if reference else None
        if isinstance(target, h5py.Dataset):
            yield from _arrays(target, "", name, above)
        elif isinstance(target, h5py.Group) and target not in above:
            yield from data_sets(target, f"{name}.", above)


def _titles(item: Any) -> list[str]:
    """The texts in the field `Name` of the structs of which `item` is a field; none where they are not one each."""
    names = item.parent.get("Name")
    references = () if names is None or names == item or names.shape != item.shape else names[()].ravel()
    texts = [item.file[reference] if reference else None for reference in references]
    titles = [
        "".join(map(chr, text[()].ravel().tolist()))
        for text in texts
        if text is not None and bytes(text.attrs.get("MATLAB_class", b"")) == b"char" and text.dtype.kind == "u"
    ]
    return titles if len(set(titles)) == item.size and all(titles) else []


def write(columns: Mapping[str, Array], metadata: Mapping[str, object]) -> bytes:
    """The bytes of an HDF5 file, one data set per column, metadata (JSON) as an attribute; reads back bit for bit."""
    h5py = require("h5py", "h5py", "the output", "an HDF5 file")
    buffer = io.BytesIO()
    with h5py.File(buffer, "w", track_order=True) as file:
        for name, values in columns.items():
            file.create_dataset(name.replace("/", "."), data=values, compression="gzip", compression_opts=4)
        file.attrs[METADATA_KEY] = json.dumps(metadata)
    return buffer.getvalue()
