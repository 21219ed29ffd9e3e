"""The scale of the angle from the shape of gravity: counts per turn, unit, or a gear between axis and encoder.

Gravity is b sin q of the true angle q = s q_m, which no other scale of a logged angle q_m turns into a sine. With
a11 s q_m'' + b sin(s q_m) + F = −a12 q2'' (or the torque) and b free, s depends on the scales of neither drive nor
gravity; in a free decay, a11 q_m'' + b sin(s q_m)/s + F/s = 0, it is what the period's dependence on the amplitude
shows. Small swings do not determine s.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from swingid.balance.fits import LAG, WindowFit, columns_of, known_side, sensor_variance
from swingid.balance.rows import Signals
from swingid.balance.systematics import SLOPE, place_fits, shape_columns
from swingid.checks.answer import CLEARLY, LEAST
from swingid.checks.ran import ran
from swingid.checks.stated import AS_GOOD, AS_SHARP
from swingid.format import number, percent, plus_minus
from swingid.model.equation import SOUGHT, Equation
from swingid.numerics.arrays import Array
from swingid.numerics.regression import LinearFit, fit_linear
from swingid.numerics.test_functions import project
from swingid.result.result import Message
from swingid.uncertainty.significance import CERTAIN, DETECTED, INDICATED, MATTERS

SCALE = "angle-scale"

USUAL = {
    180 / np.pi: "the log is in rad, not in deg",
    np.pi / 180: "the log is in deg, not in rad",
    360.0: "the log is in turns, not in deg",
    2 * np.pi: "the log is in turns, not in rad",
    2.0: "counts_per_turn is stated twice as large",
    4.0: "counts_per_turn is stated four times as large",
    0.5: "counts_per_turn is stated at half, as where both edges count",
    0.25: "counts_per_turn is stated at a quarter, as of the lines of a quadrature encoder",
}
"""Scales that usual mistakes give, with the mistake."""

ROUNDS = 12
"""Gauss–Newton steps, each at most by a factor of two: enough for degrees that are stated for radians."""

SETTLED = 0.1
"""Of the standard uncertainty: a step that ends the search."""


@dataclass(frozen=True)
class AngleScale:
    """True angle over logged angle with its standard uncertainty, the inertia a11 with it, and the residuals.

    a11: with the gravity torque as stated. left: root mean square of the residuals; plain: of those with the scale 1.
    """

    value: float
    u: float
    a11: float
    left: float
    plain: float

    @property
    def relative(self) -> float:
        """Relative standard uncertainty."""
        return self.u / self.value


def check_angle_scale(
    law: WindowFit, tried: Iterable[WindowFit], signals: Signals, uncertainty: float
) -> list[Message]:
    """A warning where the shape of gravity contradicts the scale of the angle, and the inertia is biased by it.

    tried: fits of windows of every length. uncertainty: the inertia's, without conflicts with the rig file. Not where
    a torque that depends on the angle describes the rows clearly better.
    """
    if signals.linear or not law.value("gravity_torque"):
        return []
    searched = ((fit, *one) for fit in tried if (one := search_scale(fit, signals)) is not None)
    every = sorted(searched, key=lambda one: one[2] / one[1])
    for sharpest, s, u in every:
        found = scale_at(sharpest, signals, s, u)
        if found is not None:
            break
    else:
        return []
    ran("angle-scale")
    if abs(found.a11 - law.a11) <= max(MATTERS * uncertainty, LEAST * law.a11):
        return []
    for fit, s, u in every:
        off = (s - 1) * np.sign(found.value - 1)
        within = off <= (CERTAIN if fit is sharpest else DETECTED) * u
        if within and u / s < AS_SHARP * found.relative and scale_at(fit, signals, s, u) is not None:
            return []
    if found.left > CLEARLY * found.plain:  # friction that no term describes leaves 0.55 and more (foreign logs)
        return []
    if any(AS_GOOD * _rms(one.more) < found.left for one in place_fits(sharpest, signals)):
        return []
    text = (
        f"gravity has the shape of the sine of {plus_minus(found.value, found.u)} times the angle as read"
        f"{_likely(found)}, with which "
        f"the residuals of the balance fall to {percent(found.left / found.plain)} and the inertia would be "
        f"{number(found.a11 - law.equation.carried, law.equation.unit)}: angle_unit under [log], "
        "sensors.counts_per_turn or a gear between axis and encoder is wrong, or a torque that depends on the angle, "
        "as of a cable, a spring or magnets, has this shape; correct the one, or state the other."
    )
    return [Message(SCALE, text)]


def _likely(found: AngleScale) -> str:
    """Clause on the usual mistake that gives this scale; empty where none does."""
    off = {one: abs(found.value - one) / found.u for one in USUAL}
    nearest = min(off, key=lambda one: off[one])
    return f" ({USUAL[nearest]})" if off[nearest] < INDICATED else ""


def search_scale(fit: WindowFit, signals: Signals) -> tuple[float, float] | None:
    """The scale of the angle by the windows of a fit, and its uncertainty; None where they do not determine one."""
    s, spread = 1.0, np.inf
    for k in range(ROUNDS):
        step, spread = _step(fit, signals, s)
        if not np.isfinite(step + spread):
            return None
        s += float(np.clip(step, -s / 2, s))
        if abs(step) < (1.0 if k == 0 else SETTLED) * spread:
            return s, spread
    return None


def scale_at(fit: WindowFit, signals: Signals, s: float, spread: float) -> AngleScale | None:
    """What follows from a scale s; None where it does not reduce the residuals."""
    free = fit.equation.but(gravity_torque=SOUGHT) if _is_driven(fit) else fit.equation
    sine = _sine(fit, signals, s, slope=False)[0]
    before, after = _solved(fit, free, fit.rows["gravity_torque"], 1.0).residuals, _solved(fit, free, sine, s).residuals
    stated = _solved(fit, fit.equation, sine, s)
    a11 = float(stated.values[0]) / (s if _is_driven(fit) else 1.0)
    plain, left = (float(np.sqrt(np.mean(one**2))) for one in (before, after))
    return AngleScale(s, spread, a11, left, plain) if left <= plain else None


def _step(fit: WindowFit, signals: Signals, s: float) -> tuple[float, float]:
    """Gauss–Newton step of the scale from s, and its standard uncertainty."""
    sine, slope = _sine(fit, signals, s)
    free = fit.equation.but(gravity_torque=SOUGHT) if _is_driven(fit) else fit.equation
    solved = _solved(fit, free, sine, s, slope if _is_driven(fit) else slope / s - sine / s**2)
    own, b = solved.influence[-1], fit.value("gravity_torque")
    if _is_driven(fit):  # of the fit without the slope (Kaufman 1975), for far from s both mix
        b = float(solved.values[1] - (solved.influence[1] @ own) / max(own @ own, 1e-300) * solved.values[-1])
    if b <= 0:
        return np.nan, np.nan
    # at least by noise of the sensors: residuals may be smaller, as of a log that is prescribed
    sensor, _ = sensor_variance(fit.rows, own, fit.coefficients | {"gravity_torque": b}, fit.noise)
    data = LinearFit(solved.values, solved.residuals, own[None], solved.condition)
    spread = float(np.sqrt(max(float(data.covariance(LAG)[0, 0]), sensor)))
    return float(solved.values[-1]) / b, spread / b


def _is_driven(fit: WindowFit) -> bool:
    return fit.equation.drive != "none"


def _sine(fit: WindowFit, signals: Signals, s: float, *, slope: bool = True) -> Array:
    """∫φ sin(s q) and, with `slope`, its derivative by s, (2, windows)."""
    if s == 1.0:
        return np.stack([fit.rows["gravity_torque"], *(shape_columns(fit, signals)[SLOPE].T if slope else ())])
    windows, angle = fit.rows.windows, signals.angle
    columns = [(np.sin(s * angle), 0), *([(angle * np.cos(s * angle), 0)] if slope else [])]
    return project(signals.nodes, columns, windows.centres, windows.half).T


def _solved(fit: WindowFit, equation: Equation, sine: Array, s: float, more: Array | None = None) -> LinearFit:
    """The windows fitted with this sine in the place of that of the angle; more: a further regressor, the last.

    The first value is a11 s under a drive and a11 in a free decay, whose equation is divided by s.
    """
    rows = fit.rows.beside({"gravity_torque": sine if _is_driven(fit) else sine / s})
    _, columns = columns_of(rows, equation, fit.friction)
    # what the fit explains by declared imperfections remains theirs
    target = known_side(rows, equation) + fit.explained
    return fit_linear(columns if more is None else np.column_stack([columns, more]), target)


def _rms(fit: WindowFit) -> float:
    return float(np.sqrt(np.mean(fit.fit.residuals**2)))
