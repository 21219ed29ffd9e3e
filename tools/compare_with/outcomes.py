"""What a case leaves behind: of a command its exit code, JSON and words; of a call its value or error."""

from __future__ import annotations

import io
import json
import tomllib
from collections.abc import Callable, Sequence
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np

SAMPLES = 100
"""Rows of a column that are kept beside its sums."""

JSON = "{json}"
"""Stands in the arguments of a command for the file whose JSON is kept."""


def of_command(arguments: Sequence[str], folder: Path, name: str = "out") -> dict[str, Any]:
    """Run ``swingid ARGUMENTS`` in this process; exit code, JSON, and the words on both outputs."""
    from swingid.cli import main

    target = folder / f"{name}.json"
    words, faults = io.StringIO(), io.StringIO()
    with redirect_stdout(words), redirect_stderr(faults):
        code = main([str(target) if one == JSON else one for one in arguments])
    found: dict[str, Any] = {"command": " ".join(arguments), "exit": code}
    if JSON in arguments:
        found["json"] = json.loads(target.read_text(encoding="utf-8")) if target.exists() else "no file"
    return found | {"stdout": words.getvalue(), "stderr": faults.getvalue()}


def of_call(function: Callable[[], Any]) -> dict[str, Any]:
    """Call a function of the library; its value, or the code and the exit code of an error that a user can act on."""
    try:
        return {"value": plain(function())}
    except Exception as error:
        if not hasattr(error, "exit_code"):
            raise
        refused = {"kind": type(error).__name__, "exit": error.exit_code, "code": getattr(error, "code", None)}
        return {"error": {**refused, "message": str(error)}}


def of_table(path: Path) -> dict[str, Any]:
    """The columns of a Parquet or text table, read without swingid: sums, and some rows."""
    import pyarrow.csv
    import pyarrow.parquet

    if path.suffix == ".parquet":
        table = pyarrow.parquet.read_table(path)
    else:
        lines = path.read_bytes().splitlines(keepends=True)
        text = b"".join(line for line in lines if not line.startswith(b"#"))
        table = pyarrow.csv.read_csv(io.BytesIO(text))
    return {name: of_column(table[name].to_numpy()) for name in table.column_names}


def of_column(values: Any) -> dict[str, Any]:
    """Length, mean, root mean square and some rows of a column; the first texts where it holds no numbers."""
    numbers = np.asarray(values)
    if numbers.dtype.kind not in "fiub":
        return {"rows": len(numbers), "texts": [str(one) for one in numbers[:SAMPLES]]}
    numbers = numbers.astype(float)
    if not len(numbers):
        return {"rows": 0}
    at = np.unique(np.linspace(0, len(numbers) - 1, SAMPLES).round().astype(int))
    sums = [float(np.mean(numbers)), float(np.sqrt(np.mean(numbers**2)))]
    return {"rows": len(numbers), "mean_and_rms": sums, "samples": numbers[at].tolist()}


def of_recording(log: Any) -> dict[str, Any]:
    """Channels and findings of a `Recording`."""
    names = ("time", "angle", "wheel_angle", "voltage", "torque", "reference", "wheel_speed")
    channels = {name: getattr(log, name) for name in names}
    return {
        "channels": {name: of_column(values) for name, values in channels.items() if values is not None},
        "drive_held": log.drive_held,
        "findings": [
            {"code": one.code, "message": one.message, "level": one.level, "repair": one.repair} for one in log.findings
        ],
    }


def of_toml(path: Path) -> Any:
    """The keys and values of a TOML file, without its comments."""
    return plain(tomllib.loads(path.read_text(encoding="utf-8"))) if path.exists() else "no file"


def plain(value: Any) -> Any:
    """Recursively to what JSON knows; NaN and infinities stay."""
    if hasattr(value, "to_dict"):
        return plain(value.to_dict())
    if hasattr(value, "__dataclass_fields__"):
        return {name: plain(getattr(value, name)) for name in value.__dataclass_fields__}
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return value if isinstance(value, str | int | float | bool | None) else str(value)
