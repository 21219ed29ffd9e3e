"""JSON lines (one object per row) and JSON: a list of rows, an object of arrays, or a list of rows inside an object.

The JSON of "Better Actuator Models" (Rhoban/bam) is a header (mass, length, motor, trajectory) and `entries` with
position, speed, load, input_volts, timestamp: an example of a small importer (`is_bam`, `decoded`). `load` is the duty
of the bridge in 1/885, its sign wrapped into 16 bits (as the XL330's register Present PWM).
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from swingid.errors import InputError
from swingid.recording.formats.table import METADATA_KEY, Table, columns_of, flat, number_of

if TYPE_CHECKING:
    from swingid.numerics.arrays import Array
    from swingid.recording.formats.table import Columns


ENDINGS = (".jsonl", ".ndjson", ".json")
MAGIC = b""
NOT_JSON = "is not JSON: damaged, or cut off while it was written; save it again"


def read(content: bytes, name: str) -> Table:
    """Rows as columns by their keys; nested objects give ``outer.inner``. What swingid wrote keeps its metadata.

    Raises InputError for text that is no JSON, or holds no rows.
    """
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{name} {NOT_JSON}.", code="not-a-table") from None
    metadata: Mapping[str, object] = {}
    rows, header, lost = _parse(text, name)
    if isinstance(header, dict) and str(header.get("schema", "")).startswith("swingid."):
        message = f"{name} is a result of swingid ({header['schema']}), not a log; give the log that it was found in."
        raise InputError(message, code="not-a-log")
    if rows and set(rows[0]) == {METADATA_KEY}:
        first = rows.pop(0)[METADATA_KEY]
        metadata = first if isinstance(first, dict) else {}
    if isinstance(header, dict) and is_bam(header):
        rows = decoded(rows)
    columns = columns_of([flat(row) for row in rows]) if rows else _arrays(header)
    if not columns:
        message = f"{name} holds no rows: JSON lines, a list of objects, or an object of arrays is needed."
        raise InputError(message, code="not-a-table")
    return Table(columns, metadata, lost)


def write(columns: Mapping[str, Array], metadata: Mapping[str, object]) -> bytes:
    """The bytes of a JSON lines file: metadata in the first line, then one object per row; reads back bit for bit."""
    names = list(columns)
    lines = [json.dumps({METADATA_KEY: dict(metadata)})]
    for row in zip(*(columns[name].tolist() for name in names), strict=True):
        cells = {name: (value if np.isfinite(value) else None) for name, value in zip(names, row, strict=True)}
        lines.append(json.dumps(cells))
    return ("\n".join(lines) + "\n").encode()


def _parse(text: str, name: str) -> tuple[list[dict[str, Any]], object, int]:
    """Rows, what stands around them, and the number of lines that are no JSON."""
    try:
        whole = json.loads(text)
    except RecursionError:
        raise InputError(f"{name} {NOT_JSON}.", code="not-a-table") from None
    except ValueError:
        return _lines(text, name)
    if isinstance(whole, list):
        return [row for row in whole if isinstance(row, dict)], None, sum(not isinstance(row, dict) for row in whole)
    if isinstance(whole, dict):
        for value in whole.values():
            if isinstance(value, list) and value and all(isinstance(row, dict) for row in value):
                return list(value), whole, 0
        if set(whole) == {METADATA_KEY}:
            return [whole], None, 0
    return [], whole, 0


def _lines(text: str, name: str) -> tuple[list[dict[str, Any]], object, int]:
    rows, lost = [], 0
    for line in text.splitlines():
        if not line.strip():
            continue
        try:
            row = json.loads(line)
        except (ValueError, RecursionError):
            row = None
        if isinstance(row, dict):
            rows.append(row)
        else:
            lost += 1
    if not rows:
        raise InputError(f"{name} {NOT_JSON}.", code="not-a-table")
    return rows, None, lost


def _arrays(header: object) -> Columns:
    """The arrays of numbers in an object."""
    columns: Columns = {}
    for key, value in header.items() if isinstance(header, dict) else ():
        numbers = isinstance(value, list) and all(isinstance(cell, int | float) or cell is None for cell in value)
        if numbers and len(value) > 1:
            columns[str(key)] = np.array([number_of(cell) for cell in value])
    return columns


FULL_DUTY = 885
"""`load` of the JSON of bam at full duty."""

LARGEST_SUPPLY = 1e6
"""Volts that no supply has: an integer of hundreds of digits, as damage makes it, is no float."""


def is_bam(header: Mapping[str, Any]) -> bool:
    """Return whether a JSON object is a log of bam."""
    return {"motor", "trajectory", "entries"} <= header.keys()


def decoded(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """The entries with two more columns: `duty` from -1 to 1, and `bridge_volts`, duty times the supply."""
    objects = []
    for row in rows:
        load, volts = row.get("load"), row.get("input_volts")
        more: dict[str, Any] = {}
        if isinstance(load, int) and abs(load) < 1 << 32:
            more["duty"] = (load - 65536 if load > 32767 else load) / FULL_DUTY
            if isinstance(volts, int | float) and abs(volts) < LARGEST_SUPPLY:
                more["bridge_volts"] = more["duty"] * volts
        objects.append({**row, **more})
    return objects
