"""Encoders calibrate themselves in the balance of the logs they wrote (THEORY 4, self-calibration).

Row (I) closes for the true angles only. What a once-per-turn nonlinearity of either encoder and a latency between the
channels leave of it has its own course over the motion; several motions of one body tell it from inertia and friction.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from swingid.calibration.encoders.estimate import Estimate, estimate, solve
from swingid.calibration.encoders.logs import CalibrationLog
from swingid.calibration.encoders.parts import ANGLE, Part, parts_of, uncalibrated
from swingid.calibration.encoders.rig_file import with_encoders
from swingid.errors import InputError, UnanswerableError
from swingid.format import plus_minus
from swingid.model.rig import Rig
from swingid.preparation.encoders import Encoders
from swingid.preparation.push import without_pushes
from swingid.recording.recording import Recording
from swingid.result.provenance import add_findings, exact_in_row_one, provenance
from swingid.result.result import Message, Result
from swingid.uncertainty.budget import BudgetEntry, Parameter, combined, scatter, systematic
from swingid.uncertainty.significance import CERTAIN

TOLD = 0.5
"""Share of its bound that a part's uncertainty may be for the part to count as told by the logs."""

FOREIGN = 1.5
"""A log that leaves so many times more beside the others than with parts of its own does not belong to them."""


@dataclass(frozen=True)
class EncoderCalibration:
    """What `calibrate_encoders` found.

    result: every part with its uncertainty, those that the logs do not tell too; method "calibrate-encoders". told:
    names of the parts that they tell. rig: the rig with these, ``rig.text`` its file with the comments of the old one.
    """

    result: Result
    rig: Rig
    told: tuple[str, ...]


def calibrate_encoders(logs: Recording | Sequence[Recording], rig: Rig) -> EncoderCalibration:
    """Once-per-turn nonlinearity of each encoder and the latency between the channels, from logs of one body.

    Parameters
    ----------
    logs : Recording or sequence of Recording
        Ordinary logs as for `identify`, of one body on one rig. Motions of several frequencies and amplitudes tell
        more; large amplitudes most.
    rig : Rig
        As for `identify`. `sensors.nonlinearity` and the uncertainty of the latencies are bounds of what is sought;
        without them 1° and 10 ms. What an earlier calibration wrote is not used.

    Not for encoders whose place within the turn changes from log to log, as that of an incremental encoder without
    index does: calibrate each such log for itself.

    Raises
    ------
    InputError
        No log, a linear axis without drive, a channel that is missing, a wrong sign.
    UnanswerableError
        No motion, or logs that tell none of it.
    """
    several = [without_pushes(log, rig) for log in ([logs] if isinstance(logs, Recording) else logs)]
    if not several:
        raise InputError("no log was given; calibrate needs at least one log of a motion.", code="no-log")
    plain = uncalibrated(rig)
    asked = parts_of(plain)
    if not any(not part.nuisance for part in asked):
        raise InputError(
            f"rig {rig.name}: a linear axis without a drive has neither a nonlinearity per turn nor a latency to find.",
            code="nothing-to-calibrate",
        )
    read = [CalibrationLog.of(log, plain) for log in several]
    found = estimate(read, plain, asked)
    budget = [entry for k, part in enumerate(asked) for entry in _budget(found, k, part)]
    parameters = {part.key: _parameter(found, budget, part, plain) for part in asked if not part.nuisance}
    told = tuple(part.key for part in asked if not part.nuisance and found.uncertainties[part.key] < TOLD * part.prior)
    if not told:
        raise UnanswerableError(
            f"{_names(several)} tell nothing of the encoders; record large swings of several frequencies.",
            code="not-identifiable",
        )
    warnings = list(_strangers(read, plain, asked, found))
    notes = [*_notes(asked, told, found), *exact_in_row_one(rig)]
    for log in several:
        add_findings(log, warnings, notes)
    new, more = with_encoders(rig, parameters, told)
    names = [log.source.path for log in several]
    hashes = [log.source.sha256 for log in several]
    origin = provenance(several[0], rig) | ({"logs": names, "logs_sha256": hashes} if len(several) > 1 else {})
    result = Result(
        method="calibrate-encoders",
        status="warning" if warnings else "ok",
        parameters=parameters,
        warnings=tuple(dict.fromkeys(warnings)),
        notes=tuple(dict.fromkeys([*notes, *more])),
        budget=tuple(entry for entry in budget if entry.parameter in parameters),
        provenance=origin,
    )
    return EncoderCalibration(result, new, told)


def _names(logs: Sequence[Recording]) -> str:
    return logs[0].source.path or "the log" if len(logs) == 1 else f"the {len(logs)} logs"


def _parameter(found: Estimate, budget: list[BudgetEntry], part: Part, rig: Rig) -> Parameter:
    value = found.values[part.key]
    if part.unit == "s":
        encoders = Encoders.of(rig)
        value += (encoders.angle if part.key.startswith(f"{ANGLE}.latency") else encoders.wheel).latency.value
    return Parameter.of(value, combined(budget, part.key), part.unit)


def _budget(found: Estimate, k: int, part: Part) -> Iterator[BudgetEntry]:
    """Scatter holds the bound of a part that the logs hardly determine, and what uncertain constants of the rig do."""
    yield BudgetEntry(scatter("scatter of the windows, bounds and constants"), part.key, float(found.scatter[k]))
    if found.grid[k] > 0:
        yield BudgetEntry(systematic("place of the encoder's grid"), part.key, float(found.grid[k]))
    if found.drift[k] > 0:
        yield BudgetEntry(systematic("drift with the length of the windows"), part.key, float(found.drift[k]))


def _strangers(logs: Sequence[CalibrationLog], rig: Rig, asked: Sequence[Part], found: Estimate) -> Iterator[Message]:
    """Logs that the common inertia and encoders do not fit."""
    if len(logs) < 2:
        return
    for log, error in zip(logs, found.errors, strict=True):
        own = float(solve([log], rig, asked).fit.errors[0])
        if error > FOREIGN * own:
            text = (
                f"{log.name} does not go with the other logs: with one inertia and the same encoders it leaves "
                f"{error / own:.1f} times what it leaves alone; was it another body, or did an incremental encoder "
                "start at another place of its turn?"
            )
            yield Message("logs-differ", text)


def _notes(asked: Sequence[Part], told: Sequence[str], found: Estimate) -> Iterator[Message]:
    untold = [part.key for part in asked if not part.nuisance and part.key not in told]
    if untold:
        text = f"not told by these logs, and not written: {', '.join(untold)}."
        yield Message("not-told", text)
    for part in asked:
        value, u = found.values[part.key], found.uncertainties[part.key]
        if part.key == "zero" and abs(value) > CERTAIN * u:
            text = f"0 of the angle lies {plus_minus(value, u, 'rad')} beside hanging; nothing was written for it."
            yield Message("zero", text)
    wide = [part.key for part in asked if not part.nuisance and not part.declared]
    if wide:
        text = f"the rig file bounds these not; they were sought within 1° and 10 ms: {', '.join(wide)}."
        yield Message("bounds", text)
