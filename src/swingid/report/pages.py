"""The pages of campaign, comparison, inspection and validation, each one HTML file that needs nothing else."""

from __future__ import annotations

from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING

from swingid.report.html import environment, write_page

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from swingid.model.rig import Rig
    from swingid.study.campaign import Summary
    from swingid.study.compare import Comparison
    from swingid.study.inspect import Inspection
    from swingid.study.validate import Validation


def write_campaign(summary: Summary, path: str | Path) -> Path:
    """Write the page of `summary` to `path` and return it. Raises InputError when the file cannot be written."""
    from swingid.study.campaign.summary import cell_name, counted, figures, told_headings

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
    from swingid.report.figures.campaign import (
        draw_boxes,
        draw_coverage,
        draw_coverage_by,
        draw_levels,
        draw_map,
        draw_tornado,
    )

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


def write_comparison(comparison: Comparison, rig: Rig, path: str | Path) -> Path:
    """Write the page of `comparison` to `path` and return it. Raises InputError when the file cannot be written."""
    from markupsafe import Markup

    from swingid.report.figures.studies import draw_forest
    from swingid.report.style import house_style, to_svg
    from swingid.study.compare.comparison import answer_cells, friction_text

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


LEVEL_WORDS = {
    "ok": "ok",
    "note": "note",
    "unknown": "not told",
    "advice": "advice",
    "repair": "mend",
    "fault": "fault",
}

ORDER = ("fault", "repair", "advice")

STATUS = {"ready": "ok", "repairs": "warning", "unusable": "refused"}

ANSWERS = {"ready": "ready", "repairs": "ready after repairs", "unusable": "not usable"}


def write_inspection(found: Inspection, path: str | Path) -> Path:
    """Write the page of `found` to `path` and return it. Raises InputError when the file cannot be written."""
    from markupsafe import Markup

    from swingid.report.figures.studies import draw_inspection
    from swingid.report.style import house_style, to_svg
    from swingid.study.inspect.inspection import columns_table

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
            levels=LEVEL_WORDS,
            columns=columns_table(found),
        )
    )
    return write_page(page, Path(path))


def write_validation(validation: Validation, rig: Rig, path: str | Path) -> Path:
    """Write the page of `validation` to `path` and return it. Raises InputError when the file cannot be written."""
    from markupsafe import Markup

    from swingid.report.figures.studies import draw_validation
    from swingid.report.style import house_style, to_svg
    from swingid.study.validate import cells

    logs = []
    with house_style():
        for k, prediction in enumerate(validation.predictions):
            figure = draw_validation(prediction, linear=validation.linear)
            svg = Markup(to_svg(figure, f"validation{k}", f"Measured and predicted angle of {prediction.log}"))
            logs.append({"cells": cells(prediction, linear=validation.linear, fine=True), "svg": svg})
    template = environment().get_template("validation.html.j2")
    page = template.render(rig=rig, logs=logs, method=validation.method, notes=validation.notes)
    return write_page(page, Path(path))
