"""Torques that depend on the angle and are no terms of the rig: a cable, a spring, magnets.

They bias all methods alike, for the motion confuses them with inertia and gravity, not the way in which a method turns
the balance into equations. So one balance, that of momentum, is fitted with and without them (`place_fits`), and the
difference counts for every method.
"""

from __future__ import annotations

import math

import numpy as np

from swingid.balance.systematics import PlaceFit
from swingid.checks.closure import share_left
from swingid.checks.hypothesis import Evidence, Finding, Judged
from swingid.format import number, percent
from swingid.model.terms import is_spring
from swingid.numerics.regression import fit_linear
from swingid.uncertainty.significance import BETTER, CERTAIN_RATIO, DETECTED

LINEAR = 1e-3
"""Share of a torque that is no linear function of the angle, up to which it is one: friction, gravity's sine, noise and
the rounding of two columns leave more of any that was measured."""

HIDES = 5.0
"""Change of the inertia by a torque of the angle over the share of it that the balance leaves open.

It was 1 to 23, in the middle 3, on 21 foreign logs with such a torque, and 17 of a base that rolls. What is left beside
the torque that was found may do as much again.
"""

PLACE = "torque that depends on the angle"
"""Source of `place_torque` in the budget."""


def torque_computed(evidence: Evidence) -> list[Finding] | None:
    """Return whether the torque is a linear function of the angle: computed with it, as a spring in software is."""
    log = evidence.part.log
    if log.torque is None or not np.ptp(log.torque):
        return None
    line = fit_linear(np.column_stack([log.angle, np.ones(len(log))]), log.torque)
    if float(np.std(line.residuals)) > LINEAR * float(np.std(log.torque)):
        return []
    equation = evidence.law.equation
    unit = equation.shown("N/m" if equation.linear else "N m/rad")
    text = (
        f"the torque is the angle times {number(float(line.values[0]), unit)} to {LINEAR:.1%}, so it was computed, "
        "and is no measurement: the inertia follows from this factor and the frequency alone; log the torque itself."
    )
    return [Finding(0.0 if log.drive_held else math.inf, text)]


def place_found(evidence: Evidence, judged: Judged) -> list[Finding] | None:
    """Return whether a torque that depends on the angle, which no term of the rig has, biases the inertia.

    Not where gravity is unknown as well, which at one frequency takes the part of a spring.
    """
    if evidence.law.equation.seeks("gravity_torque"):
        return None
    sharpest: dict[str, PlaceFit] = {}
    for fit in evidence.place:  # what windows that distinguish it better do not show is lack of fit of the friction
        if fit.kind not in sharpest or fit.variance < sharpest[fit.kind].variance:
            sharpest[fit.kind] = fit
    significant = max(filter(_is_certain, sharpest.values()), key=lambda fit: abs(fit.difference), default=None)
    if significant is None:
        return []
    hidden = HIDES * share_left(significant.more) * significant.more.a11
    contained = judged.contains(significant.difference) and judged.contains(hidden)
    key = "axis.stiffness" if evidence.law.equation.linear else "axis.stiffness or axis.cogging"
    text = (
        "a torque that depends on the angle, as of a cable, a spring or magnets, would reduce the residuals of the "
        f"balance to {_ratio(significant):.0%} and change the inertia by as much as "
        f"{percent(significant.difference / significant.plain.inertia, sign=True)}"
        f"{', which the interval contains' if contained else ''}; remove it, or state {key}."
    )
    return [Finding(significant.difference, text, contained)]


def _ratio(fit: PlaceFit) -> float:
    """Residuals with the torque over those without it, root mean square."""
    return float(np.sqrt(np.mean(fit.more.fit.residuals**2) / np.mean(fit.plain.fit.residuals**2)))


def _is_certain(fit: PlaceFit) -> bool:
    """Return whether the torque explains the residuals, and its change of the inertia is significant."""
    extra, ratio = len(fit.more.declared) - len(fit.plain.declared), _ratio(fit)
    freedom = fit.more.independent - len(fit.more.unknowns) - extra
    if not 0 < ratio < BETTER or (ratio**-2 - 1) * freedom / extra < CERTAIN_RATIO:
        return False
    return bool(abs(fit.difference) >= DETECTED * fit.variance**0.5)


def spring_not_stated(evidence: Evidence, judged: Judged) -> list[Finding]:
    """A note where a spring is not stated, and this motion does not distinguish it from inertia and gravity.

    That is where its posterior adds more than the standard uncertainty to the inertia. Rotary axes only.
    """
    signals, equation = evidence.signals, evidence.law.equation
    springs = [fit for fit in evidence.place if fit.kind == "spring"]
    sharpest = min(springs, key=lambda fit: fit.variance, default=None)
    stated = any(is_spring(item.term) for item in equation.conservative)
    if sharpest is None or stated or signals.linear or equation.seeks("gravity_torque"):
        return []
    spring = sharpest.more.declared[-1]
    if abs(float(spring.shifts[0])) <= judged.limits["alone"]:
        return []
    effect = float(sharpest.plain.fit.influence[0] @ spring.item.rows) * 0.01 * abs(equation.value("gravity_torque"))
    text = (
        "axis.stiffness is not stated, so no spring (cable, band) is assumed to act; this motion does not distinguish "
        "one from inertia and gravity: 1 % of the gravity torque per rad is an error of "
        f'{percent(effect / evidence.law.inertia, sign=True)}; state axis.stiffness = "0 ± x" (N m/rad) where one may '
        "act."
    )
    return [Finding(0.0, text)]
