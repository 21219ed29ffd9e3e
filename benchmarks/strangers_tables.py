"""Tables of the suite of foreign logs (strangers.py), of its answers as plain data; trust.py puts them into a page."""

from __future__ import annotations

import math
import tomllib
from collections import defaultdict
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binomtest, chi2

Rows = list[dict[str, Any]]
Entries = dict[str, dict[str, Any]]

KINDS = (
    "wheel on a pendulum",
    "free pendulum",
    "wire, strings, spring",
    "torque on the axis",
    "motor on the axis",
    "flywheel",
    "gyroscope",
    "carriage",
)
"""As docs/which-rig.md has them."""

UNUSABLE = "unusable log"
"""What `unusable` of an entry says: the log lacks what its rig file names; the right answer is a refusal."""

PARTS = {
    "first series, open": {(1, False)},
    "first series, held out": {(1, True)},
    "second series, open": {(2, False)},
    "second series, held out": {(2, True)},
    "second series, all": {(2, False), (2, True)},
}
"""Series and halves of the suite. The second one was run once before anybody looked at its answers."""

FEWEST = 3
"""Answers of one body that make a spread; two have a single difference."""


def kind(path: Path) -> str:
    """One of KINDS, of a rig file."""
    rig = tomllib.loads(path.read_text(encoding="utf-8"))
    axis, drive = rig.get("axis", {}), rig["drive"]["kind"]
    if axis.get("kind") == "linear":
        return "carriage"
    if drive != "none":
        return {
            "reaction-wheel": "wheel on a pendulum",
            "motor": "motor on the axis",
            "direct": "torque on the axis",
        }[drive]
    sprung = any(name in axis for name in ("stiffness", "bifilar", "trifilar", "suspension"))
    if not sprung and axis.get("gravity_torque", 0) == 0 and "mass" not in axis:
        return "flywheel"
    if "angle_speed" in rig["log"]:
        return "gyroscope"
    return "wire, strings, spring" if sprung else "free pendulum"


def by_kind(rows: Rows, entries: Entries, rigs: Path) -> Iterator[tuple[str, ...]]:
    """Counts for each kind of rig and method: wrong is an "ok" answer whose interval does not meet the evidence."""
    yield ("rig", "method", "logs", "ok", "of these wrong", "warned", "of these wrong", "refused", "crashed")
    own = defaultdict(list)
    for row in rows:
        entry = entries[row["log"]]
        own[UNUSABLE if "unusable" in entry else kind(rigs / entry["rig"]), row["method"]].append(row)
    methods = list(dict.fromkeys(row["method"] for row in rows))
    for name in (*KINDS, UNUSABLE):
        for method in methods:
            if found := own[name, method]:
                yield (name, method, str(len(found)), *_counts(found))


def _counts(rows: Rows) -> Iterator[str]:
    for status in ("ok", "warning"):
        with_it = [row for row in rows if row["status"] == status]
        yield _count(len(with_it))
        yield _count(sum(row["verdict"] == "misses" for row in with_it))
    for status in ("refused", "crash"):
        yield _count(sum(row["status"] == status for row in rows))


def _count(number: int) -> str:
    return str(number) if number else "–"


def shares(rows: Rows, entries: Entries) -> Iterator[tuple[str, ...]]:
    """Of the "ok" answers to usable logs, the share that meets the evidence; its interval by Clopper and Pearson."""
    yield ("logs", "method", "answers", "ok", "of these hold", "share that holds", "95 % interval", "off by, worst")
    for label, halves in PARTS.items():
        names = {n for n, e in entries.items() if (e.get("series", 1), e["held_out"]) in halves and "unusable" not in e}
        of = [row for row in rows if row["log"] in names and row["method"] != "reading"]
        for method in dict.fromkeys(row["method"] for row in of):
            found = [row for row in of if row["method"] == method]
            yield (label, method, str(len(found)), *_share(row for row in found if row["status"] == "ok"))


def _share(rows: Iterable[dict[str, Any]]) -> tuple[str, ...]:
    judged = [row for row in rows if row["verdict"] in ("meets", "misses")]
    if not judged:
        return ("–",) * 5
    held = sum(row["verdict"] == "meets" for row in judged)
    low, high = interval(held, len(judged))
    worst = max(row.get("by", 0.0) for row in judged)
    return (
        str(len(judged)),
        str(held),
        f"{100 * held / len(judged):.0f} %",
        f"{100 * low:.0f} to {100 * high:.0f} %",
        f"{worst:.1f} half-widths" if worst else "–",
    )


def interval(hits: int, of: int) -> tuple[float, float]:
    """The 95 % interval of a share by Clopper and Pearson."""
    found = binomtest(hits, of).proportion_ci(0.95, method="exact")
    return float(found.low), float(found.high)


def repeats(rows: Rows, entries: Entries) -> Iterator[tuple[str, ...]]:
    """The spread of "ok" answers of one body against their budgets, by body and method.

    chi-squared is that of the differences from the generalised mean, with the covariance of the answers: what each has
    of its own, and what constants of the rig file (`shared_id`) do to all, which cancels as far as they do it alike.
    """
    yield ("body", "method", "logs", "mean", "spread", "median u", "χ²/ν", "95 % range", "")
    groups = defaultdict(list)
    for row in rows:
        entry = entries[row["log"]]
        if row["status"] == "ok" and 0 < row.get("own", 0.0) < math.inf and "unusable" not in entry:
            groups[body(entry), row["method"]].append(row)
    for (name, method), own in groups.items():
        if len(own) < FEWEST:
            continue
        values, covariance = np.array([row["value"] for row in own]), _covariance(own)
        mean, ratio, low, high = spread(values, covariance)
        yield (
            name,
            method,
            str(len(own)),
            f"{mean:.4g}",
            f"{100 * np.std(values, ddof=1) / mean:.2g} %",
            f"{100 * np.median([row['own'] for row in own]) / mean:.2g} %",
            f"{ratio:.2g}",
            f"{low:.2g} to {high:.2g}",
            "above" if ratio > high else "below" if ratio < low else "within",
        )


def _covariance(rows: Rows) -> np.ndarray:
    sources = dict.fromkeys(name for row in rows for name in row.get("shared", {}))
    shared = np.array([[row.get("shared", {}).get(name, 0.0) for name in sources] for row in rows])
    own = np.diag([row["own"] ** 2 for row in rows])
    return own + (shared @ shared.T if sources else 0.0)


def body(entry: dict[str, Any]) -> str:
    """Name of what was measured: logs of it are repeats."""
    low, high = entry["evidence"]
    return str(entry.get("body") or f"{Path(entry['rig']).stem} [{low:g}, {high:g}]")


def spread(values: np.ndarray, covariance: np.ndarray) -> tuple[float, float, float, float]:
    """Generalised mean, chi-squared of the differences per degree of freedom, and the 95 % range of the latter."""
    weights = np.linalg.solve(covariance, np.ones(len(values)))
    mean = float(weights @ values / np.sum(weights))
    off = values - mean
    freedom = len(values) - 1
    low, high = chi2.ppf([0.025, 0.975], freedom) / freedom
    return mean, float(off @ np.linalg.solve(covariance, off) / freedom), float(low), float(high)
