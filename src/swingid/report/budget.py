"""The uncertainty budget as a table in the form of the GUM.

Columns: X, x, u(x), type, distribution, sensitivity coefficient, contribution, ν (JCGM 100:2008, 4 and 5; EA-4/02
M:2022, 4, shows the form). A contribution that is evaluated as a whole, as scatter or lack of fit, is a correction
whose estimate is 0, with the sensitivity coefficient 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from swingid.format import common_exponent, interval, number, percent, power_of_ten, pretty_unit
from swingid.model.terms import stated_at
from swingid.report.words import RIG, parameter_word
from swingid.result.result import Result
from swingid.result.summary import freedom_text, sorted_budget
from swingid.table import Cell, Column, Table
from swingid.uncertainty.budget import BudgetEntry, Parameter, combined
from swingid.uncertainty.freedom import MANY
from swingid.units import Quantity

if TYPE_CHECKING:
    from swingid.model.rig import Rig

MOST = 30
"""Entries of one parameter beyond which the smaller ones are summed in one line."""

LEAST = 1e-4
"""Share of the combined variance below which its digits say nothing."""

SENSOR_UNITS = {"latency": "s", "cosine": "rad", "sine": "rad", "clock": ""}


@dataclass(frozen=True)
class Budget:
    """The budget of one parameter: its table, and the result with U and k."""

    name: str
    words: str
    table: Table
    combined: str
    freedom: str
    factor: str
    expanded: str
    interval: str


def budgets(result: Result, rig: Rig | None, *, linear: bool) -> list[Budget]:
    """One budget for each parameter whose uncertainty is known and has entries, the leading one first."""
    tables = []
    for name, parameter in result.parameters.items():
        entries = [entry for entry in sorted_budget(result.budget, name) if entry.standard_uncertainty > 0]
        if parameter.standard_uncertainty and entries:
            tables.append(_budget(name, parameter, entries, result, rig, linear=linear))
    return tables


def _budget(
    name: str, parameter: Parameter, entries: list[BudgetEntry], result: Result, rig: Rig | None, *, linear: bool
) -> Budget:
    u = parameter.standard_uncertainty or 0.0
    exponent = common_exponent([u])
    shown, rest = (entries, []) if len(entries) <= MOST + 1 else (entries[:MOST], entries[MOST:])
    total = combined(entries, name)
    lines = [_line(entry, parameter, exponent, total, result, rig, linear=linear) for entry in shown]
    if rest:
        sums = _scaled(combined(rest, name), exponent), _share(combined(rest, name), total)
        lines.append((f"{len(rest)} smaller ones together", *("",) * 5, *sums, ""))
    word = parameter_word(name, linear=linear)
    power = f"{power_of_ten(exponent)} " if exponent else ""
    k = parameter.coverage_factor or 0.0
    ends = parameter.interval95
    return Budget(
        name,
        str(word),
        Table(_columns(f"{power}{pretty_unit(parameter.unit)}".strip()), tuple(lines), "wide budget"),
        number(u, parameter.unit, 2, fine=True),
        freedom_text(parameter),
        f"{k:.2f}",
        number(k * u, parameter.unit, 2, fine=True),
        interval(ends, parameter.unit, middle=parameter.value, fine=True) if ends else "",
    )


def _line(
    entry: BudgetEntry,
    parameter: Parameter,
    exponent: int,
    total: float,
    result: Result,
    rig: Rig | None,
    *,
    linear: bool,
) -> tuple[str | Cell, ...]:
    key = entry.shared_id or entry.source
    word = RIG.get(key)
    unit = word.unit_on(linear=linear) if word else SENSOR_UNITS.get(key.rpartition(".")[2], "")
    slope = entry.sensitivity
    if slope:
        x = _stated(key, result, rig)
        estimate = "–" if x is None else number(x, unit, 6, fine=True)
        u, c = number(entry.standard_uncertainty / abs(slope), unit, 2, fine=True), number(slope, "", 3, fine=True)
    else:
        estimate, c = "0", "1"
        u = number(entry.standard_uncertainty, parameter.unit, 2, fine=True)
    freedom = entry.origin.degrees_of_freedom
    return (
        Cell(str(word) if word else entry.source, key if word and entry.sensitivity else ""),
        estimate,
        u,
        entry.type,
        entry.origin.distribution,
        c,
        _scaled(entry.standard_uncertainty, exponent),
        _share(entry.standard_uncertainty, total),
        "∞" if freedom >= MANY else f"{freedom:.3g}",
    )


def _share(u: float, total: float) -> str:
    """Share of the combined variance."""
    share = (u / total) ** 2
    return "<\u00a00.01\u00a0%" if share < LEAST else percent(share, fine=True)


def _scaled(u: float, exponent: int) -> str:
    """A contribution in the power of ten of its column, to three digits."""
    return f"{u / 10.0**exponent:.3g}"


def _stated(key: str, result: Result, rig: Rig | None) -> float | None:
    """The estimate of an input quantity: a constant as the rig file states it; None where it is unknown."""
    if key.startswith("sensors.") and rig is not None:
        quantity = getattr(rig.sensors.of("wheel" if ".wheel." in key else "angle"), key.rpartition(".")[2], None)
        return quantity.value if isinstance(quantity, Quantity) else None
    if (constant := result.origin.constants.get(key)) is not None:
        return constant.value
    stated = stated_at(rig, key)
    return stated.value if isinstance(stated, Quantity) else None


def _columns(unit: str) -> tuple[Column, ...]:
    """Columns of a budget; unit: of the contributions."""
    words = (Column("type", "", True), Column("distribution", "", True))
    first, last = ("estimate x", "u(x)"), ("c", f"c u(x), {unit}", "share of u²", "ν")
    numbers = {heading: Column(heading, "number", True) for heading in (*first, *last)}
    return (
        Column("input quantity X", "text"),
        *(numbers[column] for column in first),
        *words,
        *(numbers[column] for column in last),
    )
