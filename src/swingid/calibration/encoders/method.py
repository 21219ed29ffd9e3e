"""Encoder calibration from ordinary logs of the rig (THEORY 4, self-calibration).

Equation (I) holds for the true angles only. A once-per-turn nonlinearity of either encoder and a latency between the
channels leave residuals of their own course; several motions of one body distinguish them from inertia and friction.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from swingid.calibration.encoders.estimate import STEPS, STRETCHES, Estimate, estimate, solve
from swingid.calibration.encoders.logs import CalibrationLog
from swingid.calibration.encoders.parts import ANGLE, WHEEL, Part, latency_key, parts_of, stated_latency, uncalibrated
from swingid.calibration.outcome import quantity, result_of, rewritten
from swingid.errors import InputError, UnanswerableError, require_rig
from swingid.format import plus_minus
from swingid.model.rig import Rig
from swingid.model.rig.sensors import ONE_ENCODER
from swingid.preparation.push import without_pushes
from swingid.progress import stepped, stepwise
from swingid.recording.recording import Recording, listed
from swingid.result.provenance import add_findings, exact_in_row_one
from swingid.result.result import Message, Parameter, Result
from swingid.uncertainty.budget import Evaluated, Scatter, evaluate, systematic
from swingid.uncertainty.significance import CERTAIN

IDENTIFIABLE = 0.5
"""Posterior over prior standard deviation below which a part counts as identifiable."""

FOREIGN = 1.5
"""A log whose residuals are so many times larger with the common parts than with its own does not belong to the others.
"""


@dataclass(frozen=True)
class EncoderCalibration:
    """What `calibrate_encoders` found.

    result: every part with its uncertainty, also those that are not identifiable; method "calibrate-encoders".
    determined:
    names of the identifiable parts. rig: the rig with these, ``rig.text`` its file with the comments of the old one.
    """

    result: Result
    rig: Rig
    determined: tuple[str, ...]


def calibrate_encoders(logs: Recording | Sequence[Recording], rig: Rig) -> EncoderCalibration:
    """Once-per-turn nonlinearity of each encoder and the latency between the channels, from logs of one body.

    Not for encoders whose zero changes from log to log, as that of an incremental encoder without index does:
    calibrate each such log separately.

    Parameters
    ----------
    logs : Recording or sequence of Recording
        Ordinary logs as for `identify`, of one body on one rig. Several frequencies and amplitudes contain more
        information; large amplitudes most.
    rig : Rig
        As for `identify`. `sensors.nonlinearity` and the uncertainty of the latencies are priors; without them 1° and
        10 ms. Values of an earlier calibration are not used.

    Raises
    ------
    UsageError
        No log, no rig.
    InputError
        A linear axis without drive, a channel that is missing, a wrong sign.
    UnanswerableError
        No motion, or logs from which no part is identifiable.
    """
    require_rig(rig)
    several = [without_pushes(log, rig) for log in listed(logs)]
    plain = uncalibrated(rig)
    parts = parts_of(plain)
    if all(part.nuisance for part in parts):
        raise InputError(
            f"rig {rig.name}: a linear axis without a drive has neither a nonlinearity per turn nor a latency to find.",
            code="nothing-to-calibrate",
        )
    # preparation, steps to the parts, windows of other lengths; and the steps with each log alone
    count = 1 + STEPS + len(STRETCHES) + (STEPS if len(several) > 1 else 0)
    with stepwise(count * len(several)):
        return _calibrated(several, rig, plain, parts)


def _calibrated(several: Sequence[Recording], rig: Rig, plain: Rig, parts: Sequence[Part]) -> EncoderCalibration:
    """The calibration by logs without pushes; plain: the rig without an earlier calibration."""
    wanted = [part for part in parts if not part.nuisance]
    read = []
    for log in several:
        read.append(CalibrationLog.of(log, plain))
        stepped()
    estimated = estimate(read, plain, parts)
    known = estimated.uncertainties < IDENTIFIABLE * np.array([part.prior for part in parts])
    determined = tuple(part.key for part, is_known in zip(parts, known, strict=True) if is_known and not part.nuisance)
    if not determined:
        name = several[0].source.path or "the log" if len(several) == 1 else f"the {len(several)} logs"
        raise UnanswerableError(
            f"{name}: no parameter of the encoders is identifiable; record large swings of several frequencies.",
            code="not-identifiable",
        )
    evaluated = _evaluated(estimated, plain)
    warnings = list(_strangers(read, plain, estimated))
    notes = [*_notes(wanted, determined, estimated), *exact_in_row_one(rig)]
    for log in several:
        add_findings(log, warnings, notes)
    new, lost = _with_encoders(rig, evaluated.parameters, determined)
    result = result_of("calibrate-encoders", several, rig, evaluated, warnings, [*notes, *lost])
    return EncoderCalibration(result, new, determined)


def _evaluated(estimated: Estimate, rig: Rig) -> Evaluated:
    """All parts but nuisances; a latency is added to the stated one.

    The scatter contains the priors of parts that are hardly identifiable, and uncertain constants of the rig.
    """
    at = {part.key: k for k, part in enumerate(estimated.parts) if not part.nuisance}
    units, late = {part.key: part.unit for part in estimated.parts}, stated_latency(rig).value
    values = {key: (float(estimated.values[k]) + late * (units[key] == "s"), units[key]) for key, k in at.items()}
    sizes = {
        "place of the encoder's grid": np.sqrt(np.maximum(estimated.grid, 0.0)),
        "drift with the length of the windows": estimated.drift,
    }
    common = [
        (systematic(source), key, float(spreads[k])) for source, spreads in sizes.items() for key, k in at.items()
    ]
    places = np.ix_([*at.values()], [*at.values()])
    name = "scatter of the windows, bounds and constants"
    return evaluate(values, Scatter(name, estimated.scatter[places], np.full(len(at), np.inf)), common)


def _strangers(logs: Sequence[CalibrationLog], rig: Rig, estimated: Estimate) -> Iterator[Message]:
    """Logs that the common inertia and encoders do not fit."""
    if len(logs) < 2:
        return
    for log, error in zip(logs, estimated.errors, strict=True):
        alone = float(solve([log], rig, estimated.parts).fit.errors[0])
        if error > FOREIGN * alone:
            text = (
                f"{log.name} is inconsistent with the other logs: its residuals with one inertia and the same encoders "
                f"are {error / alone:.1f} times those of its own fit; check whether the body was the same, and whether "
                "an incremental encoder began at another zero."
            )
            yield Message("logs-differ", text)


def _notes(wanted: Sequence[Part], determined: Sequence[str], estimated: Estimate) -> Iterator[Message]:
    unknown = [part.key for part in wanted if part.key not in determined]
    if unknown:
        yield Message("not-told", f"not identifiable from these logs, and not written: {', '.join(unknown)}.")
    for part, value, u in zip(
        estimated.parts, estimated.values.tolist(), estimated.uncertainties.tolist(), strict=True
    ):
        if part.nuisance and abs(value) > CERTAIN * u:
            text = (
                f"the zero of the angle is {plus_minus(value, u, 'rad')} from the hanging position; it is not written."
            )
            yield Message("zero", text)
    wide = [part.key for part in wanted if not part.declared]
    if wide:
        text = f"the rig file states no prior of these; 1° and 10 ms were taken: {', '.join(wide)}."
        yield Message("bounds", text)


def _with_encoders(rig: Rig, parameters: dict[str, Parameter], determined: Sequence[str]) -> tuple[Rig, list[Message]]:
    """The rig with the parts `determined` (keys of `found`) and their uncertainties; stated values of the others go.

    A latency is one between two channels: it is written at the wheel (at the angle of a direct drive) with the
    combined uncertainty, and the other channel then counts as exact.
    """
    keys = [f"{table}.{key}" for table in (ANGLE, WHEEL) for key in ONE_ENCODER]
    values: dict[str, object] = {key: quantity(parameters[key]) if key in determined else None for key in keys}
    key = latency_key(rig)
    if key in determined:
        values[key] = quantity(parameters[key])
        if key.startswith(WHEEL) and rig.sensors.latency.std is not None:
            values[f"{ANGLE}.latency"] = rig.sensors.latency.value
    return rewritten(rig, values)
