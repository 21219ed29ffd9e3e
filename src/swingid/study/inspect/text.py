"""An inspection as text for a terminal."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from swingid.recording.inspect import Check, Column
    from swingid.study.inspect.inspection import Inspection

MARKS = {"ok": "ok  ", "note": "note", "unknown": "?   ", "advice": "tip ", "repair": "MEND", "fault": "BAD "}
WIDTH = 118


def summary(found: Inspection) -> str:
    """Verdict, columns, checks, methods and, without a rig, the guessed [log] table."""
    lines = [f"{found.path}: {found.verdict.line}"]
    lines += [f"advice: {found.verdict.advice}."] if found.verdict.advice else []
    lines += ["", "columns", *_columns(found)]
    lines += ["", "checks" if found.rig is None else f"checks against rig {found.rig.name}"]
    for check in found.checks:
        lines += wrapped(check)
    if found.services:
        lines += ["", "how much of it serves each method"]
        wide = max(len(service.method) for service in found.services)
        for service in found.services:
            lines.append(f"  {service.method:<{wide}}  {service.seconds:8.4g} s  {service.why}")
    if found.rig is None and found.roles.found:
        lines += ["", "guessed for rig.toml (swingid init --from LOG DIR writes it)", ""]
        lines += [f"  {line}" for line in found.table.splitlines()]
    return "\n".join(lines)


def wrapped(check: Check) -> list[str]:
    """One check as lines: mark, title, evidence, and what to do."""
    told = check.remedy and check.remedy not in check.evidence and check.level in ("advice", "repair", "fault")
    text = check.evidence + (f" → {check.remedy}" if told else "")
    head = f"  {MARKS[check.level]} {check.title:<20} "
    body = textwrap.wrap(text, WIDTH - len(head)) or [""]
    return [head + body[0], *(" " * len(head) + line for line in body[1:])]


def columns_table(found: Inspection) -> list[tuple[str, str, str, str, str, str]]:
    """Cells per column: name, what it seems to be, type, unit, range, first values."""
    named = {role.column: name for name, role in found.roles.found.items()}
    return [
        (
            column.name,
            named.get(column.name, found.roles.others.get(column.name, "")).replace("_", " "),
            column.kind,
            column.unit,
            range_of(column),
            ", ".join(column.first),
        )
        for column in found.columns
    ]


def range_of(column: Column) -> str:
    """From the lowest to the highest value, and cells without a number."""
    if column.kind in ("text", "empty"):
        return ""
    low, high = f"{column.low:.5g}", f"{column.high:.5g}"
    if low == high and column.low != column.high:  # seconds since 1970
        low, high = f"{column.low:.14g}", f"{column.high:.14g}"
    text = f"{low} … {high}"
    text += f", {column.missing} missing" if column.missing else ""
    return text + (f", {column.outliers} far outside" if column.outliers else "")


def _columns(found: Inspection) -> list[str]:
    rows = [("column", "seems to be", "type", "unit", "range", "first values"), *columns_table(found)]
    widths = [min(max(len(row[k]) for row in rows), 34) for k in range(6)]
    return [("  " + "  ".join(f"{cell:<{w}}" for cell, w in zip(row, widths, strict=True))).rstrip() for row in rows]
