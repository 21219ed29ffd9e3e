"""What a status is worth: of the answers in runs with each fault, how many are ok, and how many of these are wrong."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from swingid.table import Table, plain

if TYPE_CHECKING:
    from swingid.numerics.arrays import Bools
    from swingid.study.campaign.plan import Plan
    from swingid.study.trials import Columns

WIDE = 1.5
"""Half-widths of the 95 % interval beyond which an answer is wrong: 0.3 % of right ones are, if errors are normal."""

CLEAN = "none"
"""The fault that is none."""

HEADINGS = ("answers", "ok", "of these wrong", "warned", "refused", "crashed")


@dataclass(frozen=True)
class Trust:
    """Counts of answers, refusals included: ok, wrong though ok, with a warning, refused by a reason, crashed."""

    answers: int
    ok: int
    wrong: int
    warned: int
    refused: int
    crashed: int

    @classmethod
    def of(cls, columns: Columns, rows: Bools) -> Trust:
        """The counts in some rows of the results; runs without a log do not count."""
        c = {name: columns[name][rows] for name in ("status", "code", "value", "truth", "low", "high")}
        ok = c["status"] == "ok"
        with np.errstate(invalid="ignore"):
            wrong = np.abs(c["value"] - c["truth"]) > WIDE * (c["high"] - c["low"]) / 2
        crashed = np.char.startswith(c["code"].astype(str), "bug-") & (c["status"] != "failed")
        refused = (c["status"] == "refused") & ~crashed
        counts = (c["status"] != "failed", ok, ok & wrong, c["status"] == "warning", refused, crashed)
        return cls(*(int(count.sum()) for count in counts))

    def cells(self) -> tuple[str, ...]:
        """Return the cells of a table, below `HEADINGS`."""
        parts = [f"{100 * n / self.answers:.0f} %" if n else "–" for n in (self.warned, self.refused, self.crashed)]
        return (str(self.answers), str(self.ok), self.share(), *parts)

    def share(self) -> str:
        """The share of the "ok" answers that are wrong."""
        return f"{self.wrong} = {100 * self.wrong / self.ok:.0f} %" if self.wrong else "–"


def trust_of(plan: Plan, columns: Columns) -> list[dict[str, Any]]:
    """Counts at each level of each factor with faults, for each method; plain data."""
    return [
        {"factor": factor, "level": str(level), "method": method, **asdict(Trust.of(columns, rows & of_method))}
        for factor in fault_factors(plan)
        for level, rows in _levels(columns, factor).items()
        for method, of_method in _levels(columns, "method").items()
    ]


def trust_tables(plan: Plan, columns: Columns) -> list[Table]:
    """Make two tables for each factor with faults: by fault, worst first, and by the levels of the other factors."""
    tables = []
    methods = _levels(columns, "method")
    for factor in fault_factors(plan):
        names = np.array([label.partition(":")[0] for label in columns[factor].tolist()])
        of_fault = {str(name): names == name for name in dict.fromkeys(names)}
        clean = of_fault.pop(CLEAN, np.zeros(len(names), bool))
        counts = {name: Trust.of(columns, rows) for name, rows in of_fault.items()}
        ranked = sorted(
            (n for n, t in counts.items() if t.answers), key=lambda n: -counts[n].wrong / max(counts[n].ok, 1)
        )
        groups = {"nothing wrong": clean, "**any fault**": ~clean} | {name: of_fault[name] for name in ranked}
        by_fault = []
        for name, rows in groups.items():
            by_method = [Trust.of(columns, rows & method) for method in methods.values()]
            cells = (f"{trust.wrong} of {trust.ok}" for trust in by_method)
            by_fault.append((name, *Trust.of(columns, rows).cells(), *cells))
        tables.append(Table(plain(factor, *HEADINGS, *methods), tuple(by_fault)))
        others = [other for other in (*plan.tables.factors, "method") if other != factor]
        levels = {f"{o} {v}": rows for o in others for v, rows in _levels(columns, o).items()}
        by_level = tuple((n, *Trust.of(columns, r & ~clean).cells()) for n, r in levels.items())
        tables.append(Table(plain("with a fault", *HEADINGS), by_level))
    return tables


def fault_factors(plan: Plan) -> list[str]:
    """Names of the factors that put faults into runs."""
    return [name for name, factor in plan.tables.factors.items() if (factor.key or "").startswith("faults.")]


def _levels(columns: Columns, name: str) -> dict[str, Bools]:
    """Rows by the values of a column, in the order of the first of each."""
    return {
        f"{v:g}" if isinstance(v, float) else str(v): columns[name] == v for v in dict.fromkeys(columns[name].tolist())
    }
