"""Torques that depend on the angle and are no terms of the rig: a cable, a spring, magnets.

They bias all methods alike, for the motion confuses them with inertia and gravity, not the way in which a method turns
the balance into equations. So one balance, that of momentum, is fitted with and without them (`place_fits`), and the
difference counts for every method.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from swingid.balance.fits import LAG, WindowFit
from swingid.balance.rows import Signals
from swingid.balance.systematics import PlaceFit
from swingid.checks.answer import LEAST
from swingid.checks.ran import ran
from swingid.format import percent
from swingid.model.terms import is_spring
from swingid.result.result import Message
from swingid.uncertainty.significance import BETTER, CERTAIN_RATIO, DETECTED, MATTERS

PLACE = "torque that depends on the angle"
"""Source of `place_torque` in the budget."""


def check_place(law: WindowFit, fits: Iterable[PlaceFit], total: float) -> list[Message]:
    """A warning where a torque that depends on the angle, which no term of the rig has, biases the inertia.

    total: standard uncertainty of the inertia without such torques. Not where gravity is unknown as well, which at one
    frequency takes the part of a spring.
    """
    if law.equation.seeks("gravity_torque"):
        return []
    ran("place")
    sharpest: dict[str, PlaceFit] = {}
    for one in fits:  # what windows that distinguish it better do not show is lack of fit of the friction
        if one.kind not in sharpest or one.variance < sharpest[one.kind].variance:
            sharpest[one.kind] = one
    certain = (one for one in sharpest.values() if _is_certain(one, total))
    found = max(certain, key=lambda one: abs(one.difference), default=None)
    if found is None:
        return []
    key = "axis.stiffness" if law.equation.linear else "axis.stiffness or axis.cogging"
    text = (
        "a torque that depends on the angle, as of a cable, a spring or magnets, would reduce the residuals of the "
        f"balance to {_ratio(found):.0%} and change the inertia by as much as "
        f"{percent(found.difference / found.plain.inertia, sign=True)}; remove it, or state {key}."
    )
    return [Message("place-torque", text)]


def _ratio(one: PlaceFit) -> float:
    """Residuals with the torque over those without it, root mean square."""
    return float(np.sqrt(np.mean(one.more.fit.residuals**2) / np.mean(one.plain.fit.residuals**2)))


def _is_certain(one: PlaceFit, total: float) -> bool:
    """Whether the torque explains the residuals, and changes the inertia beyond its standard uncertainty `total`."""
    extra, ratio = len(one.more.declared) - len(one.plain.declared), _ratio(one)
    freedom = len(one.more.rows.windows) / (LAG / 2) - len(one.more.unknowns) - extra
    if not 0 < ratio < BETTER or (ratio**-2 - 1) * freedom / extra < CERTAIN_RATIO:
        return False
    least = max(MATTERS * total, LEAST * abs(one.plain.a11), DETECTED * one.variance**0.5)
    return bool(abs(one.difference) >= least)


def spring_note(law: WindowFit, fits: Iterable[PlaceFit], signals: Signals, total: float) -> list[Message]:
    """A note where a spring is not stated, and this motion does not distinguish it from inertia and gravity.

    That is where its posterior adds more than the standard uncertainty `total` to the inertia. Rotary axes only.
    """
    springs = [one for one in fits if one.kind == "spring"]
    found = min(springs, key=lambda one: one.variance, default=None)
    stated = any(is_spring(term.term) for term in signals.further)
    if found is None or stated or signals.linear or law.equation.seeks("gravity_torque"):
        return []
    spring = found.more.declared[-1]
    if abs(float(spring.shifts[0])) <= total:
        return []
    effect = (
        float(found.plain.fit.influence[0] @ spring.item.rows)
        * 0.01
        * abs(law.equation.value("gravity_torque"))
        / law.inertia
    )
    text = (
        "axis.stiffness is not stated, so no spring (cable, band) is assumed to act; this motion does not distinguish "
        f"one from inertia and gravity: 1 % of the gravity torque per rad is an error of {percent(effect, sign=True)}; "
        'state axis.stiffness = "0 ± x" (N m/rad) where one may act.'
    )
    return [Message("spring-not-stated", text)]
