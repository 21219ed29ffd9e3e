"""Whether the wheel follows its encoder: one that slips by a share s on the shaft of its encoder as it turns one way.

The wheel then turns by q2 − s/2 (q2 ± ∫|q2'|), + for a slip as it turns forward. In equation (I) the even part, of
∫|q2'|, is as no term is, and gives s; the other is as a smaller inertia of the wheel, and follows from it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swingid.balance.covariance import LAG
from swingid.balance.fits import WindowFit
from swingid.balance.rows import Signals
from swingid.checks.hypothesis import Evidence, Finding
from swingid.format import percent, plus_minus
from swingid.numerics.once import once
from swingid.numerics.regression import fit_linear
from swingid.numerics.test_functions import project
from swingid.uncertainty.dark import dark_uncertainty
from swingid.uncertainty.significance import BETTER, CERTAIN

SLIP = "wheel that slips on its encoder's shaft"
"""Source of `slip_entry` in the budget."""

LARGEST = 0.1
"""Share above which it is another error: products of shares, which the rows leave out, are 5 % of the effect there, and
a slow motion, in whose rows a slip hardly is, takes any remainder of the residuals as a share of 50 % to 200 %."""


@dataclass(frozen=True)
class _Slip:
    """Share s, negative of a slip as it turns back, with its standard uncertainty, the change of a11 by it, and the
    ratio of the residuals with it.
    """

    value: float
    u: float
    change: float
    ratio: float


def wheel_slips(evidence: Evidence) -> list[Finding] | None:
    """Find a wheel that slips one way, where that explains what the balance leaves."""
    slip = _slip(evidence.law, evidence.signals)
    if slip is None:
        return None
    if not CERTAIN * slip.u < abs(slip.value) <= LARGEST or slip.ratio > BETTER:
        return []
    share = plus_minus(100 * abs(slip.value), 100 * slip.u, "%")
    direction = "forward" if slip.value > 0 else "back"
    text = (
        f"the wheel seems to slip by {share} on the shaft of its encoder as it turns {direction}, which reduces the "
        f"residuals of the balance to {slip.ratio:.0%} and changes the inertia by "
        f"{percent(slip.change / evidence.law.inertia, sign=True)}; tighten the wheel and record again."
    )
    return [Finding(slip.change, text)]


def slip_entry(evidence: Evidence, u: float) -> float:
    """Standard uncertainty of a11 by a wheel that slips: the unexplained difference to the fit with it."""
    slip = _slip(evidence.law, evidence.signals)
    if slip is None or not 0 < abs(slip.value) <= LARGEST:
        return 0.0
    return dark_uncertainty(slip.change, (slip.change * slip.u / slip.value) ** 2, u)


@once
def _slip(law: WindowFit, signals: Signals) -> _Slip | None:
    """The slip by the rows of a fit; None without the angle of a wheel."""
    rate, a12 = signals.wheel_rate, law.value("wheel")
    if rate is None or not a12:
        return None
    travel = np.cumsum(np.abs(rate.ravel()) * signals.nodes.flat[1]).reshape(signals.angle.shape)
    windows = law.rows.windows
    even = a12 / 2 * project(signals.nodes, [(travel, 2)], windows.centres, windows.half)[:, 0]
    # scales of wheel and gravity that are not as stated leave residuals, too: in proportion to gravity
    sought = law.equation.seeks("gravity_torque") or not law.value("gravity_torque")
    others = law.columns if sought else np.column_stack([law.columns, law.rows["gravity_torque"]])
    plain, fit = (fit_linear(x, law.known + law.explained) for x in (others, np.column_stack([others, even])))
    share = -float(fit.values[-1])
    lacking = share * even + abs(share) * a12 / 2 * law.rows["wheel"]
    return _Slip(
        share,
        float(np.sqrt(fit.covariance(LAG)[-1, -1])),
        float(law.fit.influence[0] @ lacking),
        float(np.linalg.norm(fit.residuals)) / max(float(np.linalg.norm(plain.residuals)), 1e-300),
    )
