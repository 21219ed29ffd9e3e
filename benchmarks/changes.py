"""Changes within a log: false findings on logs without a change, and power over a grid. Into docs/trust.md.

    python benchmarks/changes.py [--clean 1600] [--changed 960]

The logs are those of the plan `clean` (every friction law, motion and kind of sensor), as they are and with the faults
"warming", "running in" and "zero drift" of the registry at the severities of GRID. `momentum`, one process.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

import swingid as sw
from swingid.errors import SwingidError
from swingid.study.campaign import load_plan
from swingid.study.campaign.trial import experiment_at, head_of
from swingid.study.faults import FAULTS, parse_fault, with_faults
from trust import PAGE, markdown

GRID = {
    "warming": {"2 %": 0.02, "5 %": 0.05, "10 %": 0.1, "20 %": 0.2},
    "running in": {"2 %": 0.02, "5 %": 0.05, "10 %": 0.1, "20 %": 0.2},
    "zero drift": {"0.1 mrad": 1e-4, "0.3 mrad": 3e-4, "1 mrad": 1e-3, "5 mrad": 5e-3},
}
FOUND = {"warming": "friction-changes", "running in": "friction-changes", "zero drift": "zero-drifts"}
DRY = ("Coulomb", "Stribeck", "Stribeck, wide")
NEW = ("friction-changes", "zero-drifts", "parts-disagree", "second-half-not-predicted", "mirrored-parts-differ")


def answers(runs: int, faults: Sequence[str]) -> Iterator[dict[str, Any]]:
    """One row per log: its fault and motion, codes of warnings and notes, whether the interval contains the inertia."""
    plan = load_plan("clean").with_runs(runs)
    for trial in range(runs):
        head = head_of(plan, trial)
        fault = faults[trial % len(faults)]
        if fault.startswith("running in") and head.place["friction"] not in DRY:
            fault = fault.replace("running in", "warming")
        row = {"fault": fault, "motion": head.place["motion"]}
        try:
            experiment = with_faults(experiment_at(plan, head.place["point"]), [parse_fault(fault)])
            log = experiment.log(head.place["seed"])
            result = sw.identify(experiment.read(log), experiment.stated)
        except SwingidError as error:
            yield row | {"refused": error.code}
            continue
        low, high = result.inertia.interval95
        truth = log.metadata["truth"]["inertia"]
        yield row | {
            "warnings": [message.code for message in result.warnings],
            "notes": [message.code for message in result.notes],
            "holds": low <= truth <= high,
            "off": abs(result.inertia.value - truth) / ((high - low) / 2),
        }


def false_findings(rows: list[dict[str, Any]]) -> str:
    """How many logs without a change have each of the findings."""
    given = [row for row in rows if "holds" in row]
    table = [("finding", "warned", "noted", "of logs")]
    for code in NEW:
        warned, noted = (str(sum(code in row[kind] for row in given)) for kind in ("warnings", "notes"))
        table.append((code, warned, noted, str(len(given))))
    return markdown(table)


def power(rows: list[dict[str, Any]]) -> str:
    """Shares of logs in which a change is found, by motion, and of intervals that hold."""
    kinds = {"one tone": ("sine",), "two tones": ("two tones", "direct drive"), "free swing": ("free swing",)}
    table = [("change over the log", "logs", "found", *kinds, "warned of it", "interval holds", "ok, and wrong")]
    for name, grades in GRID.items():
        for grade in grades:
            own = [row for row in rows if row["fault"] == f"{name}: {grade}" and "holds" in row]
            code = FOUND[name]
            found = [code in row["warnings"] + row["notes"] for row in own]
            shares = []
            for ends in kinds.values():
                among = [hit for hit, row in zip(found, own, strict=True) if row["motion"].endswith(ends)]
                shares.append(f"{np.mean(among):.0%}" if among else "–")
            wrong = sum(not row["warnings"] and row["off"] > 1.5 for row in own)
            warned = np.mean([code in row["warnings"] for row in own])
            holds = np.mean([row["holds"] for row in own])
            counts = (f"{np.mean(found):.0%}", *shares, f"{warned:.0%}", f"{holds:.0%}", str(wrong))
            table.append((f"{name}, {grade}", str(len(own)), *counts))
    return markdown(table)


def main() -> None:
    """Make both tables and put them into the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--clean", type=int, default=1600)
    parser.add_argument("--changed", type=int, default=960)
    given = parser.parse_args()
    for name, grades in GRID.items():
        FAULTS[name] = replace(FAULTS[name], grades=grades)
    made = {"false findings": false_findings(list(answers(given.clean, ["none"])))} if given.clean else {}
    every = [f"{name}: {grade}" for name, grades in GRID.items() for grade in grades]
    made["changes"] = power(list(answers(given.changed, every)))
    text = PAGE.read_text(encoding="utf-8")
    for name, table in made.items():
        print(table)
        place = re.compile(rf"(<!-- trust: {name} -->\n).*?(<!-- end -->)", re.DOTALL)
        text = place.sub(lambda found, table=table: f"{found[1]}{table}{found[2]}", text)
    PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
