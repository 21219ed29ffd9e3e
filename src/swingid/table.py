"""A table of texts for people: one type for a terminal, a page, its PDF and a document."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import zip_longest

WIDTH = 100
"""Characters of a line of a terminal."""

NO_BREAK = "\u00a0"
"""Keeps a value and its unit on one line."""

LEAST = 30
"""Characters that the last column has at least, however wide the others are."""


@dataclass(frozen=True)
class Column:
    """A column: its heading, the form of its cells on a page, whether a narrow page repeats the heading at each cell.

    form: "head" for the headings of rows, else a class of `report.css`: "text" breaks anywhere, "name", "number" and
    "value-cell" do not break.
    """

    heading: str = ""
    form: str = ""
    repeated: bool = False


@dataclass(frozen=True)
class Cell:
    """A cell that is more than its text: with a name as files have it beneath, or with a form beside the column's."""

    text: str
    key: str = ""
    form: str = ""


@dataclass(frozen=True)
class Table:
    """Columns and rows of cells; key, title and a sentence where a page has many; chosen: a row to emphasise.

    style: of a page, "pairs" for words and what they mean, "wide" for rows that a narrow page sets as blocks.
    """

    columns: tuple[Column, ...]
    rows: tuple[tuple[str | Cell, ...], ...]
    style: str = "wide"
    key: str = ""
    title: str = ""
    caption: str = ""
    chosen: int | None = None

    def __bool__(self) -> bool:
        """Return whether it has rows."""
        return bool(self.rows)

    @property
    def headings(self) -> tuple[str, ...]:
        """The headings of its columns; () where none has one."""
        headings = tuple(column.heading for column in self.columns)
        return headings if any(headings) else ()

    def texts(self) -> list[list[str]]:
        """Headings, if there are any, and rows as plain text."""
        rows = [[cell if isinstance(cell, str) else cell.text for cell in row] for row in self.rows]
        return [list(self.headings), *rows] if self.headings else rows

    def lines(self) -> list[str]:
        """Set columns side by side for a terminal, the last one wrapped at its width."""
        return aligned(self.texts())

    def markdown(self) -> str:
        """Its sentence and its rows for a document in Markdown."""
        lines = ["| " + " | ".join(map(_escaped, row)) + " |" for row in self.texts()]
        lines.insert(1, "|" + "---|" * len(self.columns))
        caption = [_escaped(self.caption), ""] if self.caption else []
        return "\n".join([*caption, *lines]) + "\n"


def plain(*headings: str) -> tuple[Column, ...]:
    """Columns of which nothing but the heading is to be said."""
    return tuple(Column(heading) for heading in headings)


def pairs(rows: Sequence[tuple[str, str | Cell]], form: str = "text") -> Table:
    """A table of words and what they mean; form: of the second column."""
    return Table((Column(form="head"), Column(form=form)), tuple(rows), "pairs")


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Set rows of cells as columns, the last one wrapped at the terminal's width."""
    widths = [max(map(len, column)) for column in zip_longest(*rows, fillvalue="")]
    lines = []
    for row in rows:
        *start, last = (cell.ljust(width) for cell, width in zip(row, widths, strict=True))
        indent = "    " + "".join(cell + "  " for cell in start)
        width = max(WIDTH, len(indent) + LEAST)
        lines += wrapped(last.rstrip() or " ", indent, " " * len(indent), width) or [indent.rstrip()]
    return lines


def wrapped(text: str, first: str = "    ", rest: str = "      ", width: int = WIDTH) -> list[str]:
    """Lines of a text for a terminal, the first and the others indented; no word is parted, nor what is to stay."""
    lines = textwrap.wrap(
        text, width, initial_indent=first, subsequent_indent=rest, break_long_words=False, break_on_hyphens=False
    )
    return [line.replace(NO_BREAK, " ") for line in lines]


def _escaped(cell: str) -> str:
    if cell.startswith("`"):  # code, in which nothing is escaped
        return cell
    return cell.replace("|", "\\|").replace("*", "\\*").replace("_", "\\_")
