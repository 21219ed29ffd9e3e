"""Which column is likely which channel: by its name, its unit, and by how the columns move with each other.

A guess, to be confirmed by the owner of the rig; each guess states its reason.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from swingid.model.rig.fields import SECONDS
from swingid.recording.grid import TURN
from swingid.recording.inspect import candidates as traits
from swingid.recording.inspect.candidates import Candidate, Role
from swingid.recording.inspect.columns import unit_of_steps
from swingid.recording.inspect.marks import guess_point, seen_from_a_camera

if TYPE_CHECKING:
    from swingid.numerics.arrays import Array
    from swingid.recording.inspect.columns import Column


DERIVATIVE = 0.8
"""Correlation with the slope of another column from which on a column is that column's speed."""

RISING = 0.98
"""Share of rows after which a clock rises."""

FASTEST_RATE = 70.0
"""Range in rad/s that no gyroscope of 2000 deg/s covers."""

SLOWEST, FASTEST = 4.0, 50_000.0
"""Rows per second that rigs log."""


def guess_time(candidates: list[Candidate], roles: dict[str, Role]) -> Candidate | None:
    """The clock: a column that rises, best one that is called so; its unit from the header or from the rate."""
    best: tuple[float, Candidate, float] | None = None
    for candidate in candidates:
        steps = np.diff(candidate.values)
        steps = steps[np.isfinite(steps)]
        if not steps.size or candidate.column.constant or (counts_rows(candidate) and candidate.scores["time"] < 2):
            continue
        rising = float(np.mean(steps >= 0))
        score = candidate.scores["time"] + 2.0 * bool(candidate.unit_in("time"))
        if rising < RISING and score < 3:
            continue
        even = float(np.median(np.abs(steps - np.median(steps)))) < 0.2 * abs(float(np.median(steps)))
        score += 2.0 * (rising >= RISING) + even
        if (score >= 3 or even) and (best is None or score > best[0]):
            best = score, candidate, rising
    if best is None:
        return None
    _, candidate, rising = best
    unit = candidate.unit_in("time")
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
    roles["time"] = Role("time", candidate.name, unit or "s", why, candidate.scores["time"] >= 2)
    return candidate


def counts_rows(candidate: Candidate) -> bool:
    """Return whether a column numbers the rows: it rises by 1 from row to row."""
    if candidate.column.kind != "whole numbers":
        return False
    steps = np.diff(candidate.values)
    return bool(steps.size and np.mean(steps == 1) > RISING)


def clocks_beside(candidates: list[Candidate]) -> dict[str, str]:
    """What other columns are that only rise: clocks by their name, and numbers of the rows."""
    others = {c.name: "numbers the rows" for c in candidates if counts_rows(c)}
    for candidate in candidates:
        steps = np.diff(candidate.values)
        steps = steps[np.isfinite(steps)]
        if steps.size and candidate.scores["time"] >= 2 and np.mean(steps >= 0) >= RISING:
            others.setdefault(candidate.name, "another clock")
    return others


def guess_speeds(moving: list[Candidate], stamps: Array) -> dict[Candidate, str]:
    """Columns that are the speed of another one: they go with its slope, and are called so or have its size."""
    clock = traits.thin(stamps)
    if len(clock) < 50:
        return {}
    slopes = {c.name: traits.slope(traits.thin(c.values), clock) for c in moving}
    level = {c.name: traits.smooth(traits.thin(c.values)) for c in moving}
    result = {}
    for speed in moving:
        named = speed.scores["speed"] >= 2 or speed.unit in traits.SPEED_UNITS or traits.is_gyroscope(speed.name)
        if not named and max(speed.scores[role] for role in OF_OTHERS) >= 2:
            continue
        match = [(traits.correlation(level[speed.name], slopes[c.name]), c) for c in moving if c is not speed]
        match = [(r, c) for r, c in match if c.scores["speed"] < 3 and c.unit not in traits.SPEED_UNITS]
        r, of = max(match, key=lambda m: (round(m[0], 2), -m[1].scores["reference"]), default=(0.0, speed))
        if named or (r > DERIVATIVE and traits.has_size(level[speed.name], slopes[of.name])):
            result[speed] = of.name if r > DERIVATIVE else "an angle that is not logged"
    return result


