"""The page of a comparison: all methods on the same logs, one HTML file that needs nothing else."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from swingid.report.html import environment, write_page

if TYPE_CHECKING:
    from swingid.model.rig import Rig
    from swingid.study.compare import Comparison


def write_comparison(comparison: Comparison, rig: Rig, path: str | Path) -> Path:
    """Write the page of `comparison` to `path` and return it. Raises InputError when the file cannot be written."""
    from markupsafe import Markup

    from swingid.report.figures.forest import draw_forest
    from swingid.report.style import house_style, to_svg
    from swingid.study.compare.text import answer_cells, friction_text

    with house_style():
        figure = draw_forest(comparison)
        forest = "" if figure is None else Markup(to_svg(figure, "forest", "Inertia by method"))
    tables = [
        {
            "log": log,
            "known": any(t.truth is not None for t in comparison.of(log)),
            "rows": [
                (answer_cells(t, fine=True), friction_text(t.result, fine=True), t.result) for t in comparison.of(log)
            ],
            "verdict": next(v.message for v in comparison.verdicts if v.log == log),
        }
        for log in comparison.logs
    ]
    page = environment().get_template("comparison.html.j2").render(rig=rig, tables=tables, forest=forest)
    return write_page(page, Path(path))
