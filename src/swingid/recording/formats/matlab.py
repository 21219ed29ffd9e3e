"""MATLAB v5 files (save -v7 and older down to v5), through scipy.io: arrays, and fields of plain structs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from swingid.errors import InputError
from swingid.recording.formats.table import Table

if TYPE_CHECKING:
    from numpy.typing import NDArray

ENDINGS = (".mat",)
MAGIC = b"MATLAB "


def read(content: bytes, name: str) -> Table:
    """Vectors by their name, fields of a struct as ``s.field``, columns of a matrix as ``name(:,2)``.

    Scalars are left out. Raises InputError for v7.3 (HDF5) and v4 files, damaged ones, and files that hold only objects
    such as timeseries, which SciPy cannot read.
    """
    if b"\x89HDF\r\n\x1a\n" in content[:1024]:
        message = (
            f"{name} is a MATLAB v7.3 file (HDF5), which is not read; save it in MATLAB with the option '-v7'"
        )
        raise InputError(message, code="matlab-v73")
    if not content.startswith(b"MATLAB 5.0"):
        message = f"{name} is not a MATLAB v5 file; save it in MATLAB with the option '-v7', or export CSV or Parquet"
        raise InputError(message, code="not-a-table")
    columns: dict[str, NDArray[np.float64] | NDArray[np.object_]] = {}
    for key, value in _variables(content, name).items():
        if not key.startswith("__"):
            _collect(columns, key, value)
    if not columns:
        message = f"{name} holds no vectors of numbers (timeseries and other objects are not read); save plain arrays in it"
        raise InputError(message, code="not-a-table")
    return Table(columns)


def _variables(content: bytes, name: str) -> dict[str, Any]:
    import io
    import warnings

    from scipy.io import loadmat

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found: dict[str, Any] = loadmat(io.BytesIO(content), squeeze_me=True)
    except Exception:  # the parser meets damaged bytes with errors of every kind; all mean one thing here
        message = (
            f"{name} is not a whole MATLAB file: damaged, or cut off while it was written; save it again"
        )
        raise InputError(message, code="not-a-table") from None
    return found


def _collect(columns: dict[str, NDArray[np.float64] | NDArray[np.object_]], key: str, value: Any) -> None:
    """Add the vectors in one variable to the columns."""
    if not isinstance(value, np.ndarray | np.void):
        return
    if value.dtype.names is not None and value.size == 1:
        for field in value.dtype.names:
            _collect(
                columns,
                f"{key}.{field}",
                np.asarray(value[field].item() if value.ndim == 0 else value[field]),
            )
        return
    if value.dtype.kind not in "fiub":
        return
    if value.ndim == 1 and value.size > 1:
        columns[key] = np.asarray(value, dtype=np.float64)
    elif value.ndim == 2:
        for k in range(value.shape[1]):
            columns[f"{key}(:,{k + 1})"] = np.asarray(value[:, k], dtype=np.float64)
