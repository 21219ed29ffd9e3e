"""The page of the paper: figures and tables in one HTML file that needs nothing else."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from swingid.report.html import environment, write_page
from swingid.report.paper.drawing import Drawing


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
            tables={table.key: table for table in tables(results)},
            figures={number: Markup(figure.svg) for number, figure in drawn.items()},
            captions={number: (figure.caption, figure.here) for number, figure in drawn.items()},
            seed=results["seed"],
            verdicts={HOLDS: "holds", PARTLY: "part", FAILS: "fails"},
        )
    )
    return write_page(page, Path(path))
