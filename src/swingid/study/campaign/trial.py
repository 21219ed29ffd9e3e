"""One trial: the twin draws and runs, a log is written and read back, every method answers; rows of the results.

A trial is a pure function of the plan and its number: any process may do it, at any time.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from swingid.errors import SwingidError
from swingid.identification import identify
from swingid.methods.output_error.bound import cramer_rao
from swingid.recording.recording import Recording
from swingid.study.campaign.experiment import experiment_of
from swingid.study.experiment import Experiment, through_file

if TYPE_CHECKING:
    from swingid.result.result import Parameter, Result
    from swingid.study.campaign.plan import Plan

STILL = 0.01
"""Share of its final value within which the gain k tilde counts as settled."""

AT_LIMIT = 0.999
"""Share of the voltage limit from which on a command counts as saturated."""


Row = dict[str, Any]

FAILED, REFUSED = "failed", "refused"
"""Status of a row where there was no log, and where the method has no number; others are those of a result."""


@dataclass(frozen=True)
class Loop:
    """Measures of one run; NaN where there is no loop.

    wanted, tracking: RMS of y_m less its mean, and of y_m - q1, over the second half (rad). k_tilde: the gain at the
    end. settling (s): since when k tilde is within 1 % of it. chatter: RMS of the voltage's change from sample to
    sample over the second half (V; direct drive N m). saturated: share of the second half at the voltage's limit.
    """

    wanted: float = np.nan
    tracking: float = np.nan
    k_tilde: float = np.nan
    settling: float = np.nan
    chatter: float = np.nan
    saturated: float = np.nan


def loop_of(log: Recording, limit: float | None) -> Loop:
    """The measures of a log that holds its reference and its gain. limit: of the voltage, None for none."""
    if log.reference is None or log.adaptive_gain is None:
        return Loop()
    half = slice(len(log) // 2, None)
    gain = log.adaptive_gain
    far = np.flatnonzero(np.abs(gain - gain[-1]) > STILL * abs(gain[-1]))
    settled = log.time[far[-1] + 1] - log.time[0] if len(far) else 0.0
    commands = log.voltage if log.voltage is not None else log.torque
    chatter = saturated = np.nan
    if commands is not None:
        chatter = float(np.sqrt(np.mean(np.diff(commands[half]) ** 2)))
        saturated = 0.0 if limit is None else float(np.mean(np.abs(commands[half]) >= AT_LIMIT * limit))
    tracking = float(np.sqrt(np.mean((log.reference - log.angle)[half] ** 2)))
    return Loop(float(np.std(log.reference[half])), tracking, float(gain[-1]), float(settled), chatter, saturated)


@dataclass(frozen=True)
class Head:
    """What all rows of a trial have in common: its place, the twin's true values, measures of the loop, bounds."""

    place: Row
    truth: Row = field(default_factory=dict)
    loop: Loop = field(default_factory=Loop)
    bounds: dict[str, float] = field(default_factory=dict)

    @classmethod
    def of(cls, plan: Plan, trial: int) -> Head:
        """The head of a trial of which no more than its place is known."""
        point, repeat = plan.place(trial)
        place = {"trial": trial, "point": point, "repeat": repeat, "seed": plan.seed(point, repeat)}
        return cls({**place, **plan.points[point].labels})

    def row(
        self,
        method: str,
        quantity: str,
        found: Parameter | Exception | None,
        status: str = "ok",
        warnings: Iterable[str] = (),
    ) -> Row:
        """A row with a number, with the reason why there is none, or with neither."""
        nothing = dict.fromkeys(("value", "u", "low", "high", "error"), math.nan)
        code, message = _reason(found) if isinstance(found, Exception) else ("", "")
        row = {
            **self.place,
            "method": method,
            "quantity": quantity,
            "status": status,
            "code": code,
            "message": message,
            "warnings": " ".join(sorted(set(warnings))),
            "truth": _number(self.truth.get(quantity)),
            **nothing,
            "bound": self.bounds.get(quantity, math.nan),
            **asdict(self.loop),
        }
        if found is None or isinstance(found, Exception):
            return row
        low, high = found.interval95 or (math.nan, math.nan)
        u = math.nan if found.standard_uncertainty is None else found.standard_uncertainty
        error = found.value / row["truth"] - 1 if row["truth"] else math.nan
        return row | {"value": found.value, "u": u, "low": low, "high": high, "error": error}


def run_trial(plan: Plan, trial: int) -> list[Row]:
    """The rows of one trial: one per method and quantity, whatever happens in it."""
    head = Head.of(plan, trial)
    quantities = plan.tables.quantities
    try:
        experiment = experiment_at(Known(plan), head.place["point"])
        log = experiment.log(head.place["seed"])
        known = through_file(log, experiment.stated)
    except Exception as error:
        # whatever it is, it concerns this trial alone: the others go on, and the row holds the reason
        return [head.row(name, q, error, FAILED) for name in plan.tables.base.methods or [""] for q in quantities]
    motor = experiment.twin.drive.motor
    loop = loop_of(log, None if motor is None else motor.voltage_limit)
    truth = log.metadata["truth"]
    assert isinstance(truth, dict)
    head = replace(head, truth=truth, loop=loop, bounds=bounds_of(plan, experiment, log))
    rows = [] if experiment.methods else [head.row("", q, None) for q in quantities]
    for name, method, options in experiment.methods:
        try:
            result: Result | Exception = identify(known, experiment.stated, method, **options)
        except Exception as error:  # as above
            result = error
        rows += [_answer(head, name, q, result) for q in quantities]
    return rows


def _answer(head: Head, name: str, quantity: str, result: Result | Exception) -> Row:
    if isinstance(result, Exception):
        return head.row(name, quantity, result, REFUSED)
    if quantity not in result.parameters:
        missing = SwingidError(f"{name} does not identify {quantity}", code="not-identified")
        return head.row(name, quantity, missing, REFUSED)
    warnings = (warning.code for warning in result.warnings)
    return head.row(name, quantity, result.parameters[quantity], result.status, warnings)


class Known:
    """A plan as a key of caches: equal where what decides its results is."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self.key = (plan.source, repr(plan.identity()))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Known) and self.key == other.key

    def __hash__(self) -> int:
        return hash(self.key)


@lru_cache(maxsize=64)
def experiment_at(known: Known, point: int) -> Experiment:
    """The experiment of a point, made once per process."""
    return experiment_of(known.plan, known.plan.points[point])


def bounds_of(plan: Plan, experiment: Experiment, log: Recording) -> dict[str, float]:
    """Least standard deviations by quantity, where the plan has a bound and the sensors have noise."""
    bound = plan.tables.bound
    if bound is None:
        return {}
    try:
        start = (experiment.initial_angle, *[0.0] * (3 if log.wheel_angle is not None else 1))
        return cramer_rao(log, experiment.twin, bound.law, free=bound.free, start=start)
    except SwingidError:
        return {}


def _reason(error: Exception) -> tuple[str, str]:
    if isinstance(error, SwingidError):
        return error.code, error.message
    return f"bug-{type(error).__name__}", " ".join(str(error).split())[:200]


def _number(value: object) -> float:
    return float(value) if isinstance(value, int | float) else math.nan
