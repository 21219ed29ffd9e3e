"""Section 5 on the twin: its experiment, with and without the test body and balanced by it, and its ideal simulations.

The simulations are Fig. 7 with its four times, and Fig. 8 with the backstepping controller.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from swingid.control.backstepping import Backstepping
from swingid.control.references import Sine
from swingid.errors import UnanswerableError
from swingid.numerics.arrays import Array, Bools
from swingid.pooling.difference import difference
from swingid.preparation.scale import equation_of
from swingid.recording.recording import Recording
from swingid.result.result import Result
from swingid.simulation.twin import Run
from swingid.study.reproduce import published, runs
from swingid.study.reproduce.runs import Answer, Log

FRICTIONS = {"viscous": {}, "hidden": runs.HIDDEN}
"""Twins by their friction: the paper's viscous one, and one with dry friction that no method has in its model."""

VISCOUS = ("viscous", "viscous_positive", "viscous_negative")

CASES = ("plain", "body", "balanced")

GROWING = np.concatenate([np.arange(0.5, 8.5, 0.5), [10.0, 12.0, 15.0, 18.0, 22.0]])
"""Lengths (s) of the logs from t = 0 on that show how soon a way knows J1."""

CONVERGED = published.SIMULATION_ERROR
"""Per cent."""

FREQUENCIES = (2.0, 8.5)
"""Of the program motion of Fig. 8, which the paper does not print, rad/s."""

WORKS = {"held": "work of the held voltage", "trapezoid": "work by the trapezoid on samples"}


@dataclass(frozen=True)
class Experiment:
    """One twin's runs by case, and the answers as plain data."""

    runs: dict[str, Run]
    answers: dict[str, object]


def experiment(friction: str, seed: int, progress: Callable[[str], None]) -> Experiment:
    """All ways on the logs of all cases of one twin of `FRICTIONS`."""
    twins = {case: runs.with_friction(runs.rig_of(case), FRICTIONS[friction]) for case in CASES}
    made = {case: runs.experiment_run(case, twins[case], seed) for case in CASES}
    logs = {case: runs.read_back(made[case], twins[case], span=runs.SPANS[case]) for case in CASES}
    whole = runs.read_back(made["plain"], twins["plain"])
    rows: list[Answer] = []
    for estimator in runs.WAYS:
        progress(f"experiment, {friction} friction: {runs.WAYS[estimator].words}")
        rows.append(_row(estimator, logs, whole))
    soon = {}
    for case in ("plain", "body"):
        ends, errors = runs.interval_errors(runs.read_back(made[case], twins[case]))
        soon[case] = {f"within {bound:g} %": settled_within(ends, errors, bound) for bound in (5.0, 1.4)}
    answers: dict[str, object] = {
        "friction": friction,
        "rows": rows,
        "controller": {case: controller(made[case]) for case in CASES},
        "first_interval": soon,
    }
    return Experiment(made, answers)


def _row(estimator: str, logs: dict[str, Log], whole: Log) -> Answer:
    results = {case: runs.result_by(estimator, log) for case, log in logs.items()}
    row: Answer = {"way": estimator, "words": runs.WAYS[estimator].words}
    for case, result in results.items():
        row[case] = _cell(result, logs[case])
    for case in ("body", "balanced"):
        row[f"j_e_{case}"] = _body(results["plain"], results[case])
    row["converged"] = converged(estimator, whole)
    return row


def converged(estimator: str, log: Log) -> float | None:
    """Length (s) of a log from the run's start from which on J1^ stays within `CONVERGED`; None where it does not."""
    errors = [runs.error_by(estimator, log.first(length)) for length in GROWING.tolist()]
    return settled_within(GROWING, np.array(errors), CONVERGED)


def _cell(result: Result | str, log: Log) -> Answer:
    """J1^ (with the body J1 + J_e), its error, f1, u, a11 and warnings, or the code of the refusal."""
    if isinstance(result, str):
        return {"refused": result}
    inertia = result.inertia
    return runs.answer_of(inertia.value, viscous(result), log) | {
        "u": inertia.standard_uncertainty,
        "a11": inertia.value + equation_of(log.rig).carried,
        "warnings": [warning.code for warning in result.warnings],
    }


def viscous(result: Result) -> float | None:
    """Viscous coefficient of the bearing (N m s), of a law by direction the mean of both; None where there is none."""
    values = [result.parameters[name].value for name in VISCOUS if name in result.parameters]
    return sum(values) / len(values) if values else None


def _body(plain: Result | str, loaded: Result | str) -> Answer:
    """J_e^ with its error in per cent of the known inertia."""
    if isinstance(plain, str) or isinstance(loaded, str):
        return {"refused": plain if isinstance(plain, str) else str(loaded)}
    value = loaded.inertia.value - plain.inertia.value
    cell: Answer = {"inertia": value, "error": 100 * (value / published.J_E - 1)}
    try:
        cell["u"] = difference(plain, loaded).inertia.standard_uncertainty
    except UnanswerableError:
        cell["u"] = None
    return cell


