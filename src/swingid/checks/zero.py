"""Is 0 of the angle where the body hangs? Gravity about another zero, b sin(q1 − δ), leaves −b δ cos q1 in row (I)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from swingid.balance.fits import LAG, WindowFit, columns_of, known_side
from swingid.balance.rows import Signals
from swingid.checks.answer import LEAST
from swingid.format import number, percent, plus_minus
from swingid.numerics.arrays import Array
from swingid.numerics.regression import fit_linear
from swingid.numerics.test_functions import project
from swingid.preparation.scale import Scale
from swingid.recording.findings import Kind
from swingid.result.result import Message
from swingid.uncertainty.significance import CERTAIN, MATTERS

ROUNDS = 3

AS_GOOD = 1.2
"""Ratio of sums of squares up to which two readings of the data explain them alike."""


@dataclass(frozen=True)
class _Offset:
    """δ of the angle in rad with its standard uncertainty, a11 with it set right, sum of squares of what is left."""

    value: float
    spread: float
    a11: float
    left: float

    def matters(self, a11: float, uncertainty: float) -> bool:
        """Whether the offset is certain, and moves a11 by more than its interval."""
        sure = CERTAIN * self.spread < abs(self.value) < np.pi / 2
        return bool(sure and abs(self.a11 - a11) > max(MATTERS * uncertainty, LEAST * abs(a11)))


def check_zero(law: WindowFit, signals: Signals, scale: Scale, uncertainty: float) -> list[Message]:
    """A warning where the angle's zero is off by so much that the inertia suffers.

    uncertainty: the inertia's, with all declared imperfections. cos q1 swings at twice the motion's frequency, so it
    is told from inertia and odd friction. Friction that depends on the direction swings so too; small swings of one
    frequency can't tell the two apart, and then both are named.
    """
    if not scale.b or signals.linear:
        return []
    friction = tuple(name for name in law.unknowns if name in law.rows.friction)
    cosine = project(signals.nodes, [(signals.cosine, 0)], law.rows.windows.centres, law.rows.windows.half)
    found, doubt = _offset(law, signals, scale, friction, cosine[:, 0]), ""
    if not found.matters(law.a11, uncertainty):
        less = tuple(name for name in friction if name != "viscous_even")
        alone = _offset(law, signals, scale, less, cosine[:, 0])
        if not alone.matters(law.a11, uncertainty) or alone.left > AS_GOOD * float(
            law.fit.residuals @ law.fit.residuals
        ):
            return []
        found, doubt = alone, ", unless it is friction that depends on the direction, which looks alike in this motion"
    effect = percent((found.a11 - law.a11) / (law.a11 - scale.carried), sign=True)
    offset = plus_minus(found.value, found.spread, "rad")
    text = (
        f"0 of the angle seems to lie {offset} beside the hanging position{doubt}; "
        f"set right it moves the inertia by {effect}, so take {number(found.value, 'rad')} off the angle."
    )
    return [Message("zero-off", text, Kind.ANGLE_ZERO)]


def _offset(law: WindowFit, signals: Signals, scale: Scale, friction: tuple[str, ...], cosine: Array) -> _Offset:
    """δ of the angle from the rows of a fit, with these terms of friction beside it; one round where there is none.

    cosine: ∫φ cos q1 of every row.
    """
    assert scale.b is not None
    windows = law.rows.windows
    _, columns = columns_of(law.rows, scale, friction)
    # what the fit has put down to declared imperfections, such as α cos q, stays with them
    whole = columns_of(law.rows, scale, tuple(name for name in law.unknowns if name in law.rows.friction))[1]
    declared = whole @ law.fit.values + law.fit.residuals - known_side(law.rows, scale)
    offset, spread, rows = 0.0, 0.0, law.rows
    for _ in range(ROUNDS):
        if offset:
            angle = signals.angle - offset
            terms = [(np.cos(angle), 0), (np.sin(angle), 0)]
            cosine, sine = project(signals.nodes, terms, windows.centres, windows.half).T
            rows = replace(law.rows, gravity=sine)
        fit = fit_linear(np.column_stack([columns, cosine]), known_side(rows, scale) + declared)
        offset -= float(fit.values[-1]) / scale.b
        spread = float(np.sqrt(fit.covariance(LAG)[-1, -1])) / scale.b
        if abs(offset) < CERTAIN * spread:
            break
    return _Offset(offset, spread, float(fit.values[0]), float(fit.residuals @ fit.residuals))
