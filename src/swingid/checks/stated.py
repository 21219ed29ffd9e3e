"""What the rig file states and the balance contradicts: ideal encoders, and the gravity torque.

Each is a systematic error, equal at every swing, that the scatter of the windows does not contain.

Encoders: an undeclared once-per-turn nonlinearity leaves residuals that two more columns per encoder describe.
Gravity: with the gravity torque fitted the drive alone is the scale reference, so where the motion distinguishes the
two, an error of the torque constant, the wheel's inertia, the angle's unit or the clock gives another gravity torque.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from swingid.balance.errors import bends
from swingid.balance.fits import ROUNDING, WindowFit, residuals_beside, with_declared, with_gravity_free
from swingid.balance.perturbations import BENDS
from swingid.balance.rows import Signals
from swingid.balance.systematics import gravity_conflict, leaves_no_inertia, left_by_place
from swingid.checks.hypothesis import Evidence, Finding
from swingid.format import number, percent, plus_minus
from swingid.model.rig import Rig
from swingid.model.terms import is_spring, rig_terms
from swingid.numerics.arrays import Array
from swingid.preparation.encoders import Encoders
from swingid.uncertainty.significance import BETTER, CERTAIN, CERTAIN_RATIO, DETECTED

CONFLICT = "conflict of the gravity torque with the log"
"""Source of `gravity_conflict` in a budget."""

WIDE = 0.5 * np.pi / 180
"""Prior standard deviation (rad) of a nonlinearity where nothing is declared."""

AMPLITUDES = 4
"""Further unknowns: cosine and sine of each encoder."""

AS_SHARP = 2.0
"""Windows of another length are compared where their uncertainty is larger by at most this factor."""

AS_GOOD = 1.2
"""Ratio of sums of squares up to which two models fit the rows equally well."""


def encoders_bent(evidence: Evidence) -> list[Finding] | None:
    """Return whether an undeclared once-per-turn nonlinearity of the encoders is significant.

    Not where gravity is unknown as well, whose column is nearly that of a nonlinearity, not where a torque that depends
    on the angle explains the residuals better, and not where the angle is the integral of a rate.
    """
    law, signals, rig = evidence.law, evidence.signals, evidence.part.rig
    equation, encoders = law.equation, signals.encoders
    if signals.linear or not equation.driven or equation.seeks("gravity_torque") or _stated_or_usual(evidence):
        return None
    if encoders.level is not None or not _may_show(law, signals):
        return None
    declared = signals.declaring(Encoders.of(rig.changed({"sensors.nonlinearity": WIDE})))
    bent = with_declared(replace(law, declared=()), rig, declared)
    before, after = (float(np.mean(residuals_beside(fit, _uncertain(law)) ** 2)) for fit in (law, bent))
    if not _shows(law, before, after) or after > AS_GOOD * left_by_place(law, signals, _uncertain(law)):
        return []
    text = (
        "a once-per-turn nonlinearity of the encoders, which the rig file does not declare, would reduce the residuals "
        f"of the balance to {np.sqrt(after / before):.0%} and make the inertia "
        f"{plus_minus(bent.inertia, bent.total, equation.shown(equation.unit))}; declare sensors.nonlinearity, such as "
        '"0.1 deg", or calibrate the encoders.'
    )
    return [Finding(max(abs(bent.a11 - law.a11), bent.total), text)]


def _stated_or_usual(evidence: Evidence) -> bool:
    """Return whether the nonlinearity of the axis' encoder is stated, or as large as its kind has it."""
    if not evidence.signals.encoders.angle.bent:
        return False
    if not evidence.signals.encoders.angle.assumed:
        return True
    shifts = (effect.value for effect in evidence.law.declared if effect.item.of.shape in BENDS)
    return all(abs(value) < CERTAIN for value in shifts)


def _shows(law: WindowFit, before: float, after: float) -> bool:
    """Return whether a fall of the residuals' power is large and significant."""
    # without a nonlinearity 0.95 of the residuals and more remain
    freedom = law.independent - len(law.unknowns) - AMPLITUDES
    if not before > ROUNDING**2 * float(np.mean(law.known**2)):
        return False  # these are residuals of the arithmetic
    return 0 < after < BETTER**2 * before and (before / after - 1) * freedom / AMPLITUDES >= CERTAIN_RATIO


