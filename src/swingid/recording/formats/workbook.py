"""Workbooks of Excel and OpenOffice (.xls, .xlsx, .xlsb, .ods), as phyphox exports them; by the package calamine."""

from __future__ import annotations

import importlib
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from swingid.errors import InputError
from swingid.recording.formats import csv
from swingid.recording.formats.isolated import UnreadableError, is_installed, read_apart, require
from swingid.recording.formats.sheets import FEWEST_ROWS, joined
from swingid.recording.formats.table import Table, most_unpacked

if TYPE_CHECKING:
    from swingid.recording.formats.table import Columns

ENDINGS = (".xls", ".xlsx", ".xlsb", ".ods")
MAGIC = b"\xd0\xcf\x11\xe0"

SEPARATOR = "\x1f"
"""Between the title of a sheet and the name of its column."""


def read(content: bytes, name: str) -> Table:
    """The sheets of a workbook, see `sheets.joined`: below a header, which may be merged cells, a title or units.

    Raises InputError for a damaged workbook, one without numbers, and where calamine is missing.
    """
    if not is_installed("python_calamine"):
        require("python_calamine", "python-calamine", name, "an Excel workbook")
    try:
        columns, raw = read_apart("python_calamine", f"{__name__}:extract", content)
    except UnreadableError:
        message = f"{name} is not a whole workbook, is protected by a password, or is no workbook; export it again"
        raise InputError(f"{message}, as CSV where that fails.", code="not-a-table") from None
    sheets: dict[str, dict[str, Any]] = {title: {} for title in json.loads(raw)["sheets"]}
    for key, values in columns.items():
        title, _, column = key.partition(SEPARATOR)
        sheets[title][column] = values
    units = json.loads(raw)["units"]
    tables = {title: Table(sheet, units=units.get(title, {})) for title, sheet in sheets.items()}
    return joined(tables, name, "sheet", json.loads(raw)["problems"])


def extract(path: str) -> tuple[Columns, str]:
    """Columns with numbers of all sheets, and their titles and units; for the process of `isolated`."""
    calamine: Any = importlib.import_module("python_calamine")
    columns: Columns = {}
    units: dict[str, dict[str, str]] = {}
    problems: list[str] = []
    spare = most_unpacked(Path(path).stat().st_size)
    book = calamine.CalamineWorkbook.from_path(path)
    for title in book.sheet_names:
        rows = book.get_sheet_by_name(title).to_python(skip_empty_area=True)
        spare -= 8 * sum(map(len, rows))
        if spare < 0:
            raise ValueError("more cells than the file can hold")
        try:
            table = csv.read(_text(rows), f"sheet {title[:40]!r}")
        except InputError as error:
            problems += [_problem(error)] if len(rows) > FEWEST_ROWS else []
            continue  # an empty sheet, or one of texts
        units[title] = dict(table.units)
        for column in table.columns:
            values = table.numbers(column)[0]
            if not np.isnan(values).all():
                columns[f"{title}{SEPARATOR}{column}"] = values
    return columns, json.dumps({"sheets": list(book.sheet_names), "units": units, "problems": problems})


def _problem(error: InputError) -> str:
    """What is wrong with a sheet, with the usual cause where two columns have one name."""
    if error.code != "double-column":
        return error.message
    return f"{error.message.rstrip('.')}, and split merged cells of the header, which name one column only."


def _text(rows: list[list[object]]) -> bytes:
    """The rows as text with tabs, without empty ones."""
    lines = ["\t".join(_cell(cell) for cell in row) for row in rows if any(cell not in ("", None) for cell in row)]
    return ("\n".join(lines) + "\n").encode() if lines else b""


def _cell(cell: object) -> str:
    """A cell as text without tabs and line breaks; numbers with all their digits."""
    return repr(cell) if isinstance(cell, float) else " ".join(str(cell if cell is not None else "").split())
