"""Predict logs that were not fitted, in a free run and swing by swing, with the normalised fit of MATLAB's `compare`.

fit = 100 % · (1 − ‖y − ŷ‖ / ‖y − mean y‖). In the free run only the motion's initial values come from the log
(estimated by least squares, as `compare` does); swing by swing they are measured anew at the start of each swing.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from swingid.balance.fits import BASIS, fit_rows
from swingid.balance.level import PARAMETER as RATE_BIAS
from swingid.balance.rows import Signals, rows_of
from swingid.balance.windows import law_windows
from swingid.checks.answer import check_sign
from swingid.errors import InputError, UnanswerableError, UsageError
from swingid.format import noise_of, number
from swingid.methods.output_error.problem import NO_ENTRIES, Input, Problem
from swingid.methods.output_error.segments import problem_of
from swingid.methods.output_error.unknowns import Unknowns
from swingid.model.parameters import constants as rig_constants
from swingid.model.parameters import vector
from swingid.model.rig import Rig
from swingid.model.terms import TERMS, further_terms, values_by_key
from swingid.numerics import shooting
from swingid.numerics.arrays import Array
from swingid.numerics.gauss_newton import LEAST, STALLED, solve
from swingid.preparation.noise import Noise
from swingid.preparation.prepared import Prepared, prepare
from swingid.preparation.scale import refuse_motor
from swingid.preparation.speed import smooth_speed
from swingid.progress import tracked
from swingid.recording.recording import Recording, listed
from swingid.result.data import require_scale
from swingid.result.provenance import shared_constants
from swingid.result.result import Result
from swingid.study.output import Study, noted
from swingid.table import Table, plain

SCHEMA = "swingid.validate/1"

POOR = 95.0
"""Fit one swing ahead, in per cent, below which a log contradicts the model."""

HEADINGS = plain("log", "driven by", "free run", "one swing ahead", "its error, RMS", "sensor noise")

DRIVES = {"wheel": "measured wheel", "voltage": "voltage", "torque": "torque", "none": "nothing"}


@dataclass(frozen=True)
class Prediction:
    """One log, measured and predicted: instants (s) and angles (rad or m) at its rows from `start` to `stop`.

    free_fit, swing_fit: in per cent, 100 is perfect, 0 no better than the mean. free_rms, swing_rms: of the error, in
    the unit of the angle; noise: standard deviation of one reading of the sensor.
    """

    log: str
    input: str
    time: Array
    measured: Array
    free: Array
    swing: Array
    noise: float

    @property
    def free_fit(self) -> float:
        """Normalised fit of the free run in per cent; −inf where it ran away."""
        return fit_percent(self.measured, self.free)

    @property
    def swing_fit(self) -> float:
        """Normalised fit of the predictions one swing ahead in per cent."""
        return fit_percent(self.measured, self.swing)

    @property
    def free_rms(self) -> float:
        """Root mean square error of the free run."""
        return _rms(self.free - self.measured)

    @property
    def swing_rms(self) -> float:
        """Root mean square error one swing ahead."""
        return _rms(self.swing - self.measured)


@dataclass(frozen=True)
class Validation(Study):
    """Predictions of one result for several logs; notes: what a reader of the fits should know."""

    method: str
    linear: bool
    predictions: tuple[Prediction, ...]
    notes: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Plain data, schema "swingid.validate/1", without the curves."""
        logs = [
            {
                "log": p.log,
                "input": p.input,
                "start": float(p.time[0]),
                "stop": float(p.time[-1]),
                "free_run_fit_percent": p.free_fit,
                "one_swing_ahead_fit_percent": p.swing_fit,
                "free_run_rms": p.free_rms,
                "one_swing_ahead_rms": p.swing_rms,
                "sensor_noise": p.noise,
                "unit": "m" if self.linear else "rad",
            }
            for p in self.predictions
        ]
        return {"schema": SCHEMA, "method": self.method, "logs": logs, "notes": list(self.notes)}

    def summary(self) -> str:
        """One line per log for a terminal: normalised fit of the free run and one swing ahead, error and noise."""
        table = Table(HEADINGS, tuple(cells(p, linear=self.linear) for p in self.predictions))
        head = f"[[Predictions of the model that {self.method} identified: normalised fit, 100 % is perfect]]"
        return "\n".join([head, *table.lines(), *noted(self.notes)])


def fit_percent(measured: Array, predicted: Array) -> float:
    """100 (1 − ‖y − ŷ‖ / ‖y − mean y‖), MATLAB's normalised fit; −inf for a prediction that is not finite."""
    if not np.isfinite(predicted).all():
        return float("-inf")
    return float(100 * (1 - np.linalg.norm(measured - predicted) / np.linalg.norm(measured - np.mean(measured))))


