"""What the rig file states and the balance contradicts: ideal encoders, the gravity torque, the zero of the angle.

Each is a systematic error, equal at every swing, that the scatter of the windows does not contain.

Encoders: an undeclared once-per-turn nonlinearity leaves residuals that two more columns per encoder describe.
Gravity: with the gravity torque fitted the drive alone is the scale reference, so where the motion distinguishes the
two, an error of the torque constant, the wheel's inertia, the angle's unit or the clock gives another gravity torque.
Zero: gravity about another zero, b sin(q1 − δ), leaves −b δ cos q1 in equation (I).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from swingid.balance.errors import bends
from swingid.balance.fits import (
    LAG,
    ROUNDING,
    WindowFit,
    columns_of,
    known_side,
    residuals_beside,
    with_declared,
    with_gravity_free,
)
from swingid.balance.rows import Signals
from swingid.balance.systematics import COSINE, left_by_place, shape_columns
from swingid.checks.answer import LEAST
from swingid.checks.ran import ran
from swingid.format import number, percent, plus_minus
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.numerics.regression import fit_linear
from swingid.numerics.test_functions import project
from swingid.preparation.encoders import Encoders
from swingid.preparation.zero import centre_of
from swingid.recording.findings import Kind
from swingid.result.result import Message
from swingid.uncertainty.significance import BETTER, CERTAIN, CERTAIN_RATIO, DETECTED, INDICATED, MATTERS

WIDE = 0.5 * np.pi / 180
"""Prior standard deviation (rad) of a nonlinearity where nothing is declared."""

AMPLITUDES = 4
"""Further unknowns: cosine and sine of each encoder."""

AS_SHARP = 2.0
"""Windows of another length are compared where their uncertainty is larger by at most this factor."""

ROUNDS = 3
"""Gauss–Newton steps for the offset of the angle."""

AS_GOOD = 1.2
"""Ratio of sums of squares up to which two models fit the rows equally well."""


def check_encoders(law: WindowFit, rig: Rig, signals: Signals) -> list[Message]:
    """A warning where an undeclared once-per-turn nonlinearity of the encoders is significant and biases the inertia.

    Not where gravity is unknown as well, whose column is nearly that of a nonlinearity, not where a torque that depends
    on the angle explains the residuals better, and not where the angle is the integral of a rate.
    """
    equation = law.equation
    if signals.linear or equation.drive == "none" or equation.seeks("gravity_torque") or signals.encoders.angle.bent:
        return []
    if signals.encoders.level is not None or not _may_show(law, signals):
        return []
    ran("encoders")
    declared = signals.declaring(Encoders.of(rig.changed({"sensors.nonlinearity": WIDE})))
    bent = with_declared(replace(law, declared=()), rig, declared)
    before, after = (float(np.mean(residuals_beside(fit, _uncertain(law)) ** 2)) for fit in (law, bent))
    if not _shows(law, before, after) or after > AS_GOOD * left_by_place(law, signals, _uncertain(law)):
        return []
    if max(abs(bent.a11 - law.a11), bent.total) < max(MATTERS * law.total, LEAST * law.a11):
        return []
    text = (
        "a once-per-turn nonlinearity of the encoders, which the rig file does not declare, would reduce the residuals "
        f"of the balance to {np.sqrt(after / before):.0%} and make the inertia "
        f"{plus_minus(bent.inertia, bent.total, equation.unit)}; declare sensors.nonlinearity, such as "
        '"0.1 deg", or calibrate the encoders.'
    )
    return [Message("encoder-nonlinearity", text, Kind.ENCODER_NONLINEARITY)]


def _shows(law: WindowFit, before: float, after: float) -> bool:
    """Whether a fall of the residuals' power is large and significant."""
    # without a nonlinearity 0.95 of the residuals and more remain
    freedom = len(law.rows) / (LAG / 2) - len(law.unknowns) - AMPLITUDES
    if not before > ROUNDING**2 * float(np.mean(law.known**2)):
        return False  # these are residuals of the arithmetic
    return 0 < after < BETTER**2 * before and (before / after - 1) * freedom / AMPLITUDES >= CERTAIN_RATIO


