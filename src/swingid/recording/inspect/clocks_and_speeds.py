"""What moves as a clock, and what as the speed of something else."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from swingid.recording.conventions import SECONDS
from swingid.recording.inspect.candidates import Candidate, Role
from swingid.recording.inspect.likeness import correlation, has_size, slope, smooth, thin
from swingid.recording.inspect.names import ROLE_UNITS, SPEED_UNITS

if TYPE_CHECKING:
    from swingid.numerics.arrays import Array


DERIVATIVE = 0.8
"""Correlation with the slope of another column from which on a column is that column's speed."""

RISING = 0.98
"""Share of rows after which a clock rises."""

SLOWEST, FASTEST = 4.0, 50_000.0
"""Rows per second that rigs log."""


def guess_time(candidates: list[Candidate], found: dict[str, Role]) -> Candidate | None:
    """The clock: a column that rises, best one that is called so; its unit from the header or from the rate."""
    best: tuple[float, Candidate, float] | None = None
    for candidate in candidates:
        steps = np.diff(candidate.values)
        steps = steps[np.isfinite(steps)]
        if not steps.size or candidate.column.constant or (counts_rows(candidate) and candidate.scores["time"] < 2):
            continue
        rising = float(np.mean(steps >= 0))
        score = candidate.scores["time"] + 2.0 * (candidate.unit in ROLE_UNITS["time"])
        if rising < RISING and score < 3:
            continue
        even = float(np.median(np.abs(steps - np.median(steps)))) < 0.2 * abs(float(np.median(steps)))
        score += 2.0 * (rising >= RISING) + even
        if (score >= 3 or even) and (best is None or score > best[0]):
            best = score, candidate, rising
    if best is None:
        return None
    _, candidate, rising = best
    unit = candidate.unit if candidate.unit in ROLE_UNITS["time"] else ""
    steps = np.diff(candidate.values)
    usual = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    why = (
        "rises from row to row"
        if rising == 1
        else f"rises at {rising:.1%} of the rows"
        if rising > 0
        else "by its name"
    )
    if not unit and usual > 0:
        fits = [name for name, factor in SECONDS.items() if SLOWEST <= 1 / (usual * factor) <= FASTEST]
        unit = fits[0] if fits else "s"
        why += f", {1 / (usual * SECONDS[unit]):.4g} rows per second if in {unit}"
    found["time"] = Role("time", candidate.name, unit or "s", why, candidate.scores["time"] >= 2)
    return candidate


def counts_rows(candidate: Candidate) -> bool:
    """Whether a column numbers the rows: it rises by 1 from row to row."""
    if candidate.column.kind != "whole numbers":
        return False
    steps = np.diff(candidate.values)
    return bool(steps.size and np.mean(steps == 1) > RISING)


def clocks_beside(candidates: list[Candidate]) -> dict[str, str]:
    """What other columns are that only rise: clocks by their name, and numbers of the rows."""
    found = {c.name: "numbers the rows" for c in candidates if counts_rows(c)}
    for candidate in candidates:
        steps = np.diff(candidate.values)
        steps = steps[np.isfinite(steps)]
        if steps.size and candidate.scores["time"] >= 2 and np.mean(steps >= 0) >= RISING:
            found.setdefault(candidate.name, "another clock")
    return found


def guess_speeds(moving: list[Candidate], stamps: Array) -> list[tuple[Candidate, str]]:
    """Columns that are the speed of another one: they go with its slope, and are called so or have its size."""
    clock = thin(stamps)
    if len(clock) < 50:
        return []
    slopes = {c.name: slope(thin(c.values), clock) for c in moving}
    level = {c.name: smooth(thin(c.values)) for c in moving}
    result = []
    for speed in moving:
        named = speed.scores["speed"] >= 2 or speed.unit in SPEED_UNITS
        if not named and max(_main(speed)) >= 2:
            continue
        match = [(correlation(level[speed.name], slopes[c.name]), c) for c in moving if c is not speed]
        match = [(r, c) for r, c in match if c.scores["speed"] < 3 and c.unit not in SPEED_UNITS]
        r, of = max(match, key=lambda m: (round(m[0], 2), -m[1].scores["reference"]), default=(0.0, speed))
        if named or (r > DERIVATIVE and has_size(level[speed.name], slopes[of.name])):
            result.append((speed, of.name if r > DERIVATIVE else "what is not logged"))
    return result


def _main(candidate: Candidate) -> list[float]:
    return [candidate.scores[role] for role in ("angle", "wheel", "voltage", "torque", "reference", "current")]
