"""Cells of text as numbers and seconds: decimal commas, marks between thousands, times of day, dates."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import date
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from swingid.numerics.arrays import Array


_GROUPED = {
    ".": re.compile(r"\s*[+-]?[1-9]\d{0,2}(,\d{3})+(\.\d*)?\s*"),
    ",": re.compile(r"\s*[+-]?[1-9]\d{0,2}(\.\d{3})+(,\d*)?\s*"),
}
"""Numbers with a mark between thousands, by the decimal sign; none of them begins with 0."""

_DECIMAL_COMMA = re.compile(r"\s*[+-]?\d*,\d*([eE][+-]?\d+)?\s*")


def is_grouped(cell: str, decimal: str) -> bool:
    """Return whether a cell is a number with a mark between thousands."""
    return _GROUPED[decimal].fullmatch(cell) is not None


def has_decimal_comma(cell: str) -> bool:
    """Return whether a cell is a number with a decimal comma."""
    return _DECIMAL_COMMA.fullmatch(cell) is not None and any(letter.isdigit() for letter in cell)


def are_whole_thousands(cells: Sequence[str], decimal: str) -> bool:
    """Return whether a column holds whole numbers, with a mark above 999: -181, 1.046. Decimals would be of any
    length.
    """
    mark = "," if decimal == "." else "."
    marked = [cell for cell in cells if mark in cell]
    short = [cell for cell in cells if re.fullmatch(r"\s*[+-]?[1-9]\d{1,2}\s*", cell)]
    if len(short) < max(3, len(cells) // 10) or not marked:
        return False
    return all(is_grouped(cell, decimal) and decimal not in cell for cell in marked) and all(
        decimal not in cell for cell in cells
    )


def plain_cells(cells: Sequence[str | None], decimal: str) -> list[str | None]:
    """Cells of a column of text with the numbers among them in plain digits; others as they are.

    Marks between thousands count as such where every cell that has the mark fits; commas that do not are decimal ones.
    """
    mark = "," if decimal == "." else "."
    marked = [cell for cell in cells if cell and mark in cell]
    if marked and all(is_grouped(cell, decimal) for cell in marked):
        cells = [cell.replace(mark, "") if cell and is_grouped(cell, decimal) else cell for cell in cells]
    return [cell.replace(",", ".") if cell and has_decimal_comma(cell) else cell for cell in cells]


DAY = 86400.0
EPOCH = date(1970, 1, 1).toordinal()

_CLOCK = r"(?:(?P<hour>\d{1,2}):)?(?P<minute>\d{1,2}):(?P<second>\d{1,2}(?:[.,]\d*)?)(?:\s*(?P<half>[AaPp])\.?[Mm]\.?)?"
_ZONE = r"\s*(?:[Zz]|UTC|(?P<sign>[+-])(?P<zone_hour>\d\d):?(?P<zone_minute>\d\d))?"
_DATE = r"(?P<one>\d{1,4})[-./](?P<two>\d{1,2})[-./](?P<three>\d{1,4})"
_STAMP = re.compile(rf"\s*(?:{_DATE}(?:\s*[T ]\s*|\s+))?{_CLOCK}{_ZONE}\s*")

LONGEST = 48
"""Characters of a stamp; longer cells are none, whatever they hold."""

LOST = 0.01
"""Share of the cells that may be no stamp in a column of stamps."""


def is_stamp(cell: str) -> bool:
    """Return whether a cell is a time of day, or a date with one."""
    return _parts(cell) is not None


def _parts(cell: str) -> re.Match[str] | None:
    """What a stamp consists of; None for other cells, and for those that are too long to be one."""
    return _STAMP.fullmatch(cell) if ":" in cell and len(cell) <= LONGEST else None


def seconds_of(cells: Sequence[str | None]) -> Array | None:
    """Seconds of a column of stamps: since 1970 with a date, else since midnight; None for any other column.

    NaN where a cell is no stamp. A time of day goes on over midnight. Where day and month may be either, as in
    03/05/2024, the month comes first; within a day that makes no difference.
    """
    first = next((cell for cell in cells if cell), "")
    if not is_stamp(first):
        return None
    day_first = any(_day_first(cell) for cell in cells if cell)
    seconds = np.array([_seconds(cell, day_first) if cell else np.nan for cell in cells])
    if np.count_nonzero(np.isnan(seconds)) > LOST * len(seconds):
        return None
    return over_midnight(seconds)


def over_midnight(seconds: Array) -> Array:
    """Seconds since midnight as seconds that go on; other times as they are."""
    good = np.isfinite(seconds)
    if not good.any() or seconds[good].max() > DAY:
        return seconds
    nights = np.zeros(len(seconds))
    nights[good] = np.cumsum(np.diff(seconds[good], prepend=seconds[good][0]) < -DAY / 2)
    return seconds + DAY * nights


def _day_first(cell: str) -> bool:
    """Return whether the first part of a date can be no month: a day, as it is wherever dots part them."""
    part = re.match(r"\s*(\d{1,2})([-./])\d", cell)
    return part is not None and (int(part[1]) > 12 or part[2] == ".")


def _seconds(cell: str, day_first: bool) -> float:
    part = _parts(cell)
    if part is None:
        return float("nan")
    hour, half = int(part["hour"] or 0), part["half"]
    if half is not None:
        hour = hour % 12 + (12 if half in "Pp" else 0)
    seconds = 3600.0 * hour + 60.0 * int(part["minute"]) + float(part["second"].replace(",", "."))
    if part["sign"]:
        zone = 3600 * int(part["zone_hour"]) + 60 * int(part["zone_minute"])
        seconds -= zone if part["sign"] == "+" else -zone
    if part["one"] is None:
        return seconds
    return seconds + DAY * _days(part["one"], part["two"], part["three"], day_first)


@lru_cache(maxsize=64)
def _days(first: str, second: str, third: str, day_first: bool) -> float:
    """Days since 1970 of a date; NaN for none."""
    if len(first) == 4:
        year, month, day = first, second, third
    else:
        day, month, year = (first, second, third) if day_first else (second, first, third)
    whole = int(year) + (2000 if len(year) <= 2 else 0)
    try:
        return float(date(whole, int(month), int(day)).toordinal() - EPOCH)
    except ValueError:
        return float("nan")