OF_OTHERS = ("angle", "wheel", "voltage", "torque", "reference", "current")
"""Roles by a name of which a column is no speed."""

FEWEST = 20
"""Rows from which on a motion can be seen."""

POSITION = 0.02
"""Roughness below which a column moves as a position does."""

ALSO = 20.0
"""A column is as smooth as another if it is at most so many times rougher."""

NO_NAME = re.compile(
    r"(\w+(\(\d+\))?\.)*(column|col|ch|channel|data|signals?|values?|var|x|y|xout|yout|ans|out)?[ _.:(,)\d]*",
    re.IGNORECASE,
)
"""Names without a meaning."""


def guess_angle(moving: list[Candidate], roles: dict[str, Role]) -> Candidate | None:
    """The pendulum's angle: by name and unit, else the smoothest column."""
    scored = [(traits.fits(c, "angle") - 1.5 * c.scores["reference"] - 0.8 * c.scores["wheel"], c) for c in moving]
    best, angle = max(scored, key=lambda s: s[0], default=(0.0, None))
    if angle is not None:  # of position_0 and position_1 the wheel's goes farther
        angle = min((c for score, c in scored if score == best and _same_but_number(c, angle)), key=_span)
    why = "by its name"
    if angle is None or best < 1:
        ranked = [(traits.roughness(c.values), c) for c in moving if traits.fits(c, "angle") > -2]
        if not ranked:
            return None
        rough, angle = min(ranked, key=lambda s: s[0])
        smooth_ones = [(c.column.span, r, c) for r, c in ranked if r < min(POSITION, ALSO * rough)]
        if len(smooth_ones) > 1:
            _, rough, angle = min(smooth_ones, key=lambda s: s[0])  # a wheel goes farther than the body that carries it
        if rough > 0.2 or len(angle.values) < FEWEST:
            return None
        why = "a smooth column, as positions are"
    unit = angle.unit_in("angle")
    if unit:
        why += f", its unit is stated ({unit})"
    else:
        unit, reason = _angle_unit(angle.column)
        why += f"; {unit} {reason}"
    roles["angle"] = Role("angle", angle.name, unit, why, best >= 2)
    return angle


def _angle_unit(column: Column) -> tuple[str, str]:
    """Unit of an angle that states none, by the size of its values: a swing in rad covers a turn or two at most."""
    span = column.span
    by_steps, counts = unit_of_steps(column)
    if by_steps:
        return by_steps, f"for its steps are then {counts} in a turn"
    if column.kind == "whole numbers" and span > 50:
        return "counts", f"for its values are whole numbers over a range of {span:g}"
    low, high = np.nanquantile(column.values, (0.1, 0.9))
    quarter = float(high - low) / 4
    if span > 12 and (span > 400 or traits.passes(column.values, float(low) + quarter, float(high) - quarter) >= 3):
        return "deg", f"for it goes back and forth over {span:.3g}, too much for a swing in rad"
    return "rad", f"for it covers {span:.3g}"


def guess_wheel(unassigned: list[Candidate], angle: Candidate, roles: dict[str, Role]) -> None:
    """The wheel's angle: by its name, else a second smooth position that goes farther than the pendulum's."""
    named = [(traits.fits(c, "wheel") - c.scores["reference"], c) for c in unassigned if c.scores["wheel"] >= 2]
    named = [(score, c) for score, c in named if score >= 2 and traits.roughness(c.values) < 0.5]
    wheel, why = None, "by its name"
    if named:
        wheel = max(named, key=lambda s: s[0])[1]
    else:
        unnamed = [c for c in unassigned if NO_NAME.fullmatch(c.name) or _same_but_number(c, angle)]
        unnamed = [c for c in unnamed if not c.unit and traits.roughness(c.values) < POSITION]
        unnamed = [c for c in unnamed if not traits.alike(c, angle)]
        wheel = max((c for c in unnamed if c.column.span > 3 * angle.column.span), key=_span, default=None)
        why = f"a smooth position over {0.0 if wheel is None else wheel.column.span:.3g}"
    if wheel is None:
        return
    unit = wheel.unit_in("wheel")
    by_steps, counts = unit_of_steps(wheel.column)
    if not unit and by_steps:
        unit = by_steps
        why += f"; {unit}, for its steps are then {counts} in a turn"
    elif not unit:
        whole = wheel.column.kind == "whole numbers" and wheel.column.span > 50
        unit = (
            "counts" if whole else roles["angle"].unit if roles["angle"].unit in traits.ROLE_UNITS["wheel"] else "rad"
        )
        why += f"; {unit} as the angle" if not whole else "; whole numbers, so counts"
    roles["wheel_angle"] = Role("wheel_angle", wheel.name, unit, why, bool(named))


