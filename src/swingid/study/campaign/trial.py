"""One trial: the twin draws and runs, a log is written and read back, every method answers; rows of the results.

A trial is a pure function of the plan and its number: any process may do it, at any time.

Trials of a point can also be done together: the ensemble simulates them in a block, and the batched estimators read
it. That is some hundred times faster, and less: the inertia with its type A uncertainty alone, arrays in place of
files, no measures of the loop.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import lru_cache
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np

from swingid.batch import energy_batch, momentum_batch, plan_batch
from swingid.errors import SwingidError
from swingid.identification import identify
from swingid.methods.output_error.bound import cramer_rao
from swingid.methods.table import one_momentum
from swingid.recording.recording import Recording
from swingid.result.result import Parameter
from swingid.simulation.draws import draw_constants
from swingid.simulation.ensemble import simulate_ensemble
from swingid.study.campaign.experiment import experiment_of
from swingid.study.experiment import Experiment, encoder_places

if TYPE_CHECKING:
    from swingid import batch
    from swingid.result.result import Result
    from swingid.simulation.ensemble import Ensemble
    from swingid.study.campaign.plan import Plan

STILL = 0.01
"""Share of its final value within which the gain k tilde counts as settled."""

AT_LIMIT = 0.999
"""Share of the voltage limit from which on a command counts as saturated."""

Row = dict[str, Any]

FOR_CHOICES = 3
"""Runs of each point from which `plan_batch` chooses windows and smoothing for all of them."""

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

    def _true(self, quantity: str) -> float:
        """The true value of a parameter, or of a ratio such as "gravity_torque/inertia"; NaN where there is none."""
        over, slash, under = quantity.partition("/")
        value = _number(self.truth.get(over))
        return value / _number(self.truth.get(under)) if slash else value

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
            "truth": self._true(quantity),
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
        known = experiment.read(log)
    except Exception as error:
        # whatever it is, it concerns this trial alone: the others go on, and the row holds the reason
        return [head.row(name, q, error, FAILED) for name in plan.tables.base.methods or [""] for q in quantities]
    motor = experiment.twin.drive.motor
    loop = loop_of(log, None if motor is None else motor.voltage_limit)
    truth = log.metadata["truth"]
    assert isinstance(truth, dict)
    head = replace(head, truth=truth, loop=loop, bounds=bounds_of(plan, experiment, log))
    rows = [] if experiment.methods else [head.row("", q, None) for q in quantities]
    with one_momentum():
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


def batch_rows(plan: Plan, trials: Sequence[int]) -> list[Row]:
    """The rows of some trials, in their order: a group for each point among them."""
    rows = []
    for point, group in groupby(trials, key=lambda trial: plan.place(trial)[0]):
        rows += _rows_together(plan, point, list(group))
    return rows


def _rows_together(plan: Plan, point: int, trials: list[int]) -> list[Row]:
    """The rows of trials of one point; where one of them fails the others are done without it."""
    names = plan.tables.base.methods
    try:
        experiment = experiment_at(Known(plan), point)
        chosen = _choices(Known(plan), point)
        seeds = [plan.seed(*plan.place(trial)) for trial in trials]
        runs = simulate_ensemble(
            experiment.twin,
            experiment.reference,
            experiment.controller,
            duration=experiment.duration,
            rate=experiment.rate,
            seeds=seeds,
            initial_angle=experiment.initial_angle,
            draw=experiment.draw,
            encoder_zero=[encoder_places(experiment.twin, seed) for seed in seeds],
            record="all" if plan.tables.bound else "measured",
            threads=1,
        )
    except Exception as error:
        if len(trials) > 1:
            half = len(trials) // 2
            return _rows_together(plan, point, trials[:half]) + _rows_together(plan, point, trials[half:])
        return [Head.of(plan, trials[0]).row(name, "inertia", error, FAILED) for name in names]
    found = [_estimates(method, runs, experiment, chosen) for _, method, _ in experiment.methods]
    rows = []
    for k, trial in enumerate(trials):
        truth = {"inertia": _inertia(experiment, seeds[k])}
        bounds = bounds_of(plan, experiment, runs.recording(k)) if plan.tables.bound else {}
        head = replace(Head.of(plan, trial), truth=truth, bounds=bounds)
        rows += [_row(head, name, estimates, k) for name, estimates in zip(names, found, strict=True)]
    return rows


@lru_cache(maxsize=64)
def _choices(known: Known, point: int) -> batch.Plan:
    """What the batched estimators choose once for a point, from its first runs."""
    plan, experiment = known.plan, experiment_at(known, point)
    logs = [experiment.log(plan.seed(point, repeat)) for repeat in range(FOR_CHOICES)]
    return plan_batch([experiment.read(log) for log in logs], experiment.stated)


def _estimates(method: str, runs: Ensemble, experiment: Experiment, chosen: batch.Plan) -> batch.Batch | Exception:
    """The estimates of all runs by one method, or why there are none."""
    angle, stated = runs.channel("angle"), experiment.stated
    wheel = runs.channel("wheel_angle") if stated.drive.kind == "reaction-wheel" else None
    try:
        if method == "momentum-batch":
            return momentum_batch(angle, wheel, experiment.rate, stated, chosen, threads=1)
        return energy_batch(angle, wheel, runs.channel("command"), experiment.rate, stated, chosen, threads=1)
    except Exception as error:  # as in `run_trial`
        return error


def _inertia(experiment: Experiment, seed: int) -> float:
    """The twin's inertia, as drawn."""
    assert experiment.twin.axis.inertia is not None
    drawn = draw_constants(experiment.twin, seed) if experiment.draw else {}
    return drawn.get("axis.inertia", experiment.twin.axis.inertia.value)


def _row(head: Head, name: str, estimates: batch.Batch | Exception, k: int) -> Row:
    if isinstance(estimates, Exception):
        return head.row(name, "inertia", estimates, REFUSED)
    value, u = float(estimates.inertia[k]), float(estimates.u[k])
    if not math.isfinite(value):
        error = SwingidError("the log holds too few swings", code="too-short")
        return head.row(name, "inertia", error, REFUSED)
    return head.row(name, "inertia", Parameter.of(value, u, "kg m^2"))
