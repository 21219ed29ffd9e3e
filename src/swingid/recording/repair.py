"""Plain faults of a log's rows: no number, out of order, stamped twice, beyond the drive's limit. Repairs are counted.

Nothing is resampled; uneven steps and missing rows are no fault, and stamps are kept as they are unless the motion
shows that rows taken at a constant rate were stamped unevenly (`rows.even_clock`). Each repair has a switch
(`findings.REPAIRS`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from swingid.recording.continuity import find_jumps, find_spikes, is_wrapped, unwrap
from swingid.recording.findings import JUMPS
from swingid.recording.lost_rows import find_lost
from swingid.recording.rate_checks import unsaturated
from swingid.recording.rows import even_clock, even_places, few, rows_in_order, take

if TYPE_CHECKING:
    from swingid.recording.conventions import Channels, Reading


ANGLES = ("angle", "wheel_angle")
SMOOTH = (*ANGLES, "angle_speed", "wheel_speed")  # channels in which a single odd sample is a fault
PASSES = 3  # a spike beside another shows when the first one is gone
PLACE, SPIKE = "place", "spike"
"""Of a row, as channels, so that rows are left out of them, too: its place on an even clock; 1 where it is a spike."""


def repaired(channels: Channels, reading: Reading) -> Channels:
    """The channels (logged units, with "time") without faulty rows, angles continuous; `reading` gets the findings.

    Raises InputError where a log is not one run of rows in time with a few slips, but something else, and where it
    cannot be used without a repair that is off.
    """
    for fault in FAULTS:
        channels = fault(channels, reading)
    return channels


def with_places(channels: Channels, reading: Reading) -> Channels:
    """The place of each row on an even clock as a channel, where that is what the stamps show."""
    places = even_places(channels["time"], reading.conventions.rate)
    return channels if places is None else {**channels, PLACE: places}


def on_even_clock(channels: Channels, reading: Reading) -> Channels:
    """Stamps that scatter about a constant rate as that rate, where the motion is smoother so."""
    if reading.conventions.rate is not None or "clock" in reading.off:
        return channels
    smooth = [channels[name] for name in (*ANGLES, "angle_speed") if name in channels]
    clock = even_clock(channels["time"], smooth)
    if clock is None:
        return channels
    message = f"the stamps in {reading.column('time')} scatter by {clock.scatter:.3g} about"
    message += f" {1 / clock.step:.6g} rows a second, and the motion is smoother at that rate; it was used instead."
    reading.found("clock-fitted", message, "note", "clock")
    return {**channels, "time": clock.time}


def made_continuous(channels: Channels, reading: Reading) -> Channels:
    """Angles that go on over turns; rows that were spikes on the way are marked as such."""
    for channel in ANGLES:
        turn = reading.conventions.scale(channel).turn
        if channel not in channels or turn is None or not is_wrapped(channels[channel], turn):
            continue
        column = reading.column(channel)
        if "unwrap" in reading.off:
            reading.found("wrapped", f"{column} seems to be logged within one turn, and was left so.", "warning")
            continue
        result = unwrap(channels["time"], channels[channel], turn)
        channels = {**channels, channel: result.values, SPIKE: np.maximum(result.spikes, channels.get(SPIKE, 0.0))}
        if channel == "angle" and "reference" in channels:
            apart = channels["reference"] - result.values
            channels["reference"] = result.values + apart - turn * np.round(apart / turn)
        message = f"{column} was logged within one turn and was made continuous."
        reading.found("unwrapped", message, "note", "unwrap")
        if result.ambiguous:
            message = f"{column} moves too far between rows to count its turns without ambiguity"
            message += f" (at {result.ambiguous} rows); log it faster, or continuous over turns."
            reading.found("ambiguous-turns", message, "warning")
    return channels


def without_spikes(channels: Channels, reading: Reading, passes: int = PASSES) -> Channels:
    """Single samples that fit neither neighbour are left out: marked ones, and what `passes` searches find."""
    channels = dict(channels)
    spikes = np.asarray(channels.pop(SPIKE, np.zeros(len(channels["time"]))), dtype=bool)
    times, everything, count = [], channels, len(spikes)
    for again in range(passes + 1):
        if spikes.any():
            times.append(channels["time"][spikes])
            channels = take(channels, ~spikes)
        elif again:
            break
        spikes = np.zeros(len(channels["time"]), dtype=bool)
        for channel in SMOOTH if again < passes else ():
            if channel in channels:
                spikes |= find_spikes(channels["time"], channels[channel], reading.averaged)
    if times:
        instants = np.sort(np.concatenate(times))
        shown = ", ".join(f"{time:g}" for time in instants[:5]) + (", ..." if instants.size > 5 else "")
        if "spikes" in reading.off:
            message = f"{instants.size} of {count} rows hold isolated spikes of an angle, not removed, at {shown} s."
            reading.found("spikes-left", message, "warning", at=instants)
            channels = everything
        else:
            message = f"{instants.size} of {count} rows left out: isolated spikes of an angle at {shown} s."
            # a row less here and there changes nothing; many may be no spikes but another fault of the channel
            level: Literal["note", "warning"] = "note" if few(instants.size, count) else "warning"
            reading.found("spikes", message, level, "spikes", at=instants)
    return channels


def with_lost_rows(channels: Channels, reading: Reading) -> Channels:
    """Stamps made of the row number, later by the rows that the motion shows to be missing; `PLACE` is taken out."""
    channels = dict(channels)
    places, time = channels.pop(PLACE, None), channels["time"]
    if places is None or time.size < 2 or "angle" not in channels:
        return channels
    lost = find_lost(places.astype(np.int64), [channels[name] for name in ANGLES if name in channels])
    if lost is None:
        return channels
    count, unsure = int(lost.before.sum()), lost.spread / time.size
    text = f"the angles jump along the motion, by whole rows, at {np.count_nonzero(lost.before)} of {time.size} rows:"
    text += f" {count} rows ({count / (time.size + count):.2g} of all) were lost, and the time does not show it"
    if "lost-rows" in reading.off:
        text += "; it was left so. Log the time of each row"
        reading.found("lost-rows", f"{text}.", "warning", at=time[lost.before > 0])
        return channels
    step = float((time[-1] - time[0]) / (places[-1] - places[0]))
    text += f"; it was restored, with {lost.hidden.sum():.2g} more where the motion is too slow to show them"
    text += f", to {unsure:.1g} of the time. Log the time of each row"
    # a note: what is unsure of the time is in the clock's, and the interval contains it
    reading.found("lost-rows", f"{text}.", "note", "lost-rows", at=time[lost.before > 0], of_time=unsure)
    return {**channels, "time": time + step * np.cumsum(lost.before + lost.hidden)}


def warned_of_jumps(channels: Channels, reading: Reading) -> Channels:
    """The channels, with a warning of jumps that are no lost rows."""
    for channel in ANGLES:
        jumps = find_jumps(channels["time"], channels[channel], reading.averaged) if channel in channels else []
        if not jumps:
            continue
        shown = ", ".join(f"{size:.3g} at {channels['time'][row]:g} s" for row, size in jumps[:3])
        message = f"{reading.column(channel)} jumps by {shown}{', ...' if len(jumps) > 3 else ''}"
        message += "; if the encoder slipped or lost counts there, use a log of one side of it."
        at = [channels["time"][row] for row, _ in jumps]
        reading.found("jumps", message, "warning", at=at, source=JUMPS)
    return channels


def noted_gaps(channels: Channels, reading: Reading) -> Channels:
    """The channels, with a note of steps that are longer than others."""
    steps = np.diff(channels["time"])
    if steps.size == 0 or steps.max() <= 1.5 * steps.min():
        return channels
    usual = float(np.median(steps))
    gaps = int(np.count_nonzero(steps > 1.5 * usual))
    if gaps:
        message = f"{gaps} of {steps.size} steps of {reading.column('time')} are longer than 1.5 times the usual"
        message += f" {usual:.6g} s (the longest {steps.max():.6g} s); the stamps were used as they are."
        reading.found("gaps", message, "note")
    return channels


LIMIT_ROUNDING = 1e-3
"""Of the limit: what a logger may round a command up to."""


def limited(channels: Channels, reading: Reading) -> Channels:
    """The channels (logged units) with commanded voltages within ± `drive.motor.voltage_limit`.

    A voltage that was measured, not held, is what the motor got, and is left as it is.
    """
    motor = reading.rig.drive.motor
    if "voltage" not in channels or motor is None or motor.voltage_limit is None or not reading.held:
        return channels
    limit = motor.voltage_limit / abs(reading.conventions.scale("voltage").factor)
    voltage = channels["voltage"]
    beyond = int(np.count_nonzero(np.abs(voltage) > (1 + LIMIT_ROUNDING) * limit))
    if beyond == 0:
        return channels
    where = f"{reading.column('voltage')} goes beyond drive.motor.voltage_limit = {motor.voltage_limit:g} V"
    where += f" in {beyond} of {voltage.size} rows"
    if "limit" in reading.off:
        message = f"{where}, and was left so; if it is a command, the motor got less."
        reading.found("voltage-beyond-limit", message, "warning")
        return channels
    message = f"{where}; the limit was taken there, as what the motor got"
    message += " (drive_held = false states that it was measured)."
    reading.found("voltage-limited", message, "note", "limit")
    return {**channels, "voltage": np.clip(voltage, -limit, limit)}


FAULTS = (
    rows_in_order,
    with_places,
    on_even_clock,
    made_continuous,
    without_spikes,
    noted_gaps,
    with_lost_rows,
    warned_of_jumps,
    limited,
    unsaturated,
)
"""Faults of a log, in the order in which they are looked for: what repairs each, or says that it is there."""

FAULTS_OF_MEANS = (on_even_clock, without_spikes, noted_gaps, warned_of_jumps)
"""Of a part of a large log, whose rows are means of some that are in order, continuous and within the limit."""