def _may_show(law: WindowFit, signals: Signals) -> bool:
    """Whether the residuals would fall enough without a prior of the amplitudes: quick, and a necessary condition."""
    bent, constants = bends(law.rows, signals, law.coefficients), _uncertain(law)
    before, after = (residuals_beside(law, more) for more in (constants, np.hstack([constants, bent])))
    return _shows(law, float(np.mean(before**2)), float(np.mean(after**2)))


def _uncertain(law: WindowFit) -> Array:
    """Columns (rows, n) of the constants that are stated with an uncertainty, which explain residuals as well."""
    columns = [effect.item.rows for effect in law.declared if not effect.item.of.fitted]
    return np.array(columns).reshape(len(columns), len(law.rows)).T


def check_gravity(
    law: WindowFit,
    tried: Iterable[WindowFit],
    signals: Signals,
    rig: Rig,
    uncertainty: float | None = None,
) -> list[Message]:
    """A warning where the balance contradicts `axis.gravity_torque` by so much that the inertia is biased.

    tried: the same fit at other lengths of windows. uncertainty: of the inertia, if not that of `law`.
    """
    stated, equation = rig.axis.acting_gravity, law.equation
    if stated is None or equation.seeks("gravity_torque") or equation.drive == "none" or signals.linear:
        return []
    ran("gravity-torque")
    found = _freed(law, signals, rig)
    if found is None:
        return []
    free, spread = found
    b = free.value("gravity_torque")
    for own in (law, *tried):
        one = found if own is law else _freed(own, signals, rig)
        if one is None or one[1] >= AS_SHARP * spread:
            continue
        off = one[0].value("gravity_torque") - stated.value
        if off * (b - stated.value) <= 0 or abs(off) <= DETECTED * np.hypot(one[1], stated.std or 0.0):
            return []
    # the disagreement of windows is no part of law.total: a wrong scale causes it
    if free.a11 <= 0 or (stated.value and b <= 0):
        return []
    apart = abs(free.a11 - law.a11)
    if apart <= max(MATTERS * (law.total if uncertainty is None else uncertainty), LEAST * law.a11):
        return []
    if not stated.value:
        text = (
            f"the balance gives a gravity torque of {plus_minus(b, spread, equation.torque_unit)}, but the rig file "
            f"gives none; with it the inertia is {number(free.a11 - equation.carried, equation.unit)}: give "
            'axis.gravity_torque, a number or "unknown", or the spring that acts like it.'
        )
        return [Message("gravity-torque-disagrees", text, Kind.GRAVITY_TORQUE)]
    drive = "log.torque_gain" if equation.drive == "direct" else "drive.wheel.inertia (with rotor and gear)"
    by_drive, by_gravity = (
        number(a11 - equation.carried, equation.unit) for a11 in (free.a11, free.a11 * stated.value / b)
    )
    text = (
        f"the balance gives a gravity torque of {plus_minus(b, spread, equation.torque_unit)}, "
        f"{_against(b / stated.value)} axis.gravity_torque: one of {drive}, "
        f"axis.gravity_torque, the angle's unit and the clock is wrong; the inertia is {by_drive} if the drive's scale "
        f"is right, {by_gravity} if gravity is; state the one that may be wrong with its uncertainty."
    )
    return [Message("gravity-torque-disagrees", text, Kind.GRAVITY_TORQUE)]


def _against(ratio: float) -> str:
    """A ratio in words, before what it is compared with."""
    if 0.1 < ratio < 10:
        return f"{percent(ratio - 1, sign=True)} from"
    return f"{number(ratio, digits=3)} times"


