"""The experiment of section 5 on the twin: with and without the test body, and with the pendulum balanced by it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from swingid.errors import UnanswerableError
from swingid.model.rig import Rig
from swingid.pooling.difference import difference
from swingid.result.result import Result
from swingid.simulation.twin import Run
from swingid.study.reproduce import published
from swingid.study.reproduce.published import J_E
from swingid.study.reproduce.runs import (
    HIDDEN,
    SPANS,
    WAYS,
    Answer,
    Log,
    each_interval,
    error_by,
    experiment_run,
    read_back,
    result_by,
    rig_of,
    with_friction,
)

FRICTIONS = {"viscous": {}, "hidden": HIDDEN}
"""Twins by their friction: the paper's viscous one, and one with dry friction that no method has in its model."""

VISCOUS = ("viscous", "viscous_positive", "viscous_negative")

CASES = ("plain", "body", "balanced")

GROWING = np.concatenate([np.arange(0.5, 8.5, 0.5), [10.0, 12.0, 15.0, 18.0, 22.0]])
"""Lengths (s) of the logs from t = 0 on that show how soon a way knows J1."""

CONVERGED = published.SIMULATION_ERROR
"""Per cent."""


@dataclass(frozen=True)
class Experiment:
    """One twin's runs by case, the logs that were identified, and the answers as plain data."""

    runs: dict[str, Run]
    logs: dict[str, Log]
    answers: dict[str, object]


def experiment(friction: str, seed: int, progress: Callable[[str], None]) -> Experiment:
    """All ways on the logs of all cases of one twin of `FRICTIONS`."""
    twins = {case: with_friction(rig_of(case), FRICTIONS[friction]) for case in CASES}
    runs = {case: experiment_run(case, twins[case], seed) for case in CASES}
    logs = {case: read_back(runs[case], twins[case], span=SPANS[case]) for case in CASES}
    whole = read_back(runs["plain"], twins["plain"])
    rows: list[Answer] = []
    for way in WAYS:
        progress(f"experiment, {friction} friction: {WAYS[way].words}")
        rows.append(_row(way, logs, whole))
    answers: dict[str, object] = {
        "friction": friction,
        "rows": rows,
        "controller": {case: controller(runs[case]) for case in CASES},
        "first_interval": {case: _first_interval(runs[case], twins[case]) for case in ("plain", "body")},
    }
    return Experiment(runs, logs, answers)


def _row(way: str, logs: dict[str, Log], whole: Log) -> Answer:
    results = {case: result_by(way, log) for case, log in logs.items()}
    row: Answer = {"way": way, "words": WAYS[way].words}
    for case, result in results.items():
        row[case] = _cell(result, logs[case])
    for case in ("body", "balanced"):
        row[f"j_e_{case}"] = _body(results["plain"], results[case])
    row["converged"] = converged(way, whole)
    return row


def converged(way: str, log: Log) -> float | None:
    """Length (s) of a log from the run's start from which on J1^ stays within `CONVERGED`; None where it does not."""
    errors = [error_by(way, Log(log.recording.segment(0.0, length), log.rig, log.truth)) for length in GROWING.tolist()]
    return settled_within(GROWING, np.array(errors), CONVERGED)


def _cell(result: Result | str, log: Log) -> Answer:
    """J1^ (with the body J1 + J_e), a11, f1 as the paper counts it, and how long an online estimate took."""
    if isinstance(result, str):
        return {"refused": result}
    motor, wheel = log.rig.drive.motor, log.rig.drive.wheel
    assert motor is not None
    assert wheel is not None
    inertia = result.inertia
    cell: Answer = {
        "inertia": inertia.value,
        "u": inertia.standard_uncertainty,
        "a11": inertia.value + wheel.inertia.value + motor.rotor_inertia.value,
        "error": 100 * (inertia.value / log.truth - 1),
        "warnings": [warning.code for warning in result.warnings],
    }
    f1 = viscous(result)
    if f1 is not None:
        cell["f1"] = f1 / motor.gear_ratio.value
    return cell


def viscous(result: Result) -> float | None:
    """Viscous coefficient of the bearing (N m s), of a law by direction the mean of both; None where there is none."""
    values = [result.parameters[name].value for name in VISCOUS if name in result.parameters]
    return sum(values) / len(values) if values else None


def _body(plain: Result | str, loaded: Result | str) -> Answer:
    """J_e^ with its error in per cent of the known inertia."""
    if isinstance(plain, str) or isinstance(loaded, str):
        return {"refused": plain if isinstance(plain, str) else str(loaded)}
    value = loaded.inertia.value - plain.inertia.value
    cell: Answer = {"inertia": value, "error": 100 * (value / J_E - 1)}
    try:
        cell["u"] = difference(plain, loaded).inertia.standard_uncertainty
    except UnanswerableError:
        cell["u"] = None
    return cell


def controller(run: Run) -> Answer:
    """The end of the adaptation: k tilde, when it last grew; tracking error and voltage from 15 to 22 s."""
    log = run.recording
    gain, reference, voltage = log.adaptive_gain, log.reference, log.voltage
    assert gain is not None
    assert reference is not None
    assert voltage is not None
    grown = np.nonzero(np.diff(gain) > 0)[0]
    part = (log.time >= SPANS["plain"][0]) & (log.time <= SPANS["plain"][1])
    e = (reference - log.angle)[part]
    return {
        "k_tilde": float(gain[-1]),
        "settled": float(log.time[grown[-1] + 1]) if len(grown) else 0.0,
        "error_rms": float(np.sqrt(np.mean(e**2))),
        "error_peak": float(np.abs(e).max()),
        "voltage_rms": float(np.sqrt(np.mean(voltage[part] ** 2))),
        "voltage_peak": float(np.abs(voltage[part]).max()),
    }


def _first_interval(run: Run, twin: Rig) -> Answer:
    """When (6), interval by interval from the start, comes within 5 % for good, and within 1.4 %."""
    log = read_back(run, twin)
    ends, values = each_interval(log)
    errors = 100 * (values / log.truth - 1)
    return {f"within {bound:g} %": settled_within(ends, errors, bound) for bound in (5.0, 1.4)}


def settled_within(times: np.ndarray, errors: np.ndarray, bound: float) -> float | None:
    """First of `times` from which on all errors stay within ± `bound`; None where the last does not."""
    outside = np.nonzero(~(np.abs(errors) <= bound))[0]
    first = outside[-1] + 1 if len(outside) else 0
    return None if first == len(times) else float(times[first])
