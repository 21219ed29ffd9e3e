"""A result as text for a terminal, in the manner of lmfit's ``fit_report``."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from swingid.format import interval, number, percent, plus_minus
from swingid.result.data import Details, Message, ResultData
from swingid.table import wrapped
from swingid.uncertainty.budget import BudgetEntry, Parameter, combined
from swingid.uncertainty.freedom import MANY

MOST_ENTRIES, MOST_LAWS = 10, 6
"""Budget entries and friction laws beyond this many are counted, not listed."""

NEGLIGIBLE = 0.01
"""Share of the combined uncertainty below which an entry of the budget is not worth a line."""

UNCORRELATED = 0.1
"""Correlation coefficient below which a pair is not worth a line; ten of them together hardly change a sum's
uncertainty."""

KNOWN_REASONS = {"stribeck_speed": "it is found by a search over trial speeds, not by the linear fit"}

TITLES = {
    "ok": "a number without warnings",
    "warning": "a number to be checked for the reasons in the warnings",
    "refused": "no number",
}


def summarise(result: ResultData) -> str:
    """`result` as text: how it was got, parameters ± standard uncertainty, budget, friction, warnings, notes.

    A refused result is one sentence: why there is no number.
    """
    if result.status == "refused":
        reason = result.error.message if result.error else "the method gave no reason."
        return f"{result.method}: no number, because {' '.join(reason.split()).rstrip('.')}."
    parts = [
        ("Identification", _identification(result)),
        ("Parameters", _parameters(result)),
        ("Correlations", _correlations(result)),
        ("Logs", _logs(result)),
        (f"Uncertainty of {named(result)}", _budget(result)),
        ("Propagation of distributions", _distributions(result)),
        ("Friction", _friction(result.details)),
        ("Estimates by kind of window", _kinds(result)),
        ("Warnings", message_lines(result.warnings)),
        ("Notes", message_lines(result.notes)),
    ]
    return "\n".join(line for title, lines in parts if lines for line in (f"[[{title}]]", *lines))


def why_unknown(result: ResultData, name: str) -> str:
    """Why parameter `name` has no uncertainty: the result's own words if it has any, else what the budget shows."""
    for message in (*result.warnings, *result.notes):
        if message.code.startswith("no-uncertainty") and (message.code.endswith(name) or name in message.message):
            return message.message
    if any(entry.parameter == name for entry in result.budget):
        return "its budget is incomplete: the data do not bound every source"
    return KNOWN_REASONS.get(name, f"the {result.method} method evaluates no source of uncertainty for it")


def named(result: ResultData) -> str:
    """The parameter that the result is about, in a title."""
    return "the inertia" if result.leading == "inertia" else result.leading


def segment_text(details: Details, *, fine: bool = False) -> str:
    """'3.20 s to 25.00 s, 52 turning points, modulating functions of ±0.18 s'."""
    inside = (details.turning_times >= details.start) & (details.turning_times <= details.stop)
    parts = [f"{details.start:.2f} s to {details.stop:.2f} s", counted(int(inside.sum()), "turning point")]
    if details.window is not None:
        parts.append(f"modulating functions of ±{number(details.window, 's', 3, fine=fine)}")
    return ", ".join(parts)


def _identification(result: ResultData) -> list[str]:
    rows = [
        ("method", result.method),
        ("status", f"{result.status} ({TITLES[result.status]})"),
        ("log", _log_text(result)),
        ("rig", _rig_text(result.provenance)),
        ("used", segment_text(result.details) if result.details else None),
    ]
    return [f"    {name:<7} = {value}" for name, value in rows if value]


def _log_text(result: ResultData) -> str:
    origin, rows = result.origin, result.provenance.get("rows")
    if len(origin.runs) == 2:
        return f"{origin.runs['loaded'].result} less {origin.runs['tare'].result}"
    if origin.several:
        return of_several(result) or counted(len(origin.logs), "log")
    return f"{origin.logs[0] or 'made in memory'}" + (f" ({rows} rows)" if rows else "")


def _rig_text(provenance: dict[str, object]) -> str | None:
    name, source = provenance.get("rig"), provenance.get("rig_source")
    return None if name is None else f"{name}" + (f" ({source})" if source and source != name else "")


