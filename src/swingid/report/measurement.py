"""The report of one result: its content in the order of ISO/IEC 17025:2017, 7.8, as an HTML page or as a PDF."""

from __future__ import annotations

import hashlib
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING

from swingid.format import interval, number
from swingid.report import tables
from swingid.report.budget import budgets
from swingid.report.certificate import Certificate, stated_rows
from swingid.report.figures.estimates import (
    draw_budget,
    draw_convergence,
    draw_distribution,
    draw_kinds,
    draw_logs,
    draw_swings,
)
from swingid.report.figures.motion import draw_changing, draw_friction, draw_log, draw_residuals, draw_turning_points
from swingid.report.page import date_of_issue, filled, is_pdf, picture, write_page
from swingid.report.pdf import Attachment, Head
from swingid.report.style import house_style
from swingid.report.words import DRIVES, KINDS, parameter_word
from swingid.result.brief import value_and_reach
from swingid.result.result import Result
from swingid.result.summary import freedom_text, relative, segment_text, value_text, why_unknown
from swingid.table import pairs

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from swingid.model.rig import Rig
    from swingid.recording.recording import Recording

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
    "distribution": "Distribution of the inertia by random draws",
    "logs": "Inertia of every log",
    "convergence": "Online estimate over time",
}

REPORT, CERTIFICATE = "Measurement report", "Calibration certificate"


def write_report(
    result: Result,
    log: Recording | None,
    rig: Rig | None,
    path: str | Path,
    certificate: Certificate | None = None,
) -> Path:
    """Write the report of `result` to `path` and return it: a PDF where the name ends in .pdf, else an HTML page.

    certificate: what the laboratory states, see `load_certificate`. The PDF contains the result as JSON and the rig
    file; it is made by the extra `pdf`. What there are no data for is left out; a refused result states why, `log` and
    `rig` may then be None. The same result gives the same bytes (a PDF: on the same day, or with SOURCE_DATE_EPOCH).
    Raises InputError when the file cannot be written; it appears whole or not at all.
    """
    issued = date_of_issue() if is_pdf(path) or certificate is not None else ""
    page = render(result, log, rig, certificate, issued)
    attachments = [Attachment("result.json", "application/json", "the result", result.to_json())]
    if rig is not None and rig.text:
        attachments.append(Attachment("rig.toml", "application/toml", "the rig file", rig.text))
    name = certificate.laboratory.name if certificate else ""
    stated = (certificate.measurement.issued if certificate else None) or issued
    head = Head(kind_of(result, certificate), number_of(result, certificate), name, stated)
    return write_page(page, path, head, attachments)


def render(
    result: Result,
    log: Recording | None,
    rig: Rig | None,
    certificate: Certificate | None = None,
    issued: str = "",
) -> str:
    """The report of `write_report` as HTML text, with all figures inside; issued: the date, "" for none."""
    return filled("report.html.j2", **_context(result, log, rig, certificate, issued))


def kind_of(result: Result, certificate: Certificate | None) -> str:
    """What the report is: a calibration certificate only of a number, and only if the laboratory is accredited."""
    accredited = certificate is not None and certificate.accredited
    return CERTIFICATE if accredited and result.status != "refused" else REPORT


def number_of(result: Result, certificate: Certificate | None) -> str:
    """The number of the report: as stated, else the first digits of the SHA-256 of the result's JSON."""
    if certificate is not None and certificate.measurement.number:
        return certificate.measurement.number
    return hashlib.sha256(result.to_json().encode("utf-8", "backslashreplace")).hexdigest()[:12]


def _identification(result: Result, certificate: Certificate | None, issued: str) -> list[tuple[str, str]]:
    rows = [("number", number_of(result, certificate))]
    stated = certificate.measurement.issued if certificate else None
    if stated or issued:
        rows.append(("date of issue", stated or issued))
    rows += stated_rows(certificate) if certificate else []
    named, digests = [log for log in result.origin.logs if log], result.origin.digests
    rows += [("log" if len(named) == 1 else "logs", ", ".join(named))] if named else []
    if len(digests) == 1:
        rows.append(("SHA-256 of the log", digests[0]))
    else:
        rows += [(f"SHA-256 of log {k}", digest) for k, digest in enumerate(digests, start=1)]
    return rows


