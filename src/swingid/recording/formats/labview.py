"""LabVIEW measurement files (.lvm): text with a header, then segments with a header each, then rows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from swingid.errors import InputError
from swingid.recording.formats.csv import LABVIEW, as_text, read_rows
from swingid.recording.formats.dialect import Layout
from swingid.recording.formats.table import Table

if TYPE_CHECKING:
    from collections.abc import Iterator

    from swingid.numerics.arrays import Array

ENDINGS = (".lvm",)
MAGIC = LABVIEW

END = "***End_of_Header***"
TIME = "X_Value"


def read(content: bytes, name: str) -> Table:
    """The channels by their names, `X_Value` as the time; segments of the same channels one after the other.

    Raises InputError, naming the file, where the headers are not whole.
    """
    lines = as_text(content, name).decode().splitlines()
    try:
        begin = _end(lines)
        # the mark behind the word is the one that the file uses
        mark = next((line[9] for line in lines[:begin] if line.startswith("Separator") and len(line) > 9), "\t")
        decimal = next((line[18:].strip() for line in lines[:begin] if line.startswith("Decimal_Separator")), ".")
        segment, names, rows = _segments(lines[begin + 1 :], mark)
    except StopIteration:
        message = f"{name} is not a whole LabVIEW measurement file: its headers do not end; export it again."
        raise InputError(message, code="not-a-table") from None
    labels = segment.get("Y_Unit_Label", [])
    units = ["s" if column.startswith(TIME) else label for column, label in _labelled(names, labels)]
    text = "\n".join(mark.join(row[: len(names)]) for row in rows) + "\n"
    width, point = len(names), "," if decimal == "," else "."
    layout = Layout(mark.encode(), point, tuple(names), tuple(units), 0, width, width)
    table = read_rows(text.encode(), layout, name)
    if TIME not in table.columns or not np.isnan(table.numbers(TIME)[0]).all():
        return table
    first, step = (_number(segment.get(key, [""]), decimal) for key in ("X0", "Delta_X"))
    time: Array = first + step * np.arange(len(table.columns[TIME]), dtype=np.float64)
    return Table({**table.columns, TIME: time}, {}, table.unreadable_rows, table.units)


def _end(lines: list[str]) -> int:
    return next(k for k, line in enumerate(lines) if line.startswith(END))


def _segments(lines: list[str], mark: str) -> tuple[dict[str, list[str]], list[str], list[list[str]]]:
    """The header of the first segment, its columns' names, and the rows of all."""
    header: dict[str, list[str]] = {}
    names: list[str] = []
    rows: list[list[str]] = []
    while any(line.strip() for line in lines):
        end = _end(lines)
        for line in lines[:end]:
            key, *values = line.split(mark)
            header.setdefault(key.strip(), [value.strip() for value in values])
        names = names or _unlike(lines[end + 1].split(mark)) if end + 1 < len(lines) else names
        below = lines[end + 2 :]
        stop = next((k for k, line in enumerate(below) if line.startswith("Channels")), len(below))
        rows += [line.split(mark) for line in below[:stop] if line.strip()]
        lines = below[stop:]
    return header, names, rows


def _unlike(names: list[str]) -> list[str]:
    """Names without the comment's, each once: a second X_Value is called X_Value 2."""
    differing: list[str] = []
    for raw in names:
        name = raw.strip()
        if not name or name == "Comment":
            break
        same = sum(other == name or other.startswith(f"{name} ") for other in differing)
        differing.append(f"{name} {same + 1}" if same else name)
    return differing


def _labelled(names: list[str], labels: list[str]) -> Iterator[tuple[str, str]]:
    """Each column with the label of its channel; the times have none."""
    channel = 0
    for name in names:
        is_time = name.startswith(TIME)
        yield name, "" if is_time or channel >= len(labels) else labels[channel]
        channel += not is_time


def _number(cells: list[str], decimal: str) -> float:
    """The first cell as a number, NaN where it is none."""
    try:
        return float(cells[0].replace(decimal, "."))
    except (ValueError, IndexError):
        return float("nan")
