"""Whether channels can be the motion of the rig that they are said to be: rows, motion, units."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from swingid.errors import InputError, UnanswerableError
from swingid.recording.recording import Finding

if TYPE_CHECKING:
    from swingid.model.rig import Rig
    from swingid.numerics.arrays import Array
    from swingid.recording.conventions import Channels

FEWEST_ROWS = 10
SLOWEST_STEP = 0.5  # s: with less than two rows a second a swing of a pendulum cannot be seen
NO_STEP = 60.0  # s: no swing at all
LONG_REST = 0.1  # of the log: a wheel that rests so long while the axis swings is an encoder that died
TO_AND_FRO = 3  # passes between the outer quarters of the range: a body that swings, not one that spins down
TURN = 2.0 * np.pi
SPARSEST = 30.0  # times what the rows take one after the other: two runs in one file, or a clock that was set
SHORTEST_STEP = 1e-7  # s

#: Largest values that a rig may log: a clock that counts seconds from any epoch, angles of years of turning.
LARGEST = {"time": 1e11, "angle": 1e9, "wheel_angle": 1e12, "wheel_speed": 1e9, "voltage": 1e6, "torque": 1e9}

#: Range of a to-and-fro motion, in turns, that gravity does not allow: a free body swings over less than one turn,
#: a reaction wheel is too weak to throw it over the top and back time and again, a strong motor is not.
WIDEST_SWING = {"none": 1.5, "reaction-wheel": 2.0, "direct": 10.0}


def judge(channels: Channels, rig: Rig, name: str, *, still_axis: bool = False) -> list[Finding]:
    """What is odd about the channels (model units and signs), as findings; `name` is the file's, for messages.

    still_axis: the angle may stand still. Raises UnanswerableError for too few rows and for an angle that does not
    move, InputError for a motion that the axis cannot make (degrees taken for radians).
    """
    _refuse_absurd_numbers(channels, rig, name)
    time, angle = channels["time"], channels["angle"]
    if time.size < FEWEST_ROWS:
        rows = "1 usable row" if time.size == 1 else f"{time.size} usable rows"
        message = f"{name} has {rows}, too few to tell a motion; log some swings."
        raise UnanswerableError(message, code="too-short")
    column = f"column {rig.log.angle!r} (the angle)"
    if np.ptp(angle) == 0.0 and not still_axis:
        message = f"{name}: {column} does not change; log a motion, or set [log] angle to the right column."
        raise UnanswerableError(message, code="no-motion")
    _refuse_impossible_swings(angle, rig, f"{name}: {column}")
    findings = []
    wheel = channels.get("wheel_angle")
    still = None if wheel is None else _longest_rest(time, wheel)
    if still is not None and time[-1] - time[0] > 0:
        first, last = still
        swings = np.ptp(angle[first : last + 1]) > 0.5 * np.ptp(angle)
        if swings and time[last] - time[first] > LONG_REST * (time[-1] - time[0]):
            part = "" if last - first == time.size - 1 else f" from {time[first]:.4g} to {time[last]:.4g} s"
            message = f"column {rig.log.wheel_angle!r} (wheel angle) does not change{part} while the axis swings"
            findings.append(Finding("wheel-still", f"{message}; is the wheel's encoder connected?", "warning"))
    step = float(np.median(np.diff(time)))
    if step > NO_STEP:
        message = f"{name}: one row in {step:g} s is too slow for a swing; if column {rig.log.time!r} is in us or ns"
        raise InputError(f"{message}, set [log] time_unit.", code="absurd-time")
    if step > SLOWEST_STEP:
        message = f"one row in {step:g} s is too slow for a swing; if the time is in ms, set [log] time_unit."
        findings.append(Finding("slow-rows", message, "warning"))
    return findings


def _longest_rest(time: Array, values: Array) -> tuple[int, int]:
    """First and last row of the longest time in which `values` do not change at all."""
    edges = np.concatenate(([0], np.flatnonzero(np.diff(values)) + 1, [len(values)]))
    first, last = edges[:-1], edges[1:] - 1
    longest = int(np.argmax(time[last] - time[first]))
    return int(first[longest]), int(last[longest])


def _refuse_absurd_numbers(channels: Channels, rig: Rig, name: str) -> None:
    """Numbers that no instrument writes: another unit, another column, or a fault of the logger."""
    for channel, largest in LARGEST.items():
        peak = float(np.abs(channels[channel]).max(initial=0.0)) if channel in channels else 0.0
        if peak <= largest:
            continue
        where = f"{name}: column {getattr(rig.log, channel)!r}"
        if channel == "time":
            message = f"{where} reaches {peak:.3g} s; if it is in ms, us or ns, set [log] time_unit"
            raise InputError(f"{message}, or [log] rate where rows are evenly spaced.", code="absurd-time")
        what = f"the {channel.replace('_', ' ')} reaches {peak:.3g}"
        raise InputError(f"{where}: {what}, which no rig does; set [log] {channel} and its unit.", code="absurd-number")
    steps = np.diff(channels["time"])
    if steps.size and float(steps.sum()) > SPARSEST * steps.size * float(np.median(steps)):
        longest = int(np.argmax(steps))
        message = f"{name}: column {rig.log.time!r} jumps by {steps[longest]:.3g} s after row {longest + 1}, and the"
        message += f" rows cover less than a {SPARSEST:.0f}th of the time"
        raise InputError(f"{message}; give one run per file, or mend the clock.", code="absurd-time")
    if steps.size and not float(np.median(steps)) >= SHORTEST_STEP:
        message = (
            f"{name}: column {rig.log.time!r} rises by {np.median(steps):.3g} from row to row, which is no time in s"
        )
        raise InputError(f"{message}; log seconds, or set [log] rate where rows are evenly spaced.", code="absurd-time")


def _refuse_impossible_swings(angle: Array, rig: Rig, column: str) -> None:
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
        message = f"{column} swings to and fro over {turns:.3g} turns, which gravity does not allow"
        fix = 'set [log] angle_unit = "deg" if it is in degrees, or check [log] angle'
        raise InputError(f"{message}; {fix}.", code="implausible-angle")
