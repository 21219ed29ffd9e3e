"""Speed as ratios to references measured in the same run, with a history.

    python benchmarks/speed [FAMILY …] [--record] [--check] [--table] [--alarms]     (make speed)

A family is a file of this folder with a function `cases`. Times are processor times, one thread. --record adds a file
to benchmarks/history, --check ends with 1 where a ratio is worse than the history allows (`history.py`), --table writes
docs/benchmarks.md.
"""

from __future__ import annotations

import argparse
import importlib
import re
import sys
from pathlib import Path

from case import Case, Measured, measured

import history

FAMILIES = ("identify", "start", "ensembles", "large_logs")
PAGE = Path(__file__).resolve().parents[2] / "docs" / "benchmarks.md"
HEAD = ("", "reference", "ratio", "goal", "our time")


def main() -> int:
    """Measure, print, record, compare."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("families", nargs="*", default=FAMILIES, metavar="FAMILY", help=", ".join(FAMILIES))
    for name in ("record", "check", "table", "alarms"):
        parser.add_argument(f"--{name}", action="store_true")
    given = parser.parse_args()
    if unknown := set(given.families) - set(FAMILIES):
        parser.error(f"there is no family {', '.join(sorted(unknown))}; there are {', '.join(FAMILIES)}")
    if given.table and set(given.families) != set(FAMILIES):
        parser.error("--table is for all families, as it writes the whole table")
    if given.alarms:
        above, tried, spread = history.alarms()
        print(f"{above} of {tried} ratios of the history above the limit; from run to run {100 * spread:.1f} %")
        return 0
    results, worse = [], []
    for family in given.families:
        before = len(results)
        for case in importlib.import_module(family).cases():
            result = measured(case)
            results.append(result)
            print(line(result), flush=True)
            if given.check and (text := regression(case, result)):
                worse.append(text)
        if len(results) == before:
            print(f"{family}: nothing measured, for its reference needs a program that is not here (see its file)")
    if given.record:
        print(f"recorded in {history.record(results)}")
    if given.table:
        write_table(results)
    for text in worse:
        print(text, file=sys.stderr)
    return 1 if worse else 0


def regression(case: Case, result: Measured) -> str | None:
    """One sentence where the case is worse than the history allows, measured twice."""
    largest = history.limit(case.name, history.records(), history.processor())
    if largest is None or result.ratio <= largest:
        return None
    again = measured(case)
    print(f"{line(again)}  (again)", flush=True)
    if again.ratio <= largest:
        return None
    allowed = f"more than the {largest:.3g} that benchmarks/history allows"
    return f"{case.name}: {again.ratio:.3g} times the reference, {allowed}"


def line(result: Measured) -> str:
    """A row for the terminal."""
    asked = "" if result.asked is None else f"  (goal {result.asked:g})"
    times = f"{in_units(result.ours)} against {in_units(result.reference)}"
    return f"{result.name:34} {result.ratio:9.3g} ± {100 * result.spread:.0f} %{asked:14}  {times}"


def in_units(seconds: float) -> str:
    """A time with three digits."""
    for size, unit in ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs")):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds / 1e-9:.3g} ns"


def write_table(results: list[Measured]) -> None:
    """Into docs/benchmarks.md."""
    rows = ["| " + " | ".join(HEAD) + " |", "|" + "---|" * len(HEAD)]
    for result in results:
        asked = "–" if result.asked is None else f"≤ {result.asked:g}"
        cells = (result.name, result.reference_is, f"{result.ratio:.2g}", asked, in_units(result.ours))
        rows.append("| " + " | ".join(cells) + " |")
    text = PAGE.read_text(encoding="utf-8")
    pattern = re.compile(r"(<!-- speed: ratios -->\n\n).*?(\n\n<!-- end -->)", re.DOTALL)
    if not pattern.search(text):
        raise SystemExit("docs/benchmarks.md has no place for the ratios")
    PAGE.write_text(pattern.sub(lambda match: match[1] + "\n".join(rows) + match[2], text), encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
