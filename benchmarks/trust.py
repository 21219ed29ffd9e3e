"""What the status of an answer is worth, on simulated faults and on foreign logs. Into docs/trust.md.

    python benchmarks/trust.py simulated [--runs 480] [--out DIR] [--workers N]
    python benchmarks/trust.py foreign [--data DIR] [--out FILE]
    python benchmarks/trust.py clean [--runs 10000] [--out DIR] [--workers N]

`simulated` runs (or goes on with, or reads) the campaign `trust` in DIR; `foreign` runs (or goes on with, or reads, in
the JSON of FILE) all logs of strangers.py by four methods; `clean` runs the campaign `clean`, of logs without a fault.
Each replaces its tables in the page.
"""

from __future__ import annotations

import argparse
import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

import strangers
import strangers_tables as tables
from swingid.methods.table import METHODS
from swingid.study.campaign import load_plan, run_campaign, summarise
from swingid.study.campaign.trust import trust_tables

PAGE = Path(__file__).resolve().parents[1] / "docs" / "trust.md"


def simulated(runs: int, folder: str, workers: int | None) -> str:
    """The tables of the campaign."""
    plan = load_plan("trust").with_runs(runs)
    run_campaign(plan, folder, workers=workers)
    return "\n".join(markdown(table.texts()) for table in trust_tables(plan, summarise(plan, folder).columns))


def clean(runs: int, folder: str, workers: int | None) -> str:
    """False alarms and coverage of the 95 % intervals by the levels of each factor, and the codes of the alarms."""
    plan = load_plan("clean").with_runs(runs)
    run_campaign(plan, folder, workers=workers)
    columns = summarise(plan, folder).columns
    inside = (columns["low"] <= columns["truth"]) & (columns["truth"] <= columns["high"])
    table = [("logs", "number", "warned", "refused", "answers whose interval holds", "warnings")]
    groups = {"all": np.ones(len(inside), bool)}
    for factor in plan.tables.factors:
        groups |= {str(level): columns[factor] == level for level in dict.fromkeys(columns[factor].tolist())}
    for name, rows in groups.items():
        status, answered = columns["status"][rows], rows & np.isfinite(columns["value"])
        codes = Counter(" ".join(columns["warnings"][rows][status == "warning"]).split())
        shares = [f"{100 * np.mean(status == kind):.2f} %" for kind in ("warning", "refused")]
        held = f"{100 * np.mean(inside[answered]):.1f} %"
        found = ", ".join(f"{code} {count}" for code, count in codes.most_common()) or "–"
        table.append((name, str(rows.sum()), *shares, held, found))
    return markdown(table)


def foreign(data: Path, kept: Path | None) -> dict[str, str]:
    """The tables of the suite of foreign logs, by their places in the page."""
    entries = strangers.entries()
    rows = strangers.outcomes(entries, [name for name in METHODS if name != "backstepping"], data, kept)
    named = {entry["name"]: entry for entry in entries}
    return {
        "foreign": markdown(list(tables.by_kind(rows, named, strangers.HERE / "rigs"))),
        "shares": markdown(list(tables.shares(rows, named))),
        "repeats": markdown(list(tables.repeats(rows, named))),
    }


def markdown(table: Sequence[Sequence[str]]) -> str:
    """A table of the page, its first row the heading."""
    head, *rows = (f"| {' | '.join(row)} |" for row in table)
    return "\n".join([head, "|" + "---|" * len(table[0]), *rows, ""])


def main() -> None:
    """Make the tables and put them into the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("which", choices=("simulated", "foreign", "clean"))
    parser.add_argument("--runs", type=int)
    parser.add_argument("--out")
    parser.add_argument("--workers", type=int)
    parser.add_argument("--data", type=Path, default=strangers.CACHE)
    given = parser.parse_args()
    if given.which == "foreign":
        made = foreign(given.data, Path(given.out) if given.out else None)
    else:
        campaign, runs = {"simulated": (simulated, 480), "clean": (clean, 10_000)}[given.which]
        folder = given.out or f"campaign-trust-{given.which}"
        made = {given.which: campaign(given.runs or runs, folder, given.workers)}
    text = PAGE.read_text(encoding="utf-8")
    for place, table in made.items():
        print(table)
        text, places = re.subn(rf"(<!-- trust: {place} -->\n).*?(<!-- end -->)", rf"\1{table}\2", text, flags=re.DOTALL)
        assert places == 1, f"{PAGE} has {places} places for {place}"
    PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
