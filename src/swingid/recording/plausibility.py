"""Whether channels can be the motion of the rig that they are said to be: rows, motion, units."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from swingid.errors import InputError, UnanswerableError
from swingid.recording.recording import Finding

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from swingid.model.rig import Rig
    from swingid.recording.conventions import Channels

FEWEST_ROWS = 10
SLOWEST_STEP = 0.5  # s: with less than two rows a second a swing of a pendulum cannot be seen
TO_AND_FRO = 3  # passes between the outer quarters of the range: a body that swings, not one that spins down
TURN = 2.0 * np.pi

#: Range of a to-and-fro motion, in turns, that gravity does not allow: a free body swings over less than one turn,
#: a reaction wheel is too weak to throw it over the top and back time and again, a strong motor is not.
WIDEST_SWING = {"none": 1.5, "reaction-wheel": 2.0, "direct": 10.0}


def judge(channels: Channels, rig: Rig, name: str, *, still_axis: bool = False) -> list[Finding]:
    """What is odd about the channels (model units and signs), as findings; `name` is the file's, for messages.

    still_axis: the angle may stand still. Raises UnanswerableError for too few rows and for an angle that does not
    move, InputError for a motion that the axis cannot make (degrees taken for radians).
    """
    time, angle = channels["time"], channels["angle"]
    if time.size < FEWEST_ROWS:
        message = f"{name} has {time.size} usable rows, too few to tell a motion; log some swings."
        raise UnanswerableError(message, code="too-short")
    column = f"column {rig.log.angle!r} (the angle)"
    if np.ptp(angle) == 0.0 and not still_axis:
        message = f"{name}: {column} does not change; log a motion, or set [log] angle to the right column."
        raise UnanswerableError(message, code="no-motion")
    _refuse_impossible_swings(angle, rig, f"{name}: {column}")
    findings = []
    wheel = channels.get("wheel_angle")
    if wheel is not None and np.ptp(wheel) == 0.0:
        message = f"column {rig.log.wheel_angle!r} (wheel angle) does not change; is the wheel's encoder connected?"
        findings.append(Finding("wheel-still", message, "warning"))
    step = float(np.median(np.diff(time)))
    if step > SLOWEST_STEP:
        message = f"one row in {step:g} s is too slow for a swing; the time has to be in seconds, is it in ms?"
        findings.append(Finding("slow-rows", message, "warning"))
    return findings


def _refuse_impossible_swings(angle: NDArray[np.float64], rig: Rig, column: str) -> None:
    gravity = rig.axis.gravity_torque
    if rig.axis.kind != "rotary" or (gravity != "unknown" and gravity.value == 0.0):
        return
    low, high = float(angle.min()), float(angle.max())
    turns = (high - low) / TURN
    if turns < WIDEST_SWING[rig.drive.kind]:
        return
    side = np.where(angle > high - (high - low) / 4, 1, np.where(angle < low + (high - low) / 4, -1, 0))
    passes = np.count_nonzero(np.diff(side[side != 0]))
    if passes >= TO_AND_FRO:
        message = f"{column} swings to and fro over {turns:.1f} turns, which gravity does not allow"
        fix = 'set [log] angle_unit = "deg" if it is in degrees, or check [log] angle'
        raise InputError(f"{message}; {fix}.", code="implausible-angle")
