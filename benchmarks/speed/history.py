"""Records of earlier runs in benchmarks/history, one JSON file each, and the largest ratio that is no regression.

The logarithm of a ratio scatters from run to run, by the machine's other work and by where code and data happen to lie
in memory. Its standard deviation is estimated from the latest `LATEST` records of the same processor and mixed with
`TYPICAL` as if that were known from `WEIGHT` further records. A new ratio is called worse where it is above the upper
prediction limit of a normal variable (Student's t, one side, `ALARM` in a case of a run) in two measurements, one after
the other. `python benchmarks/speed --alarms` counts the records that would have been called worse than those before.

Only the latest records count that differ from the last one by less than the factor `CHANGE`: what was recorded before
a gain would hide that it is lost again.

Where fewer than `FEWEST` are left the limit is `ELSEWHERE` times their median, and on a processor without any that of
all records: the ratios of the ensembles to scalar C differed by up to two between processors of 256 and 512 bits.
"""

from __future__ import annotations

import json
import math
import platform
import re
import statistics
import subprocess
from dataclasses import asdict
from datetime import UTC, datetime
from itertools import takewhile
from pathlib import Path
from typing import Any

from case import Measured
from scipy import stats

FOLDER = Path(__file__).resolve().parents[1] / "history"
LATEST, FEWEST = 8, 3
TYPICAL, WEIGHT = 0.05, 4
"""Standard deviation of the logarithm of a median ratio from run to run (`--alarms` prints it), and its weight."""
ALARM = 1e-3
CHANGE, ELSEWHERE = 1.5, 2.0


def processor() -> str:
    """The processor's name, family and model, and the width of its vectors, which change ratios most."""
    info = Path("/proc/cpuinfo")
    if not info.is_file():
        return platform.processor() or platform.machine()
    text = info.read_text(encoding="utf-8")
    found = {key: re.search(rf"^{key}\s*:\s*(.*)$", text, re.M) for key in ("model name", "cpu family", "model")}
    name, family, model = (match[1] if match else "?" for match in found.values())
    bits = 512 if " avx512f" in text else 256 if " avx2" in text else 128
    return f"{name} (family {family}, model {model}), {bits} bit"


def records() -> list[dict[str, Any]]:
    """All records, the oldest first; SystemExit names a file that is none."""
    found = []
    for path in FOLDER.glob("*.json"):
        try:
            one = json.loads(path.read_text(encoding="utf-8"))
            found.append({key: one[key] for key in ("time", "processor", "ratios")})
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise SystemExit(f"{path} is no record of speed ({error!r}); restore it, or delete it") from None
    return sorted(found, key=lambda record: record["time"])


def record(results: list[Measured]) -> Path:
    """Write a record of this run."""
    now = datetime.now(UTC)
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], cwd=FOLDER.parent, capture_output=True, text=True, check=False
    ).stdout.strip()
    path = FOLDER / f"{now:%Y-%m-%d-%H%M%S}.json"
    content = {
        "time": now.isoformat(timespec="seconds"),
        "commit": commit,
        "processor": processor(),
        "python": platform.python_version(),
        "ratios": {
            result.name: {key: value for key, value in asdict(result).items() if key not in ("name", "asked")}
            for result in results
        },
    }
    FOLDER.mkdir(exist_ok=True)
    path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    return path


def limit(name: str, before: list[dict[str, Any]], machine: str) -> float | None:
    """Largest ratio of a case that is no regression on `machine`; None where no record has the case."""
    having = [record for record in before if name in record["ratios"]]
    if not having:
        return None
    here = [record for record in having if record["processor"] == machine]
    same = _since_change([math.log(record["ratios"][name]["ratio"]) for record in here][-LATEST:])
    if len(same) < FEWEST:
        known = same or [math.log(record["ratios"][name]["ratio"]) for record in having]
        return ELSEWHERE * math.exp(statistics.median(known))
    freedom = WEIGHT + len(same) - 1
    variance = (WEIGHT * TYPICAL**2 + (len(same) - 1) * statistics.variance(same)) / freedom
    beyond = float(stats.t.ppf(1.0 - ALARM, freedom)) * math.sqrt(variance * (1.0 + 1.0 / len(same)))
    return math.exp(statistics.fmean(same) + beyond)


def _since_change(logs: list[float]) -> list[float]:
    """The latest of some logarithms, back to one that differs from the last by the factor `CHANGE` or more."""
    return list(takewhile(lambda value: abs(value - logs[-1]) < math.log(CHANGE), reversed(logs)))


def alarms() -> tuple[int, int, float]:
    """Ratios of the history above the limit of the records before them, all that have one, their typical spread."""
    past = records()
    above, tried, gaps = 0, 0, []
    for place, now in enumerate(past):
        for name, entry in now["ratios"].items():
            same = [r for r in past[:place] if name in r["ratios"] and r["processor"] == now["processor"]]
            if len(same) >= FEWEST:
                tried += 1
                above += entry["ratio"] > (limit(name, past[:place], now["processor"]) or math.inf)
            if same:
                gaps.append(math.log(entry["ratio"] / same[-1]["ratios"][name]["ratio"]))
    spread = 1.4826 * statistics.median(map(abs, gaps)) / math.sqrt(2.0) if gaps else math.nan
    return above, tried, spread
