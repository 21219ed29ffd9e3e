"""Where the experiment's 7 % could come from: one imperfection at a time, and what it does to J1^ and J_e^.

Only the imperfection is there: viscous friction as in the paper, everything else as stated. The paper's method is (6)
with the voltage as it was held, mirrored about the measured turning points; NLS is output error under the voltage with
viscous and Coulomb friction in its model.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from swingid.study.changes import Times, changed
from swingid.study.experiment import without_truth
from swingid.study.reproduce import published, runs
from swingid.study.reproduce.runs import Answer, Log

COMPARED, PAPER_ONLY = ("printed", "nls", "momentum"), ("printed",)


@dataclass(frozen=True)
class Imperfection:
    """What is not as it should be.

    stated: constants of the rig file times a factor, as the lab states them; friction, sensors: what the twin has
    and the lab does not know; options: of the paper's method; mirror: whether nodes stand about the reference's turning
    points; letter: whether (6) is taken letter by letter there (`by_letter`); draws: seeds, where the phase of the
    nonlinearity or the place of the grids of encoders matters. size: how large it is, with its unit, where half of it
    does half as much.
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
    size: Sequence[float | str] | None = None


def imperfections() -> list[Imperfection]:
    """The rows of the table: constants stated too large and too small, then what the file of cases has."""
    cases = published.stated_in("cases")
    rows = [Imperfection("nothing", "none")]
    for letter, (key, per_cent) in cases["stated"].items():
        for sign, share in (("+", per_cent / 100), ("−", -per_cent / 100)):
            words, stated = f"{letter} stated {sign} {per_cent} %", {key: 1 + share}
            rows.append(Imperfection(words, "constants", stated, size=(per_cent, "%")))
    return rows + [Imperfection(words, **row) for words, row in cases["imperfection"].items()]


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
    row: Answer = {name: getattr(imperfection, name) for name in ("words", "group", "draws", "size")}
    for estimator, errors in by_estimator.items():
        j1, j_e = np.array(errors).T
        row[estimator] = {"j1": _one(j1), "j_e": _one(j_e)}
    if imperfection.draws > 1 and imperfection.group == "sensors":
        # of J1^ by (6) from one interval alone: root mean square over all intervals of all draws
        drawn = [_log("plain", imperfection, seed + draw, logs) for draw in range(imperfection.draws)]
        row["single"] = _rms(np.concatenate([runs.interval_errors(log)[1] for log in drawn]))
    return row


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
    return pair[0].error(values[0]), 100 * ((values[1] - values[0]) / published.J_E - 1)
