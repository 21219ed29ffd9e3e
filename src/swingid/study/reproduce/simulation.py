"""The ideal simulations of section 5: Fig. 7 with its four times, Fig. 8 with the backstepping controller."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from swingid.control.backstepping import Backstepping
from swingid.control.references import Sine
from swingid.numerics.arrays import Array
from swingid.recording.recording import Recording
from swingid.study.reproduce import published
from swingid.study.reproduce.experiment import settled_within
from swingid.study.reproduce.runs import (
    WAYS,
    Answer,
    Log,
    answer_of,
    by_letter,
    each_interval,
    ideal_rig,
    read_back,
    result_by,
    run_of,
    simulation_run,
)

FREQUENCIES = (2.0, 8.5)
"""Of the program motion of Fig. 8, which the paper does not print, rad/s."""


WORKS = {"held": "work of the held voltage", "trapezoid": "work by the trapezoid on samples"}


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


def simulation(progress: Callable[[str], None]) -> Simulation:
    """Both simulations and what the methods say of the first."""
    progress("ideal simulation of Fig. 7, 10 kHz")
    run = simulation_run()
    log = read_back(run, ideal_rig())
    rows = [_at_the_times(log, work, letter) for letter in (True, False) for work in WORKS]
    for way in ("printed", "better", "momentum", "nls-viscous"):
        progress(f"ideal simulation of Fig. 7: {WAYS[way].words}")
        rows.append(_row(WAYS[way].words + ", all intervals" * (way == "printed"), way, log))
    progress("backstepping of Fig. 8, 10 kHz")
    curves = tuple(curve_of(law, frequency) for frequency in FREQUENCIES for law in ("printed", "consistent"))
    assert run.recording.adaptive_gain is not None
    gain = run.recording.adaptive_gain
    answers: dict[str, object] = {
        "rows": rows,
        "single": _single(log),
        "k_tilde": float(gain[-1]),
        "settled": float(run.recording.time[np.nonzero(np.diff(gain) > 0)[0][-1] + 1]),
        "error_rms": _tracking(run.recording),
        "backstepping": [_convergence(curve, log.truth) for curve in curves],
    }
    return Simulation(run.recording, curves, log.truth, answers)


def _row(words: str, way: str, log: Log, **options: object) -> Answer:
    result = result_by(way, log, **options)
    if isinstance(result, str):
        return {"words": words, "refused": result}
    return {"words": words} | answer_of(result.inertia.value, result.parameters["viscous"].value, log)


def _at_the_times(log: Log, work: str, letter: bool) -> Answer:
    """(6) and (7) from the paper's four times: letter by letter, or each pass with its own potential energies."""
    words = "letter by letter" if letter else "potential energy of each pass's own nodes"
    words = f"(6) at the paper's times, {words}; {WORKS[work]}"
    if not letter:
        return _row(words, "printed", log, nodes=published.TIMES, work=work)
    return {"words": words} | answer_of(*by_letter(log, published.TIMES, work), log)


def _single(log: Log) -> Answer:
    """Errors (per cent) of J1^ by (6) from one interval each, where k tilde no longer grows."""
    _, values = each_interval(log)
    errors = 100 * (values / log.truth - 1)
    settled = errors[len(errors) // 2 :]
    return {"intervals": len(settled), "rms": float(np.sqrt(np.mean(settled**2))), "worst": float(max(abs(settled)))}


def _tracking(log: Recording) -> float:
    assert log.reference is not None
    late = log.time > log.time[-1] / 2
    return float(np.sqrt(np.mean((log.reference - log.angle)[late] ** 2)))


@cache
def curve_of(law: str, frequency: float) -> Curve:
    """The backstepping run of Fig. 8 by the law "printed" or "consistent": 0.8 sin (frequency t), ideal, 10 kHz."""
    twin = ideal_rig()
    controller = Backstepping.paper(twin, law="printed" if law == "printed" else "consistent")
    log = run_of(twin, Sine(published.AMPLITUDE, frequency), controller, duration=12.0, rate=1e4).recording
    assert log.adaptive_gain is not None
    return Curve(law, frequency, log.time, controller.inertia(log.adaptive_gain))


def _convergence(curve: Curve, truth: float) -> Answer:
    errors = 100 * (curve.inertia / truth - 1)
    error, after = published.BACKSTEPPING
    return {
        "law": curve.law,
        "frequency": curve.frequency,
        "after_8_s": float(errors[np.searchsorted(curve.time, after)]),
        "within_5": settled_within(curve.time, errors, error),
        "within_1": settled_within(curve.time, errors, 1.0),
        "end": float(errors[-1]),
    }