def _context(
    result: Result, log: Recording | None, rig: Rig | None, certificate: Certificate | None, issued: str
) -> dict[str, object]:
    linear = rig.axis.kind == "linear" if rig else "inertia" in result.parameters and result.inertia.unit == "kg"
    answered = result.status != "refused"
    laws, more_laws = tables.law_table(result)
    return {
        "result": result,
        "status_words": STATUS[result.status],
        "kind": kind_of(result, certificate),
        "title": _title(result, log),
        "identification": pairs(_identification(result, certificate, issued)),
        "accredited": certificate is not None and certificate.accredited,
        "stated": certificate is not None,
        "method": tables.method_table(result, rig),
        "answer": _answer(result, linear=linear) if result.leading in result.parameters else None,
        "linear": linear,
        "segment": segment_text(result.details, fine=True) if result.details else "",
        "parameters": tables.parameter_table(result, linear=linear),
        "rig": rig if answered else None,
        "drive": DRIVES.get(rig.drive.kind, rig.drive.kind) if rig else "",
        "rig_rows": tables.rig_table(rig) if rig and answered else None,
        "sensor_rows": tables.sensor_table(rig) if rig and answered else None,
        "log_rows": tables.recording_table(log, result) if log is not None and answered else None,
        "laws": laws,
        "more_laws": more_laws,
        "kinds": [
            (name, KINDS[name]) for name in (result.details.estimates if result.details else ()) if name in KINDS
        ],
        "logs": tables.log_table(result, "mass" if linear else "inertia"),
        "budgets": budgets(result, rig, linear=linear) if answered else [],
        "checks": tables.check_table(result),
        "distributions": tables.distribution_table(result),
        "draws": result.monte_carlo,
        "correlations": tables.correlation_table(result),
        "extra": tables.extra_table(result),
        "agreement": tables.agreement_table(result),
        "swings_off": tables.swings_off(result),
        "figures": _drawn(result, log, linear=linear) if answered else {},
        "provenance": tables.provenance_table(result),
        "making": tables.metadata_table(log.metadata) if log is not None and answered else None,
        "wheel": log is not None and log.wheel_angle is not None,
        "friction_stated": bool(rig and (rig.axis.inertia is not None or rig.axis.friction.model_fields_set)),
    }


def _title(result: Result, log: Recording | None) -> str:
    origin = result.origin
    tare, loaded = (Path(origin.runs[key].result).name if key in origin.runs else "" for key in ("tare", "loaded"))
    if tare and loaded:
        return f"{loaded} less {tare}"
    paths = [log.source.path] if log and log.source.path and not origin.several else origin.logs
    names = [Path(str(each)).name for each in paths if each or origin.several]
    if len(names) > MOST_NAMES:
        names = [f"{len(names)} logs"]
    return f"{', '.join(names) or 'a log made in memory'}, {result.method} method"


def _answer(result: Result, *, linear: bool) -> dict[str, str]:
    inertia = result.main
    word = parameter_word(result.leading, linear=linear)
    u, ends = inertia.standard_uncertainty, inertia.interval95
    return {
        "words": word.words,
        "symbol": word.symbol,
        "value": value_and_reach(inertia, fine=True) if ends else value_text(inertia, fine=True),
        "standard": number(u, inertia.unit, 2, fine=True) if u is not None else "",
        "factor": f"{inertia.coverage_factor:.2f}" if inertia.coverage_factor else "",
        "freedom": freedom_text(inertia),
        "interval": interval(ends, inertia.unit, middle=inertia.value, fine=True) if ends else "",
        "relative": relative(inertia, fine=True),
        "unknown": "" if u is not None else why_unknown(result, result.leading),
    }


def _unused(result: Result, first: float, last: float) -> list[tuple[float, float]]:
    """Parts (s) of a log from `first` to `last` that were not used, or are in none of the parts selected."""
    if result.details is not None:
        return result.details.unused(first, last)
    ends = [
        first,
        *(end for part in sorted(result.per_part, key=attrgetter("start")) for end in (part.start, part.stop)),
    ]
    return list(zip(ends[::2], [*ends[1::2], last], strict=True)) if result.per_part else []


@house_style()
def _drawn(result: Result, log: Recording | None, *, linear: bool) -> dict[str, str]:
    """Inline SVG by name, only of what there is."""
    details = result.details
    drawn: dict[str, Figure | None] = {
        "budget": draw_budget(result),
        "swings": draw_swings(result),
        "kinds": draw_kinds(result),
        "distribution": draw_distribution(result),
        "logs": draw_logs(result),
        "convergence": draw_convergence(result),
    }
    if log is not None:
        drawn["log"] = draw_log(log, _unused(result, float(log.time[0]), float(log.time[-1])), linear=linear)
    if details is not None:
        drawn["residuals"] = draw_residuals(details, linear=linear)
        drawn["changing"] = draw_changing(details.changing)
        if log is not None:
            drawn["turning_points"] = draw_turning_points(log, details, linear=linear)
        if details.friction is not None:
            drawn["friction"] = draw_friction(details.friction, linear=linear)
    return {name: picture(figure, name, TITLES[name]) for name, figure in drawn.items() if figure is not None}
