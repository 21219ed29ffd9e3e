"""Logs that are read in parts, beside the least that any program does with such a file: read and look once."""

from __future__ import annotations

import atexit
import importlib.util
import io
import sys
import tempfile
from collections.abc import Iterable, Iterator
from functools import partial
from pathlib import Path
from types import ModuleType

import numpy as np
from case import Case, processor_time

import swingid as sw
from swingid.recording.large import LargeLog

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests"))

ROWS, PIECE = 1_500_000, 250_000
COLUMNS = ("t", "q1", "q2", "u")


def cases() -> Iterator[Case]:
    """2.5 minutes at 10 kHz: its rows as parts of a log, and identified, from each format."""
    made = _maker()
    given = made.GIVEN
    folder = tempfile.TemporaryDirectory()
    atexit.register(folder.cleanup)
    parquet, text = (made.write_large_log(Path(folder.name) / f"log.{ending}", ROWS) for ending in ("parquet", "csv"))
    look = {parquet: partial(_look, _parquet, parquet), text: partial(_look, _text, text)}
    for path, name in ((parquet, "Parquet"), (text, "text")):
        reference = processor_time(look[path])
        yield Case(f"large log, {name}, rows", "pyarrow, means", processor_time(partial(_rows, path, given)), reference)
    for method in ("momentum", "energy"):
        ours = processor_time(partial(_identified, parquet, given, method))
        yield Case(f"large log, {method}", "pyarrow, means", ours, processor_time(look[parquet]), pairs=5)


def _maker() -> ModuleType:
    """tests/large_logs.py, which has the name of this file."""
    spec = importlib.util.spec_from_file_location("made_large_logs", ROOT / "tests" / "large_logs.py")
    assert spec is not None
    assert spec.loader is not None
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


def _rows(path: Path, rig: sw.Rig) -> None:
    """All rows repaired and averaged, which is what a method gets."""
    for _ in LargeLog(str(path), rig).parts():
        pass


def _identified(path: Path, rig: sw.Rig, method: str) -> None:
    sw.identify(LargeLog(str(path), rig, workers=1), rig, method)  # others would not be counted


def _parquet(path: Path) -> Iterable[dict[str, np.ndarray]]:
    import pyarrow.parquet as pq

    for batch in pq.ParquetFile(path).iter_batches(batch_size=PIECE, columns=list(COLUMNS)):
        yield {name: batch[name].to_numpy() for name in COLUMNS}


def _text(path: Path) -> Iterable[dict[str, np.ndarray]]:
    import pyarrow.csv as pc

    for batch in pc.open_csv(io.BytesIO(path.read_bytes())):
        yield {name: batch[name].to_numpy() for name in COLUMNS}


def _look(read: object, path: Path) -> float:
    """Range, finite or not, and means of eleven rows of every column."""
    found = 0.0
    for columns in read(path):
        for values in columns.values():
            blocks = values[: values.size // 11 * 11].reshape(-1, 11)
            found += float(values.max() - values.min()) + float(blocks.mean(axis=1)[-1])
    return found
