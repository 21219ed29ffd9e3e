"""The pages of a result and of the studies: each one HTML file that needs nothing else."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING

from swingid.format import interval
from swingid.report import tables
from swingid.report.figures.estimates import draw_budget, draw_convergence, draw_kinds, draw_logs, draw_swings
from swingid.report.figures.motion import draw_changing, draw_friction, draw_log, draw_residuals, draw_turning_points
from swingid.report.figures.studies import draw_forest, draw_inspection, draw_validation
from swingid.report.style import house_style, to_svg
from swingid.report.words import DRIVES, KINDS, parameter_word
from swingid.result.result import Result
from swingid.result.summary import log_row, relative, segment_text, value_text, why_unknown
from swingid.system import write_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from swingid.model.rig import Rig
    from swingid.recording.recording import Recording
    from swingid.study.campaign import Summary
    from swingid.study.campaign.summary import Cell
    from swingid.study.compare import Comparison
    from swingid.study.inspect import Inspection
    from swingid.study.validate import Validation

STATUS = {"ok": "no warnings", "warning": "with warnings", "refused": "no estimate"}

MOST_NAMES = 3
"""Logs that a title names; of more it gives the number."""

TITLES = {
    "log": "Measured channels over time",
    "turning_points": "Angle with its turning points",
    "swings": "Inertia of every swing",
    "friction": "Friction against speed",
    "residuals": "Residuals over time",
    "changing": "Changes within the log",
    "budget": "Uncertainty budget of the inertia",
    "kinds": "Estimates by kind of projection",
    "logs": "Inertia of every log",
    "convergence": "Online estimate over time",
}

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

VERDICTS = {
    "ready": ("ok", "ready"),
    "repairs": ("warning", "ready after repairs"),
    "unusable": ("refused", "not usable"),
}
"""Class of the page's head, and its words, by the status of an inspection."""


def write_report(result: Result, log: Recording | None, rig: Rig | None, path: str | Path) -> Path:
    """Write the report of `result` to `path` and return it; the same result gives the same bytes.

    What there are no data for is left out; a refused result states why, `log` and `rig` may then be None.
    Raises InputError when the file cannot be written; it appears whole or not at all.
    """
    return write_page(render(result, log, rig), path)


def write_page(page: str, path: str | Path) -> Path:
    """Write a page whole or not at all, see `write_whole`; returns the path."""
    target = Path(path)
    write_whole(target, page.encode("utf-8", "backslashreplace"))  # names of files may hold what is no text
    return target


def render(result: Result, log: Recording | None, rig: Rig | None) -> str:
    """The report of `write_report` as HTML text, with all figures inside."""
    return filled("report.html.j2", **_context(result, log, rig))


