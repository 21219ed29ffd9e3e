"""A result in a dozen lines: the number with its expanded uncertainty, status, what dominates, what would help."""

from __future__ import annotations

from collections.abc import Iterator
from math import sqrt
from pathlib import Path

from swingid.format import interval, number, percent, plus_minus
from swingid.result.data import ResultData
from swingid.result.summary import (
    AGREEMENT,
    counted,
    log_row,
    of_several,
    relative,
    share,
    sorted_budget,
    summarise,
)
from swingid.table import NO_BREAK, wrapped
from swingid.uncertainty.budget import BudgetEntry, Parameter

MOST_PARAMETERS, MOST_LOGS, MOST_SHARES, MOST_NOTES = 3, 3, 3, 5
"""Lines for parameters beside the first, for logs and contributions, and names of notes; in all at most 15 lines."""

STATUS = {
    "ok": "ok, no check found anything that matters",
    "warning": "warning, check the number for the reasons below",
}


def brief(result: ResultData) -> str:
    """`result` in at most 15 lines, and its warnings in full; a refused one as `summarise` has it."""
    if result.status == "refused":
        return summarise(result)
    rows = [
        *_values(result),
        *_draws(result),
        *_logs(result),
        ("status", STATUS[result.status]),
        ("log", _origin(result)),
    ]
    rows += [*_scale(result), *_shares(result), *_notes(result)]
    wide = max(len(name) for name, _ in rows) + 2
    lines = [line for name, text in rows for line in _wrapped(f"{name:<{wide}}{text}", " " * wide)]
    warned = (_wrapped(f"{warning.code}: {warning.message}", "    ") for warning in result.warnings)
    return "\n".join([*lines, *(line for each in warned for line in each)])


def expanded(parameter: Parameter) -> str:
    """Value ± half of its 95 % interval, with the coverage factor and the relative standard uncertainty."""
    return f"{value_and_reach(parameter)}  {coverage(parameter)}"


def value_and_reach(parameter: Parameter, *, fine: bool = False) -> str:
    """'(3.02200 ± 0.00091)e-3 kg m²': value ± half of its 95 % interval; the value where that is unknown."""
    if parameter.interval95 is None:
        return number(parameter.value, parameter.unit, fine=fine)
    low, high = parameter.interval95
    return plus_minus(parameter.value, (high - low) / 2, parameter.unit, fine=fine)


def coverage(parameter: Parameter) -> str:
    """'(95 %, k = 2.05; u = 0.15 %)': what stands behind `value_and_reach`."""
    if parameter.coverage_factor is None:
        return "(uncertainty unknown)"
    u = relative(parameter)
    share_of_value = f"; u {'' if u.startswith('>') else '= '}{u}" if u else ""
    return f"(95 %, k = {parameter.coverage_factor:.2f}{share_of_value})"


def _values(result: ResultData) -> Iterator[tuple[str, str]]:
    """The leading parameter, then the others and the friction law."""
    names = sorted(result.parameters, key=lambda name: name != result.leading)
    shown = names[: 2 if result.per_log else 1 + MOST_PARAMETERS]
    for name in shown:
        yield name, expanded(result.parameters[name])
    if len(names) > len(shown):
        yield "", f"and {counted(len(names) - len(shown), 'more parameter')}: -v"
    law = result.details.friction.law if result.details is not None and result.details.friction is not None else None
    if law and not result.per_log:
        yield "friction", law


def _draws(result: ResultData) -> Iterator[tuple[str, str]]:
    """The leading parameter by propagation of distributions."""
    yield from (("draws", note.message.rstrip(".")) for note in result.notes if note.code == "no-draws")
    drawn = result.monte_carlo
    if drawn is None:
        return
    if result.leading not in drawn.parameters:
        yield "draws", f"{drawn.answered} of {drawn.draws} have an estimate: too few for a distribution"
        return
    distribution = drawn.parameters[result.leading]
    ends = interval(distribution.interval95, middle=distribution.mean)
    yield "draws", f"{ends}, shortest 95 % of {drawn.answered}; {AGREEMENT[distribution.agrees]}"