def _same_but_number(first: Candidate, second: Candidate) -> bool:
    """Return whether two names differ in their numbers only."""
    return re.sub(r"\d+", "", first.name) == re.sub(r"\d+", "", second.name)


def _span(candidate: Candidate) -> float:
    return candidate.column.span


def guess_reference(unassigned: list[Candidate], angle: Candidate, roles: dict[str, Role]) -> None:
    """The reference of the angle: called so, or moving with it as one."""
    beside = [
        (traits.correlation(traits.thin(c.values), traits.thin(angle.values)), c, traits.alike(c, angle))
        for c in unassigned
    ]
    scored = [(c.scores["reference"] + 3.0 * same, r, c) for r, c, same in beside if same or _names_reference(c)]
    scored = [s for s in scored if s[2].scores["torque"] < 2 and s[2].scores["voltage"] < 2]
    if not scored:
        return
    _, r, reference = max(scored, key=lambda s: (s[0], s[1]))
    text = f"goes with the angle (correlation {r:.3f})"
    roles["reference"] = Role("reference", reference.name, reference.unit, text, reference.scores["reference"] >= 2)


def _names_reference(candidate: Candidate) -> bool:
    return candidate.scores["reference"] >= 3 or (candidate.scores["reference"] >= 2 and candidate.scores["angle"] >= 1)


def guess_drive(unassigned: list[Candidate], roles: dict[str, Role]) -> None:
    """Voltage and torque, by name and unit; without a wheel a voltage beside no torque is that of a motor."""
    wheel = "wheel_angle" in roles or any(c.scores["wheel"] >= 2 for c in unassigned)
    for role in ("torque", "voltage"):
        if "torque" in roles and not wheel:
            return
        # of several, one that changes its sign: a supply does not
        scored = [(traits.fits(c, role), c) for c in free(unassigned, roles)]
        score, best = max(
            scored, key=lambda s: (s[0] >= 2, traits.changes_sign(s[1].values), s[0]), default=(0.0, None)
        )
        if best is None or score < 2 or (role == "torque" and "wheel_angle" in roles):
            continue
        why = "by its unit" if best.scores[role] < 2 else "by its name"
        roles[role] = Role(role, best.name, best.unit, why, best.scores[role] >= 2)


def free(candidates: Iterable[Candidate], roles: dict[str, Role]) -> list[Candidate]:
    """The columns without a role."""
    taken = {role.column for role in roles.values()}
    return [candidate for candidate in candidates if candidate.name not in taken]


def guess_wheel_speed(speeds: dict[Candidate, str], angle: Candidate, roles: dict[str, Role]) -> None:
    """The speed of a wheel whose angle was not logged."""
    named = [c for c, of in speeds.items() if of != angle.name and (c.scores["wheel"] >= 2 or c.unit == "rpm")]
    if named:
        best = max(named, key=lambda c: c.scores["wheel"])
        unit = best.unit if best.unit in traits.SPEED_UNITS else "rad/s"
        roles["wheel_speed"] = Role("wheel_speed", best.name, unit, "by its name", True)


def guess_rate(speeds: list[Candidate], roles: dict[str, Role]) -> None:
    """The rate of the axis where no angle was logged: of the components of a gyroscope the one that moves most."""
    rates = [c for c in speeds if c.unit in traits.RATE_UNITS or traits.is_gyroscope(c.name)]
    rates = rates or [c for c in speeds if c.scores["speed"] >= 2 > c.scores["wheel"] and c.unit not in ("m/s", "mm/s")]
    if not rates:
        return
    best = max(rates, key=lambda c: float(np.nanstd(c.values)))
    unit, why = best.unit, "a rate, by its name"
    if best.unit in traits.RATE_UNITS:
        why = f"a rate, its unit is stated ({best.unit})"
    else:
        # the fastest gyroscopes of phones and boards measure 2000 deg/s = 35 rad/s
        unit = "deg/s" if best.column.span > FASTEST_RATE else "rad/s"
        why += f"; {unit} for it covers {best.column.span:.3g}"
    why += ", the largest component" if len(rates) > 1 else ""
    roles["angle_speed"] = Role("angle_speed", best.name, unit, why, True)


