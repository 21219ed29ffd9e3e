"""MATLAB objects in v5 files: `timeseries` and `Simulink.SimulationData.Dataset`, by the package mat-io."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from swingid.errors import InputError
from swingid.recording.formats.isolated import UnreadableError, is_installed, read_apart
from swingid.recording.formats.optional import require
from swingid.recording.formats.vectors import add_vectors

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from swingid.numerics.arrays import Array
    from swingid.recording.formats.vectors import Columns

_DEPTH = 12


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
    found: list[tuple[str, Array, NDArray[Any]]] = []
    for variable, value in variables.items():
        found += _series(value, str(variable), 0)
    return _columns(found), "{}"


def _columns(found: list[tuple[str, Array, NDArray[Any]]]) -> Columns:
    columns: Columns = {}
    if not found:
        return columns
    common = found[0][1]
    columns["time"] = common
    for name, time, data in found:
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
    if depth > _DEPTH:
        return
    properties = getattr(value, "properties", None)
    if isinstance(properties, dict):
        if getattr(value, "classname", "") == "timeseries":
            yield from _of_timeseries(properties, name)
            return
        own = _text(properties.get("Name")) or name
        for inner in properties.values():
            yield from _series(inner, own, depth + 1)
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
