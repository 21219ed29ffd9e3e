"""MATLAB v5 files (save -v7 and older down to v5), through scipy.io: arrays, and fields of plain structs."""

from __future__ import annotations

import io
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from swingid.errors import InputError
from swingid.recording.formats.table import Table

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Columns = dict[str, NDArray[np.float64] | NDArray[np.object_]]

ENDINGS = (".mat",)
MAGIC = b"MATLAB "


def read(content: bytes, name: str) -> Table:
    """Vectors by their name, fields of a struct as ``s.field``, columns of a matrix as ``name(:,2)``.

    Scalars are left out. Raises InputError for v7.3 (HDF5) and v4 files, damaged ones, and files that hold
    only objects such as timeseries, which SciPy cannot read.
    """
    if b"\x89HDF\r\n\x1a\n" in content[:1024]:
        message = f"{name} is a MATLAB v7.3 file (HDF5), which is not read; save it with the option '-v7'."
        raise InputError(message, code="matlab-v73")
    if not content.startswith(b"MATLAB 5.0"):
        message = f"{name} is not a MATLAB v5 file; save it in MATLAB with the option '-v7', or export CSV."
        raise InputError(message, code="not-a-table")
    columns: Columns = {}
    for key, value in _variables(content, name).items():
        if not key.startswith("__"):
            _collect(columns, key, value)
    if not columns:
        message = f"{name} holds no vectors of numbers, only scalars or objects such as timeseries"
        raise InputError(f"{message}; save plain arrays in MATLAB.", code="not-a-table")
    return Table(columns)


def _variables(content: bytes, name: str) -> dict[str, Any]:
    from scipy.io import loadmat

    stream: Any = io.BytesIO(content)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found: dict[str, Any] = loadmat(stream, squeeze_me=True)
    except Exception:  # the parser meets damaged bytes with errors of every kind; all mean one thing here
        message = f"{name} is not a whole MATLAB file: damaged, or cut off while it was written; save it again."
        raise InputError(message, code="not-a-table") from None
    return found


def _collect(columns: Columns, key: str, value: Any) -> None:
    """Add the vectors in one variable to the columns."""
    if not isinstance(value, np.ndarray):
        return
    if value.dtype.names is not None and value.ndim == 0:
        for field in value.dtype.names:
            _collect(columns, f"{key}.{field}", value[field].item())
    elif value.dtype.kind in "fiub" and value.ndim == 1 and value.size > 1:
        columns[key] = value.astype(np.float64)
    elif value.dtype.kind in "fiub" and value.ndim == 2:
        for k, column in enumerate(value.T, start=1):
            columns[f"{key}(:,{k})"] = column.astype(np.float64)