def counted_from_top(angle: Candidate, unit: str) -> bool | None:
    """Return whether the body hangs, or swings, half a turn from 0; None for counts, whose zero is anywhere."""
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


@dataclass(frozen=True)
class Roles:
    """All guesses of a file, by role, what its other columns seem to be, and the kind of drive that follows.

    zero_up: whether the angle seems to be counted from the top; None where that is not determined. linear: a position.
    """

    found: dict[str, Role]
    others: dict[str, str] = field(default_factory=dict)
    zero_up: bool | None = None
    linear: bool = False

    def column(self, role: str) -> str | None:
        """The column in a role, None where there is none."""
        return self.found[role].column if role in self.found else None

    @property
    def has_motion(self) -> bool:
        """Return whether a column is the angle of the axis, its rate, or the place of a mark on the body."""
        return bool({"angle", "angle_speed", "point_x"} & self.found.keys())

    @property
    def drive(self) -> str:
        """The kind of drive that follows from the channels."""
        if "wheel_angle" in self.found or "wheel_speed" in self.found:
            return "reaction-wheel"
        if "torque" in self.found:
            return "direct"
        return "motor" if "voltage" in self.found else "none"


def guess_roles(columns: list[Column]) -> Roles:
    """The likely role of each column. Columns without numbers, and those of another length than most, have none."""
    with np.errstate(over="ignore", invalid="ignore"):  # absurd numbers are no motion, and no cause to print
        roles = _guess(columns)
    taken = {role.column for role in roles.found.values()}
    return replace(roles, others={name: what for name, what in roles.others.items() if name not in taken})


def _guess(columns: list[Column]) -> Roles:
    lengths = [len(c.values) for c in columns if c.kind in ("numbers", "whole numbers")]
    usual = max(set(lengths), key=lengths.count) if lengths else 0
    usable = [c for c in columns if c.kind in ("numbers", "whole numbers") and len(c.values) == usual]
    candidates = [Candidate(c, traits.name_scores(c.name), traits.unit_of(c.name, c.unit)) for c in usable]
    roles: dict[str, Role] = {}
    time = guess_time(candidates, roles)
    rest = [c for c in candidates if c is not time]
    moving = [c for c in rest if not c.column.constant]
    others = {c.name: "does not change" for c in rest if c.column.constant}
    texts = [c for c in columns if c.kind == "text" and any(cell.strip().startswith(("[", "(")) for cell in c.first)]
    others |= {c.name: "lists, which need a column for each number" for c in texts}
    beside = clocks_beside(moving)
    others |= beside
    others |= {c.name: "of an accelerometer or magnetometer" for c in moving if traits.is_no_motion(c)}
    moving = [c for c in moving if c.name not in beside and not traits.is_no_motion(c)]
    stamps = time.values if time is not None else np.arange(float(usual))
    marks = guess_point([c for c in rest if c.name not in beside], roles)
    if marks:
        others |= {c.name: "of a mark" for c in marks if c.column.constant is False}
        return Roles(roles, others | {c.name: "not known" for c in moving if c not in marks})
    pixels = [c for c in moving if seen_from_a_camera(c, rest)]
    others |= {c.name: "a place in a picture" for c in pixels}
    moving = [c for c in moving if c not in pixels]
    speeds = guess_speeds(moving, stamps)
    others |= {c.name: f"speed of {of}" for c, of in speeds.items()}
    moving = [c for c in moving if c not in speeds]
    angle = guess_angle(moving, roles)
    if angle is None:
        guess_rate(list(speeds), roles)
        return Roles(roles, others)
    others |= {c.name: "not known" for c in moving}
    guess_wheel(free(moving, roles), angle, roles)
    guess_reference(free(moving, roles), angle, roles)
    guess_drive(free(moving, roles), roles)
    if "wheel_angle" not in roles:
        guess_wheel_speed(speeds, angle, roles)
    linear = roles["angle"].unit in ("m", "mm")
    return Roles(roles, others, None if linear else counted_from_top(angle, roles["angle"].unit), linear)
