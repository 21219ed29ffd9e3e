"""The pages of campaign, comparison, inspection and validation, each one HTML file that needs nothing else."""

from __future__ import annotations

from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING

from swingid.report.figures.studies import draw_forest, draw_inspection, draw_validation
from swingid.report.html import filled, picture, write_page
from swingid.report.style import house_style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from swingid.model.rig import Rig
    from swingid.study.campaign import Summary
    from swingid.study.compare import Comparison
    from swingid.study.inspect import Inspection
    from swingid.study.validate import Validation


MAPS = (
    "Median over everything else that is varied. Crossed out: the loop does not follow in half of the runs (its "
    "tracking error is above a fifth of the motion, both RMS). A gain that settles after the whole run has not "
    "settled. Grey: not run. The inertia's error is that of the first method."
)

BOXES = (
    "Boxes hold the middle half of the runs, whiskers 95 % of them. Left: how large errors are. Right: in the standard "
    "uncertainty that the method stated for that run; 95 % should lie in the green band."
)

COVERAGE = "The green line is the stated coverage probability."

TORNADO = (
    "Bars reach from the lowest to the highest mean error over the levels of a factor; the thin line is the largest "
    "root mean square, written at the right with its level."
)

LEVELS = "Root mean square of the relative error, with its standard error."

LEVEL_WORDS = {
    "ok": "ok",
    "note": "note",
    "unknown": "not identifiable",
    "advice": "advice",
    "repair": "mend",
    "fault": "fault",
}

ORDER = ("fault", "repair", "advice")

STATUS = {"ready": "ok", "repairs": "warning", "unusable": "refused"}

ANSWERS = {"ready": "ready", "repairs": "ready after repairs", "unusable": "not usable"}


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
    page = filled(
        "campaign.html.j2",
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
    return write_page(page, path)


def _pictures(summary: Summary) -> list[tuple[str, str, str]]:
    """(title, inline SVG, caption) of every picture that there are data for."""
    with house_style():
        return [
            (title, picture(figure, f"campaign{k}", title), caption)
            for k, (title, figure, caption) in enumerate(_drawn(summary))
            if figure is not None
        ]


def _drawn(summary: Summary) -> list[tuple[str, Figure | None, str]]:
    from swingid.report.figures import campaign as draw

    plan = summary.plan.tables
    drawn: list[tuple[str, Figure | None, str]] = [
        (f"Loop over {a} and {b}", draw.draw_map(summary, (a, b)), "" if k else MAPS)
        for k, (a, b) in enumerate(plan.report.maps)
    ]
    drawn += [
        ("Errors by method", draw.draw_boxes(summary), BOXES),
        ("Coverage of the intervals", draw.draw_coverage(summary), COVERAGE),
    ]
    if plan.design == "one-at-a-time" or len(plan.factors) > 2:
        drawn += [(f"What each factor does to {m}", draw.draw_tornado(summary, m), TORNADO) for m in plan.base.methods]
    if plan.design != "one-at-a-time":
        for name in plan.factors:
            drawn.append((f"Error by {name}", draw.draw_levels(summary, name), LEVELS))
            if len(plan.factors) <= 2:
                drawn.append((f"Coverage by {name}", draw.draw_coverage_by(summary, name), ""))
    return drawn


def write_comparison(comparison: Comparison, rig: Rig, path: str | Path) -> Path:
    """Write the page of `comparison` to `path` and return it. Raises InputError when the file cannot be written."""
    from swingid.study.compare.comparison import answer_cells, friction_text

    with house_style():
        forest = picture(draw_forest(comparison), "forest", "Inertia by method")
    tables = [
        {
            "log": log,
            "known": any(t.truth is not None for t in comparison.of(log)),
            "rows": [(answer_cells(t, fine=True), friction_text(t.result, fine=True)) for t in comparison.of(log)],
            "doubts": comparison.doubts(log),
            "verdict": next(v.message for v in comparison.verdicts if v.log == log),
        }
        for log in comparison.logs
    ]
    return write_page(filled("comparison.html.j2", rig=rig, tables=tables, forest=forest), path)


def write_inspection(found: Inspection, path: str | Path) -> Path:
    """Write the page of `found` to `path` and return it. Raises InputError when the file cannot be written."""
    from swingid.study.inspect.inspection import columns_table

    with house_style():
        drawn = picture(draw_inspection(found), "inspection", "The log at a glance")
    page = filled(
        "inspection.html.j2",
        found=found,
        name=Path(found.path).name,
        picture=drawn,
        status=STATUS[found.verdict.status],
        answer=ANSWERS[found.verdict.status],
        todo=[check for level in ORDER for check in found.checks if check.level == level],
        levels=LEVEL_WORDS,
        columns=columns_table(found),
    )
    return write_page(page, path)


def write_validation(validation: Validation, rig: Rig, path: str | Path) -> Path:
    """Write the page of `validation` to `path` and return it. Raises InputError when the file cannot be written."""
    from swingid.study.validate import cells

    logs = []
    with house_style():
        for k, prediction in enumerate(validation.predictions):
            figure = draw_validation(prediction, linear=validation.linear)
            svg = picture(figure, f"validation{k}", f"Measured and predicted angle of {prediction.log}")
            logs.append({"cells": cells(prediction, linear=validation.linear, fine=True), "svg": svg})
    page = filled("validation.html.j2", rig=rig, logs=logs, method=validation.method, notes=validation.notes)
    return write_page(page, path)
