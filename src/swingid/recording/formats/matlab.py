"""MATLAB v5 files (save -v7 and older down to v5): arrays of numbers, fields of plain structs, time series in objects.

A reader of its own, after MATLAB's "MAT-File Format": SciPy's crashes the process on some damaged files, and a log that
was cut off is what people have. Objects (`timeseries`, `Simulink.SimulationData.Dataset`) are read by mat-io.
"""

from __future__ import annotations

import importlib
import io
import json
import math
import re
import struct
import zlib
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from swingid.errors import InputError
from swingid.recording.formats import hdf5
from swingid.recording.formats.arrow import parse_metadata
from swingid.recording.formats.isolated import UnreadableError, is_installed, read_apart, require
from swingid.recording.formats.table import METADATA_KEY, WIDEST, Table, add_vectors, most_unpacked

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from swingid.numerics.arrays import Array
    from swingid.recording.formats.table import Columns


ENDINGS = (".mat",)
MAGIC = b"MATLAB "

_HEADER = 128
_DEPTH = 8  # of structs in structs
_MATRIX, _COMPRESSED = 14, 15  # element types
_STRUCT, _NUMERIC = 2, range(6, 16)  # array classes: double, single, and the integers
_COMPLEX = 0x0800
#: Element types that hold numbers, as numpy's type codes.
_NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}


def read(content: bytes, name: str) -> Table:
    """Vectors by their name, fields of a struct as ``s.field``, of several structs as ``s(2).field``.

    A matrix gives ``name(:,2)`` or, if wide, ``name(2,:)``.
    Scalars, texts, cells, sparse and complex arrays are left out. A v7.3 file is HDF5 and read as such; where there
    are no vectors, time series inside objects are looked for. Raises InputError for v4 files and damaged ones.
    """
    if hdf5.MAGIC in content[:1024]:
        return hdf5.read(content, name)
    if not content.startswith(b"MATLAB 5.0"):
        message = f"{name} is not a MATLAB v5 file; save it in MATLAB with the option '-v7', or export CSV."
        raise InputError(message, code="not-a-table")
    columns: Columns = {}
    try:
        order = {b"IM": "<", b"MI": ">"}[content[126:_HEADER]]
        for kind, data in _elements(content[_HEADER:], order):
            if kind == _COMPRESSED:
                for inner, unpacked in _elements(_unpacked(data, most_unpacked(len(content))), order):
                    _collect(columns, "", inner, unpacked, order)
            else:
                _collect(columns, "", kind, data, order)
    except (ValueError, LookupError, StopIteration, OverflowError, struct.error, zlib.error):
        message = f"{name} is not a whole MATLAB file: damaged, or cut off while it was written; save it again."
        raise InputError(message, code="not-a-table") from None
    raw = "".join(map(chr, columns.pop(METADATA_KEY, np.empty(0)).astype(np.int64)))
    if not columns:
        columns = read_objects(content, name)
    if not columns:
        message = f"{name} holds no vectors of numbers and no time series; save arrays in MATLAB, or export CSV."
        raise InputError(message, code="not-a-table")
    return Table(columns, parse_metadata(raw))


def write(columns: Mapping[str, Array], metadata: Mapping[str, object]) -> bytes:
    """The bytes of a MATLAB v5 file with one column vector per column; reads back bit for bit.

    A name that MATLAB does not allow gets "_" in the place of other characters. Metadata (JSON) are the character
    codes in the variable `swingid`.
    """
    import scipy.io

    names = {column: re.sub(r"\W", "_", column, flags=re.ASCII)[:31] for column in columns}
    names = {column: name if name[0].isalpha() else f"x_{name}"[:31] for column, name in names.items()}
    if len(set(names.values())) < len(names):
        message = "two columns would have one name in MATLAB; write another format, or rename them"
        raise InputError(f"{message}: {', '.join(names)}.", code="double-column")
    codes = np.frombuffer(json.dumps(metadata).encode(), np.uint8).astype(np.float64)
    buffer = io.BytesIO()
    variables = {name: columns[column].reshape(-1, 1) for column, name in names.items()}
    savemat: Any = scipy.io.savemat  # takes buffers too, whatever the stubs that may be installed say
    savemat(buffer, {**variables, METADATA_KEY: codes}, do_compression=True)
    return buffer.getvalue()


def _elements(content: bytes, order: str) -> Iterator[tuple[int, bytes]]:
    """Type and data of each element; a ValueError where the bytes end within one."""
    at = 0
    while at < len(content):
        kind, size = struct.unpack_from(order + "II", content, at)
        start = at + 8
        if kind >> 16:  # small element: the size stands in the upper half, up to four bytes of data in the size's place
            kind, size, start = kind & 0xFFFF, kind >> 16, at + 4
            if size > 4:
                raise ValueError("small element of more than four bytes")
            at += 8
        else:
            at = start + size + (0 if kind == _COMPRESSED else -size % 8)
        if start + size > len(content):
            raise ValueError("element beyond the end")
        yield kind, content[start : start + size]


def _unpacked(data: bytes, most: int) -> bytes:
    """What was compressed; ValueError where it is more than `most` bytes, or cut off."""
    inflater = zlib.decompressobj()
    unpacked = inflater.decompress(data, most)
    if not inflater.eof:
        raise ValueError("more numbers than the file can hold, or cut off")
    return unpacked


