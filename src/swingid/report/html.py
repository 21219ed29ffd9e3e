"""The pages of the studies: comparison, inspection, validation, campaign; see `report.measurement` for a result."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

from swingid.errors import UnanswerableError, UsageError
from swingid.report.figures.studies import draw_forest, draw_inspection, draw_validation
from swingid.report.page import filled, picture, write_page
from swingid.report.pdf import Head
from swingid.report.style import house_style
from swingid.system import write_whole
from swingid.table import Cell, Column, Table, plain

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

LONG = 24
"""Characters from which the name of a column of a log may break."""

ORDER = ("fault", "repair", "advice")

VERDICTS = {
    "ready": ("ok", "ready"),
    "repairs": ("warning", "ready after repairs"),
    "unusable": ("refused", "not usable"),
}
"""Class of the page's head, and its words, by the status of an inspection."""


def write_campaign(summary: Summary, path: str | Path) -> Path:
    """Write the page of `summary` to `path` and return it. Raises InputError when the file cannot be written."""
    from swingid.study.campaign.summary import statistics_table
    from swingid.study.output import counted

    plan = summary.plan
    levels = {factor: [cell for cell in summary.by_level if cell.factor == factor] for factor in plan.tables.factors}
    page = filled(
        "campaign.html.j2",
        plan=plan.tables,
        source=plan.source,
        summary=summary,
        points=len({int(point) for point in summary.columns["point"]}),
        overall=statistics_table(summary.overall, fine=True),
        tables=[statistics_table(cells, factor, fine=True) for factor, cells in levels.items() if cells],
        messages=list(summary.refusals_and_warnings()),
        failed=counted(summary.failures, summary.trials) if summary.failures else "",
        pictures=_campaign_pictures(summary),
    )
    return write_page(page, path)


@house_style()
def _campaign_pictures(summary: Summary) -> list[tuple[str, str, str]]:
    """(title, inline SVG, caption) of every picture that there are data for."""
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
    return [
        (title, picture(figure, f"campaign{k}", title), caption)
        for k, (title, figure, caption) in enumerate(drawn)
        if figure is not None
    ]


def write_comparison(comparison: Comparison, rig: Rig, path: str | Path) -> Path:
    """Write the page of `comparison` to `path` and return it. Raises InputError when the file cannot be written."""
    from swingid.study.compare.comparison import tables_of

    with house_style():
        forest = picture(draw_forest(comparison), "forest", "Inertia by method")
    logs = []
    for log in comparison.logs:
        trials = comparison.of(log)
        answers, friction = tables_of(trials, fine=True)
        verdict = next(v.message for v in comparison.verdicts if v.log == log)
        messages = comparison.messages(log)
        logs.append({"name": log, "answers": answers, "friction": friction, "verdict": verdict, "messages": messages})
    return write_page(
        filled("comparison.html.j2", rig=rig, logs=logs, forest=forest), path, Head("Comparison of methods")
    )


def _columns(inspection: Inspection) -> Table:
    """The columns of a log."""
    from swingid.study.inspect.inspection import columns_table

    rows: list[tuple[str | Cell, ...]] = [
        (Cell(name, form="name" if len(name) < LONG else "text"), *rest) for name, *rest in columns_table(inspection)
    ]
    words = plain("column", "seems to be", "type", "unit")
    return Table((*words, Column("range", "number"), Column("first values", "text")), tuple(rows))


def write_inspection(inspection: Inspection, path: str | Path) -> Path:
    """Write the page of an inspection to `path` and return it. Raises InputError when the file cannot be written."""
    with house_style():
        drawn = picture(draw_inspection(inspection), "inspection", "The log at a glance")
    status, answer = VERDICTS[inspection.verdict.status]
    page = filled(
        "inspection.html.j2",
        found=inspection,
        name=Path(inspection.path).name,
        picture=drawn,
        status=status,
        answer=answer,
        todo=[check for level in ORDER for check in inspection.checks if check.level == level],
        checks=Table(
            (Column(form="level"), Column(form="title"), Column(form="text")),
            tuple((Cell(LEVEL_WORDS[c.level], form=c.level), c.title, c.evidence) for c in inspection.checks),
        ),
        services=Table(
            (Column("method", "name"), Column("time", "number", True), Column("what takes the rest", "text", True)),
            tuple((s.method, f"{s.seconds:.4g} s", s.why) for s in inspection.services),
        ),
        columns=_columns(inspection),
    )
    return write_page(page, path, Head("Inspection of a log", inspection.sha256[:12]))


PICTURES = (".png", ".svg", ".pdf")
"""Endings of pictures."""


def write_plot(inspection: Inspection, path: str | Path) -> Path:
    """Write the picture of an inspection alone, by the ending of `path` as PNG, SVG or PDF, and return the path.

    Raises UsageError for another ending, UnanswerableError where the log could not be read.
    """
    target = Path(path)
    if target.suffix.lower() not in PICTURES:
        text = f"{target} is no picture; give a name that ends in {', '.join(PICTURES)}"
        raise UsageError(text, code="unknown-ending")
    content = io.BytesIO()
    with house_style():
        figure = draw_inspection(inspection)
        if figure is None:
            raise UnanswerableError(
                f"{inspection.path} could not be read, so there is no plot; see inspect", code="no-plot"
            )
        figure.savefig(content, format=target.suffix.lower()[1:], dpi=160, bbox_inches="tight")
    write_whole(target, content.getvalue())
    return target


def write_validation(validation: Validation, rig: Rig, path: str | Path) -> Path:
    """Write the page of `validation` to `path` and return it. Raises InputError when the file cannot be written."""
    from swingid.study.validate import cells

    columns = (
        Column("driven by", "", True),
        *(
            Column(heading, "number", True)
            for heading in ("fit, free run", "fit, one swing ahead", "its error, RMS", "sensor noise")
        ),
    )
    logs = []
    with house_style():
        for k, prediction in enumerate(validation.predictions):
            figure = draw_validation(prediction, linear=validation.linear)
            svg = picture(figure, f"validation{k}", f"Measured and predicted angle of {prediction.log}")
            name, *row = cells(prediction, linear=validation.linear, fine=True)
            logs.append({"name": name, "table": Table(columns, (tuple(row),)), "svg": svg})
    page = filled("validation.html.j2", rig=rig, logs=logs, method=validation.method, notes=validation.notes)
    return write_page(page, path, Head("Validation"))
