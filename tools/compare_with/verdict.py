"""From the outcomes of two trees to a verdict: cases equal, differing, crashed; and differences that are intended."""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from compare_with.comparing import Difference, differences

NOISE = 10.0
"""Times that a difference may exceed what rounding did to the same quantity of the same case in the old tree."""

MOST = 0.5
"""Size of a difference beyond which nothing is called rounding. Motor calibration of a log without noise, for one, has
uncertainties that are rounding alone, and differ by 20 %. Inertias and their uncertainties have 1e-9 at most."""

Noise = dict[tuple[str, str], float]

SHOWN = 4
"""Differing paths that are shown of a case."""


@dataclass(frozen=True)
class Intended:
    """A difference that is wanted: patterns (* and ?) of case and path, and the reason."""

    case: str
    path: str
    reason: str


@dataclass
class Verdict:
    """All cases of two trees, compared."""

    cases: int = 0
    equal: list[str] = field(default_factory=list)
    differing: dict[str, list[Difference]] = field(default_factory=dict)
    crashed: dict[str, str] = field(default_factory=dict)
    crashed_before: list[str] = field(default_factory=list)
    intended: list[tuple[str, Difference, Intended]] = field(default_factory=list)
    rounded: dict[str, list[Difference]] = field(default_factory=dict)
    added: dict[str, list[Difference]] = field(default_factory=dict)
    words: dict[str, list[Difference]] = field(default_factory=dict)
    unused: list[Intended] = field(default_factory=list)

    @property
    def failed(self) -> bool:
        """Whether anything differs that is not intended."""
        return bool(self.differing or self.crashed)


def read_intended(path: Path) -> list[Intended]:
    """The intended differences in a TOML file: tables [[intended]] with case, path and reason."""
    if not path.exists():
        return []
    tables = tomllib.loads(path.read_text(encoding="utf-8")).get("intended", [])
    return [Intended(str(one["case"]), str(one["path"]), str(one["reason"])) for one in tables]


def matches(text: str, pattern: str) -> bool:
    """Whether a path fits a pattern in which only * and ? are special, since paths have brackets."""
    return fnmatchcase(text, pattern.replace("[", "[[]"))


def rounding(old: dict[str, Any], first: dict[str, Any]) -> Noise:
    """What rounding does to the old tree's numbers: size of differences by case and path, places in lists as one.

    `first` are its outcomes with kernels just compiled, `old` those with the same kernels from the cache, whose sums
    end in other last digits. Some numbers are a small rest of large ones, and show that in their sixth digit.
    """
    noise: Noise = {}
    for case in old.keys() & first.keys():
        for one in differences(old[case].get("outcome"), first[case].get("outcome")):
            place = case, _kind_of(one.path)
            noise[place] = max(noise.get(place, 0.0), one.size)
    return {place: size for place, size in noise.items() if size < MOST}


def _kind_of(path: str) -> str:
    return re.sub(r"\[\d+\]", "[]", path)


def verdict(old: dict[str, Any], new: dict[str, Any], intended: list[Intended], noise: Noise | None = None) -> Verdict:
    """Compare the outcomes of two trees, by case; with `noise`, what rounding explains is no failure."""
    found, used = Verdict(len(old.keys() | new.keys())), set()
    for case in sorted(old.keys() | new.keys()):
        if case not in old or case not in new:
            found.crashed[case] = f"only the {'old' if case in old else 'new'} tree has it"
            continue
        before, after = old[case], new[case]
        if "crash" in after:
            if "crash" in before:
                found.crashed_before.append(case)
            else:
                found.crashed[case] = after["crash"]
            continue
        if "crash" in before:
            found.differing[case] = [Difference("", "value", before["crash"], "an answer")]
            continue
        failing = []
        for one in differences(before["outcome"], after["outcome"]):
            wanted = next((i for i in intended if fnmatchcase(case, i.case) and matches(one.path, i.path)), None)
            if one.kind in ("added", "words"):
                (found.added if one.kind == "added" else found.words).setdefault(case, []).append(one)
            elif wanted is not None:
                used.add(wanted)
                found.intended.append((case, one, wanted))
            elif one.size <= min(NOISE * (noise or {}).get((case, _kind_of(one.path)), 0.0), MOST):
                found.rounded.setdefault(case, []).append(one)
            else:
                failing.append(one)
        if failing:
            found.differing[case] = failing
        else:
            found.equal.append(case)
    found.unused = [one for one in intended if one not in used]
    return found


def text_of(found: Verdict, *, words: bool = False, everything: bool = False) -> str:
    """The verdict as a table to read."""
    lines: list[str] = []
    for case, failing in found.differing.items():
        lines += [f"DIFFERS  {case}", *_rows(failing, len(failing) if everything else SHOWN)]
    lines += [f"CRASHED  {case}: {what}" for case, what in found.crashed.items()]
    if found.intended:
        lines += ["", "intended differences:"]
        for case, one, wanted in found.intended if everything else found.intended[:40]:
            lines.append(f"  {case} {one.path}: {short(one.old)} -> {short(one.new)}   ({wanted.reason})")
    lines += [f"intended.toml: no difference fits {one.case} {one.path}" for one in found.unused]
    if found.rounded:
        ones = [one for case in found.rounded.values() for one in case]
        largest = max(one.size for one in ones)
        lines += ["", f"rounding: {len(ones)} paths in {len(found.rounded)} cases, at most {largest:.1e} relative"]
        lines.append("  (no more than 10 times what rounding does there in the old tree; --strict fails for them)")
        if everything:
            for case, some in found.rounded.items():
                lines += [f"  {case}", *_rows(some, len(some))]
    if found.added:
        lines += ["", "added in the new tree (no failure):", *_added(found.added)]
    if words:
        reworded = sum(len(ones) for ones in found.words.values())
        lines += ["", f"reworded: {reworded} texts in {len(found.words)} cases"]
        if everything:
            for case, ones in found.words.items():
                lines += [f"  {case}", *_rows(ones, len(ones))]
    total = sum(len(failing) for failing in found.differing.values())
    lines += [f"  crashed in both trees: {case}" for case in found.crashed_before]
    crashed = f"crashed {len(found.crashed)}"
    if found.crashed_before:
        crashed += f" (and {len(found.crashed_before)} in both trees)"
    counts = f"cases {found.cases}   equal {len(found.equal)}   differing {len(found.differing)} ({total} paths)"
    lines += ["", f"{counts}   {crashed}   intended {len(found.intended)} paths"]
    return "\n".join(lines).lstrip("\n")


def _rows(ones: list[Difference], shown: int) -> list[str]:
    rows = [f"    {one.path}: {short(one.old)} -> {'missing' if one.kind == 'missing' else short(one.new)}"
            for one in ones[:shown]]  # fmt: skip
    return rows + ([f"    and {len(ones) - shown} more"] if len(ones) > shown else [])


def _added(added: dict[str, list[Difference]]) -> list[str]:
    """Added keys by their names, with how often and one example."""
    counts: dict[str, list[str]] = {}
    for case, ones in added.items():
        for one in ones:
            counts.setdefault(one.path.rpartition(".")[2], []).append(f"{case} {one.path}")
    return [f"  {key}: {len(places)} times, such as {places[0]}" for key, places in counts.items()]


def short(value: Any) -> str:
    """A value in at most 70 characters; numbers with all digits."""
    text = repr(value)
    return text if len(text) <= 70 else f"{text[:67]}..."
