"""Numbers as spreadsheets write them: with a decimal comma, with a mark between thousands."""

from __future__ import annotations

import re
from collections.abc import Sequence

_GROUPED = {
    ".": re.compile(r"\s*[+-]?[1-9]\d{0,2}(,\d{3})+(\.\d*)?\s*"),
    ",": re.compile(r"\s*[+-]?[1-9]\d{0,2}(\.\d{3})+(,\d*)?\s*"),
}
"""Numbers with a mark between thousands, by the decimal sign; none of them begins with 0."""

_DECIMAL_COMMA = re.compile(r"\s*[+-]?\d*,\d*([eE][+-]?\d+)?\s*")


def is_grouped(cell: str, decimal: str) -> bool:
    """Whether a cell is a number with a mark between thousands."""
    return _GROUPED[decimal].fullmatch(cell) is not None


def has_decimal_comma(cell: str) -> bool:
    """Whether a cell is a number with a decimal comma."""
    return _DECIMAL_COMMA.fullmatch(cell) is not None and any(letter.isdigit() for letter in cell)


def are_whole_thousands(cells: Sequence[str], decimal: str) -> bool:
    """Whether a column holds whole numbers, with a mark above 999: -181, 1.046. Decimals would be of any length."""
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
