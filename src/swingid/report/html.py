"""The report: one HTML file that needs nothing else, made from a result, its log and its rig."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from swingid.format import interval
from swingid.report import tables
from swingid.report.figures.estimates import draw_budget, draw_convergence, draw_kinds, draw_logs, draw_swings
from swingid.report.figures.motion import draw_friction, draw_log, draw_residuals, draw_turning_points
from swingid.report.style import house_style, to_svg
from swingid.report.words import DRIVES, KINDS, parameter_word
from swingid.result.result import Result
from swingid.result.summary import log_row, relative, segment_text, value_text, why_unknown
from swingid.system import write_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from swingid.model.rig import Rig
    from swingid.recording.recording import Recording

STATUS = {
    "ok": "no warnings",
    "warning": "with warnings",
    "refused": "no estimate",
}

MOST_NAMES = 3
"""Logs that a title names; of more it gives the number."""

TITLES = {
    "log": "Measured channels over time",
    "turning_points": "Angle with its turning points",
    "swings": "Inertia of every swing",
    "friction": "Friction against speed",
    "residuals": "Residuals over time",
    "budget": "Uncertainty budget of the inertia",
    "kinds": "Estimates by kind of projection",
    "logs": "Inertia of every log",
    "convergence": "Online estimate over time",
}


def write_report(result: Result, log: Recording | None, rig: Rig | None, path: str | Path) -> Path:
    """Write the report of `result` to `path` and return it; the same result gives the same bytes.

    What there are no data for is left out; a refused result says why, `log` and `rig` may then be None.
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
    linear = _is_linear(result, rig)
    answered = result.status != "refused"
    laws, more_laws = tables.law_rows(result)
    return {
        "result": result,
        "status_words": STATUS[result.status],
        "title": _title(result, log),
        "answer": _answer(result, linear=linear) if "inertia" in result.parameters else None,
        "linear": linear,
        "segment": segment_text(result.details, fine=True) if result.details else "",
        "parameters": tables.parameter_rows(result, linear=linear),
        "rig": rig if answered else None,
        "drive": DRIVES.get(rig.drive.kind, rig.drive.kind) if rig else "",
        "rig_rows": tables.rig_rows(rig) if rig and answered else [],
        "sensor_rows": tables.sensor_rows(rig) if rig and answered else [],
        "log_rows": _log_rows(result, log) if log is not None and answered else [],
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
        "swings_off": tables.swings_off(result),
        "figures": _figures(result, log, linear=linear) if answered else {},
        "provenance": tables.provenance_rows(result),
        "making": tables.making_rows(log) if answered else [],
        "wheel": log is not None and log.wheel_angle is not None,
        "friction_stated": bool(rig and (rig.axis.inertia is not None or rig.axis.friction.model_fields_set)),
    }


def _log_rows(result: Result, log: Recording) -> list[tables.Row]:
    truth = tables.truth_row(result, log)
    return tables.log_rows(log) + ([truth] if truth else [])


def _is_linear(result: Result, rig: Rig | None) -> bool:
    if rig is not None:
        return rig.axis.kind == "linear"
    return "inertia" in result.parameters and result.inertia.unit == "kg"


def _title(result: Result, log: Recording | None) -> str:
    path = (log.source.path if log else None) or result.provenance.get("log")
    several = result.provenance.get("logs")
    paths = several if isinstance(several, list) else [path] if path else []
    names = [Path(str(one)).name for one in paths]
    if len(names) > MOST_NAMES:
        names = [f"{len(names)} logs"]
    return f"{', '.join(names) or 'a log made in memory'}, {result.method} method"


def _answer(result: Result, *, linear: bool) -> dict[str, str]:
    inertia = result.inertia
    word = parameter_word("inertia", linear=linear)
    known = inertia.standard_uncertainty is not None
    return {
        "words": word.words,
        "symbol": word.symbol,
        "value": value_text(inertia, fine=True),
        "interval": interval(inertia.interval95, inertia.unit, middle=inertia.value, fine=True)
        if inertia.interval95
        else "",
        "relative": relative(inertia, fine=True),
        "unknown": "" if known else why_unknown(result, "inertia"),
    }


def _figures(result: Result, log: Recording | None, *, linear: bool) -> dict[str, str]:
    """Inline SVG by name, only of what there is."""
    with house_style():
        drawn = _drawn(result, log, linear=linear)
        return {name: picture(figure, name, TITLES[name]) for name, figure in drawn.items() if figure is not None}


def _drawn(result: Result, log: Recording | None, *, linear: bool) -> dict[str, Figure | None]:
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
        if log is not None:
            drawn["turning_points"] = draw_turning_points(log, details, linear=linear)
        if details.friction is not None:
            drawn["friction"] = draw_friction(details.friction, linear=linear)
    return drawn