def controller(run: Run, part: Bools | None = None) -> dict[str, float]:
    """The end of the adaptation: k tilde, when it last grew; tracking error and voltage in `part`, 15 to 22 s."""
    log = run.recording
    gain, reference, voltage = log.adaptive_gain, log.reference, log.voltage
    assert gain is not None
    assert reference is not None
    assert voltage is not None
    grown = np.nonzero(np.diff(gain) > 0)[0]
    first, last = runs.SPANS["plain"]
    part = (log.time >= first) & (log.time <= last) if part is None else part
    e = (reference - log.angle)[part]
    return {
        "k_tilde": float(gain[-1]),
        "settled": float(log.time[grown[-1] + 1]) if len(grown) else 0.0,
        "error_rms": float(np.sqrt(np.mean(e**2))),
        "error_peak": float(np.abs(e).max()),
        "voltage_rms": float(np.sqrt(np.mean(voltage[part] ** 2))),
        "voltage_peak": float(np.abs(voltage[part]).max()),
    }


def settled_within(times: np.ndarray, errors: np.ndarray, bound: float) -> float | None:
    """First of `times` from which on all errors stay within ± `bound`; None where the last does not."""
    outside = np.nonzero(~(np.abs(errors) <= bound))[0]
    first = outside[-1] + 1 if len(outside) else 0
    return None if first == len(times) else float(times[first])


@dataclass(frozen=True)
class Curve:
    """The estimate J1^ (kg m^2) of a backstepping run over time (s)."""

    law: str
    frequency: float
    time: Array
    inertia: Array


@dataclass(frozen=True)
class Simulation:
    """The log of Fig. 7, the curves of Fig. 8, and the answers as plain data."""

    log: Recording
    curves: tuple[Curve, ...]
    truth: float
    answers: dict[str, object]


SIMULATION_STEPS = 6
"""How often `simulation` calls `progress`."""


def simulation(progress: Callable[[str], None]) -> Simulation:
    """Both simulations and what the methods find in the first."""
    progress("ideal simulation of Fig. 7, 10 kHz")
    run = runs.simulation_run()
    log = runs.read_back(run, runs.ideal_rig())
    rows = [_at_the_times(log, work, letter) for letter in (True, False) for work in WORKS]
    for estimator in ("printed", "better", "momentum", "nls-viscous"):
        words = runs.WAYS[estimator].words
        progress(f"ideal simulation of Fig. 7: {words}")
        rows.append(_simulation_row(words + ", all intervals" * (estimator == "printed"), estimator, log))
    progress("backstepping of Fig. 8, 10 kHz")
    curves = tuple(curve_of(law, frequency) for frequency in FREQUENCIES for law in ("printed", "consistent"))
    settled = controller(run, run.recording.time > run.recording.time[-1] / 2)
    # errors (per cent) of J1^ by (6) from one interval each, where k tilde no longer grows
    _, errors = runs.interval_errors(log)
    late = errors[len(errors) // 2 :]
    single = {"intervals": len(late), "rms": float(np.sqrt(np.mean(late**2))), "worst": float(max(abs(late)))}
    answers: dict[str, object] = {"rows": rows, "single": single}
    answers |= {name: settled[name] for name in ("k_tilde", "settled", "error_rms")}
    answers["backstepping"] = [_convergence(curve, log) for curve in curves]
    return Simulation(run.recording, curves, log.truth, answers)


def _simulation_row(words: str, estimator: str, log: Log, **options: object) -> Answer:
    result = runs.result_by(estimator, log, **options)
    if isinstance(result, str):
        return {"words": words, "refused": result}
    return {"words": words} | runs.answer_of(result.inertia.value, viscous(result), log)


def _at_the_times(log: Log, work: str, letter: bool) -> Answer:
    """(6) and (7) from the paper's four times: letter by letter, or each pass with its own potential energies."""
    words = "letter by letter" if letter else "potential energy of each pass's own nodes"
    words = f"(6) at the paper's times, {words}; {WORKS[work]}"
    if not letter:
        return _simulation_row(words, "printed", log, nodes=published.TIMES, work=work)
    return {"words": words} | runs.answer_of(*runs.by_letter(log, published.TIMES, work), log)


@cache
def curve_of(law: str, frequency: float) -> Curve:
    """The backstepping run of Fig. 8 by the law "printed" or "consistent": 0.8 sin (frequency t), ideal, 10 kHz."""
    twin = runs.ideal_rig()
    controller = Backstepping.paper(twin, law="printed" if law == "printed" else "consistent")
    log = runs.run_of(twin, Sine(published.AMPLITUDE, frequency), controller, duration=12.0, rate=1e4).recording
    assert log.adaptive_gain is not None
    return Curve(law, frequency, log.time, controller.inertia(log.adaptive_gain))


def _convergence(curve: Curve, log: Log) -> Answer:
    errors = log.error(curve.inertia)
    error, after = published.BACKSTEPPING
    return {
        "law": curve.law,
        "frequency": curve.frequency,
        "after_8_s": float(errors[np.searchsorted(curve.time, after)]),
        "within_5": settled_within(curve.time, errors, error),
        "within_1": settled_within(curve.time, errors, 1.0),
        "end": float(errors[-1]),
    }
