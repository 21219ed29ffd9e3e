"""MATLAB v5 files (save -v7 and older down to v5): arrays of numbers, and fields of plain structs.

A reader of its own, after MATLAB's "MAT-File Format": SciPy's crashes the process on some damaged files, and a log that
was cut off is what people have.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from swingid.errors import InputError
from swingid.recording.formats.table import Table

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Columns = dict[str, NDArray[np.float64] | NDArray[np.object_]]

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
    """Vectors by their name, fields of a struct as ``s.field``, a matrix as ``name(:,2)`` or, if wide, ``name(2,:)``.

    Scalars, texts, cells, sparse and complex arrays are left out. Raises InputError for v7.3 (HDF5) and v4 files,
    damaged ones, and files that hold only objects such as timeseries.
    """
    if b"\x89HDF\r\n\x1a\n" in content[:1024]:
        message = f"{name} is a MATLAB v7.3 file (HDF5), which is not read; save it with the option '-v7'."
        raise InputError(message, code="matlab-v73")
    if not content.startswith(b"MATLAB 5.0"):
        message = f"{name} is not a MATLAB v5 file; save it in MATLAB with the option '-v7', or export CSV."
        raise InputError(message, code="not-a-table")
    columns: Columns = {}
    try:
        order = {b"IM": "<", b"MI": ">"}[content[126:_HEADER]]
        for kind, data in _elements(content[_HEADER:], order):
            if kind == _COMPRESSED:
                for inner, unpacked in _elements(zlib.decompress(data), order):
                    _collect(columns, "", inner, unpacked, order)
            else:
                _collect(columns, "", kind, data, order)
    except (ValueError, KeyError, StopIteration, struct.error, zlib.error):
        message = f"{name} is not a whole MATLAB file: damaged, or cut off while it was written; save it again."
        raise InputError(message, code="not-a-table") from None
    if not columns:
        message = f"{name} holds no vectors of numbers, only scalars or objects such as timeseries"
        raise InputError(f"{message}; save plain arrays in MATLAB.", code="not-a-table")
    return Table(columns)


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
        if shape == (1, 1):
            for field, (inner, value) in zip(fields, parts, strict=True):
                _collect(columns, f"{name}.{field}", inner, value, order, depth + 1)
    elif not is_complex:
        _add(columns, name, _numbers(*next(parts), order).astype(np.float64), shape)


def _numbers(kind: int, data: bytes, order: str) -> NDArray[np.generic]:
    return np.frombuffer(data, order + _NUMBERS[kind])


def _add(columns: Columns, name: str, values: NDArray[np.float64], shape: tuple[int, ...]) -> None:
    """A vector under its name, a matrix as its columns, or as its rows where these are longer."""
    array = values.reshape(shape, order="F")
    if array.size < 2 or array.ndim != 2:
        return
    if 1 in shape:
        columns[name] = values
    elif shape[0] >= shape[1]:
        columns.update({f"{name}(:,{k})": column for k, column in enumerate(array.T, start=1)})
    else:
        columns.update({f"{name}({k},:)": row for k, row in enumerate(array, start=1)})
