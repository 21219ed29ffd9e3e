"""Where the experiment's 7 % could come from: one imperfection at a time, and what it does to J1^ and J_e^.

Only the imperfection is there: viscous friction as in the paper, everything else as stated. The paper's method is (6)
with the voltage as it was held, mirrored about the measured turning points; NLS is output error under the voltage with
viscous and Coulomb friction in its model.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from swingid.study.changes import Times, changed
from swingid.study.experiment import without_truth
from swingid.study.reproduce import runs
from swingid.study.reproduce.published import J_E
from swingid.study.reproduce.runs import Answer, Log

MOTOR = {
    "torque_per_volt": "c1",
    "efficiency": "η",
    "back_emf": "c2",
    "viscous": "f2",
    "coulomb": "f3",
    "dead_zone": "d1, d2",
    "rotor_inertia": "Jr",
}
"""Motor constants by their key, with the paper's letter."""

DRAWS = 8
"""Seeds, where the phase of the encoders' nonlinearity or the place of their grids matters; their root mean square."""

COMPARED, PAPER_ONLY = ("printed", "nls", "momentum"), ("printed",)


@dataclass(frozen=True)
class Imperfection:
    """What is not as it should be.

    stated: constants of the rig file times a factor, as the lab states them; friction, sensors: what the twin has
    and the lab does not know; options: of the paper's method; mirror: whether nodes stand about the reference's turning
    points; letter: whether (6) is taken letter by letter there (`by_letter`); draws: how often it is drawn. size: how
    large it is, with its unit, where half of it does half as much.
    """

    words: str
    group: str
    stated: Mapping[str, float] = field(default_factory=dict)
    friction: Mapping[str, object] = field(default_factory=dict)
    sensors: Mapping[str, object] = field(default_factory=dict)
    options: Mapping[str, object] = field(default_factory=dict)
    mirror: bool = False
    letter: bool = False
    draws: int = 1
    size: tuple[float, str] | None = None


FRICTIONS: dict[str, dict[str, object]] = {
    "Stribeck, 2 to 4 mN m": {"coulomb": 2e-3, "static": 4e-3, "stribeck_speed": 0.3},
    "quadratic, 0.4 mN m s²": {"viscous": 2e-4, "quadratic": 4e-4},
    "viscous, ± 50 % by direction": {"viscous": None, "viscous_positive": 1.716e-3, "viscous_negative": 0.572e-3},
    "LuGre, 3 mN m, bristles of 1 mrad": {
        "coulomb": 3e-3,
        "lugre": {"bristle_stiffness": 3.0, "bristle_damping": 0.01},
    },
    "viscous, 8 times as much": {"viscous": 9.152e-3},
}
"""Friction of the twin that is not the paper's, by its words."""

PROCESSING: dict[str, dict[str, Any]] = {
    "mirror about the reference's turning points": {"mirror": True},
    "the same, (6) letter by letter (one potential energy for both passes)": {"mirror": True, "letter": True},
    "mirror about the reference's, 8 times the viscous friction": {"mirror": True, "friction": {"viscous": 9.152e-3}},
    "speeds by the observers (23)": {"options": {"velocities": "observers", "filter_time": 0.0}, "draws": DRAWS},
    "and the voltage through W_f": {"options": {"velocities": "observers"}, "draws": DRAWS},
    "work by the trapezoid on samples": {"options": {"work": "trapezoid"}},
}
"""Other ways to compute (6), by their words."""


def imperfections() -> list[Imperfection]:
    """The rows of the table."""
    rows = [Imperfection("nothing", "none")]
    for key, letter in MOTOR.items():
        rows += _stated(letter, f"drive.motor.{key}", 5)
    rows += _stated("gear i⁻¹", "drive.motor.gear_ratio", 1)
    rows += _stated("wheel J2", "drive.wheel.inertia", 1) + _stated("b", "axis.gravity_torque", 1)
    for size in ("0.1", "0.8"):
        words = f"encoders nonlinear by {size}° once per turn"
        rows.append(Imperfection(words, "sensors", sensors={"nonlinearity": f"{size} deg"}, draws=DRAWS))
    late: tuple[tuple[str, dict[str, object]], ...] = (
        ("both encoders", {"latency": 1e-3}),
        ("wheel's encoder", {"wheel": {"latency": 1e-3}}),
    )
    rows += [
        Imperfection(f"{which} 1 ms late, not declared", "sensors", sensors=sensors, size=(1.0, "ms"))
        for which, sensors in late
    ]
    rows += [Imperfection(f"friction: {words}", "friction", friction=law) for words, law in FRICTIONS.items()]
    return rows + [Imperfection(words, "processing", **changes) for words, changes in PROCESSING.items()]