def _parameters(result: ResultData) -> list[str]:
    lines: list[str] = []
    unknown: list[str] = []
    values = {name: value_text(parameter) for name, parameter in result.parameters.items()}
    names, wide = max(map(len, values), default=0) + 1, max(map(len, values.values()), default=0)
    for name, parameter in result.parameters.items():
        text = f"    {name + ':':<{names}} {values[name]:<{wide}}"
        if parameter.standard_uncertainty is None:
            text += "  (uncertainty unknown)"
            unknown += wrapped(f"{name} has no uncertainty: {why_unknown(result, name)}", "      ", "        ")
        else:
            text += f"  {'(' + relative(parameter) + ')':<10}"
        if parameter.interval95 is not None:
            text += f"  95 %: {interval(parameter.interval95, middle=parameter.value)}"
        if parameter.degrees_of_freedom < MANY:
            text += f"  (k = {parameter.coverage_factor:.2f}, {freedom_text(parameter)} degrees of freedom)"
        lines.append(text.rstrip())
    return lines + unknown


def freedom_text(parameter: Parameter) -> str:
    """Effective degrees of freedom, cut to whole ones from ten on (JCGM 100 G.4.1); "∞" for very many."""
    freedom = parameter.degrees_of_freedom
    return "∞" if freedom >= MANY else f"{freedom:.1f}" if freedom < 10 else f"{int(freedom)}"


def correlated_pairs(result: ResultData) -> list[tuple[str, str, float]]:
    """Pairs of parameters with their correlation coefficient, the strongest first, down to `UNCORRELATED`."""
    names = list(result.correlation)
    pairs = [
        (first, second, result.correlation[first][second]) for k, first in enumerate(names) for second in names[k + 1 :]
    ]
    return sorted((pair for pair in pairs if abs(pair[2]) >= UNCORRELATED), key=lambda pair: -abs(pair[2]))


def _correlations(result: ResultData) -> list[str]:
    shown = correlated_pairs(result)
    width = max((len(first) + len(second) for first, second, _ in shown), default=0) + 3
    return [f"    {first + ' and ' + second:<{width + 2}} {r:+.2f}" for first, second, r in shown[:MOST_ENTRIES]]


def value_text(parameter: Parameter, *, fine: bool = False) -> str:
    """Value ± standard uncertainty with its unit; four digits where the uncertainty is unknown."""
    if parameter.standard_uncertainty is None:
        return number(parameter.value, parameter.unit, fine=fine)
    return plus_minus(parameter.value, parameter.standard_uncertainty, parameter.unit, fine=fine)


def relative(parameter: Parameter, *, fine: bool = False) -> str:
    """Standard uncertainty as a share of the value; "" where it is unknown."""
    if not parameter.standard_uncertainty:
        return ""
    if parameter.standard_uncertainty > abs(parameter.value):
        return ">\u00a0100\u00a0%" if fine else "> 100 %"
    return percent(parameter.standard_uncertainty / abs(parameter.value), fine=fine)


def _logs(result: ResultData) -> list[str]:
    """One line per log: its inertia or ratio, how far it is from the common one, its warnings or why it was refused."""
    rows = [log_row(of_log, result) for of_log in result.per_log]
    if not rows:
        return []
    wide = [max(len(row[k]) for row in rows) for k in range(3)]
    return [
        f"    {name:<{wide[0]}}  {value:<{wide[1]}}  {off:<{wide[2]}}  {warnings}".rstrip()
        for name, value, off, warnings in rows
    ]


def log_row(result: ResultData, common: ResultData, *, fine: bool = False) -> tuple[str, str, str, str]:
    """Return one of several logs as a row: name, inertia, deviation from the common one, warnings."""
    name = str(result.provenance.get("log") or "made in memory")
    if result.leading not in result.parameters:
        return name, "no number", "", " ".join(result.error.message.split()) if result.error else ""
    share = result.main.value / common.main.value - 1
    off = percent(share if abs(share) > 1e-12 else 0.0, sign=True, fine=fine)
    return name, value_text(result.main, fine=fine), off, ", ".join(message.code for message in result.warnings)


def _budget(result: ResultData) -> list[str]:
    inertia = result.parameters.get(result.leading)
    entries = sorted_budget(result.budget, result.leading)
    if inertia is None or not entries:
        return []
    shown, rest = folded(entries, MOST_ENTRIES)
    rest_words = f"{len(rest)} smaller ones together"
    width = min(max(len(rest_words), *(len(entry.source) for entry in shown)), 60)
    lines = [
        f"    {entry.type}  {entry.source:<{width}}  {share(entry.standard_uncertainty, inertia)}" for entry in shown
    ]
    if rest:
        lines.append(f"       {rest_words:<{width}}  {share(combined(rest, result.leading), inertia)}")
    totals = [(kind, [e for e in entries if e.type == kind]) for kind in ("A", "B")]
    words = {"A": "from the data", "B": "from the rig's constants"}
    text = "; ".join(
        f"type {kind} ({words[kind]}) {share(combined(part, result.leading), inertia)}" for kind, part in totals if part
    )
    return [*lines, f"    {text}"]


