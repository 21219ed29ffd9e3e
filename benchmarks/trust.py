"""What the status of an answer is worth, on simulated faults and on foreign logs. Into docs/trust.md.

    python benchmarks/trust.py simulated [--runs 480] [--out DIR] [--workers N]
    python benchmarks/trust.py foreign [--data DIR]
    python benchmarks/trust.py clean [--runs 10000] [--out DIR] [--workers N]

`simulated` runs (or goes on with, or reads) the campaign `trust` in DIR; `foreign` runs the logs of strangers.py that
are not held out; `clean` runs the campaign `clean`, of logs without a fault. Each replaces its table in the page.
"""

from __future__ import annotations

import argparse
import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

import strangers
from swingid.methods.table import METHODS
from swingid.study.campaign import load_plan, run_campaign, summarise
from swingid.study.campaign.trust import Trust, trust_tables

PAGE = Path(__file__).resolve().parents[1] / "docs" / "trust.md"


def simulated(runs: int, folder: str, workers: int | None) -> str:
    """The tables of the campaign."""
    plan = load_plan("trust").with_runs(runs)
    run_campaign(plan, folder, workers=workers)
    return "\n".join(markdown(table) for table in trust_tables(plan, summarise(plan, folder).columns))


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


def foreign(data: Path) -> str:
    """The totals of the suite of foreign logs: wrong is an interval that does not meet the evidence."""
    rows = []
    for entry in strangers.entries():
        if not entry["held_out"]:
            found = strangers.answers(
                entry, strangers.fetched(entry, data), [m for m in METHODS if m != "backstepping"]
            )
            rows += list(found)
    table = [("method", "logs", "ok", "of these wrong", "warned", "refused", "crashed")]
    for method in dict.fromkeys(row["method"] for row in rows):
        own = [row for row in rows if row["method"] == method]
        ok = [row for row in own if row["status"] == "ok"]
        wrong = sum(row["verdict"] == "misses" for row in ok)
        count = [sum(row["status"] == status for row in own) for status in ("warning", "refused", "crash")]
        table.append((method, *Trust(len(own), len(ok), wrong, *count).cells()))
    return markdown(table)


def markdown(table: Sequence[tuple[str, ...]]) -> str:
    """A table of the page, its first row the heading."""
    head, *rows = (f"| {' | '.join(row)} |" for row in table)
    return "\n".join([head, "|" + "---|" * len(table[0]), *rows, ""])


def main() -> None:
    """Make one of the tables and put it into the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("which", choices=("simulated", "foreign", "clean"))
    parser.add_argument("--runs", type=int)
    parser.add_argument("--out")
    parser.add_argument("--workers", type=int)
    parser.add_argument("--data", type=Path, default=strangers.CACHE)
    given = parser.parse_args()
    if given.which == "foreign":
        made = foreign(given.data)
    else:
        campaign, runs = {"simulated": (simulated, 480), "clean": (clean, 10_000)}[given.which]
        made = campaign(given.runs or runs, given.out or f"campaign-trust-{given.which}", given.workers)
    print(made)
    pattern = re.compile(rf"(<!-- trust: {given.which} -->\n).*?(<!-- end -->)", re.DOTALL)
    text = PAGE.read_text(encoding="utf-8")
    assert pattern.search(text), f"{PAGE} has no place for {given.which}"
    PAGE.write_text(pattern.sub(lambda found: f"{found[1]}{made}{found[2]}", text), encoding="utf-8")


if __name__ == "__main__":
    main()
