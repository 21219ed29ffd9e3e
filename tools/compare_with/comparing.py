"""Two outcomes of a case side by side: what is equal, changed, missing, added, or only worded differently.

Numbers are equal to `RELATIVE` of the larger one, or to `FLOOR` of the scale of the quantity. The floor is for what is
essentially zero: a sum whose terms cancel keeps a rest of rounding, which another order of summation changes by 100 %.
The scale is therefore that of numbers of one kind: the largest in the same list of numbers, in the same column of a
list of tables (all standard uncertainties of a budget), or of one parameter (its value, uncertainty and interval).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any, Literal

RELATIVE = 1e-9
FLOOR = 1e-12

WORDS = {
    "message": "sentences of warnings, notes, errors and verdicts; their codes are compared",
    "stdout": "text for people; what it says is in the JSON",
    "stderr": "text for people; what it says is in the JSON and the exit code",
    "line": "sentence of the verdict of inspect; its status is compared",
    "advice": "sentence of the verdict of inspect",
    "title": "heading of a check of inspect; its code is compared",
    "evidence": "sentence of a check of inspect; its values are compared",
    "remedy": "sentence of a check of inspect",
    "why": "reason for a guessed role or for a method's share of a log",
    "log_table": "text of a [log] table with comments",
    "about": "sentence about a data set or a plan",
    "notes[]": "notes of design, rehearse and others that are plain sentences",
}
"""Keys whose texts may be reworded; with [] behind: texts in a list of that name."""

EXCLUDED = {
    "*.versions": "versions of swingid and of what it stands on",
    "*.comparison.seconds": "time that a method took",
    "*.seconds_per_run": "time that a method took",
    "*.table.seconds*": "time that a method took, in the table of a campaign",
    "*.table.*seconds": "time that a method took, in the table of a campaign",
}
"""Patterns of paths that are not compared, and why."""

IDENTITIES = (("source", "parameter"), ("code",), ("name",), ("log", "method"), ("method",), ("log",))
"""Keys that name an entry of a list, the first that all entries have; without any, its place does."""

PARAMETER = {"value", "standard_uncertainty", "interval95"}

Kind = Literal["value", "missing", "added", "words"]


@dataclass(frozen=True)
class Difference:
    """What differs at a path; kind "added": only the new tree has it.

    size: of two numbers, their difference in shares of the larger one or of their scale; of all else infinite.
    """

    path: str
    kind: Kind
    old: Any = None
    new: Any = None
    size: float = math.inf


def differences(old: Any, new: Any) -> list[Difference]:
    """All differences between two outcomes, words and added keys among them."""
    return list(_compare(old, new, "", 0.0))


def excluded(path: str) -> bool:
    """Whether the path is one of `EXCLUDED`."""
    return any(fnmatchcase(path, pattern) for pattern in EXCLUDED)


def _compare(old: Any, new: Any, path: str, scale: float, words: bool = False) -> Iterator[Difference]:
    if excluded(path):
        return
    if isinstance(old, dict) and isinstance(new, dict):
        yield from _tables(old, new, path, {})
    elif isinstance(old, list) and isinstance(new, list):
        yield from _lists(old, new, path, scale)
    elif words and isinstance(old, str) and isinstance(new, str):
        if old != new:
            yield Difference(path, "words", old, new)
    elif not same(old, new, scale):
        yield Difference(path, "value", old, new, _size(old, new, scale))


def same(old: Any, new: Any, scale: float = 0.0) -> bool:
    """Whether two values are equal; numbers to rounding, NaN to NaN, null to null; true is not 1."""
    if isinstance(old, bool) or isinstance(new, bool) or not (_is_number(old) and _is_number(new)):
        return type(old) is type(new) and old == new
    if old == new or (math.isnan(old) and math.isnan(new)):
        return True
    if not (math.isfinite(old) and math.isfinite(new)):
        return False
    return abs(old - new) <= max(RELATIVE * max(abs(old), abs(new)), FLOOR * scale)


def _tables(old: dict[str, Any], new: dict[str, Any], path: str, scales: dict[str, float]) -> Iterator[Difference]:
    """Two tables key by key; `scales`: of the columns of the list of tables that these two are in."""
    own = _scale_of([old, new]) if old.keys() >= {"value", "standard_uncertainty"} else 0.0
    for key in old.keys() | new.keys():
        at = f"{path}.{key}"
        if excluded(at):
            continue
        if key not in new:
            yield Difference(at, "missing", old[key])
        elif key not in old:
            yield Difference(at, "added", None, new[key])
        else:
            scale = max(own if key in PARAMETER else 0.0, scales.get(key, 0.0))
            yield from _compare(old[key], new[key], at, scale, words=key in WORDS)


def _lists(old: list[Any], new: list[Any], path: str, scale: float) -> Iterator[Difference]:
    tables = bool(old or new) and all(isinstance(one, dict) for one in (*old, *new))
    if tables:
        yield from _lists_of_tables(old, new, path)
        return
    words = f"{path.rpartition('.')[2]}[]" in WORDS
    if len(old) != len(new):
        yield Difference(f"{path}.length", "words" if words else "value", len(old), len(new))
        return
    scale = max(scale, _scale_of([old, new]))
    for k, (one, other) in enumerate(zip(old, new, strict=True)):
        yield from _compare(one, other, f"{path}[{k}]", scale, words)


def _lists_of_tables(old: list[Any], new: list[Any], path: str) -> Iterator[Difference]:
    """Entries paired by what names them; an entry that only one tree has is a difference, also where it is new."""
    before, after = _named(old, (*old, *new)), _named(new, (*old, *new))
    keys = {key for one in (*old, *new) for key in one}
    scales = {key: _scale_of([one.get(key) for one in (*old, *new)]) for key in keys}
    for name in before.keys() | after.keys():
        at = f"{path}[{name}]"
        if name not in after:
            yield Difference(at, "missing", before[name])
        elif name not in before:
            yield Difference(at, "value", None, after[name])
        elif not excluded(at):
            yield from _tables(before[name], after[name], at, scales)
    common = [name for name in before if name in after]
    if common != [name for name in after if name in before]:
        yield Difference(f"{path}.order", "value", common, [name for name in after if name in before])


def _named(entries: list[dict[str, Any]], both: tuple[dict[str, Any], ...]) -> dict[str, dict[str, Any]]:
    """The entries by their names; a name that comes again has its number behind it."""
    keys = next((keys for keys in IDENTITIES if all(isinstance(one.get(k), str) for one in both for k in keys)), ())
    found: dict[str, dict[str, Any]] = {}
    for k, entry in enumerate(entries):
        name = "/".join(entry[key] for key in keys) if keys else str(k)
        count, own = 1, name
        while own in found:
            count += 1
            own = f"{name} #{count}"
        found[own] = entry
    return found


def _scale_of(value: Any) -> float:
    """The largest finite number in lists (and in one table) of numbers."""
    if isinstance(value, dict):
        return max((_scale_of(item) for key, item in value.items() if key in PARAMETER), default=0.0)
    if isinstance(value, list):
        return max((_scale_of(item) for item in value), default=0.0)
    return abs(value) if _is_number(value) and math.isfinite(value) else 0.0


def _size(old: Any, new: Any, scale: float) -> float:
    if not (_is_number(old) and _is_number(new) and math.isfinite(old) and math.isfinite(new)):
        return math.inf
    return abs(old - new) / max(abs(old), abs(new), scale)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