def _collect(columns: Columns, prefix: str, kind: int, data: bytes, order: str, depth: int = 0) -> None:
    """Add the vectors in one element, a variable or a struct's field called `prefix`, to the columns."""
    if kind != _MATRIX or not data or depth > _DEPTH:
        return
    parts = _elements(data, order)
    flags = _numbers(*next(parts), order)
    array_class, is_complex = int(flags[0]) & 0xFF, int(flags[0]) & _COMPLEX
    if array_class != _STRUCT and array_class not in _NUMERIC:
        return  # objects and texts, whose parts follow another plan
    shape = tuple(int(n) for n in _numbers(*next(parts), order))
    name = prefix or next(parts)[1].decode("utf-8")
    if prefix:
        next(parts)  # the fields of a struct have empty names
    elif not name:
        return  # where MATLAB keeps the insides of objects
    if array_class == _STRUCT:
        width = int(_numbers(*next(parts), order)[0])
        names = next(parts)[1]
        fields = [names[i : i + width].split(b"\0")[0].decode("utf-8") for i in range(0, len(names), max(width, 1))]
        places = ("",) if shape == (1, 1) else tuple(f"({k})" for k in range(1, min(math.prod(shape), WIDEST) + 1))
        paths = [f"{name}{place}.{field}" for place in places for field in fields]
        for path, (inner, value) in zip(paths, parts, strict=math.prod(shape) <= WIDEST):
            _collect(columns, path, inner, value, order, depth + 1)
    elif not is_complex:
        add_vectors(columns, name, _numbers(*next(parts), order).astype(np.float64).reshape(shape, order="F"))


def _numbers(kind: int, data: bytes, order: str) -> NDArray[np.generic]:
    return np.frombuffer(data, order + _NUMBERS[kind])


_OBJECT_DEPTH = 12


def read_objects(content: bytes, name: str) -> Columns:
    """Every time series in the file as a column under the name of its signal, or of its variable.

    Series on the same instants share one column "time"; others have one of their own, "NAME.time". Empty where there is
    no series. Raises InputError where mat-io is missing or cannot read the file, which it does in a process of its own.
    """
    if not is_installed("matio"):
        require("matio", "mat-io", name, "a MATLAB file with objects such as timeseries")
    try:
        return read_apart("matio", f"{__name__}:extract", content)[0]
    except UnreadableError as why:
        message = f"{name}: its objects cannot be read ({why}); save plain arrays in MATLAB."
        raise InputError(message, code="not-a-table") from None


def extract(path: str) -> tuple[Columns, str]:
    """Columns of the time series in a file; for the process of `isolated`, for damage crashes the package."""
    variables = importlib.import_module("matio").load_from_mat(path)
    series: list[tuple[str, Array, NDArray[Any]]] = []
    for variable, value in variables.items():
        series += _series(value, str(variable), 0)
    return _columns(series), "{}"


def _columns(variables: list[tuple[str, Array, NDArray[Any]]]) -> Columns:
    columns: Columns = {}
    if not variables:
        return columns
    common = variables[0][1]
    columns["time"] = common
    for name, time, data in variables:
        free = name
        number = 2
        while free in columns:
            free, number = f"{name}_{number}", number + 1
        if time.shape != common.shape or not np.array_equal(time, common):
            columns[f"{free}.time"] = time
        add_vectors(columns, free, data)
    return columns


def _series(value: Any, name: str, depth: int) -> Iterator[tuple[str, Array, NDArray[Any]]]:
    """Name, instants and data of each time series inside `value`, an object, a struct or a cell."""
    if depth > _OBJECT_DEPTH:
        return
    properties = getattr(value, "properties", None)
    if isinstance(properties, dict):
        if getattr(value, "classname", "") == "timeseries":
            yield from _of_timeseries(properties, name)
            return
        title = _text(properties.get("Name")) or name
        for inner in properties.values():
            yield from _series(inner, title, depth + 1)
    elif isinstance(value, dict):
        for key, inner in value.items():
            yield from _series(inner, f"{name}.{key}", depth + 1)
    elif isinstance(value, np.ndarray) and value.dtype.names:
        for field in value.dtype.names:
            yield from _series(value[field], name, depth + 1)
    elif isinstance(value, np.ndarray) and value.dtype == object:
        for inner in value.ravel():
            yield from _series(inner, name, depth + 1)


def _of_timeseries(properties: dict[str, Any], name: str) -> Iterator[tuple[str, Array, NDArray[Any]]]:
    data = np.squeeze(np.asarray(properties.get("Data_")))
    if data.dtype.kind not in "biuf" or data.ndim not in (1, 2):
        return
    time: NDArray[Any] = np.ravel(np.asarray(properties.get("Time_"), dtype=np.float64))
    if time.size == 0:
        # evenly spaced series state start, step and length instead of their instants
        info = getattr(properties.get("TimeInfo"), "properties", {})
        start, step, count = (_scalar(info.get(key)) for key in ("Start_", "Increment_", "Length"))
        time = start + step * np.arange(int(count) if np.isfinite(count) else 0)
    if len(time) not in data.shape:
        return
    if data.ndim == 2 and data.shape[0] != len(time):
        data = data.T
    yield _text(properties.get("Name")) or name, time, data


def _text(value: Any) -> str:
    parts = np.ravel(np.asarray(value)) if value is not None else np.empty(0)
    return str(parts[0]) if parts.size == 1 and parts.dtype.kind == "U" else ""


def _scalar(value: Any) -> float:
    parts = np.ravel(np.asarray(value, dtype=np.float64)) if value is not None else np.empty(0)
    return float(parts[0]) if parts.size else float("nan")