def _logs(result: ResultData) -> Iterator[tuple[str, str]]:
    """List for each log its value, its deviation from the common one, its warnings, or why it has none."""
    for of_log in result.per_log[:MOST_LOGS]:
        name, _, off, warnings = log_row(of_log, result)
        if of_log.leading not in of_log.parameters:  # for which reason the warning says
            yield Path(name).name, "no number"
            continue
        value = expanded(of_log.main)
        yield Path(name).name, "  ".join(text for text in (value, f"{off} off", warnings) if text)
    if len(result.per_log) > MOST_LOGS:
        yield "", f"and {counted(len(result.per_log) - MOST_LOGS, 'more log')}: -v"


def _origin(result: ResultData) -> str:
    """Which log, which part of it, which rig, which method."""
    origin, rig, details = result.origin, result.provenance.get("rig"), result.details
    if origin.several:
        log = of_several(result) or f"{len(origin.logs)} logs"
    else:
        log = Path(origin.logs[0] or "a log made in memory").name
    if details is not None:
        log += f", {details.start:.2f} to {details.stop:.2f} s"
    return "; ".join([log, *([f"rig {rig}"] if rig else []), f"method {result.method}"])


def _shares(result: ResultData) -> Iterator[tuple[str, str]]:
    """The largest contributions to the standard uncertainty, and what makes the first of them smaller."""
    entries = sorted_budget(result.budget, result.leading)
    if not entries or result.leading not in result.parameters:
        return
    main = result.parameters[result.leading]
    for k, entry in enumerate(entries[:MOST_SHARES]):
        yield "budget" if k == 0 else "", f"{share(entry.standard_uncertainty, main)}  {entry.source}"
    yield "to reduce", remedy(entries[0], result)


def remedy(entry: BudgetEntry, result: ResultData) -> str:
    """What makes a contribution smaller, and where that is known the 95 % interval with half of it."""
    key, main = entry.shared_id or "", result.main
    if key.startswith("sensors") or ".sensors" in key:
        return f"calibrate the encoders (swingid calibrate --encoders LOG); with half of it {_halved(entry, main)}"
    if entry.type == "B":
        part, share_of_it = _largest_part(key, result)
        if part.endswith(".g"):
            return (
                f"state {part.removesuffix('g')}latitude; with half the uncertainty {_halved(entry, main, share_of_it)}"
            )
        return f"measure {part or entry.source} again; with half its uncertainty {_halved(entry, main, share_of_it)}"
    if entry.origin.averages_over_logs:
        return f"four times as many swings, in one log or in several: {_halved(entry, main)}"
    return "more swings do not reduce the first contribution; the report (--report FILE) shows where it comes from"


def _largest_part(key: str, result: ResultData) -> tuple[str, float]:
    """The most important of the numbers that a constant is computed from, and its share of the variance."""
    parts = result.origin.made_of.get(key)
    if not parts:
        return key, 1.0
    part = max(parts, key=lambda name: parts[name])
    return part, parts[part] ** 2 / sum(size**2 for size in parts.values())


def _halved(entry: BudgetEntry, main: Parameter, share_of_it: float = 1.0) -> str:
    """The expanded uncertainty with a share of one contribution half as large, and the coverage factor as it is."""
    if main.standard_uncertainty is None or main.coverage_factor is None:
        return "the interval is still unknown"
    remaining = main.standard_uncertainty**2 - 0.75 * share_of_it * entry.standard_uncertainty**2
    reach = main.coverage_factor * sqrt(max(remaining, 0.0))
    now = main.coverage_factor * main.standard_uncertainty
    before, after = (percent(u / abs(main.value)) if main.value else number(u, main.unit, 2) for u in (now, reach))
    return f"± {before} becomes ± {after}"


def _scale(result: ResultData) -> Iterator[tuple[str, str]]:
    """What to measure for an inertia, where there are ratios only."""
    yield from (("scale", note.message) for note in result.notes if note.code == "no-scale")


def _notes(result: ResultData) -> Iterator[tuple[str, str]]:
    if result.notes:
        codes = list(dict.fromkeys(note.code for note in result.notes if note.code != "no-scale"))
        more = f" and {len(codes) - MOST_NOTES} more" if len(codes) > MOST_NOTES else ""
        yield "notes", f"{', '.join(codes[:MOST_NOTES])}{more} (-v shows them)"


def _wrapped(text: str, further: str) -> list[str]:
    """Lines of `text`, with no number parted from its percent sign, or from a ± before it."""
    return wrapped(text.replace(" %", f"{NO_BREAK}%").replace("± ", f"±{NO_BREAK}"), "", further)
