"""Which column is likely which channel: by its name, its unit, and by how the columns move with each other.

A guess, to be confirmed by the person who knows the rig; each guess says what it rests on.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from swingid.recording.inspect.likeness import correlation, has_size, passes, roughness, slope, smooth, thin
from swingid.recording.inspect.names import ROLE_UNITS, SPEED_UNITS, name_scores, unit_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from swingid.recording.inspect.columns import Column

    Floats = NDArray[np.float64]

DERIVATIVE = 0.8
"""Correlation with the slope of another column from which on a column is that column's speed."""

ALIKE = 0.98
"""Correlation of two positions from which on they are one motion: a measured one and its reference."""

FEWEST = 20
"""Rows from which on a motion can be seen."""

POSITION = 0.02
"""Roughness below which a column moves as a position does."""

RISING = 0.98
"""Share of rows after which a clock rises."""

NO_NAME = re.compile(r"(column|col|ch|channel|data|signal|var|x|y)?[ _.:(,)]*\d*[ _.:(,)\d]*", re.IGNORECASE)
"""Names that say nothing."""

TURN = {"rad": 2 * np.pi, "deg": 360.0, "turns": 1.0}
"""One turn in each unit of an angle."""

SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
SLOWEST, FASTEST = 4.0, 50_000.0
"""Rows per second that rigs log."""


@dataclass(frozen=True)
class Role:
    """A column in a role: "time", "angle", "wheel_angle", "wheel_speed", "voltage", "torque" or "reference".

    unit: stated or guessed, "" where unknown; why: what the guess rests on; sure: whether the name says so too;
    header: whether the file states the unit where the reader takes it from.
    """

    role: str
    column: str
    unit: str
    why: str
    sure: bool
    header: bool = False


@dataclass(frozen=True)
class Roles:
    """All guesses of a file, by role, what its other columns seem to be, and the kind of drive that follows.

    zero_up: whether the angle seems to be counted from the top; None where that cannot be told. linear: a position.
    """

    found: dict[str, Role]
    others: dict[str, str] = field(default_factory=dict)
    zero_up: bool | None = None
    linear: bool = False

    def column(self, role: str) -> str | None:
        """The column in a role, None where there is none."""
        return self.found[role].column if role in self.found else None

    @property
    def drive(self) -> str:
        """The kind of drive that the channels speak for."""
        if "wheel_angle" in self.found or "wheel_speed" in self.found:
            return "reaction-wheel"
        return "direct" if "torque" in self.found else "none"


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A column with its scores by role, thinned for comparison."""

    column: Column
    scores: dict[str, float]
    unit: str

    @property
    def name(self) -> str:
        return self.column.name

    @property
    def values(self) -> Floats:
        return self.column.values


def guess_roles(columns: list[Column]) -> Roles:
    """The likely role of each column. Columns without numbers, and those of another length than most, have none."""
    with np.errstate(over="ignore", invalid="ignore"):  # absurd numbers are no motion, and no cause to print
        return _guess(columns)


def _guess(columns: list[Column]) -> Roles:
    lengths = [len(c.values) for c in columns if c.kind in ("numbers", "whole numbers")]
    usual = max(set(lengths), key=lengths.count) if lengths else 0
    usable = [c for c in columns if c.kind in ("numbers", "whole numbers") and len(c.values) == usual]
    candidates = [_Candidate(c, name_scores(c.name), unit_of(c.name, c.unit)) for c in usable]
    found: dict[str, Role] = {}
    others: dict[str, str] = {}
    time = _time(candidates, found)
    rest = [c for c in candidates if c is not time]
    moving = [c for c in rest if not c.column.constant]
    others |= {c.name: "does not change" for c in rest if c.column.constant}
    stamps = time.values if time else np.arange(float(usual))
    speeds = _speeds(moving, stamps)
    others |= {c.name: f"speed of {of}" for c, of in speeds}
    angle = _angle([c for c in moving if not _in(c, (s for s, _ in speeds))], found)
    if angle is None:
        return Roles(found, others)
    left = [c for c in moving if c is not angle and not _in(c, (s for s, _ in speeds))]
    left = _wheel(left, angle, speeds, found)
    left = _reference(left, angle, found)
    left = _drive(left, found)
    if "wheel_angle" not in found:
        _wheel_speed(speeds, angle, found)
    others |= {c.name: "not known" for c in left}
    others = {name: what for name, what in others.items() if name not in {r.column for r in found.values()}}
    linear = found["angle"].unit in ("m", "mm")
    return Roles(found, others, None if linear else _counted_from_top(angle, found["angle"].unit), linear)


def _in(one: _Candidate, many: Iterable[_Candidate]) -> bool:
    return any(one is other for other in many)


def _time(candidates: list[_Candidate], found: dict[str, Role]) -> _Candidate | None:
    """The clock: a column that rises, best one that is called so; its unit from the header or from the rate."""
    best: tuple[float, _Candidate, float] | None = None
    for candidate in candidates:
        steps = np.diff(candidate.values)
        steps = steps[np.isfinite(steps)]
        if not steps.size or candidate.column.constant:
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
    why = "rises from row to row" if rising == 1 else f"rises at {rising:.1%} of the rows"
    if not unit and usual > 0:
        fits = [name for name, factor in SECONDS.items() if SLOWEST <= 1 / (usual * factor) <= FASTEST]
        unit = fits[0] if fits else "s"
        why += f", {1 / (usual * SECONDS[unit]):.4g} rows per second if in {unit}"
    header = bool(candidate.column.unit)
    found["time"] = Role("time", candidate.name, unit or "s", why, candidate.scores["time"] >= 2, header)
    return candidate


def _speeds(moving: list[_Candidate], stamps: Floats) -> list[tuple[_Candidate, str]]:
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


def _main(candidate: _Candidate) -> list[float]:
    return [candidate.scores[role] for role in ("angle", "wheel", "voltage", "torque", "reference", "current")]


def _fits(candidate: _Candidate, role: str) -> float:
    """Score of a role by name and unit; negative where the unit is another quantity's."""
    score = candidate.scores[role]
    if candidate.unit and any(candidate.unit in units for units in ROLE_UNITS.values()):
        score += 2.0 if candidate.unit in ROLE_UNITS[role] else -4.0
    elif candidate.unit in SPEED_UNITS:
        score -= 4.0
    return score - candidate.scores["other"]


