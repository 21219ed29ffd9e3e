"""Encoders that bend the angle once per turn, though the rig file does not say so, and what that does to the inertia.

Their nonlinearity is a systematic error, alike at every swing: the scatter of the windows does not hold it. But it
leaves residuals that two more columns per encoder explain, and nothing else in the balance looks like them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from swingid.balance.declared import with_declared
from swingid.balance.fits import LAG, WindowFit, residuals_beside
from swingid.balance.imperfections import axis_bends, wheel_bends
from swingid.balance.rows import Signals
from swingid.checks.answer import LEAST
from swingid.format import plus_minus
from swingid.model.rig import Rig
from swingid.preparation.encoders import Encoders
from swingid.preparation.noise import Noise
from swingid.preparation.scale import Scale
from swingid.recording.findings import Kind
from swingid.result.result import Message
from swingid.uncertainty.significance import BETTER, CERTAIN_RATIO, MATTERS

WIDE = 0.5 * np.pi / 180
"""What is allowed where nothing is declared, rad."""

AMPLITUDES = 4
"""Unknowns more: cosine and sine of each encoder."""


def check_encoders(law: WindowFit, rig: Rig, signals: Signals, scale: Scale, noise: Noise) -> list[Message]:
    """A warning where an undeclared once-per-turn nonlinearity of the encoders shows and the inertia suffers by it.

    Not where gravity is sought as well, whose column is nearly that of a nonlinearity.
    """
    if signals.linear or scale.drive == "none" or scale.b is None or signals.encoders.angle.bent:
        return []
    if not _may_show(law, signals, scale):
        return []
    declared = signals.declaring(Encoders.of(rig.changed({"sensors.nonlinearity": WIDE})))
    bent = with_declared(replace(law, declared=()), rig, declared, scale, noise)
    before, after = (float(np.mean(fit.fit.residuals**2)) for fit in (law, bent))
    if not _shows(law, before, after):
        return []
    if max(abs(bent.a11 - law.a11), bent.total) < max(MATTERS * law.total, LEAST * law.a11):
        return []
    left = np.sqrt(after / before)
    text = (
        "a once-per-turn nonlinearity of the encoders, which the rig file does not declare, would leave "
        f"{left:.0%} of the balance's residuals and make the inertia "
        f"{plus_minus(bent.a11 - scale.carried, bent.total, scale.unit)}; declare sensors.nonlinearity, such as "
        '"0.1 deg", or calibrate the encoders.'
    )
    return [Message("encoder-nonlinearity", text, Kind.ENCODER_NONLINEARITY)]


def _shows(law: WindowFit, before: float, after: float) -> bool:
    """Whether a fall of the residuals' power is large, and no chance."""
    # without a nonlinearity 0.95 of the residuals and more are left
    left_over = len(law.rows.windows) / (LAG / 2) - len(law.unknowns) - AMPLITUDES  # degrees of freedom
    return 0 < after < BETTER**2 * before and (before / after - 1) * left_over / AMPLITUDES >= CERTAIN_RATIO


def _may_show(law: WindowFit, signals: Signals, scale: Scale) -> bool:
    """Whether the residuals would fall enough if the amplitudes were free: quick, and true wherever it shows."""
    b = law.value("gravity_torque") if scale.b is None else scale.b
    bends = axis_bends(signals, law.rows, law.a11, b) | {
        f"wheel {name}": effect for name, effect in wheel_bends(signals, law.rows, scale.a12).items()
    }
    left = residuals_beside(law, scale, np.column_stack(list(bends.values())))
    return _shows(law, float(np.mean(law.fit.residuals**2)), float(np.mean(left**2)))
