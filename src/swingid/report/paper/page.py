"""The page of the paper: figures and tables in one HTML file that needs nothing else."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swingid.report.html import environment, write_page
from swingid.report.paper.drawing import Drawing

if TYPE_CHECKING:
    from swingid.study.reproduce import Table


def _without_tests(found: list[Table]) -> list[Table]:
    """The tables of a page that may stand far from this project: without the names of its tests."""
    return [
        replace(table, head=table.head[:-1], rows=tuple(row[:-1] for row in table.rows), caption="")
        if table.key == "unclear"
        else table
        for table in found
    ]


def write_paper(results: dict[str, Any], figures: list[Drawing], path: str | Path) -> Path:
    """Write the page of `Reproduction.results` and its figures to `path` and return it.

    Raises InputError when the file cannot be written.
    """
    from markupsafe import Markup

    from swingid.study.reproduce.claims import FAILS, HOLDS, PARTLY
    from swingid.study.reproduce.tables import tables

    drawn = {figure.number: figure for figure in figures}
    page = (
        environment()
        .get_template("paper.html.j2")
        .render(
            tables={table.key: table for table in _without_tests(tables(results))},
            figures={number: Markup(figure.svg) for number, figure in drawn.items()},
            captions={number: (figure.caption, figure.here) for number, figure in drawn.items()},
            seed=results["seed"],
            verdicts={HOLDS: "holds", PARTLY: "part", FAILS: "fails"},
        )
    )
    return write_page(page, Path(path))
