"""The tables of docs/paper.md: made from results.json, put between marks, so that no number is typed by hand."""

from __future__ import annotations

import re
from typing import Any

from swingid.study.reproduce.tables import Table, tables

MARKS = re.compile(r"(<!-- table: ([\w-]+) -->\n).*?(<!-- end -->)", re.DOTALL)


def with_tables(text: str, results: dict[str, Any]) -> str:
    """The text of a page with every table between its marks renewed from `Reproduction.results`.

    A table goes between `<!-- table: KEY -->` and `<!-- end -->`. Raises KeyError for a key that no table has.
    """
    made = {table.key: table for table in tables(results)}
    return MARKS.sub(lambda match: f"{match[1]}\n{as_markdown(made[match[2]])}\n{match[3]}", text)


def as_markdown(table: Table) -> str:
    """Caption and table."""
    lines = ["| " + " | ".join(_escaped(cell) for cell in row) + " |" for row in (table.head, *table.rows)]
    lines.insert(1, "|" + "---|" * len(table.head))
    caption = [_escaped(table.caption), ""] if table.caption else []
    return "\n".join([*caption, *lines]) + "\n"


def _escaped(cell: str) -> str:
    if cell.startswith("`"):  # code, in which nothing is escaped
        return cell
    return cell.replace("|", "\\|").replace("*", "\\*").replace("_", "\\_")