def _may_show(law: WindowFit, signals: Signals) -> bool:
    """Return whether the residuals would fall enough without a prior of the amplitudes: quick, and a necessary
    condition.
    """
    bent, constants = bends(law.rows, signals, law.coefficients), _uncertain(law)
    before, after = (residuals_beside(law, more) for more in (constants, np.hstack([constants, bent])))
    return _shows(law, float(np.mean(before**2)), float(np.mean(after**2)))


def _uncertain(law: WindowFit) -> Array:
    """Columns (rows, n) of the constants that are stated with an uncertainty, which explain residuals as well."""
    columns = [effect.item.rows for effect in law.declared if not effect.item.of.fitted]
    return np.array(columns).reshape(len(columns), len(law.rows)).T


def gravity_off(law: WindowFit, tried: Iterable[WindowFit], signals: Signals, rig: Rig) -> list[Finding] | None:
    """Return whether the balance contradicts `axis.gravity_torque`; tried: the same fit at other lengths of windows."""
    stated, equation = rig.axis.acting_gravity, law.equation
    if stated is None or equation.seeks("gravity_torque") or not equation.driven or signals.linear:
        return None
    free = with_gravity_free(law, rig, signals)
    if free is None:
        return []
    b, spread = free.value("gravity_torque"), free.total_of("gravity_torque")
    for other in (with_gravity_free(fit, rig, signals) for fit in (law, *tried)):
        if other is None or other.total_of("gravity_torque") >= AS_SHARP * spread:
            continue
        off = other.value("gravity_torque") - stated.value
        known = np.hypot(other.total_of("gravity_torque"), stated.std or 0.0)
        if off * (b - stated.value) <= 0 or abs(off) <= DETECTED * known:
            return []
    if free.a11 <= 0 or (stated.value and leaves_no_inertia(free)):
        return []
    given, unit = plus_minus(b, spread, equation.shown(equation.torque_unit)), equation.shown(equation.unit)
    if not stated.value:
        text = (
            f"the balance gives a gravity torque of {given}, but the rig file gives none; with it the inertia is "
            f"{number(free.inertia, unit)}: give "
            'axis.gravity_torque, a number or "unknown", or the spring that acts like it.'
        )
        return [Finding(free.a11 - law.a11, text)]
    if b <= 0:
        others = [term.term.key for term in rig_terms(rig) if term.value is not None and is_spring(term.term)]
        text = (
            f"the balance gives a gravity torque of {given}, which no body has, and with it the inertia "
            f"{number(free.inertia, unit)}: {' or '.join(others) or 'a torque of the angle that is stated'} "
            "is too large, or the sign of the drive is wrong; correct it, or state it with its uncertainty."
        )
        return [Finding(free.a11 - law.a11, text)]
    drive = "log.torque_gain" if "torque" in equation.coefficients else "drive.wheel.inertia (with rotor and gear)"
    by_drive, by_gravity = (number(a11 - equation.carried, unit) for a11 in (free.a11, free.a11 * stated.value / b))
    text = (
        f"the balance gives a gravity torque of {given}, "
        f"{_against(b / stated.value)} axis.gravity_torque: one of {drive}, "
        f"axis.gravity_torque, the angle's unit and the clock is wrong; the inertia is {by_drive} if the drive's scale "
        f"is right, {by_gravity} if gravity is; state the one that may be wrong with its uncertainty."
    )
    return [Finding(free.a11 - law.a11, text)]


def conflict(evidence: Evidence, u: float) -> float:
    """Standard uncertainty of the inertia by a conflict of the gravity torque with the log, see `gravity_conflict`."""
    return gravity_conflict(evidence.law, evidence.part.rig, evidence.signals, u)


def _against(ratio: float) -> str:
    """A ratio in words, before what it is compared with."""
    if 0.1 < ratio < 10:
        return f"{percent(ratio - 1, sign=True)} from"
    return f"{number(ratio, digits=3)} times"
