"""Zero and scale of the angle from the shape of gravity.

Zero: gravity about another zero, b sin(q1 − δ), leaves −b δ cos q1 in equation (I). Scale: counts per turn, unit, or a
gear between axis and encoder.

Gravity is b sin q of the true angle q = s q_m, which no other scale of a logged angle q_m turns into a sine. With
a11 s q_m'' + b sin(s q_m) + F = −a12 q2'' (or the torque) and b free, s depends on the scales of neither drive nor
gravity; in a free decay, a11 q_m'' + b sin(s q_m)/s + F/s = 0, it is what the period's dependence on the amplitude
shows. Small swings do not determine s.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swingid.balance.covariance import LAG, sensor_variance
from swingid.balance.fits import WindowFit, columns_of, known_side
from swingid.balance.rows import Signals
from swingid.balance.systematics import place_fits
from swingid.checks.answer import CLEARLY
from swingid.checks.hypothesis import Evidence, Finding, Judged
from swingid.checks.stated import AS_GOOD, AS_SHARP
from swingid.format import number, percent, plus_minus
from swingid.model.equation import SOUGHT, Equation
from swingid.numerics.arrays import Array
from swingid.numerics.once import once
from swingid.numerics.regression import LinearFit, fit_linear
from swingid.numerics.test_functions import project
from swingid.preparation.zero import centre_of
from swingid.uncertainty.dark import dark_uncertainty
from swingid.uncertainty.significance import CERTAIN, DETECTED, INDICATED

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

ZERO = "zero of the angle"
"""Source of `zero_entry` in the budget."""

OFFSETS = 3
"""The same for the offset of the angle."""

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


def scale_off(evidence: Evidence, judged: Judged) -> list[Finding] | None:
    """Return whether the shape of gravity contradicts the scale of the angle, and the inertia is biased by it.

    Not where a torque that depends on the angle describes the rows clearly better.
    """
    law, signals = evidence.law, evidence.signals
    if signals.linear or not law.value("gravity_torque"):
        return None
    searched = ((fit, *pair) for fit in evidence.tried if (pair := search_scale(fit, signals)) is not None)
    every = sorted(searched, key=lambda of_fit: of_fit[2] / of_fit[1])
    sharpest, scale = next(((fit, at) for fit, s, u in every if (at := scale_at(fit, signals, s, u))), (law, None))
    if scale is None:
        return None
    if not judged.matters(scale.a11 - law.a11, "angle"):
        return []
    for fit, s, u in every:
        off = (s - 1) * np.sign(scale.value - 1)
        within = off <= (CERTAIN if fit is sharpest else DETECTED) * u
        if within and u / s < AS_SHARP * scale.relative and scale_at(fit, signals, s, u) is not None:
            return []
    if scale.left > CLEARLY * scale.plain:  # friction that no term describes leaves 0.55 and more (foreign logs)
        return []
    if any(AS_GOOD * _rms(torque.more.fit) < scale.left for torque in place_fits(sharpest, signals)):
        return []
    text = (
        f"gravity has the shape of the sine of {plus_minus(scale.value, scale.u)} times the angle as read"
        f"{_likely(scale)}, with which "
        f"the residuals of the balance fall to {percent(scale.left / scale.plain)} and the inertia would be "
        f"{number(scale.a11 - law.equation.carried, law.equation.shown(law.equation.unit))}: angle_unit under [log], "
        "sensors.counts_per_turn or a gear between axis and encoder is wrong, or a torque that depends on the angle, "
        "as of a cable, a spring or magnets, has this shape; correct the one, or state the other."
    )
    return [Finding(scale.a11 - law.a11, text)]


def _likely(scale: AngleScale) -> str:
    """Clause on the usual mistake that gives this scale; empty where none does."""
    off = {factor: abs(scale.value - factor) / scale.u for factor in USUAL}
    nearest = min(off, key=lambda factor: off[factor])
    return f" ({USUAL[nearest]})" if off[nearest] < INDICATED else ""


@once
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


@once
def scale_at(fit: WindowFit, signals: Signals, s: float, spread: float) -> AngleScale | None:
    """What follows from a scale s; None where it does not reduce the residuals."""
    sine = fit.rows["gravity_torque"] if s == 1.0 else _integrals(fit, signals, np.sin(s * signals.angle))[0]
    plain = _rms(_scaled(fit, fit.rows["gravity_torque"], 1.0))
    as_found, stated = _rms(_scaled(fit, sine, s)), _scaled(fit, sine, s, equation=fit.equation)
    a11 = float(stated.values[0]) / (s if _is_driven(fit) else 1.0)
    return AngleScale(s, spread, a11, as_found, plain) if as_found <= plain else None


def _step(fit: WindowFit, signals: Signals, s: float) -> tuple[float, float]:
    """Gauss–Newton step of the scale from s, and its standard uncertainty."""
    if s == 1.0:
        sine, slope = fit.rows["gravity_torque"], _integrals(fit, signals, signals.angle * signals.cosine)[0]
    else:
        angle = signals.angle
        sine, slope = _integrals(fit, signals, np.sin(s * angle), angle * np.cos(s * angle))
    solved = _scaled(fit, sine, s, slope if _is_driven(fit) else slope / s - sine / s**2)
    influence, b = solved.influence[-1], fit.value("gravity_torque")
    if _is_driven(fit):  # of the fit without the slope (Kaufman 1975), for far from s both mix
        b = float(
            solved.values[1]
            - (solved.influence[1] @ influence) / max(influence @ influence, 1e-300) * solved.values[-1]
        )
    if b <= 0:
        return np.nan, np.nan
    # at least by noise of the sensors: residuals may be smaller, as of a log that is prescribed
    sensor, _ = sensor_variance(fit.rows, influence, fit.coefficients | {"gravity_torque": b}, fit.noise)
    data = LinearFit(solved.values, solved.residuals, influence[None], solved.condition)
    spread = float(np.sqrt(max(float(data.covariance(LAG)[0, 0]), sensor)))
    return float(solved.values[-1]) / b, spread / b


def _is_driven(fit: WindowFit) -> bool:
    return fit.equation.driven


def _scaled(
    fit: WindowFit, sine: Array, s: float, more: Array | None = None, equation: Equation | None = None
) -> LinearFit:
    """The windows fitted with ∫φ sin(s q), under a drive with the gravity torque free where no equation is given.

    The first value is a11 s under a drive and a11 in a free decay, whose equation is divided by s.
    """
    free = fit.equation.but(gravity_torque=SOUGHT) if _is_driven(fit) else fit.equation
    return _refitted(fit, equation or free, sine if _is_driven(fit) else sine / s, more, fit.friction)


def _refitted(
    fit: WindowFit, equation: Equation, sine: Array, more: Array | None, friction: tuple[str, ...]
) -> LinearFit:
    """The windows fitted with another integral of the sine, and a further regressor `more`, the last."""
    rows = fit.rows.beside({"gravity_torque": sine})
    _, columns = columns_of(rows, equation, friction)
    # what the fit explains by declared imperfections, such as α cos q, remains theirs
    target = known_side(rows, equation) + fit.explained
    return fit_linear(columns if more is None else np.column_stack([columns, more]), target)


def _integrals(fit: WindowFit, signals: Signals, *functions: Array) -> Array:
    """∫φ f of functions at the nodes, (functions, windows)."""
    windows = fit.rows.windows
    return project(signals.nodes, [(function, 0) for function in functions], windows.centres, windows.half).T


def _rms(fit: LinearFit) -> float:
    return float(np.sqrt(np.mean(fit.residuals**2)))


@dataclass(frozen=True)
class _Offset:
    """δ of the angle in rad with its standard uncertainty, a11 with δ corrected, sum of squared residuals."""

    value: float
    spread: float
    a11: float
    left: float

    @property
    def certain(self) -> bool:
        """Return whether the offset is significant."""
        return bool(CERTAIN * self.spread < abs(self.value) < np.pi / 2)

    def unexplained(self, a11: float, u: float) -> float:
        """Standard uncertainty that an a11 of standard uncertainty u has by it."""
        change = self.a11 - a11
        return dark_uncertainty(change, (change * self.spread / self.value) ** 2, u) if self.value else 0.0


def zero_off(evidence: Evidence, judged: Judged) -> list[Finding] | None:
    """Return whether the zero offset of the angle is so large that the inertia is biased.

    cos q1 oscillates at twice the motion's frequency, so
    it is distinguishable from inertia and odd friction. Friction that depends on the direction does so too; small
    swings of one frequency do not distinguish the two, and then both are named. The turning points of a free decay do
    not depend on the model of its friction: what their centre contradicts is no offset of the angle.
    """
    law, signals = evidence.law, evidence.signals
    if not law.equation.value("gravity_torque") or signals.linear:
        return None
    zero, unless = _offset(law, signals), ""
    if not (zero.certain and judged.matters(zero.a11 - law.a11, "angle")):
        zero = _offset(law, signals, without="viscous_even")
        if not zero.certain or zero.left > AS_GOOD * law.lost:
            return []
        unless = ", unless it is friction that depends on the direction, which is not distinguishable in this motion"
    centre = None if _is_driven(law) else centre_of(signals.motion.turning_angles)
    if centre is not None and abs(zero.value - centre[0]) > INDICATED * np.hypot(zero.spread, centre[1]):
        return []
    effect = percent((zero.a11 - law.a11) / law.inertia, sign=True)
    offset = plus_minus(zero.value, zero.spread, "rad")
    text = (
        f"0 of the angle seems to lie {offset} beside the hanging position{unless}; "
        f"the correction changes the inertia by {effect}, so subtract {number(zero.value, 'rad')} from the angle."
    )
    return [Finding(zero.a11 - law.a11, text)]


def zero_entry(evidence: Evidence, u: float) -> float:
    """Standard uncertainty of a11 by a zero of the angle that is not the hanging position.

    It is the unexplained difference to the fit with the zero free, which swings to both sides hardly notice. Also in
    the place of friction that depends on the direction, where that describes the rows as well. A free decay has its
    zero from the centre of its swings, see `preparation.zero`.
    """
    law, signals = evidence.law, evidence.signals
    if not law.equation.value("gravity_torque") or signals.linear or not _is_driven(law):
        return 0.0
    plain, other = _offset(law, signals), _offset(law, signals, without="viscous_even")
    as_good = other.left <= AS_GOOD * law.lost
    return max(offset.unexplained(law.a11, u) for offset in ((plain, other) if as_good else (plain,)))


@once
def _offset(law: WindowFit, signals: Signals, without: str = "") -> _Offset:
    """δ of the angle from the rows of a fit; one round where there is none.

    without: the name of a term of friction that is left out.
    """
    friction = tuple(name for name in law.friction if name != without)
    sine, cosine, b = law.rows["gravity_torque"], _cosine(law, signals), law.value("gravity_torque")
    offset, spread = 0.0, 0.0
    for _ in range(OFFSETS):
        if offset:
            sine, cosine = _integrals(law, signals, np.sin(signals.angle - offset), np.cos(signals.angle - offset))
        fit = _refitted(law, law.equation, sine, cosine, friction)
        offset -= float(fit.values[-1]) / b
        spread = float(np.sqrt(fit.covariance(LAG)[-1, -1])) / b
        if abs(offset) < CERTAIN * spread:
            break
    return _Offset(offset, spread, float(fit.values[0]), float(fit.residuals @ fit.residuals))


@once
def _cosine(law: WindowFit, signals: Signals) -> Array:
    """∫φ cos q1, what a zero offset adds to gravity (windows,)."""
    cosine: Array = _integrals(law, signals, signals.cosine)[0]
    return cosine