def _freed(fit: WindowFit, signals: Signals, rig: Rig) -> tuple[WindowFit, float] | None:
    """The same windows with the gravity torque fitted, and its standard uncertainty with all that is declared."""
    free = with_gravity_free(fit, rig, signals)
    if free is None:
        return None
    k = free.unknowns.index("gravity_torque")
    return free, float(np.sqrt(free.covariance[k, k] + sum(effect.shifts[k] ** 2 for effect in free.declared)))


@dataclass(frozen=True)
class _Offset:
    """δ of the angle in rad with its standard uncertainty, a11 with δ corrected, sum of squared residuals."""

    value: float
    spread: float
    a11: float
    left: float

    def matters(self, a11: float, uncertainty: float) -> bool:
        """Whether the offset is significant, and changes a11 by more than its interval."""
        sure = CERTAIN * self.spread < abs(self.value) < np.pi / 2
        return bool(sure and abs(self.a11 - a11) > max(MATTERS * uncertainty, LEAST * abs(a11)))


def check_zero(law: WindowFit, signals: Signals, uncertainty: float) -> list[Message]:
    """A warning where the zero offset of the angle is so large that the inertia is biased.

    uncertainty: the inertia's, with all declared imperfections. cos q1 oscillates at twice the motion's frequency, so
    it is distinguishable from inertia and odd friction. Friction that depends on the direction does so too; small
    swings of one frequency do not distinguish the two, and then both are named. The turning points of a free decay do
    not depend on the model of its friction: what their centre contradicts is no offset of the angle.
    """
    if not law.equation.value("gravity_torque") or signals.linear:
        return []
    ran("angle-zero")
    cosine = shape_columns(law, signals)[COSINE][:, 0]
    found, unless = _offset(law, signals, law.friction, cosine), ""
    if not found.matters(law.a11, uncertainty):
        less = tuple(name for name in law.friction if name != "viscous_even")
        found = _offset(law, signals, less, cosine)
        if not found.matters(law.a11, uncertainty) or found.left > AS_GOOD * float(
            law.fit.residuals @ law.fit.residuals
        ):
            return []
        unless = ", unless it is friction that depends on the direction, which is not distinguishable in this motion"
    centre = centre_of(signals.motion.turning_angles) if law.equation.drive == "none" else None
    if centre is not None and abs(found.value - centre[0]) > INDICATED * np.hypot(found.spread, centre[1]):
        return []
    effect = percent((found.a11 - law.a11) / law.inertia, sign=True)
    offset = plus_minus(found.value, found.spread, "rad")
    text = (
        f"0 of the angle seems to lie {offset} beside the hanging position{unless}; "
        f"the correction changes the inertia by {effect}, so subtract {number(found.value, 'rad')} from the angle."
    )
    return [Message("zero-off", text, Kind.ANGLE_ZERO)]


def _offset(law: WindowFit, signals: Signals, friction: tuple[str, ...], cosine: Array) -> _Offset:
    """δ of the angle from the rows of a fit, with these terms of friction beside it; one round where there is none.

    cosine: ∫φ cos q1 of every row.
    """
    equation, windows = law.equation, law.rows.windows
    assert not equation.seeks("gravity_torque")
    _, columns = columns_of(law.rows, equation, friction)
    offset, spread, rows = 0.0, 0.0, law.rows
    for _ in range(ROUNDS):
        if offset:
            angle = signals.angle - offset
            terms = [(np.cos(angle), 0), (np.sin(angle), 0)]
            cosine, sine = project(signals.nodes, terms, windows.centres, windows.half).T
            rows = law.rows.beside({"gravity_torque": sine})
        # what the fit explains by declared imperfections, such as α cos q, remains theirs
        fit = fit_linear(np.column_stack([columns, cosine]), known_side(rows, equation) + law.explained)
        offset -= float(fit.values[-1]) / equation.value("gravity_torque")
        spread = float(np.sqrt(fit.covariance(LAG)[-1, -1])) / equation.value("gravity_torque")
        if abs(offset) < CERTAIN * spread:
            break
    return _Offset(offset, spread, float(fit.values[0]), float(fit.residuals @ fit.residuals))
