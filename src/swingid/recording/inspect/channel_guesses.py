"""Which of the columns that move is the angle, the wheel's, the reference, and what drives them."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from swingid.recording.inspect.candidates import Candidate, Role, alike, among, fits
from swingid.recording.inspect.encoder_steps import TURN, unit_of_steps
from swingid.recording.inspect.likeness import correlation, passes, roughness, thin
from swingid.recording.inspect.names import ROLE_UNITS, SPEED_UNITS

if TYPE_CHECKING:
    from swingid.recording.inspect.columns import Column

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
"""Names that say nothing."""


def guess_angle(moving: list[Candidate], found: dict[str, Role]) -> Candidate | None:
    """The pendulum's angle: by name and unit, else the smoothest column."""
    scored = [(fits(c, "angle") - 1.5 * c.scores["reference"] - 0.8 * c.scores["wheel"], c) for c in moving]
    best, angle = max(scored, key=lambda s: s[0], default=(0.0, None))
    if angle is not None:  # of position_0 and position_1 the wheel's goes farther
        angle = min((c for score, c in scored if score == best and _same_but_number(c, angle)), key=_span)
    why = "by its name"
    if angle is None or best < 1:
        ranked = [(roughness(c.values), c) for c in moving if fits(c, "angle") > -2]
        if not ranked:
            return None
        rough, angle = min(ranked, key=lambda s: s[0])
        smooth_ones = [(c.column.span, r, c) for r, c in ranked if r < min(POSITION, ALSO * rough)]
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
    by_steps, counts = unit_of_steps(column)
    if by_steps:
        return by_steps, f"for its steps are then {counts} in a turn"
    if column.kind == "whole numbers" and span > 50:
        return "counts", f"for its values are whole numbers over a range of {span:g}"
    low, high = np.nanquantile(column.values, (0.1, 0.9))
    if span > 12 and (span > 400 or passes(column.values, float(low), float(high)) >= 3):
        return "deg", f"for it goes to and fro over {span:.3g}, too much for a swing in rad"
    return "rad", f"for it covers {span:.3g}"


def guess_wheel(
    left: list[Candidate], angle: Candidate, speeds: list[tuple[Candidate, str]], found: dict[str, Role]
) -> list[Candidate]:
    """The wheel's angle: by its name, else a second smooth position that goes farther than the pendulum's."""
    named = [(fits(c, "wheel") - c.scores["reference"], c) for c in left if c.scores["wheel"] >= 2]
    named = [(score, c) for score, c in named if score >= 2 and roughness(c.values) < 0.5]
    wheel, why = None, "by its name"
    if named:
        wheel = max(named, key=lambda s: s[0])[1]
    else:
        unnamed = [c for c in left if NO_NAME.fullmatch(c.name) or _same_but_number(c, angle)]
        unnamed = [c for c in unnamed if not c.unit and roughness(c.values) < POSITION]
        unnamed = [c for c in unnamed if not alike(c, angle)]
        wheel = max((c for c in unnamed if c.column.span > 3 * angle.column.span), key=_span, default=None)
        why = f"a smooth position over {0.0 if wheel is None else wheel.column.span:.3g}"
    if wheel is None:
        return left
    unit = wheel.unit if wheel.unit in ROLE_UNITS["wheel"] else ""
    by_steps, counts = unit_of_steps(wheel.column)
    if not unit and by_steps:
        unit = by_steps
        why += f"; {unit}, for its steps are then {counts} in a turn"
    elif not unit:
        whole = wheel.column.kind == "whole numbers" and wheel.column.span > 50
        unit = "counts" if whole else found["angle"].unit if found["angle"].unit in ROLE_UNITS["wheel"] else "rad"
        why += f"; {unit} as the angle" if not whole else "; whole numbers, so counts"
    found["wheel_angle"] = Role("wheel_angle", wheel.name, unit, why, bool(named))
    return [c for c in left if c is not wheel]


def _same_but_number(one: Candidate, other: Candidate) -> bool:
    """Whether two names differ in their numbers only."""
    return re.sub(r"\d+", "", one.name) == re.sub(r"\d+", "", other.name)


def _span(candidate: Candidate) -> float:
    return candidate.column.span


def guess_reference(left: list[Candidate], angle: Candidate, found: dict[str, Role]) -> list[Candidate]:
    """The reference of the angle: called so, or moving with it as one."""
    beside = [(correlation(thin(c.values), thin(angle.values)), c, alike(c, angle)) for c in left]
    scored = [(c.scores["reference"] + 3.0 * same, r, c) for r, c, same in beside if same or _names_reference(c)]
    scored = [s for s in scored if s[2].scores["torque"] < 2 and s[2].scores["voltage"] < 2]
    if not scored:
        return left
    _, r, reference = max(scored, key=lambda s: (s[0], s[1]))
    text = f"goes with the angle (correlation {r:.3f})"
    role = Role("reference", reference.name, reference.unit, text, reference.scores["reference"] >= 2)
    found["reference"] = role
    return [c for c in left if c is not reference]


def _names_reference(candidate: Candidate) -> bool:
    return candidate.scores["reference"] >= 3 or (candidate.scores["reference"] >= 2 and candidate.scores["angle"] >= 1)


def guess_drive(left: list[Candidate], found: dict[str, Role]) -> list[Candidate]:
    """Voltage and torque, by name and unit; without a wheel a voltage is no known torque and stays unnamed."""
    taken: list[Candidate] = []
    for role in ("torque", "voltage"):
        if role == "voltage" and "wheel_angle" not in found and not any(c.scores["wheel"] >= 2 for c in left):
            continue
        scored = [(fits(c, role), c) for c in left if not among(c, taken)]
        score, best = max(scored, key=lambda s: s[0], default=(0.0, None))
        if best is None or score < 2:
            continue
        if role == "torque" and "wheel_angle" in found:
            continue
        why = "by its unit" if best.scores[role] < 2 else "by its name"
        found[role] = Role(role, best.name, best.unit, why, best.scores[role] >= 2)
        taken.append(best)
    return [c for c in left if not among(c, taken)]


def guess_wheel_speed(speeds: list[tuple[Candidate, str]], angle: Candidate, found: dict[str, Role]) -> None:
    """The speed of a wheel whose angle was not logged."""
    named = [c for c, of in speeds if of != angle.name and (c.scores["wheel"] >= 2 or c.unit == "rpm")]
    if named:
        best = max(named, key=lambda c: c.scores["wheel"])
        unit = best.unit if best.unit in SPEED_UNITS else "rad/s"
        found["wheel_speed"] = Role("wheel_speed", best.name, unit, "by its name", True)


def counted_from_top(angle: Candidate, unit: str) -> bool | None:
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