def filled(template: str, **values: object) -> str:
    """A template with its values; a name that it needs and does not get is an error."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("swingid.report"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(template).render(values)


def picture(figure: Figure | None, name: str, title: str) -> str:
    """A figure as inline SVG for a template; "" for none."""
    from markupsafe import Markup

    return "" if figure is None else Markup(to_svg(figure, name, title))


def _context(result: Result, log: Recording | None, rig: Rig | None) -> dict[str, object]:
    linear = rig.axis.kind == "linear" if rig else "inertia" in result.parameters and result.inertia.unit == "kg"
    answered = result.status != "refused"
    laws, more_laws = tables.law_rows(result)
    return {
        "result": result,
        "status_words": STATUS[result.status],
        "title": _title(result, log),
        "answer": _answer(result, linear=linear) if result.leading in result.parameters else None,
        "linear": linear,
        "segment": segment_text(result.details, fine=True) if result.details else "",
        "parameters": tables.parameter_rows(result, linear=linear),
        "rig": rig if answered else None,
        "drive": DRIVES.get(rig.drive.kind, rig.drive.kind) if rig else "",
        "rig_rows": tables.rig_rows(rig) if rig and answered else [],
        "sensor_rows": tables.sensor_rows(rig) if rig and answered else [],
        "log_rows": tables.log_rows(log, result) if log is not None and answered else [],
        "laws": laws,
        "more_laws": more_laws,
        "law": result.details.friction.law if result.details and result.details.friction else "",
        "kinds": [
            (name, KINDS[name]) for name in (result.details.estimates if result.details else ()) if name in KINDS
        ],
        "logs": [log_row(one, result, fine=True) for one in result.per_log],
        "budget": tables.budget_rows(result),
        "correlations": tables.correlation_rows(result),
        "extra": tables.extra_rows(result),
        "agreement": tables.agreement_rows(result),
        "swings_off": tables.swings_off(result),
        "figures": _drawn(result, log, linear=linear) if answered else {},
        "provenance": tables.provenance_rows(result),
        "making": tables.flat_rows(log.metadata) if log is not None and answered else [],
        "wheel": log is not None and log.wheel_angle is not None,
        "friction_stated": bool(rig and (rig.axis.inertia is not None or rig.axis.friction.model_fields_set)),
    }


def _title(result: Result, log: Recording | None) -> str:
    path = (log.source.path if log else None) or result.provenance.get("log")
    several = result.provenance.get("logs")
    paths = several if isinstance(several, list) else [path] if path else []
    names = [Path(str(one)).name for one in paths]
    if len(names) > MOST_NAMES:
        names = [f"{len(names)} logs"]
    return f"{', '.join(names) or 'a log made in memory'}, {result.method} method"


def _answer(result: Result, *, linear: bool) -> dict[str, str]:
    inertia = result.main
    word = parameter_word(result.leading, linear=linear)
    known = inertia.standard_uncertainty is not None
    return {
        "words": word.words,
        "symbol": word.symbol,
        "value": value_text(inertia, fine=True),
        "interval": interval(inertia.interval95, inertia.unit, middle=inertia.value, fine=True)
        if inertia.interval95
        else "",
        "relative": relative(inertia, fine=True),
        "unknown": "" if known else why_unknown(result, result.leading),
    }


@house_style()
def _drawn(result: Result, log: Recording | None, *, linear: bool) -> dict[str, str]:
    """Inline SVG by name, only of what there is."""
    details = result.details
    drawn: dict[str, Figure | None] = {
        "budget": draw_budget(result),
        "swings": draw_swings(result),
        "kinds": draw_kinds(result),
        "logs": draw_logs(result),
        "convergence": draw_convergence(result),
    }
    if log is not None:
        unused = details.unused(float(log.time[0]), float(log.time[-1])) if details else []
        drawn["log"] = draw_log(log, unused, linear=linear)
    if details is not None:
        drawn["residuals"] = draw_residuals(details, linear=linear)
        drawn["changing"] = draw_changing(details.changing)
        if log is not None:
            drawn["turning_points"] = draw_turning_points(log, details, linear=linear)
        if details.friction is not None:
            drawn["friction"] = draw_friction(details.friction, linear=linear)
    return {name: picture(figure, name, TITLES[name]) for name, figure in drawn.items() if figure is not None}


def write_campaign(summary: Summary, path: str | Path) -> Path:
    """Write the page of `summary` to `path` and return it. Raises InputError when the file cannot be written."""
    from swingid.study.campaign.summary import cell_name, figures, used_headings
    from swingid.study.output import counted

    def tabled(cells: Sequence[Cell], headings: Sequence[str]) -> list[tuple[str, tuple[str, ...]]]:
        return [(cell_name(cell), figures(cell.statistics, headings, fine=True)) for cell in cells]

    plan = summary.plan
    by_factor = []
    for factor in plan.tables.factors:
        cells = [cell for cell in summary.by_level if cell.factor == factor]
        headings = used_headings(cells)
        levels = [(level, tabled(list(own), headings)) for level, own in groupby(cells, key=lambda cell: cell.level)]
        by_factor.append({"factor": factor, "headings": headings, "levels": levels})
    headings = used_headings(summary.overall)
    page = filled(
        "campaign.html.j2",
        plan=plan.tables,
        source=plan.source,
        summary=summary,
        points=len({int(point) for point in summary.columns["point"]}),
        headings=headings,
        overall=tabled(summary.overall, headings),
        tables=by_factor,
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
    from swingid.study.compare.comparison import answer_cells, friction_text

    with house_style():
        forest = picture(draw_forest(comparison), "forest", "Inertia by method")
    tables = [
        {
            "log": log,
            "known": any(t.truth is not None for t in comparison.of(log)),
            "rows": [(answer_cells(t, fine=True), friction_text(t.result, fine=True)) for t in comparison.of(log)],
            "messages": comparison.messages(log),
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
    status, answer = VERDICTS[found.verdict.status]
    page = filled(
        "inspection.html.j2",
        found=found,
        name=Path(found.path).name,
        picture=drawn,
        status=status,
        answer=answer,
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
