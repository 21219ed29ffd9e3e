"""HDF5, and with it MATLAB v7.3: every vector of numbers in the file, by its path; by the package h5py."""

from __future__ import annotations

import importlib
import io
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swingid.errors import InputError
from swingid.recording.formats.arrow import parse_metadata
from swingid.recording.formats.isolated import UnreadableError, is_installed, read_apart, require
from swingid.recording.formats.table import METADATA_KEY, Table, add_vectors, most_unpacked

if TYPE_CHECKING:
    from swingid.numerics.arrays import Array
    from swingid.recording.formats.table import Columns

ENDINGS = (".h5", ".hdf5")
MAGIC = b"\x89HDF\r\n\x1a\n"

MOST_REFERENCES = 1000
"""Cells or structs with more elements than this are no signals of one log: a recorder has some hundred at most."""

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
        message = f"{name} is not a whole HDF5 file: damaged, or cut off while it was written; save it again."
        raise InputError(message, code="not-a-table") from None
    if not columns:
        message = f"{name} holds no vectors of numbers, only scalars, texts or objects; save plain arrays."
        raise InputError(message, code="not-a-table")
    return Table(columns, parse_metadata(raw))


def extract(path: str) -> tuple[Columns, str]:
    """Columns and metadata of a file; for the process of `isolated`, for damage makes the library loop for ever."""
    h5py: Any = importlib.import_module("h5py")
    columns: Columns = {}
    spare = most_unpacked(Path(path).stat().st_size)

    with h5py.File(path, "r") as file:
        for name, item in data_sets(file):
            if item.dtype.kind in "biuf":
                spare -= 8 * int(item.size or 0)
                if spare < 0:
                    raise ValueError("more numbers than the file can hold")
                array = item[()]
                # MATLAB writes its arrays with the axes swapped
                add_vectors(columns, name, array.T if "MATLAB_class" in item.attrs else array)
        raw = file.attrs.get(METADATA_KEY, "{}")
    return columns, raw if isinstance(raw, str) else "{}"


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
