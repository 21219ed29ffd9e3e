"""Marks of a video among the columns: pairs of x and y that go along a circle, and a mark on the pivot."""

from __future__ import annotations

import re
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from swingid.recording.inspect import candidates as traits
from swingid.recording.inspect.candidates import Candidate, Role
from swingid.recording.points import Circle, circle_through, pairs

if TYPE_CHECKING:
    from collections.abc import Sequence

PLACES = frozenset(("", "px", "m", "mm", "cm"))
"""Units of places."""

UNNAMED = re.compile(r"column(\d+)")
"""Names of the columns of a file without a header."""

STILL, NEAR = 0.05, 0.3
"""Largest range of a mark on the pivot, in levers of the body, for trackers scatter by some pixels; and its distance
from the centre of the arc, which a mark that rests elsewhere exceeds."""

MASS = re.compile(r"\bmass\b", re.IGNORECASE)
"""Tracker calls its points mass A, mass B, which are no accelerations."""

SPEED, XY = re.compile(r"^v[_ ]?[xy]", re.IGNORECASE), re.compile(r"(^|[^a-z])[xy]\d?([^a-z]|$)", re.IGNORECASE)

Mark = tuple[Candidate, Candidate]


def guess_point(candidates: Sequence[Candidate], roles: dict[str, Role]) -> list[Candidate]:
    """The mark on the body and one on the pivot, if any, into `found`; the columns of all marks.

    None are sought where a column is called an angle and nothing else.
    """
    for candidate in candidates:
        is_named = candidate.scores["angle"] >= 2 and not candidate.column.constant
        if candidate.unit in ("rad", "deg") or (is_named and not XY.search(candidate.name)):
            return []
    marks = _marks(candidates)
    moving = [(circle, mark) for mark in marks if (circle := _circle(mark)) is not None and _is_arc(circle, mark)]
    if not moving:
        return []
    circle, (x, y) = min(moving, key=lambda candidate: candidate[0].scatter / candidate[0].radius)
    unit = f" {x.unit}" if x.unit else ""
    why = f"it goes along an arc of radius {circle.radius:.4g}{unit}, scatter {circle.scatter:.2g}{unit}"
    roles["point_x"] = Role("point_x", x.name, x.unit, why, True)
    roles["point_y"] = Role("point_y", y.name, y.unit, "as x", True)
    still = [mark for mark in marks if _is_pivot(mark, circle)]
    if still:
        for axis, candidate in zip("xy", still[0], strict=True):
            roles[f"pivot_{axis}"] = Role(
                f"pivot_{axis}", candidate.name, candidate.unit, "a mark that stays where it is", True
            )
    return [candidate for mark in marks for candidate in mark]


def seen_from_a_camera(angle: Candidate, candidates: Sequence[Candidate]) -> bool:
    """Return whether a column is a place in a picture: by its unit, or as x, or one of x and y, over many pixels.

    y alone may be the output of a system, in degrees.
    """
    if angle.unit == "px":
        return True
    spans = {other.name: other.column.span for other in candidates if _is_place(other)}
    paired = max((max(spans[x], spans[y]) for x, y in pairs(spans) if angle.name in (x, y)), default=0.0)
    alone = spans.get(angle.name, 0.0) if re.fullmatch(r"(?i)c?x", angle.name.strip()) else 0.0
    return not angle.unit and max(paired, alone) > PIXELS


PIXELS = 12.6
"""Range of a column called x or y from which on it is neither rad (two turns) nor metres of a rig: pixels."""


def _marks(candidates: Sequence[Candidate]) -> list[Mark]:
    """Pairs of columns that may be a place: by names that differ in x and y, or side by side without names."""
    by_name = {candidate.name: candidate for candidate in candidates}
    marks = [(by_name[x], by_name[y]) for x, y in pairs(by_name)]
    if not marks:
        unnamed = [candidate for candidate in candidates if UNNAMED.fullmatch(candidate.name)]
        marks = list(pairwise(unnamed))
    return [mark for mark in marks if all(_is_place(candidate) for candidate in mark) and mark[0].unit == mark[1].unit]


def _is_place(candidate: Candidate) -> bool:
    other = (
        (traits.is_no_motion(candidate) and not MASS.search(candidate.name))
        or traits.is_gyroscope(candidate.name)
        or candidate.scores["speed"] >= 2
    )
    return candidate.unit in PLACES and not other and SPEED.match(candidate.name) is None


def _is_pivot(mark: Mark, circle: Circle) -> bool:
    """Return whether a mark rests about where the body turns."""
    x, y = (axis.column for axis in mark)
    away = np.hypot((x.low + x.high) / 2 - circle.centre[0], (y.low + y.high) / 2 - circle.centre[1])
    return bool(max(x.span, y.span) < STILL * circle.radius and away < NEAR * circle.radius)


def _is_arc(circle: Circle, mark: Mark) -> bool:
    """Return whether a mark goes along a circle; one without names much more exactly, for other pairs may go so by
    chance.
    """
    if not UNNAMED.fullmatch(mark[0].name):
        return circle.is_arc
    exact = COMPUTED < circle.scatter / circle.radius < EXACT and circle.line > CLEAR * circle.scatter
    x, y = (traits.thin(axis.values) for axis in mark)
    away = np.array(circle.centre) - (np.nanmedian(x), np.nanmedian(y))  # an arc lies on one side of its centre
    beyond = away @ np.array((circle.centre[0] - x, circle.centre[1] - y))
    return bool(circle.is_arc and exact and np.nanmin(beyond) > 0)


COMPUTED, EXACT, CLEAR = 1e-6, 0.005, 10.0
"""Least and largest scatter of a mark without names in levers, and that about a line in scatters: a current and a
position, or an angle and its rate, lie on ellipses that are circles by chance to some per cent; sine and cosine of an
angle lie on one to the last digit."""


def _circle(mark: Mark) -> Circle | None:
    x, y = (axis.values for axis in mark)
    if max(np.nanmax(np.abs(x), initial=0.0), np.nanmax(np.abs(y), initial=0.0)) > 1e9:
        return None
    return circle_through(traits.thin(x), traits.thin(y))
