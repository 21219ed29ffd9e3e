"""The page of a campaign: figures of every method, pictures, what failed; one HTML file that needs nothing else."""

from __future__ import annotations

from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING

from swingid.report.html import environment, write_page

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from swingid.study.campaign import Summary


def write_campaign(summary: Summary, path: str | Path) -> Path:
    """Write the page of `summary` to `path` and return it. Raises InputError when the file cannot be written."""
    from swingid.study.campaign.text import cell_name, counted, figures, told_headings

    plan = summary.plan
    tables = []
    for factor in plan.tables.factors:
        cells = [cell for cell in summary.by_level if cell.factor == factor]
        headings = told_headings(cells)
        levels = [
            (level, [(cell_name(cell), figures(cell.statistics, headings, fine=True)) for cell in of_level])
            for level, of_level in groupby(cells, key=lambda cell: cell.level)
        ]
        tables.append({"factor": factor, "headings": headings, "levels": levels})
    headings = told_headings(summary.overall)
    doubts = []
    for cell in summary.overall:
        for what, codes in (("refused", cell.statistics.refusals), ("warned", cell.statistics.warnings)):
            if codes:
                doubts.append((f"{cell_name(cell)} {what}", counted(codes, cell.statistics.runs)))
    page = (
        environment()
        .get_template("campaign.html.j2")
        .render(
            plan=plan.tables,
            source=plan.source,
            summary=summary,
            points=len({int(point) for point in summary.columns["point"]}),
            headings=headings,
            overall=[(cell_name(cell), figures(cell.statistics, headings, fine=True)) for cell in summary.overall],
            tables=tables,
            doubts=doubts,
            failed=counted(summary.failures, summary.trials) if summary.failures else "",
            pictures=_pictures(summary),
        )
    )
    return write_page(page, Path(path))


def _pictures(summary: Summary) -> list[tuple[str, str, str]]:
    """(title, inline SVG, caption) of every picture that there are data for."""
    from markupsafe import Markup

    from swingid.report.style import house_style, to_svg

    with house_style():
        return [
            (title, Markup(to_svg(figure, f"campaign{k}", title)), caption)
            for k, (title, figure, caption) in enumerate(_drawn(summary))
            if figure is not None
        ]


def _drawn(summary: Summary) -> list[tuple[str, Figure | None, str]]:
    from swingid.report.figures.boxes import draw_boxes
    from swingid.report.figures.coverage import draw_coverage, draw_coverage_by
    from swingid.report.figures.levels import draw_levels
    from swingid.report.figures.maps import draw_map
    from swingid.report.figures.tornado import draw_tornado

    plan = summary.plan.tables
    drawn: list[tuple[str, Figure | None, str]] = [
        (f"Loop over {a} and {b}", draw_map(summary, (a, b)), "" if k else MAPS)
        for k, (a, b) in enumerate(plan.report.maps)
    ]
    drawn += [
        ("Errors by method", draw_boxes(summary), BOXES),
        ("Coverage of the intervals", draw_coverage(summary), COVERAGE),
    ]
    if plan.design == "one-at-a-time" or len(plan.factors) > 2:
        drawn += [(f"What each factor does to {m}", draw_tornado(summary, m), TORNADO) for m in plan.base.methods]
    if plan.design != "one-at-a-time":
        for name in plan.factors:
            drawn.append((f"Error by {name}", draw_levels(summary, name), LEVELS))
            if len(plan.factors) <= 2:
                drawn.append((f"Coverage by {name}", draw_coverage_by(summary, name), ""))
    return drawn


MAPS = (
    "Median over everything else that is varied. Crossed out: the loop does not follow in half of the runs (its "
    "tracking error is above a fifth of the motion, both RMS). A gain that settles after the whole run has not "
    "settled. Grey: not run. The inertia's error is that of the first method."
)
BOXES = (
    "Boxes hold the middle half of the runs, whiskers 95 % of them. Left: how large errors are. Right: in the standard "
    "uncertainty that the method claimed for that run; 95 % should lie in the green band."
)
COVERAGE = "The green line is what is claimed."
TORNADO = (
    "Bars reach from the lowest to the highest mean error over the levels of a factor; the thin line is the largest "
    "root mean square, written at the right with its level."
)
LEVELS = "Root mean square of the relative error, with its standard error."
