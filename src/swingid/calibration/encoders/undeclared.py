"""Bent encoders and late channels that the rig file does not declare, found from the identified logs and taken off.

The scatter of a log does not hold them, but its balance shows them (warnings of the kinds `CAUSES`). Then the same logs
calibrate the encoders, as `calibrate_encoders` does, and are identified once more. So they do where a nonlinearity is
declared that is too large for the first order that methods take it to.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from swingid.calibration.encoders.method import calibrate_encoders
from swingid.calibration.encoders.parts import ANGLE, LATEST, WHEEL, WIDE, declared_spread, latency_key
from swingid.errors import SwingidError, UnanswerableError
from swingid.model.rig import Rig
from swingid.recording.findings import Kind
from swingid.recording.recording import Finding, Recording
from swingid.result.result import Message, Result
from swingid.uncertainty.significance import CERTAIN, INDICATED

CAUSES = {Kind.ENCODER_NONLINEARITY, Kind.LATE_CHANNEL}
"""Kinds of warnings that lead here."""

ALIKE = {*CAUSES, Kind.GRAVITY_TORQUE, Kind.ANGLE_ZERO}
"""With what looks much like a nonlinearity of an encoder: beside the gravity torque, one log does not lead here."""

CODE, REPAIR = "calibrated-by-itself", "calibrate"

Ask = Callable[[Rig, tuple[Finding, ...]], Result]
"""Identification of the logs with another rig and these findings more."""


def calibrated_by_itself(result: Result, ask: Ask, logs: Sequence[Recording], rig: Rig) -> Result:
    """The result of the same logs with what they themselves tell of undeclared encoder errors.

    Unchanged where `result` does not warn of such, where the repair "calibrate" is switched off, where an encoder would
    have to be bent by more than 1° and three times what is declared, and where the new result still warns of what looks
    like it or of anything new: then it was not the cause. The new one warns too, by `CODE`.
    """
    before = _warnings(result)
    kinds = {warning.kind for warning in before}
    switched_off = any(found.repair == REPAIR for log in logs for found in log.findings)
    if not kinds & CAUSES or (Kind.GRAVITY_TORQUE in kinds and len(logs) == 1) or switched_off:
        return result
    try:
        better, text = _encoders(logs, rig) if Kind.ENCODER_NONLINEARITY in kinds else _latency(rig)
        again = ask(better, (Finding(CODE, text, "warning", REPAIR, Kind.CALIBRATED),))
    except SwingidError:
        return result
    codes = {warning.code for warning in before}
    left = [one for one in _warnings(again) if one.kind is not Kind.CALIBRATED]
    settled = all(one.kind not in ALIKE and one.code in codes for one in left)  # nothing of the kind, and nothing new
    settled &= all(_size(better, table) <= max(WIDE, INDICATED * declared_spread(rig, table)) for table in _tables(rig))
    return _of_the_file(again, result) if settled else result


def _warnings(result: Result) -> list[Message]:
    return [warning for one in (result, *result.per_log) for warning in one.warnings]


def _encoders(logs: Sequence[Recording], rig: Rig) -> tuple[Rig, str]:
    """The rig with the encoders as the logs tell them, and a sentence; UnanswerableError where they hardly tell."""
    found = calibrate_encoders(logs, rig)
    parts = [part for key, part in found.result.parameters.items() if "nonlinearity" in key]
    # steps of an encoder that come again with every swing look like a nonlinearity, too
    if not any(abs(part.value) > CERTAIN * (part.standard_uncertainty or np.inf) for part in parts):
        raise UnanswerableError("the logs hardly tell how far the encoders are bent.", code="not-identifiable")
    sizes = [f"{np.degrees(_size(found.rig, table)):.2g}° {of}" for table, of in _tables(rig).items()]
    text = (
        f"the rig file does not say how far the encoders are bent; {_log(logs)} {' and '.join(sizes)} once per turn, "
        "which was found in the same balance and taken off. Write it into the rig file with swingid calibrate "
        "--encoders; several motions tell it better."
    )
    return found.rig, text


def _latency(rig: Rig) -> tuple[Rig, str]:
    """The rig with its latency left open, which momentum finds then, and a sentence."""
    key = latency_key(rig)
    channel = rig.sensors.of("wheel" if key.startswith(WHEEL) else "angle")
    text = (
        f"the channels are read at different times, which the rig file does not say: {key} was found in the same "
        f"balance, within {1e3 * LATEST:.0f} ms. Write it into the rig file with swingid calibrate --encoders."
    )
    return rig.changed({key: {"value": channel.latency.value, "std": LATEST}}), text


def _tables(rig: Rig) -> dict[str, str]:
    tables = {ANGLE: "of the angle's encoder"}
    return tables | {WHEEL: "of the wheel's"} if rig.drive.kind == "reaction-wheel" else tables


def _size(rig: Rig, table: str) -> float:
    """Of the nonlinearity that is stated of an encoder, rad."""
    sensor = rig.sensors.of("wheel" if table == WHEEL else "angle")
    return float(np.hypot(sensor.cosine.value, sensor.sine.value))


def _log(logs: Sequence[Recording]) -> str:
    return "this log shows" if len(logs) == 1 else "these logs show"


def _of_the_file(again: Result, first: Result) -> Result:
    """`again` with the rig of the user's file in its provenance."""
    per_log = tuple(_of_the_file(one, other) for one, other in zip(again.per_log, first.per_log, strict=True))
    return replace(again, provenance=again.provenance | _rig(first), per_log=per_log)


def _rig(result: Result) -> dict[str, object]:
    return {key: value for key, value in result.provenance.items() if key.startswith("rig")}