def _angle(moving: list[_Candidate], found: dict[str, Role]) -> _Candidate | None:
    """The pendulum's angle: by name and unit, else the smoothest column."""
    scored = [(_fits(c, "angle") - 1.5 * c.scores["reference"] - 0.8 * c.scores["wheel"], c) for c in moving]
    best, angle = max(scored, key=lambda s: s[0], default=(0.0, None))
    why = "by its name"
    if angle is None or best < 1:
        ranked = [(roughness(c.values), c) for c in moving if _fits(c, "angle") > -2]
        if not ranked:
            return None
        rough, angle = min(ranked, key=lambda s: s[0])
        smooth_ones = [(c.column.span, r, c) for r, c in ranked if r < POSITION and c.column.kind == "numbers"]
        if len(smooth_ones) > 1:
            _, rough, angle = min(smooth_ones, key=lambda s: s[0])  # a wheel goes farther than the body that carries it
        if rough > 0.2 or len(angle.values) < FEWEST:
            return None
        why = "a smooth column, as positions are"
    unit = angle.unit if angle.unit in ROLE_UNITS["angle"] else ""
    if unit:
        why += f", its unit is stated ({unit})"
    else:
        unit, reason = _angle_unit(angle.column)
        why += f"; {unit} {reason}"
    found["angle"] = Role("angle", angle.name, unit, why, best >= 2)
    return angle


def _angle_unit(column: Column) -> tuple[str, str]:
    """Unit of an angle that states none, by the size of its values: a swing in rad covers a turn or two at most."""
    span = column.span
    if column.kind == "whole numbers" and span > 50:
        return "counts", f"for its values are whole numbers over a range of {span:g}"
    low, high = np.nanquantile(column.values, (0.1, 0.9))
    if span > 12 and (span > 400 or passes(column.values, float(low), float(high)) >= 3):
        return "deg", f"for it goes to and fro over {span:.3g}, too much for a swing in rad"
    return "rad", f"for it covers {span:.3g}"