def validate(
    result: Result, logs: Recording | Sequence[Recording], rig: Rig, *, input: Literal["voltage", "wheel"] | None = None
) -> Validation:
    """Predict `logs` by the model that `result` identified, and compare.

    Parameters
    ----------
    result : Result
        As `identify` gives it.
    logs, rig
        Other logs and their rig, whose inertia and friction are not read.
    input : "wheel" (default) or "voltage"
        What drives the prediction of a reaction wheel: its measured angle, which needs no motor, or both rows of the
        model.

    Raises
    ------
    UsageError
        No log, no rig, an unknown input.
    InputError
        A refused result, a missing channel or one of the wrong sign.
    UnanswerableError
        A log without motion.

    Examples
    --------
    >>> import swingid as sw
    >>> rig, motion = sw.Rig.load("paper"), sw.parse_reference("sine 0.8 rad 8.5 rad/s")
    >>> fitted, other = (sw.simulate(rig, motion, duration=25, seed=k) for k in (1, 2))
    >>> found = sw.validate(sw.identify(fitted, rig), other, rig)
    >>> found.predictions[0].swing_fit > 99
    True
    """
    if input not in (None, "voltage", "wheel"):
        raise UsageError(f"unknown input {input!r}; choose voltage or wheel.", code="unknown-input")
    refuse_motor(rig, "validate")
    p = model_vector(result, rig)
    several, predicted = [], []
    for k, log in enumerate(tracked(listed(logs))):
        prepared = prepare(with_found_gain(log, result, rig), rig)
        several.append(prepared)
        predicted.append(_of_log(prepared, p, input, prepared.log.source.path or f"log {k + 1}"))
    predictions = tuple(predicted)
    notes = (*_notes(result, [prepared.log for prepared in several], rig), *_misfits(predictions))
    return Validation(result.method, rig.axis.kind == "linear", predictions, notes)


def _notes(result: Result, logs: Sequence[Recording], rig: Rig) -> Iterator[str]:
    """Note that a log was fitted, and that the rig is not that of the result."""
    for log in logs:
        if log.source.sha256 in result.origin.digests:
            yield f"the result was fitted to {log.source.path}: its fit is no test of the model."
    then, now = result.origin.constants, shared_constants(rig)
    if then and (other := [key for key in {**then, **now} if then.get(key) != now.get(key)]):
        yield f"rig {rig.name} is not as in the result, which was found with another {', '.join(other)}."


def _misfits(predictions: Sequence[Prediction]) -> Iterator[str]:
    """Warn that a log contradicts the model, and say which statement of the rig file to check."""
    for p in predictions:
        if p.swing_fit >= POOR:
            continue
        drive = {
            "wheel": "the wheel's sign and scale under [log]",
            "voltage": "the motor's constants and the voltage's sign",
        }
        look = drive.get(p.input, "the torque's sign and gain" if p.input == "torque" else "the angle's zero and scale")
        yield (
            f"{p.log} does not move as the model, even one swing ahead (fit {fit_text(p.swing_fit)}): is it the same "
            f"body and rig? Check {look}, or identify this log by itself."
        )


def _of_log(prepared: Prepared, p: Array, wanted: Literal["voltage", "wheel"] | None, name: str) -> Prediction:
    source = drive_of(prepared.log, prepared.rig, wanted)
    part = prepared.part()
    noise, half_period = part.noise, part.motion.half_period
    if len(part.motion.turning_times) > 1:
        signals = Signals.of(part.log, prepared.rig, part.motion, part.encoders)
        rows = rows_of(signals, law_windows(signals, half_period / 4))
        law = fit_rows(rows, prepared.equation, noise, BASIS)
        if law is not None:
            check_sign(law, name, live=part.log.is_live)
    runs = [
        problem_of(part.log, part.encoders, noise, source, length, part.longest_gap) for length in (np.inf, half_period)
    ]
    if not len(runs[0].measured):
        raise UnanswerableError(f"{name} has no stretch of rows long enough to predict.", code="too-short")
    fit = solve(runs[0].shooting(Unknowns((), p)), np.empty(0), runs[0].starts, STALLED, LEAST)
    free = _outputs(fit.prediction)
    # half a swing more at either end, for a speed smoothed at the end of its rows is a worse one
    around = prepared.log.segment(part.start - half_period, part.stop + half_period)
    swing = _outputs(runs[1].predict(p, NO_ENTRIES, _measured_starts(runs[1], around, noise), 0))
    axis, steps = ~runs[0].wheel, ~runs[1].wheel
    time = runs[0].times[axis]
    # segments too short to predict are left out of either; what both hold is compared
    _, mine, others = np.intersect1d(time, runs[1].times[steps], return_indices=True)
    measured = runs[0].measured[axis][mine]
    return Prediction(name, source, time[mine], measured, free[axis][mine], swing[steps][others], noise.angle)


