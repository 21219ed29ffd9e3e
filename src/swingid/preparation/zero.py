"""Where the body of a free decay hangs: the centre of its swings, from which its angle is counted.

Four turning angles in succession, c + A, c − A + d, c + A − 2d + e, …, have the mean (a0 + 3 a1 + 3 a2 + a3)/8 = c up
to an eighth of the second difference of the losses d: nothing of a constant loss (dry friction), A (1 − ρ)³/8 where a
swing leaves the share ρ of the amplitude. A constant torque, as of a twisted cable, moves the centre as well, and so it
does to first order in the balance.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from swingid.errors import UnanswerableError
from swingid.format import number, plus_minus
from swingid.model.terms import rig_terms
from swingid.preparation.encoders import Correction
from swingid.preparation.motion import find_motion
from swingid.preparation.noise import channel_noise
from swingid.preparation.segment import part_of
from swingid.recording.conventions import Conventions
from swingid.recording.findings import Finding, Kind
from swingid.uncertainty.significance import CERTAIN
from swingid.units import Quantity

if TYPE_CHECKING:
    from swingid.model.rig import Rig
    from swingid.numerics.arrays import Array
    from swingid.recording.recording import Recording

REPAIR = "zero"

FEWEST = 4
"""Means, of seven turning points, whose scatter is known to a quarter."""

HARMLESS = 5e-3
"""Zero (rad) up to which the inertia of swings to both sides is wrong by less than 0.01 %."""


def centre_of(turning_angles: Array) -> tuple[float, float] | None:
    """Centre of shrinking swings and the scatter of its single values, rad; None with less than seven turning points.

    Its values drift together, as friction and slack change with the amplitude, so their number does not make it better.
    """
    q = turning_angles
    if len(q) < FEWEST + 3:
        return None
    means = (q[:-3] + 3 * (q[1:-2] + q[2:-1]) + q[3:]) / 8
    return float(np.mean(means)), float(np.std(means, ddof=1))


def centred(log: Recording, rig: Rig) -> tuple[Recording, tuple[Correction, ...]]:
    """The log with its angle counted from the centre of the swings of a free decay, with a note, and the decision.

    Unchanged where scatter and steps of the angle explain the offset, where it is harmless, where a spring has a centre
    of its own, and where it was done before. Only known where the repair "zero" is switched off.
    """
    gravity, held = rig.axis.gravity_torque, [term for term in rig_terms(rig) if term.term.is_conservative]
    b = gravity.value if isinstance(gravity, Quantity) else 1.0
    # one torque draws it back: gravity, or the strings that it hangs on
    hangs = not held if b else len(held) == 1 and rig.axis.suspension is not None
    if rig.drive.channel is not None or rig.axis.kind != "rotary" or not hangs or isinstance(gravity, str):
        return log, ()
    if REPAIR in log.done:
        return log, ()
    noise = channel_noise(log, rig)
    try:
        motion = find_motion(log.time, log.angle, noise.angle)
        start, stop, _ = part_of(log, motion, rig.drive.channel)
    except UnanswerableError:
        return log, ()  # the method says why
    estimate = centre_of(motion.within(start, stop).turning_angles)
    if estimate is None:
        return log, ()
    centre, scatter = estimate
    centre -= 2 * np.pi * round(centre / (2 * np.pi))
    if abs(centre) <= max(CERTAIN * scatter, noise.resolution, HARMLESS):
        return log, ()
    off = REPAIR in log.repairs_off
    kept = Correction("angle", "zero", centre, scatter, "rad", "switched off" if off else "found")
    if off:
        return log, (kept,)
    reading = float(Conventions.of(rig).scale("angle").to_log(np.array([centre]))[0])
    text = (
        f"the body hangs at {plus_minus(centre, scatter, 'rad')}, the centre of its free swings, from where its angle "
        f"was counted; angle_zero = {number(reading, '', 4)} under [log] states it."
    )
    reference = None if log.reference is None else log.reference - centre
    note = Finding("zero-corrected", text, "note", REPAIR, Kind.ANGLE_ZERO)
    findings, done = (*log.findings, note), log.done | {REPAIR}
    return replace(log, angle=log.angle - centre, reference=reference, findings=findings, done=done), (kept,)