def _wheel(
    left: list[_Candidate], angle: _Candidate, speeds: list[tuple[_Candidate, str]], found: dict[str, Role]
) -> list[_Candidate]:
    """The wheel's angle: by its name, else a second smooth position that goes farther than the pendulum's."""
    named = [(_fits(c, "wheel") - c.scores["reference"], c) for c in left if c.scores["wheel"] >= 2]
    named = [(score, c) for score, c in named if score >= 2 and roughness(c.values) < 0.5]
    wheel, why = None, "by its name"
    if named:
        wheel = max(named, key=lambda s: s[0])[1]
    else:
        unnamed = [c for c in left if NO_NAME.fullmatch(c.name) and not c.unit and roughness(c.values) < POSITION]
        unnamed = [c for c in unnamed if not _alike(c, angle)]
        wheel = max((c for c in unnamed if c.column.span > 3 * angle.column.span), key=_span, default=None)
        why = f"a smooth position over {0.0 if wheel is None else wheel.column.span:.3g}"
    if wheel is None:
        return left
    unit = wheel.unit if wheel.unit in ROLE_UNITS["wheel"] else ""
    if not unit:
        whole = wheel.column.kind == "whole numbers" and wheel.column.span > 50
        unit = "counts" if whole else found["angle"].unit if found["angle"].unit in ROLE_UNITS["wheel"] else "rad"
        why += f"; {unit} as the angle" if not whole else "; whole numbers, so counts"
    found["wheel_angle"] = Role("wheel_angle", wheel.name, unit, why, bool(named))
    return [c for c in left if c is not wheel]


def _span(candidate: _Candidate) -> float:
    return candidate.column.span


def _reference(left: list[_Candidate], angle: _Candidate, found: dict[str, Role]) -> list[_Candidate]:
    """The reference of the angle: called so, or moving with it as one."""
    alike = [(correlation(thin(c.values), thin(angle.values)), c, _alike(c, angle)) for c in left]
    scored = [(c.scores["reference"] + 3.0 * same, r, c) for r, c, same in alike if same or _names_reference(c)]
    scored = [s for s in scored if s[2].scores["torque"] < 2 and s[2].scores["voltage"] < 2]
    if not scored:
        return left
    _, r, reference = max(scored, key=lambda s: (s[0], s[1]))
    text = f"goes with the angle (correlation {r:.3f})"
    role = Role("reference", reference.name, reference.unit, text, reference.scores["reference"] >= 2)
    found["reference"] = role
    return [c for c in left if c is not reference]


def _alike(one: _Candidate, other: _Candidate) -> bool:
    """Whether two columns are one motion, measured or wanted: they go together and equally far."""
    ratio = one.column.span / max(other.column.span, 1e-300)
    return 0.3 < ratio < 3.0 and correlation(thin(one.values), thin(other.values)) > ALIKE


def _names_reference(candidate: _Candidate) -> bool:
    return candidate.scores["reference"] >= 3 or (candidate.scores["reference"] >= 2 and candidate.scores["angle"] >= 1)


def _drive(left: list[_Candidate], found: dict[str, Role]) -> list[_Candidate]:
    """Voltage and torque, by name and unit; without a wheel a voltage is no known torque and stays unnamed."""
    taken: list[_Candidate] = []
    for role in ("torque", "voltage"):
        if role == "voltage" and "wheel_angle" not in found and not any(c.scores["wheel"] >= 2 for c in left):
            continue
        scored = [(_fits(c, role), c) for c in left if not _in(c, taken)]
        score, best = max(scored, key=lambda s: s[0], default=(0.0, None))
        if best is None or score < 2:
            continue
        if role == "torque" and "wheel_angle" in found:
            continue
        why = "by its unit" if best.scores[role] < 2 else "by its name"
        found[role] = Role(role, best.name, best.unit, why, best.scores[role] >= 2)
        taken.append(best)
    return [c for c in left if not _in(c, taken)]


def _wheel_speed(speeds: list[tuple[_Candidate, str]], angle: _Candidate, found: dict[str, Role]) -> None:
    """The speed of a wheel whose angle was not logged."""
    named = [c for c, of in speeds if of != angle.name and (c.scores["wheel"] >= 2 or c.unit == "rpm")]
    if named:
        best = max(named, key=lambda c: c.scores["wheel"])
        unit = best.unit if best.unit in SPEED_UNITS else "rad/s"
        found["wheel_speed"] = Role("wheel_speed", best.name, unit, "by its name", True)


def _counted_from_top(angle: _Candidate, unit: str) -> bool | None:
    """Whether the body hangs, or swings, half a turn from 0; None for counts, whose zero is anywhere."""
    turn = TURN.get(unit)
    if turn is None:
        return None
    lowered = angle.name.lower().replace(" ", "")
    if "up=0" in lowered or "0=up" in lowered:
        return True
    values = angle.values[np.isfinite(angle.values)]
    begin = values[: max(20, len(values) // 200)]
    # a body that is at rest when the log begins hangs; one that ends up inverted does not
    at_rest = np.ptp(begin) < 0.01 * np.ptp(values)
    middle = float(np.median(begin if at_rest else values)) / turn
    from_half = abs(middle - np.floor(middle) - 0.5)
    return bool(from_half < 0.08)