def _outputs(prediction: shooting.Prediction) -> Array:
    return prediction.outputs if prediction.finite else np.full(len(prediction.outputs), np.nan)


def _measured_starts(problem: Problem, log: Recording, noise: Noise) -> Array:
    """Angle and speed of the channels at the start of every segment, from their smoothed angles, see `motion.Speed`."""
    instants = problem.knots[problem.bounds[:-1]]
    channels = [(problem.encoders.angle, log.angle, noise.angle)]
    if problem.input == "voltage" and log.wheel_angle is not None:
        channels.append((problem.encoders.wheel, log.wheel_angle, noise.wheel))
    columns = []
    for sensor, values, sigma in channels:
        speed = smooth_speed(log.time + sensor.latency.value, values, sigma)
        columns += [speed.angle_at(instants), speed.at(instants)]
    return np.column_stack(columns)


def _rms(error: Array) -> float:
    return float(np.sqrt(np.mean(error**2)))


def model_vector(result: Result, rig: Rig) -> Array:
    """Parameter vector of `rig` with what `result` found in the place of axis.inertia, friction and unknown gravity.

    Constants that the fit moved within what rig.toml states (output error) are where it found them.

    Raises InputError for a refused result, and for one of the other kind of axis.
    """
    require_scale(result, "the result")
    if "inertia" not in result.parameters:
        raise InputError("the result has no inertia: it was refused; give one with a number.", code="refused-result")
    linear = rig.axis.kind == "linear"
    if (result.inertia.unit == "kg") != linear:
        kind = "linear" if linear else "rotary"
        raise InputError(
            f"the result is in {result.inertia.unit}, but rig {rig.name} is {kind}; give the rig of the result.",
            code="other-axis",
        )
    identified = {name: parameter.value for name, parameter in result.parameters.items()}
    changes: dict[str, object] = {"axis.inertia": identified["inertia"], "axis.friction": None}
    if "gravity_torque" in identified:
        changes["axis.gravity_torque"] = identified["gravity_torque"]
    by_key = _by_key(identified, rig)
    further = {key for term in further_terms() for key in (term.key, term.shift)}
    changes |= {key: value for key, value in by_key.items() if key in further and not key.startswith("axis.friction.")}
    values = {key: quantity.value for key, quantity in rig_constants(rig.changed(changes)).items()}
    values |= {key: value for key, value in result.origin.found.items() if key in values}
    # what a fit finds may lie a little outside what a rig file may state, such as a Coulomb friction below 0
    values |= by_key
    return vector(values, rig.drive.channel)


def _by_key(values: Mapping[str, float], rig: Rig) -> dict[str, float]:
    """Identified values under the keys of rig.toml. Raises InputError for what the model has no term for."""
    parts = {name for term in further_terms() for name in term.parts}
    of_sensor = (RATE_BIAS,)  # nothing of the body: a log to predict has its own
    values = {name: value for name, value in values.items() if name not in of_sensor}
    unknown = [name for name in values if name not in parts and (name not in TERMS or not TERMS[name].key)]
    if unknown:
        raise InputError(
            f"the result holds {', '.join(unknown)}, which the model of rig {rig.name} has no term for; give a "
            "result of one log or of several logs of one rig.",
            code="unknown-parameter",
        )
    return values_by_key(values)


def with_found_gain(log: Recording, result: Result, rig: Rig) -> Recording:
    """The log with its torque by the gain that the fit found, where it moved log.torque_gain."""
    gain = result.origin.found.get("log.torque_gain")
    if log.torque is None or gain is None:
        return log
    return replace(log, torque=log.torque * (gain / rig.log.torque_gain.value))


def drive_of(log: Recording, rig: Rig, wanted: Literal["voltage", "wheel"] | None) -> Input:
    """What drives the prediction: the measured wheel unless the voltage is wanted, the torque, or nothing."""
    if rig.drive.wheel is None:
        return "torque" if rig.drive.channel == "torque" else "none"
    if wanted == "voltage":
        motor = rig.drive.motor
        if log.voltage is None or motor is None or motor.torque_per_volt.value <= 0:
            raise UnanswerableError(
                "a prediction from the voltage needs the log's voltage and drive.motor.torque_per_volt; take the wheel "
                "as input.",
                code="no-motor-constants",
            )
        return "voltage"
    return "wheel"


def cells(p: Prediction, *, linear: bool, fine: bool = False) -> tuple[str, ...]:
    """One line of the table."""
    unit = "m" if linear else "rad"
    errors = (number(p.swing_rms, unit, 2, fine=fine), noise_of(p.noise, float(np.ptp(p.measured)), unit, 2, fine=fine))
    return (p.log, DRIVES[p.input], fit_text(p.free_fit), fit_text(p.swing_fit), *errors)


def fit_text(fit: float) -> str:
    """A normalised fit in per cent."""
    return f"{fit:.2f} %" if math.isfinite(fit) else "ran away"
