"""Real logs of foreign rigs: the answer of every method beside independent evidence of the inertia.

    python benchmarks/strangers.py [NAME...] [--methods momentum,energy] [--held-out | --all] [--data DIR] [--json FILE]

The logs are listed in `strangers/logs.d/*.toml`, each with its address, checksum, rig file and evidence (`how` says
what from; of the parameter `quantity`, by default the one that the result is about). They are no part of the project:
a file is taken from --data (default $SWINGID_STRANGERS, else a folder of the user's cache), as SHA256.ENDING, and
downloaded there where it is missing. `held_out` logs were set aside before anything was tuned and are run only with
--held-out or --all. `series` 2 came later; its evidence was written before its first run. Logs with one `body`, by
default those of one rig file with one evidence, are repeats. An `unusable` log lacks what its rig file names, which
swingid does not know. `trust.py foreign` makes tables of all.

A row: value and 95 % interval, evidence, status with the codes of its warnings, and a verdict: "meets" where interval
and evidence overlap, "misses" with the distance between them in half-widths of the interval, "refused", "crash".
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import os
import tomllib
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import swingid as sw
from swingid.errors import SwingidError
from swingid.methods.table import METHODS

HERE = Path(__file__).parent / "strangers"
CACHE = Path(os.environ.get("SWINGID_STRANGERS") or Path.home() / ".cache" / "swingid" / "strangers")
NEAR = 0.01
"""Relative distance of a value from the evidence that counts as near."""


def entries() -> list[dict[str, Any]]:
    """All logs of the suite, by name."""
    found = [log for path in sorted((HERE / "logs.d").glob("*.toml")) for log in tomllib.loads(path.read_text())["log"]]
    names = [log["name"] for log in found]
    assert len(set(names)) == len(names), "two logs have one name"
    return found


def fetched(entry: dict[str, Any], folder: Path) -> Path:
    """The file of a log, downloaded where it is missing. Raises OSError where that fails or the checksum is another."""
    path = folder / f"{entry['sha256']}{Path(entry['url']).suffix}"
    if not path.exists():
        with urllib.request.urlopen(entry["url"], timeout=60) as answer:
            content = answer.read()
        if hashlib.sha256(content).hexdigest() != entry["sha256"]:
            raise OSError(f"{entry['url']} is another file than that of the list")
        folder.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    return path


def answers(entry: dict[str, Any], path: Path, methods: list[str]) -> Iterator[dict[str, Any]]:
    """The answer of each method to one log, as plain data."""
    try:
        rig = sw.Rig.load(HERE / "rigs" / entry["rig"])
        log = sw.Recording.load(path, rig)
        log = log.segment(*entry["part"]) if "part" in entry else log
    except SwingidError as error:
        yield {
            "method": "reading",
            "status": "refused",
            "codes": [error.code],
            "verdict": "refused",
            "text": str(error),
        }
        return
    for method in methods:
        row: dict[str, Any] = {"method": method}
        try:
            result = sw.identify(log, rig, method)
        except SwingidError as error:
            row |= {"status": "refused", "codes": [error.code], "verdict": "refused", "text": str(error)}
        except Exception as error:  # a crash is one of the results
            row |= {"status": "crash", "codes": [type(error).__name__], "verdict": "crash", "text": str(error)[:200]}
        else:
            row |= {"status": result.status, "codes": [message.code for message in result.warnings]}
            row |= found(result, entry)
        yield row


def found(result: sw.Result, entry: dict[str, Any]) -> dict[str, Any]:
    """Value, interval and verdict of the parameter that the evidence is of, and what other logs do not share of it."""
    name = entry.get("quantity", result.leading)
    if name not in result.parameters:
        return {"verdict": "another quantity", "text": f"no {name} among {', '.join(result.parameters)}"}
    one = result.parameters[name]
    row = {"value": one.value, "interval": one.interval95} | contributions(result, name)
    return row | verdict(one.value, one.interval95, entry["evidence"])


def contributions(result: sw.Result, name: str) -> dict[str, Any]:
    """What a parameter has of its own, as a standard uncertainty, and what of constants that logs share, signed."""
    own, shared = 0.0, dict[str, float]()
    for entry in result.budget:
        if entry.parameter == name and entry.shared_id is None:
            own = math.hypot(own, entry.standard_uncertainty)
        elif entry.parameter == name:
            shared[entry.shared_id] = math.copysign(entry.standard_uncertainty, entry.sensitivity or 1.0)
    return {"own": own, "shared": shared}


def verdict(value: float, interval: tuple[float, float] | None, evidence: list[float]) -> dict[str, Any]:
    """Whether interval and evidence overlap, by how many half-widths they miss, and how far the value is off."""
    low, high = evidence
    off = max(low - value, value - high, 0.0) / ((low + high) / 2)
    if interval is None:
        return {"verdict": "no interval", "off": off}
    apart = max(low - interval[1], interval[0] - high, 0.0)
    half = (interval[1] - interval[0]) / 2
    return {"verdict": "misses" if apart > 0 else "meets", "by": apart / half if half > 0 else 0.0, "off": off}


def outcomes(
    chosen: list[dict[str, Any]], methods: list[str], data: Path, kept: Path | None = None
) -> list[dict[str, Any]]:
    """The answers to these logs, printed one by one; logs of which the file `kept` has answers are taken from there."""
    rows: list[dict[str, Any]] = json.loads(kept.read_text()) if kept is not None and kept.exists() else []
    done = {row["log"] for row in rows}
    for entry in chosen:
        if entry["name"] in done:
            continue
        try:
            path = fetched(entry, data)
        except OSError as error:
            print(f"{entry['name']:28s} not available: {error}")
            continue
        for row in answers(entry, path, methods):
            rows.append({"log": entry["name"]} | row)
            print(line(entry, row), flush=True)
        if kept is not None:
            kept.write_text(json.dumps(rows, indent=1))
    return [row for row in rows if row["log"] in {entry["name"] for entry in chosen}]


def line(entry: dict[str, Any], row: dict[str, Any]) -> str:
    """One row of the printed table."""
    head = f"{entry['name']:28s} {row['method']:15s}"
    codes = " ".join(row["codes"])
    if "value" not in row:
        return f"{head} {row['verdict']}: {codes}"
    low, high = row["interval"] or (float("nan"),) * 2
    found = f"{row['value']:.5g} [{low:.5g}, {high:.5g}]"
    beside = "[{:.5g}, {:.5g}]".format(*entry["evidence"])
    by = f" by {row['by']:.1f}" if row["verdict"] == "misses" else ""
    return f"{head} {found:38s} {beside:22s} {row['status']:8s} {row['verdict']}{by}  {codes}"


def totals(rows: list[dict[str, Any]]) -> str:
    """Counts over all logs, one line per method."""
    lines = []
    for method in dict.fromkeys(row["method"] for row in rows):
        own = [row for row in rows if row["method"] == method]
        ok = [row for row in own if row["status"] == "ok"]
        near = [row for row in own if row.get("off", 1.0) <= NEAR]
        warned = [row for row in own if row["status"] == "warning"]
        lines.append(
            f"{method:15s} {len(own)} logs; "
            f"ok {len(ok)}, of which {sum(row['verdict'] == 'meets' for row in ok)} meet; "
            f"warned {len(warned)}, of which {sum(row['verdict'] == 'meets' for row in warned)} meet; "
            f"refused {sum(row['status'] == 'refused' for row in own)}; "
            f"crashed {sum(row['status'] == 'crash' for row in own)}; within {100 * NEAR:g} % of the evidence "
            f"{len(near)}, of which {sum(row['status'] == 'ok' for row in near)} ok"
        )
    return "\n".join(lines)


def main() -> None:
    """Run the suite and print its table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="logs whose name contains one of these; all by default")
    parser.add_argument("--methods", default="momentum,energy,equation-error,output-error")
    parser.add_argument("--held-out", action="store_true", help="the logs that were set aside, and no others")
    parser.add_argument("--all", action="store_true", help="those, too")
    parser.add_argument("--data", type=Path, default=CACHE)
    parser.add_argument("--json", type=Path, help="keep the answers there, and take those that it has")
    given = parser.parse_args()
    methods = [name for name in given.methods.split(",") if name in METHODS]
    chosen = [
        entry
        for entry in entries()
        if (not given.names or any(name in entry["name"] for name in given.names))
        and (given.all or entry["held_out"] == given.held_out)
    ]
    print(totals(outcomes(chosen, methods, given.data, given.json)))


if __name__ == "__main__":
    main()
