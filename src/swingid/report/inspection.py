"""The page of an inspection: verdict, picture, checks, columns, one HTML file that needs nothing else."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from swingid.report.html import environment, write_page

if TYPE_CHECKING:
    from swingid.study.inspect import Inspection

LEVELS = {"ok": "ok", "note": "note", "unknown": "not told", "advice": "advice", "repair": "mend", "fault": "fault"}
ORDER = ("fault", "repair", "advice")
STATUS = {"ready": "ok", "repairs": "warning", "unusable": "refused"}
ANSWERS = {"ready": "ready", "repairs": "ready after repairs", "unusable": "not usable"}


def write_inspection(found: Inspection, path: str | Path) -> Path:
    """Write the page of `found` to `path` and return it. Raises InputError when the file cannot be written."""
    from markupsafe import Markup

    from swingid.report.figures.inspection import draw_inspection
    from swingid.report.style import house_style, to_svg
    from swingid.study.inspect.text import columns_table

    with house_style():
        figure = draw_inspection(found)
        picture = "" if figure is None else Markup(to_svg(figure, "inspection", "The log at a glance"))
    page = (
        environment()
        .get_template("inspection.html.j2")
        .render(
            found=found,
            name=Path(found.path).name,
            picture=picture,
            status=STATUS[found.verdict.status],
            answer=ANSWERS[found.verdict.status],
            todo=[check for level in ORDER for check in found.checks if check.level == level],
            levels=LEVELS,
            columns=columns_table(found),
        )
    )
    return write_page(page, Path(path))