def _stated(words: str, key: str, per_cent: float) -> list[Imperfection]:
    """A constant that the rig file states too large and too small."""
    size = (per_cent, "%")
    return [
        Imperfection(f"{words} stated {sign} {per_cent:g} %", "constants", stated={key: factor}, size=size)
        for sign, factor in (("+", 1 + per_cent / 100), ("−", 1 - per_cent / 100))
    ]


def imperfection_rows(seed: int, progress: Callable[[str], None]) -> list[Answer]:
    """What each does: errors of J1^ and J_e^ in per cent, by the paper's method, by NLS and by momentum."""
    logs: dict[tuple[str, str, int], Log] = {}
    rows = []
    for imperfection in imperfections():
        progress(f"imperfection: {imperfection.words}")
        rows.append(_row(imperfection, seed, logs))
    return rows


def _row(imperfection: Imperfection, seed: int, logs: dict[tuple[str, str, int], Log]) -> Answer:
    ways = PAPER_ONLY if imperfection.group == "processing" else COMPARED
    by_estimator: dict[str, list[tuple[float, float]]] = {estimator: [] for estimator in ways}
    for draw in range(imperfection.draws):
        pair = [_log(case, imperfection, seed + draw, logs) for case in ("plain", "body")]
        for estimator in ways:
            by_estimator[estimator].append(_errors(estimator, pair, imperfection))
    row: Answer = {"words": imperfection.words, "group": imperfection.group, "draws": imperfection.draws}
    row["size"] = None if imperfection.size is None else list(imperfection.size)
    for estimator, errors in by_estimator.items():
        j1, j_e = np.array(errors).T
        row[estimator] = {"j1": _one(j1), "j_e": _one(j_e)}
    if imperfection.draws > 1 and imperfection.group == "sensors":
        row["single"] = _single(imperfection, seed, logs)
    return row


def _single(imperfection: Imperfection, seed: int, logs: dict[tuple[str, str, int], Log]) -> float:
    """Error (per cent) of J1^ by (6) from one interval alone: root mean square over all intervals of all draws."""
    drawn = [_log("plain", imperfection, seed + draw, logs) for draw in range(imperfection.draws)]
    return _rms(np.concatenate([runs.interval_errors(log)[1] for log in drawn]))


def _one(errors: np.ndarray) -> float | None:
    """The error, of several draws their root mean square; None where the method refused or did not converge."""
    if not np.isfinite(errors).all():
        return None
    return float(errors[0]) if len(errors) == 1 else _rms(errors)


def _rms(errors: np.ndarray) -> float:
    return float(np.sqrt(np.mean(errors**2)))


def _log(case: str, imperfection: Imperfection, seed: int, logs: dict[tuple[str, str, int], Log]) -> Log:
    """The log, made once for all rows with the same twin; the rig is the one that the lab states."""
    stated = changed(runs.rig_of(case), {key: Times(factor) for key, factor in imperfection.stated.items()})
    twin = runs.with_friction(runs.rig_of(case), imperfection.friction)
    twin = twin.changed({f"sensors.{key}": value for key, value in imperfection.sensors.items()})
    key = (case, repr((imperfection.friction, imperfection.sensors)), seed)
    if key not in logs:
        logs[key] = runs.experiment_log(case, twin, seed, stated=runs.rig_of(case))
    return replace(logs[key], rig=without_truth(stated))


def _errors(estimator: str, pair: list[Log], imperfection: Imperfection) -> tuple[float, float]:
    """Errors of J1^ and J_e^, per cent."""
    values = []
    for case, log in zip(("plain", "body"), pair, strict=True):
        options: dict[str, object] = dict(imperfection.options) if estimator == "printed" else {}
        if imperfection.mirror:
            options["nodes"] = nodes = runs.reference_nodes(runs.motion(case), log)
            if imperfection.letter:
                values.append(runs.by_letter(log, nodes)[0])
                continue
        result = runs.result_by(estimator, log, **options)
        # the last value of a least-squares search that did not converge has no meaning
        lost = isinstance(result, str) or any(message.code == "not-converged" for message in result.warnings)
        values.append(math.nan if isinstance(result, str) or lost else result.inertia.value)
    return pair[0].error(values[0]), 100 * ((values[1] - values[0]) / J_E - 1)
