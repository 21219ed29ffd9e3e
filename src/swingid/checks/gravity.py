"""Is the gravity torque that the balance shows the one that is stated? If not, a scale is wrong, or the clock is.

With the gravity torque left free the drive alone sets the scale, so where the motion tells the two apart, a torque
constant, a wheel's inertia, the angle's unit or a clock that is off shows as another gravity torque.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from swingid.balance.fits import WindowFit, fit_rows
from swingid.balance.imperfections import imperfections
from swingid.balance.rows import Signals
from swingid.checks.answer import LEAST
from swingid.format import number, percent, plus_minus
from swingid.model.rig import Rig
from swingid.preparation.noise import Noise
from swingid.preparation.scale import Scale
from swingid.recording.findings import Kind
from swingid.result.result import Message
from swingid.uncertainty.significance import DETECTED, MATTERS
from swingid.units import Quantity

AS_GOOD = 2.0
"""A length of windows tells as much where its uncertainty is at most this factor larger."""


def check_gravity(
    law: WindowFit,
    tried: Iterable[WindowFit],
    signals: Signals,
    rig: Rig,
    scale: Scale,
    noise: Noise,
    *,
    least: float = LEAST,
) -> list[Message]:
    """A warning where the balance contradicts `axis.gravity_torque` by so much that the inertia suffers.

    tried: the same fit at other lengths of windows. least: relative change of the inertia that is worth a warning, for
    methods that take a rougher fit as a second consistency.
    """
    stated = rig.axis.gravity_torque
    if not isinstance(stated, Quantity) or not scale.b or scale.drive == "none" or signals.linear:
        return []
    found = _freed(law, signals, rig, scale, noise)
    if found is None:
        return []
    free, spread = found
    seen = free.value("gravity_torque")
    for own in (law, *tried):
        one = found if own is law else _freed(own, signals, rig, scale, noise)
        if one is None or one[1] >= AS_GOOD * spread:
            continue
        off = one[0].value("gravity_torque") - stated.value
        if off * (seen - stated.value) <= 0 or abs(off) <= DETECTED * np.hypot(one[1], stated.std or 0.0):
            return []
    # disagreement of windows is left out of law.total: it is what a wrong scale makes
    if not seen > 0 or free.a11 <= 0 or abs(free.a11 - law.a11) <= max(MATTERS * law.total, least * law.a11):
        return []
    drive = "log.torque_gain" if scale.drive == "direct" else "drive.wheel.inertia"
    by_drive, by_gravity = (
        number(a11 - scale.carried, scale.unit) for a11 in (free.a11, free.a11 * stated.value / seen)
    )
    text = (
        f"the balance shows a gravity torque of {plus_minus(seen, spread, scale.torque_unit)}, "
        f"{percent(seen / stated.value - 1, sign=True)} from axis.gravity_torque: one of {drive}, axis.gravity_torque, "
        f"the angle's unit and the clock is off; the inertia is {by_drive} if the drive's scale is right, {by_gravity} "
        "if gravity is; state the one you doubt with its uncertainty."
    )
    return [Message("gravity-torque-disagrees", text, Kind.GRAVITY_TORQUE)]


def _freed(fit: WindowFit, signals: Signals, rig: Rig, scale: Scale, noise: Noise) -> tuple[WindowFit, float] | None:
    """The same windows with the gravity torque left free, and its standard uncertainty with all that is declared."""
    friction = tuple(name for name in fit.unknowns if name in fit.rows.friction)
    free = fit_rows(fit.rows, replace(scale, b=None), noise, friction)
    if free is None:
        return None
    k = free.unknowns.index("gravity_torque")
    variance = float(free.covariance[k, k])
    for item in imperfections(rig, signals, free.rows, free.a11, free.value("gravity_torque")):
        if item.source != "axis.gravity_torque":
            variance += (float(free.fit.influence[k] @ item.rows) * item.std) ** 2
    return free, float(np.sqrt(variance))