AGREEMENT = {
    True: "the linear interval agrees with it",
    False: "the linear interval does not agree with it",
    None: "too few draws to know whether the linear interval agrees with it",
}
"""What the comparison of JCGM 101, 8.1, found."""


def _distributions(result: ResultData) -> list[str]:
    """List for each parameter mean, standard uncertainty and shortest interval of the draws, and the comparison."""
    drawn = result.monte_carlo
    if drawn is None:
        return []
    lines = [f"    {drawn.answered} of {drawn.draws} draws of everything that is uncertain have an estimate"]
    for name, distribution in drawn.parameters.items():
        value = plus_minus(distribution.mean, distribution.standard_uncertainty, result.parameters[name].unit)
        ends = interval(distribution.interval95, middle=distribution.mean)
        lines += wrapped(f"{name}: {value}  shortest 95 %: {ends}; {AGREEMENT[distribution.agrees]}")
    missing = [name for name in result.parameters if name not in drawn.parameters]
    if missing:
        lines += wrapped(f"no distribution: {', '.join(missing)} (most draws have another friction law)")
    return lines


def sorted_budget(budget: Iterable[BudgetEntry], parameter: str) -> list[BudgetEntry]:
    """The entries of one parameter, largest first."""
    return sorted((e for e in budget if e.parameter == parameter), key=lambda e: -e.standard_uncertainty)


def folded(entries: list[BudgetEntry], most: int) -> tuple[list[BudgetEntry], list[BudgetEntry]]:
    """Sorted entries of one parameter in those to list, and two or more that are too many or too small to."""
    limit = NEGLIGIBLE * combined(entries, entries[0].parameter) if entries else 0.0
    count = max(1, sum(entry.standard_uncertainty >= limit for entry in entries[:most]))
    return (entries, []) if len(entries) - count < 2 else (entries[:count], entries[count:])


def share(uncertainty: float, parameter: Parameter, *, fine: bool = False) -> str:
    """An uncertainty relative to the value of the parameter, in its unit where that is 0."""
    if not parameter.value:
        return number(uncertainty, parameter.unit, 2, fine=fine)
    return percent(uncertainty / abs(parameter.value), fine=fine)


def _friction(details: Details | None) -> list[str]:
    if details is None or details.friction is None:
        return []
    curve = details.friction
    lines = [f"    law: {curve.law or 'none found'}"]
    ranked = sorted(curve.candidates.items(), key=lambda item: item[1])
    if len(ranked) > 1:
        lines[0] += " (lowest information criterion; differences to it:)"
        best = ranked[0][1]
        shown = ranked[1:MOST_LAWS]
        width = max(len(name) for name, _ in shown)
        lines += [f"      {name:<{width}}  +{score - best:.1f}" for name, score in shown]
        if len(ranked) > MOST_LAWS:
            lines.append(f"      and {counted(len(ranked) - MOST_LAWS, 'law')} further off")
    return lines


def _kinds(result: ResultData) -> list[str]:
    details, inertia = result.details, result.parameters.get(result.leading)
    if details is None or inertia is None or len(details.estimates) < 2:
        return []
    width = max(len(name) for name in details.estimates)
    lines = []
    for name, (value, uncertainty) in details.estimates.items():
        text = f"    {name:<{width}}  {plus_minus(value, uncertainty, inertia.unit)}"
        if value == inertia.value:
            text += "  (the estimate)"
        elif inertia.value:
            text += f"  ({percent(value / inertia.value - 1, sign=True)} from the estimate)"
        lines.append(text)
    return lines


def message_lines(messages: Sequence[Message]) -> list[str]:
    """Warnings or notes, each with its code."""
    return [line for message in messages for line in wrapped(f"{message.code}: {message.message}")]


def of_several(result: ResultData) -> str:
    """'3 parts of a.csv' where the result is of several parts of one log; "" where it is not."""
    origin = result.origin
    if not (result.per_part and origin.several and origin.logs):
        return ""
    log = str(origin.logs[0]).rpartition(" ")[0] or "a log made in memory"
    return f"{counted(len(result.per_part), 'part')} of {log}"


def counted(count: int, noun: str) -> str:
    """'1 log', '2 logs'."""
    return f"{count} {noun}{'' if count == 1 else 's'}"
