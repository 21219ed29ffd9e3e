"""Nonlinearity and latency that the rig file does not declare, estimated from the identified logs and corrected.

The scatter of a log does not contain them, but its residuals show them (warnings of the kinds `CAUSES`). Then the same
logs calibrate the encoders, as `calibrate_encoders` does, and are identified once more. The same is done where a
declared nonlinearity is too large for the first order that methods take it to.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from swingid.calibration.encoders import parts as at
from swingid.calibration.encoders.method import calibrate_encoders
from swingid.checks.latency import LATEST
from swingid.errors import SwingidError, UnanswerableError
from swingid.model.rig import Rig
from swingid.preparation.encoders import LATENCY, Channel
from swingid.recording.findings import Kind
from swingid.recording.recording import Finding, Recording
from swingid.result.result import Message, Result
from swingid.uncertainty.significance import CERTAIN, INDICATED
from swingid.units import Quantity

CAUSES = {Kind.ENCODER_NONLINEARITY, Kind.LATE_CHANNEL}
"""Kinds of warnings that lead here."""

ALIKE = {*CAUSES, Kind.GRAVITY_TORQUE, Kind.ANGLE_ZERO}
"""With what has a regressor near that of a nonlinearity: beside the gravity torque, one log does not lead here."""

WORDS: dict[Channel, str] = {"angle": "of the angle's encoder", "wheel": "of the wheel's"}

CODE, REPAIR = "calibrated-by-itself", "calibrate"

Ask = Callable[[Rig, tuple[Finding, ...]], Result]
"""Identification of the logs with another rig and additional findings."""


def calibrated_by_itself(result: Result, ask: Ask, logs: Sequence[Recording], rig: Rig) -> Result:
    """The result of the same logs with the undeclared encoder errors that they themselves make identifiable.

    Unchanged where `result` does not warn of such, where the repair "calibrate" is switched off, where the nonlinearity
    of an encoder would exceed both 1° and three times the declared one, and where the new result still warns of what
    is nearly collinear with it or of anything new: then it was not the cause. The new one warns too, by `CODE`.
    """
    before = _warnings(result)
    kinds = {warning.kind for warning in before}
    past = any(REPAIR in log.done | log.repairs_off for log in logs)
    if not kinds & CAUSES or (Kind.GRAVITY_TORQUE in kinds and len(logs) == 1) or past:
        return result
    try:
        better, text = _encoders(logs, rig) if Kind.ENCODER_NONLINEARITY in kinds else _latency(rig)
        again = ask(better, (Finding(CODE, text, "warning", REPAIR, Kind.CALIBRATED),))
    except SwingidError:
        return result
    codes = {warning.code for warning in before}
    remaining = [message for message in _warnings(again) if message.kind is not Kind.CALIBRATED]
    # nothing of the kind, and nothing new
    settled = all(message.kind not in ALIKE and message.code in codes for message in remaining)
    settled &= all(
        _size(better, channel) <= max(at.WIDE, INDICATED * at.declared_spread(rig, table))
        for channel, table in at.tables_of(rig).items()
    )
    return _of_the_file(again, result) if settled else result


def _warnings(result: Result) -> list[Message]:
    return [warning for each in (result, *result.per_log) for warning in each.warnings]


def _encoders(logs: Sequence[Recording], rig: Rig) -> tuple[Rig, str]:
    """The rig with the encoders that the logs give, and a sentence; UnanswerableError where nothing is significant.

    Where the correction of latencies is switched off, neither step uses a stated one, and the latency between the
    channels that is estimated here enters the identification as an uncertainty about 0.
    """
    uncorrected = any(LATENCY in log.repairs_off for log in logs)
    calibration = calibrate_encoders(
        logs, at.with_latencies(rig, lambda q: Quantity(0.0, q.std)) if uncorrected else rig
    )
    better, key = calibration.rig, at.latency_key(rig)
    if uncorrected and key in calibration.determined:
        late = calibration.result.parameters[key]
        better = better.changed({key: Quantity(0.0, float(np.hypot(late.value, late.standard_uncertainty or 0.0)))})
    parts = [part for key, part in calibration.result.parameters.items() if "nonlinearity" in key]
    # rounding errors of an encoder that repeat with every swing look like a nonlinearity, too
    if not any(abs(part.value) > CERTAIN * (part.standard_uncertainty or np.inf) for part in parts):
        raise UnanswerableError("the encoders' nonlinearity is hardly identifiable.", code="not-identifiable")
    sizes = [f"{np.degrees(_size(calibration.rig, channel)):.2g}° {WORDS[channel]}" for channel in at.tables_of(rig)]
    shows = "this log shows" if len(logs) == 1 else "these logs show"
    text = (
        f"the rig file does not state the encoders' nonlinearity; {shows} {' and '.join(sizes)} once per turn, which "
        "was estimated from the same data and corrected. Write it into the rig file with swingid calibrate --encoders; "
        "several motions determine it better."
    )
    return better, text


def _latency(rig: Rig) -> tuple[Rig, str]:
    """The rig with its latency left open, so that momentum estimates it, and a sentence."""
    key = at.latency_key(rig)
    text = (
        f"the channels are read at different times, which the rig file does not state: {key} was estimated from the "
        f"same data, within {1e3 * LATEST:.0f} ms. Write it into the rig file with swingid calibrate --encoders."
    )
    return rig.changed({key: Quantity(at.stated_latency(rig).value, LATEST)}), text


def _size(rig: Rig, channel: Channel) -> float:
    """Stated nonlinearity of an encoder, rad."""
    sensor = rig.sensors.of(channel)
    return float(np.hypot(sensor.cosine.value, sensor.sine.value))


def _of_the_file(again: Result, first: Result) -> Result:
    """`again` with the rig of the user's file in its provenance."""
    per_log = tuple(_of_the_file(of_log, other) for of_log, other in zip(again.per_log, first.per_log, strict=True))
    rig = {key: value for key, value in first.provenance.items() if key.startswith("rig")}
    return replace(again, provenance=again.provenance | rig, per_log=per_log)
