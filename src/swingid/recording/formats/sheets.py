"""One table of several: sheets of a workbook, or files of an archive, as apps for phones export one for each sensor."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from swingid.errors import InputError
from swingid.recording.formats.table import Table, split_unit
from swingid.spellings import canonical

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from swingid.recording.formats.table import Columns

RATES = frozenset(("rad/s", "deg/s", "rpm", "turns/s"))

FEWEST_ROWS = 10
"""Rows of a sheet that may be a log; what describes the phone has fewer, or no numbers."""


def joined(sheets: Mapping[str, Table], name: str, what: str, problems: Sequence[str] = ()) -> Table:
    """The columns of all sheets (or files, `what`): of the main one by their names, of others as ``sheet.column``.

    The main one is the only one, else that of a gyroscope, else that with most rows. Sheets have clocks of their own,
    so channels are of one of them. Raises InputError where none holds numbers; problems: what is wrong with sheets that
    hold something and are no table, of which it then states the first.
    """
    filled = {title: rows for title, rows in sheets.items() if _rows(rows) >= FEWEST_ROWS}
    if not filled and problems:
        raise InputError(f"{name}: {problems[0]}", code="not-a-table")
    if not filled:
        listed = ", ".join(repr(title[:40]) for title in list(sheets)[:8]) or "none at all"
        message = f"{name} has no {what} with {FEWEST_ROWS} rows of numbers below a header, but {listed}"
        raise InputError(f"{message}; export the raw data of the sensors.", code="no-numbers")
    main = max(filled, key=lambda title: (_is_gyroscope(title, filled[title]), _rows(filled[title])))
    columns: Columns = dict(filled[main].columns)
    units = units_of_gyroscope(main, filled[main])
    for title, rows in filled.items():
        if title != main:
            columns |= {f"{title}.{column}": values for column, values in rows.columns.items()}
            units |= {f"{title}.{column}": unit for column, unit in rows.units.items()}
    return Table(columns, filled[main].metadata, filled[main].unreadable_rows, units)


def units_of_gyroscope(title: str, table: Table) -> dict[str, str]:
    """The units of a table with the title of a sheet or file: rad/s for x, y, z of a gyroscope that state none.

    So iOS and Android give them to apps; a file alone is one that Sensor Logger names Gyroscope.csv.
    """
    units = dict(table.units)
    if _is_gyroscope(title, table) > 1:
        units |= {axis: "rad/s" for axis in "xyz" if axis in table.columns and axis not in units}
    return units


def _rows(table: Table) -> int:
    """Rows of the longest column with numbers."""
    numeric = [values for values in table.columns.values() if values.dtype.kind == "f"]
    return max(map(len, numeric), default=0) if len(numeric) > 1 else 0


def _is_gyroscope(title: str, table: Table) -> int:
    """Return whether a sheet holds rates: 3 by its title, 2 by that of an uncalibrated one, 1 by units; 0 otherwise."""
    words = re.sub(r"[^a-z]", "", title.lower())
    if words in ("gyroscope", "gyro", "gyroskop", "giroscopio"):
        return 3
    if words.startswith("gyro"):
        return 2
    stated = (table.units.get(column, "") or split_unit(column)[1] for column in table.columns)
    return int(any(canonical(unit) in RATES for unit in stated))
