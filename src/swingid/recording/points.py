"""The angle of a body from the place of a mark on it, as video trackers log it: pixels or metres, x and y.

The mark of a body on a fixed axis moves on a circle about the pivot, which is fitted where [log] pivot states none.
An error δ of the pivot changes the angle by (-δ₁ cos q + δ₂ sin q)/R, as an encoder off its axis does (δ₁ across, δ₂
along the direction in which the body hangs), so it is declared as the nonlinearity of the axis' sensor.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from swingid.errors import InputError
from swingid.numerics.regression import fit_linear
from swingid.recording.findings import Finding

if TYPE_CHECKING:
    from collections.abc import Mapping

    from swingid.model.rig import Rig
    from swingid.model.rig.tables import LogConventions
    from swingid.numerics.arrays import Array, Bools
    from swingid.recording.formats.table import Table

ANGLE = "angle of the point"
"""Name of the column that is made, in rad."""

LIKELIHOOD = 0.6
"""Likelihood below which DeepLabCut itself takes a point as not seen (its `pcutoff`)."""

LARGEST = 0.1
"""Standard uncertainty of the pivot along the lever, in levers, up to which an error of it acts linearly."""

UPRIGHT = float(np.radians(0.5))
"""Standard uncertainty (rad) of the vertical of a picture: a camera on a stand that was levelled by eye."""

FAR = 6.0
"""Standard deviations from the circle beyond which a point is not the mark."""

ROUNDS = 20
"""Fits at most; which points are far off is known after some."""

TRIPLES, MOST = 200, 500
"""Circles through three points that are tried, and points by which one is judged. With a third of the points far off,
200 triples miss a good one with a probability of 1e-31; a bad one only costs a round."""

FEWEST = 20
"""Rows for a circle, whose three numbers and their uncertainty come from the scatter."""

DIRECTIONS = {"+y": (0.0, 1.0), "-y": (0.0, -1.0), "+x": (1.0, 0.0), "-x": (-1.0, 0.0)}
"""Directions in the picture, by their names."""


Spread = Callable[[tuple[float, float]], tuple[float, float]]
"""From the direction in which the body hangs to the standard uncertainties of the pivot across and along it."""


@dataclass(frozen=True)
class Circle:
    """A circle through points: centre, radius and the scatter about it (unit of the points), covariance of the centre.

    The covariance holds for scatter that is correlated from row to row, as that of a tracker is. line: scatter about
    a straight line, by which an arc is told from one.
    """

    centre: tuple[float, float]
    radius: float
    scatter: float
    covariance: Array
    line: float

    @property
    def is_arc(self) -> bool:
        """Return whether the points lie on a circle, and not nearly as well on a line (scatter alike) or in a cloud."""
        along = float(np.sqrt(np.linalg.eigvalsh(self.covariance)[-1]))
        return self.scatter < 0.05 * self.radius and self.line > 2 * self.scatter and along < LARGEST * self.radius


def circle_through(x: Array, y: Array) -> Circle | None:
    """The circle of least squared distances through points (n,); None for fewer than `FEWEST`, or for a line.

    Starts with the algebraic fit; points far off are left out, until they are the same as before.
    """
    finite = np.isfinite(x) & np.isfinite(y)
    good = finite & _near_most(x, y, finite)
    fitted = None
    for _ in range(ROUNDS):
        if np.count_nonzero(good) < FEWEST:
            return None
        fitted = _fitted(x[good], y[good])
        if fitted is None:
            return None
        near = finite & _within(x, y, (*fitted.centre, fitted.radius), good)
        if (near == good).all():
            break
        good = near
    return fitted


def _within(x: Array, y: Array, circle: Sequence[float], good: Bools) -> Bools:
    """Points within `FAR` standard deviations of a circle (x, y, radius), by the scatter of the good ones."""
    off = np.abs(np.hypot(x - circle[0], y - circle[1]) - circle[2])
    scatter = 1.4826 * float(np.median(off[good]))
    with np.errstate(invalid="ignore"):
        return np.asarray(off <= FAR * max(scatter, 1e-9 * circle[2]))


def _near_most(x: Array, y: Array, finite: Bools) -> Bools:
    """Points near that circle, of those through three points each, from which the median distance is least."""
    if np.count_nonzero(finite) < FEWEST:
        return finite
    u, v = x[finite], y[finite]
    three = np.random.default_rng(0).integers(0, u.size, (3, TRIPLES))
    (ax, bx, cx), (ay, by, cy) = u[three], v[three]
    (bx, cx), (by, cy) = (bx - ax, cx - ax), (by - ay, cy - ay)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        area = 2 * (bx * cy - by * cx)
        ux = (cy * (bx**2 + by**2) - by * (cx**2 + cy**2)) / area
        uy = (bx * (cx**2 + cy**2) - cx * (bx**2 + by**2)) / area
        some = slice(None, None, max(1, u.size // MOST))
        off = np.abs(np.hypot(u[some, None] - ax - ux, v[some, None] - ay - uy) - np.hypot(ux, uy))
    median = np.nan_to_num(np.median(off, axis=0), nan=np.inf)
    best = int(np.argmin(median))
    if not np.isfinite(median[best]):
        return finite
    return _within(x, y, (ax[best] + ux[best], ay[best] + uy[best], float(np.hypot(ux[best], uy[best]))), finite)


def _fitted(x: Array, y: Array) -> Circle | None:
    """One fit to finite points, by Gauss-Newton."""
    size = float(max(np.ptp(x), np.ptp(y)))
    if not np.isfinite(size) or size <= 0:
        return None
    middle = float(x.mean()), float(y.mean())
    u, v = (x - middle[0]) / size, (y - middle[1]) / size
    line = float(np.linalg.svd(np.column_stack((u, v)), compute_uv=False)[-1]) / np.sqrt(len(u))
    algebraic = np.column_stack((2 * u, 2 * v, np.ones_like(u)))
    a, b, c = fit_linear(algebraic, u * u + v * v).values
    theta = np.array([a, b, np.sqrt(max(c + a * a + b * b, 1e-12))])
    for _ in range(50):
        along, distance = np.array([theta[0] - u, theta[1] - v]), np.hypot(u - theta[0], v - theta[1])
        jacobian = np.column_stack((*(along / np.maximum(distance, 1e-12)), -np.ones_like(u)))
        fit = fit_linear(jacobian, theta[2] - distance)
        theta, step = theta + fit.values, fit.values
        if not np.isfinite(theta).all() or abs(theta[2]) > 1e4:
            return None  # a line
        if np.abs(step).max() < 1e-10:
            break
    residual = np.hypot(u - theta[0], v - theta[1]) - theta[2]
    variance = float(residual @ residual) / (len(u) - 3)
    covariance = fit.normal[:2, :2] * variance * _correlated(residual)
    centre = float(theta[0] * size + middle[0]), float(theta[1] * size + middle[1])
    return Circle(centre, float(theta[2]) * size, float(np.sqrt(variance)) * size, covariance * size**2, line * size)


def _correlated(residual: Array) -> float:
    """Factor of a variance by residuals that are correlated from row to row, as a process of first order is."""
    power = float(residual @ residual)
    lag = float(residual[1:] @ residual[:-1]) / power if power > 0 else 0.0
    lag = min(max(lag, 0.0), 0.99)
    return (1 + lag) / (1 - lag)


def with_angle(table: Table, rig: Rig, name: str) -> tuple[Table, tuple[Finding, ...]]:
    """The table with the column `ANGLE` of the mark that [log] point names, and what was found of pivot and picture.

    As it is where [log] names no point, or where swingid wrote the file. Raises InputError for columns that are not
    there, and for a mark whose pivot is neither stated nor seen.
    """
    log = rig.log
    if log.point is None or ANGLE in table.columns:
        return table, ()
    x, y = (_column(table, column, "point", name) for column in log.point)
    if len(x) != len(y):
        raise InputError(f"{name}: {log.point[0]!r} and {log.point[1]!r} differ in length.", code="unequal-length")
    x, y, unseen = _seen(table, log.point, x, y)
    x[~np.isfinite(x)] = y[~np.isfinite(y)] = np.nan
    pivot, spread, words = _pivot(table, log, x, y, name)
    down, how = _down(log, x - pivot[0], y - pivot[1])
    along, across = (x - pivot[0]) * down[0] + (y - pivot[1]) * down[1], _across(down, x - pivot[0], y - pivot[1])
    angle = np.arctan2(across, along)
    good = np.isfinite(angle)
    angle[good] = np.unwrap(angle[good])
    lever = float(np.nanmedian(np.hypot(along, across)))
    cosine, sine = spread(down) if lever > 0 else (0.0, 0.0)
    text = f"the angle is that of the point ({log.point[0]!r}, {log.point[1]!r}) about {words}; {how}."
    findings = [Finding("angle-of-point", text, "note", of_zero=UPRIGHT, of_pivot=(cosine / lever, sine / lever))]
    if unseen:
        text = f"in {unseen} of {len(x)} rows the likelihood of the point is below {LIKELIHOOD:g}; they are left out."
        findings.append(Finding("point-not-seen", text, "note", "blanks"))
    return replace(table, columns={**table.columns, ANGLE: angle}), tuple(findings)


def _column(table: Table, column: str, key: str, name: str) -> Array:
    """The numbers of a column; InputError where it is not there."""
    name_in_table = table.find(column)
    if name_in_table is None:
        listed = ", ".join(repr(header[:40]) for header in list(table.columns)[:8])
        text = f"{name} has no column {column!r} but {listed}; set [log] {key} to the columns of x and y."
        raise InputError(text, code="missing-column")
    return table.numbers(name_in_table)[0].copy()


def _seen(table: Table, point: tuple[str, str], x: Array, y: Array) -> tuple[Array, Array, int]:
    """The point with NaN where its tracker did not see it, by the column of its likelihood if there is one."""
    stem = point[0].removesuffix("x")
    column = table.find(f"{stem}likelihood") if stem != point[0] else None
    if column is None:
        return x, y, 0
    likelihood = table.numbers(column)[0]
    if len(likelihood) != len(x):
        return x, y, 0
    with np.errstate(invalid="ignore"):
        lost = likelihood < LIKELIHOOD
    x[lost] = y[lost] = np.nan
    return x, y, int(np.count_nonzero(lost))


def _pivot(
    table: Table, log: LogConventions, x: Array, y: Array, name: str
) -> tuple[Sequence[Array | float], Spread, str]:
    """Place of the pivot, a function from the hanging direction to its standard uncertainties, and words.

    Stated as a place or a second mark it is exact here: the kind of the sensor declares how far a mark may be off.
    """
    if log.pivot is not None and isinstance(log.pivot[0], str):
        there = [_column(table, str(column), "pivot", name) for column in log.pivot]
        if len(there[0]) != len(x) or len(there[1]) != len(x):
            raise InputError(f"{name}: the columns of [log] pivot and point differ in length.", code="unequal-length")
        return there, lambda down: (0.0, 0.0), f"the mark ({log.pivot[0]!r}, {log.pivot[1]!r})"
    if log.pivot is not None:
        return log.pivot, lambda down: (0.0, 0.0), f"the stated pivot ({log.pivot[0]:g}, {log.pivot[1]:g})"
    circle = circle_through(x, y)
    if circle is None or not circle.is_arc:
        far = "no circle fits it" if circle is None else f"it scatters {circle.scatter:.3g} about a circle"
        text = f"{name}: the point ({log.point[0]!r}, {log.point[1]!r}) shows no pivot, for {far}"  # type: ignore[index]
        text += "; log wider swings, or state [log] pivot: its place [x, y], or the columns of a mark on it."
        raise InputError(text, code="no-pivot")

    def spread(down: tuple[float, float]) -> tuple[float, float]:
        across = np.array((-down[1], down[0]))
        sizes = [float(np.sqrt(direction @ circle.covariance @ direction)) for direction in (across, np.array(down))]
        return sizes[0], sizes[1]

    size = float(np.sqrt(np.trace(circle.covariance)))
    words = f"({circle.centre[0]:.4g}, {circle.centre[1]:.4g}) ± {size:.2g}, the centre of its arc of radius "
    return circle.centre, spread, f"{words}{circle.radius:.4g}, from which it scatters {circle.scatter:.2g}"


def _down(log: LogConventions, x: Array, y: Array) -> tuple[tuple[float, float], str]:
    """The direction in the picture in which the body hangs, and how that is known."""
    if log.point_down is not None:
        return DIRECTIONS[log.point_down], f"{log.point_down} is down, as stated"
    middle = float(np.nanmedian(x)), float(np.nanmedian(y))
    best = max(DIRECTIONS, key=lambda key: DIRECTIONS[key][0] * middle[0] + DIRECTIONS[key][1] * middle[1])
    return DIRECTIONS[best], f"{best} is down, where the point mostly is (else state [log] point_down)"


def _across(down: tuple[float, float], x: Array, y: Array) -> Array:
    """The place to the right of the direction down: x where y counts up or down, else y."""
    return x if down[1] else (-y if down[0] > 0 else y)


def pivot_of(findings: tuple[Finding, ...]) -> tuple[float, float] | None:
    """Standard deviations (rad) of cosine and sine part of an angle by the pivot that was fitted to its mark."""
    return next((finding.of_pivot for finding in findings if finding.of_pivot is not None), None)


def pairs(names: Mapping[str, object]) -> list[tuple[str, str]]:
    """Pairs of names that differ in one letter, x and y: "bob x" and "bob y", "pixelx" and "pixely"."""
    paired = []
    for name in names:
        for at, letter in enumerate(name):
            other = name[:at] + {"x": "y", "X": "Y"}.get(letter, "") + name[at + 1 :]
            if letter in "xX" and other in names:
                paired.append((name, other))
    return paired
