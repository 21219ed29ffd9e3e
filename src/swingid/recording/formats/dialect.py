"""How a text table is laid out, from its first lines: delimiter, decimal sign, header, where the rows begin."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from swingid.recording.formats.cells import are_whole_thousands, has_decimal_comma, is_grouped, is_stamp
from swingid.recording.formats.table import split_unit
from swingid.spellings import UNITS

DELIMITERS = (b"\t", b";", b",", b"|")

OTHER_UNITS = frozenset(("n.m", "cm", "1", "-"))
"""What a line of units may hold beside the `UNITS` of swingid, in lower case and without brackets."""

_SAMPLE = 60
"""Lines looked at."""


@dataclass(frozen=True)
class Layout:
    """Delimiter (one byte; a blank for any run of them), decimal sign, names, units, offset of the rows.

    names are empty where the table has no header; width is the number of cells of a row. header_width differs from
    it where the header names another number of columns.
    """

    delimiter: bytes
    decimal: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    rows: int
    width: int
    header_width: int


def find_layout(body: bytes) -> Layout | None:
    """The layout of a table in UTF-8 text without its comments; None for text without a line."""
    lines = _lines(body)
    if not lines:
        return None
    delimiter = _delimiter([line for line, _ in lines])
    cells = [split_cells(line, delimiter) for line, _ in lines]
    width = Counter(len(row) for row in cells[1:] or cells).most_common(1)[0][0]
    decimal = _decimal(cells) if delimiter != b"," else "."
    cells = _with_equal_ends(cells, width, decimal)
    first = _below_titles(cells, next(k for k, row in enumerate(cells) if len(row) == width), width, decimal)
    first = _below_preamble(cells, first, width, decimal)
    if _is_row(cells, first, decimal):
        above = len(cells[first - 1]) if first else 0
        # two names or more above the first row are a header that does not fit; one is a title
        return Layout(delimiter, decimal, (), (), lines[first][1], width, above if above > 1 else width)
    first, stacked = _rows_of_names(cells, first, width, decimal)
    names = _names(stacked, cells[first])
    at = first + 1
    units: tuple[str, ...] = ()
    if at + 1 < len(cells) and _is_units(cells[at]) and _numeric(cells[at + 1], decimal):
        units = tuple(_bare(cell) for cell in cells[at])
        at += 1
    rows = lines[at][1] if at < len(lines) else len(body)
    return Layout(delimiter, decimal, names, units, rows, width, width)


MOST_ROWS_OF_NAMES = 4
"""As DeepLabCut writes for several animals: scorer, individuals, bodyparts, coords."""


def _rows_of_names(cells: Sequence[Sequence[str]], first: int, width: int, decimal: str) -> tuple[int, list[list[str]]]:
    """The lowest row of a header of several rows, and those above it; `first` and none where it has one row.

    The rows above have merged cells, or as in the logs of DeepLabCut one name several times: the lowest one alone
    would name columns twice.
    """
    at = next(
        (k for k, row in enumerate(cells) if k > first and len(row) == width and _numeric(row, decimal)), first + 1
    )
    last = at - 1
    if last > first and _is_units(cells[last]):
        last -= 1
    lowest = [cell.strip() for cell in cells[last] if cell.strip()]
    several = len(set(lowest)) < len(lowest)
    begin = first
    if last == first and several and first and len(cells[first - 1]) in (width, width - 1, width + 1):
        begin = first - 1
    rows = [[*row, *[""] * (width - len(row))][:width] for row in cells[begin:last]]  # filled up at their ends
    if not several or not 0 < len(rows) < MOST_ROWS_OF_NAMES or last >= len(cells) or len(cells[last]) != width:
        return first, []
    return last, rows


def _names(above: Sequence[Sequence[str]], lowest: Sequence[str]) -> tuple[str, ...]:
    """Names of columns, with those of the rows above that tell them apart; merged cells hold for the columns right."""
    parts = []
    for row in above:
        held, filled = "", []
        for k, cell in enumerate(row):
            held = cell.strip() or held
            # the first column of a log of DeepLabCut holds what its rows of names are
            filled.append("" if k == 0 and held.lower() in STACK else held)
        if len({cell for cell in filled if cell}) > 1:
            parts.append(filled)
    lowest = ["frame" if cell.strip().lower() in STACK else cell.strip() for cell in lowest]
    columns = zip(*parts, lowest, strict=True)
    joined = (" ".join(dict.fromkeys(part for part in column if part)) for column in columns)
    return tuple(name or f"column{k}" for k, name in enumerate(joined, start=1))


STACK = ("scorer", "individuals", "bodyparts", "coords")
"""First cells of the rows of names that DeepLabCut writes."""


def _with_equal_ends(cells: list[list[str]], width: int, decimal: str) -> list[list[str]]:
    """Lines above the rows as wide as these, where only one of the two ends with a delimiter."""
    open_ended = all(not row[-1].strip() for row in cells if len(row) == width and row)
    lines = []
    for row in cells:
        if len(row) == width - 1 and open_ended and not _numeric(row, decimal):
            lines.append([*row, ""])
        elif len(row) == width + 1 and not row[-1].strip() and not _numeric(row, decimal):
            lines.append(row[:-1])
        else:
            lines.append(row)
    return lines


def _below_titles(cells: Sequence[Sequence[str]], first: int, width: int, decimal: str) -> int:
    """The header below titles that a spreadsheet padded with empty cells to the width of the table; `first` else."""
    rows = (k for k, row in enumerate(cells) if k > first and len(row) == width and _numeric(row, decimal))
    at = next((k for k in rows if _filled(cells[k]) > 1), first + 1)
    if at - 2 > first and _is_units(cells[at - 1]):
        at -= 1
    padded = all(_filled(cells[k]) < min(width, _filled(cells[at - 1])) for k in range(first, at - 1))
    return at - 1 if padded and len(cells[at - 1]) == width else first


def _below_preamble(cells: Sequence[Sequence[str]], first: int, width: int, decimal: str) -> int:
    """The header below lines about the log, some of which have as many cells as the table by chance; `first` else.

    Such lines hold a number beside a name, or differ in their cells, or name no unit where the header does; rows of
    names do none of these.
    """
    rows = (k for k, row in enumerate(cells) if k > first and len(row) == width and _numeric(row, decimal))
    at = next((k for k in rows if k + 1 == len(cells) or _numeric(cells[k + 1], decimal)), first + 1)
    header = at - 2 if at - 2 > first and _is_units(cells[at - 1]) else at - 1
    names = [cell.strip() for cell in cells[header]]
    if header <= first or len(names) != width or not all(names) or len(set(names)) < width:
        return first
    above = cells[first:header]
    broken = any(len(row) != width or any(is_value(cell, decimal) for cell in row) for row in above)
    broken = broken or (_has_units(names) and not any(map(_has_units, above)))
    return header if broken and not any(is_value(name, decimal) for name in names) else first


def _decimal(cells: Sequence[Sequence[str]]) -> str:
    """The decimal sign; a comma that only parts thousands beside decimal points is none."""
    columns = list(zip(*(row for row in cells[1:] if len(row) == len(cells[-1])), strict=True))
    for decimal in (".", ","):
        if any(are_whole_thousands(column, decimal) for column in columns):
            return decimal
    every = [cell for row in cells[1:] for cell in row]
    commas = [cell for cell in every if has_decimal_comma(cell)]
    points = any("." in cell and is_number(cell, ".") and not is_grouped(cell, ",") for cell in every)
    return "," if commas and not (points and all(is_grouped(cell, ".") for cell in commas)) else "."


def _is_row(cells: Sequence[Sequence[str]], at: int, decimal: str) -> bool:
    """Return whether a line is a row and no header: numbers only, or numbers where the next line has some, and text
    beside.
    """
    if _numeric(cells[at], decimal):
        return True
    if at + 1 == len(cells) or len(cells[at]) != len(cells[at + 1]):
        return False
    here, below = ([is_value(cell, decimal) for cell in cells[k]] for k in (at, at + 1))
    return here == below and any(here)


def _has_units(cells: Sequence[str]) -> bool:
    """Return whether a cell is a name with its unit: "theta [deg]"."""
    return any(split_unit(cell.strip())[1] for cell in cells)


def _filled(cells: Sequence[str]) -> int:
    return sum(bool(cell.strip()) for cell in cells)


def split_cells(line: bytes, delimiter: bytes) -> list[str]:
    """Cells of one line, quotes taken off."""
    text = line.decode("utf-8", "replace")
    if delimiter == b" ":
        return text.split()
    try:
        return next(csv.reader([text], delimiter=delimiter.decode()), [])
    except csv.Error:  # a quote that does not end
        return text.split(delimiter.decode())


def _lines(body: bytes) -> list[tuple[bytes, int]]:
    """The first lines that hold something, each with its offset."""
    rows: list[tuple[bytes, int]] = []
    at = 0
    for line in body[:200_000].splitlines(keepends=True):
        if line.strip() and len(rows) < _SAMPLE:
            rows.append((line.rstrip(b"\r\n"), at))
        at += len(line)
    return rows


def _delimiter(lines: Sequence[bytes]) -> bytes:
    """The one that splits most lines into the same number of cells, and these into numbers; else that of the first."""

    def fitness(delimiter: bytes) -> float:
        """Share of lines with the commonest number of cells, times the share of their filled cells that are numbers."""
        rows = [split_cells(line, delimiter) for line in lines]
        width, count = Counter(map(len, rows)).most_common(1)[0]
        cells = [cell for row in rows if len(row) == width for cell in row if cell.strip()]
        numbers = sum(is_value(cell, ".") or is_value(cell, ",") for cell in cells)
        return count / len(rows) * (1 + numbers / max(len(cells), 1)) if width > 1 else 0.0

    fit = {delimiter: fitness(delimiter) for delimiter in (*DELIMITERS, b" ")}
    best = max(fit, key=lambda delimiter: fit[delimiter])
    if fit[best] > 0.5:
        return best
    in_header = [delimiter for delimiter in DELIMITERS if delimiter in lines[0]]
    if in_header:
        return in_header[0]
    return b" " if len(lines[0].split()) > 1 else b","


def _numeric(cells: Sequence[str], decimal: str) -> bool:
    """Return whether a line holds numbers, times and blanks only, one of them at least."""
    return any(map(str.strip, cells)) and all(not cell.strip() or is_value(cell, decimal) for cell in cells)


def is_value(cell: str, decimal: str) -> bool:
    """Return whether the text of a cell is a number, also with a mark between thousands, or a time."""
    return is_number(cell, decimal) or is_grouped(cell, decimal) or is_stamp(cell)


def is_number(cell: str, decimal: str) -> bool:
    """Return whether the text of a cell is a number."""
    try:
        float(cell.strip().strip('"').replace(decimal, "."))
    except ValueError:
        return False
    return True


def _is_units(cells: Sequence[str]) -> bool:
    bare = [_bare(cell).lower() for cell in cells]
    return any(bare) and all(cell in UNITS or cell in OTHER_UNITS or not cell for cell in bare)


def _bare(cell: str) -> str:
    return cell.strip().strip("[]()").strip()
