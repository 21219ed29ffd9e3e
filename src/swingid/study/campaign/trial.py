"""One trial: the twin draws and runs, a log is written and read back, every method answers; rows of the results.

A trial is a pure function of the plan and its number: any process may do it, at any time.

Trials of a point can also be done together: the ensemble simulates them in a block, and the batched estimators read
it. That is some hundred times faster, and less: the inertia with its type A uncertainty alone, arrays in place of
files, no measures of the loop.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import groupby
from typing import TYPE_CHECKING

from swingid.batch import energy_batch, momentum_batch, plan_batch
from swingid.errors import SwingidError
from swingid.methods.output_error.bound import cramer_rao
from swingid.recording.recording import Recording
from swingid.result.result import Parameter
from swingid.simulation.draws import draw_constants
from swingid.simulation.ensemble import simulate_ensemble
from swingid.study.campaign.experiment import experiment_of
from swingid.study.experiment import Experiment, encoder_places
from swingid.study.trials import FAILED, REFUSED, Head, Row, rows_of

if TYPE_CHECKING:
    from swingid import batch
    from swingid.simulation.ensemble import Ensemble
    from swingid.study.campaign.plan import Plan

FOR_CHOICES = 3
"""Runs of each point from which `plan_batch` chooses windows and smoothing for all of them."""


def head_of(plan: Plan, trial: int) -> Head:
    """The head of a trial of which no more than its place is known."""
    point, repeat = plan.place(trial)
    place = {"trial": trial, "point": point, "repeat": repeat, "seed": plan.seed(point, repeat)}
    return Head({**place, **plan.points[point].labels})


def run_trial(plan: Plan, trial: int) -> list[Row]:
    """The rows of one trial: one per method and quantity, whatever happens in it."""
    head = head_of(plan, trial)
    quantities = plan.tables.quantities
    try:
        experiment = experiment_at(plan, head.place["point"])
        log = experiment.log(head.place["seed"])
    except Exception as error:
        # whatever it is, it concerns this trial alone: the others go on, and the row holds the reason
        return [head.row(name, q, error, FAILED) for name in plan.tables.base.methods or [""] for q in quantities]
    return rows_of(replace(head, bounds=bounds_of(plan, experiment, log)), experiment, log, quantities)


@lru_cache(maxsize=64)
def experiment_at(plan: Plan, point: int) -> Experiment:
    """The experiment of a point, made once per process."""
    return experiment_of(plan, plan.points[point])


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
        experiment, chosen = experiment_at(plan, point), _choices(plan, point)
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
        return [head_of(plan, trials[0]).row(name, "inertia", error, FAILED) for name in names]
    estimated = [_estimates(method, runs, experiment, chosen) for _, method, _ in experiment.methods]
    rows = []
    assert experiment.twin.axis.inertia is not None
    for k, trial in enumerate(trials):
        drawn = draw_constants(experiment.twin, seeds[k]) if experiment.draw else {}
        truth = {"inertia": drawn.get("axis.inertia", experiment.twin.axis.inertia.value)}
        bounds = bounds_of(plan, experiment, runs.recording(k)) if plan.tables.bound else {}
        head = replace(head_of(plan, trial), truth=truth, bounds=bounds)
        rows += [_row(head, name, estimates, k) for name, estimates in zip(names, estimated, strict=True)]
    return rows


@lru_cache(maxsize=64)
def _choices(plan: Plan, point: int) -> batch.Plan:
    """What the batched estimators choose once for a point, from its first runs."""
    experiment = experiment_at(plan, point)
    logs = [experiment.log(plan.seed(point, repeat)) for repeat in range(FOR_CHOICES)]
    return plan_batch([experiment.read(log) for log in logs], experiment.stated)


def _estimates(method: str, runs: Ensemble, experiment: Experiment, chosen: batch.Plan) -> batch.Batch | Exception:
    """The estimates of all runs by one method, or why there are none."""
    angle, stated = runs.channel("angle"), experiment.stated
    wheel = runs.channel("wheel_angle") if stated.drive.wheel is not None else None
    try:
        if method == "momentum-batch":
            return momentum_batch(angle, wheel, experiment.rate, stated, chosen, threads=1)
        return energy_batch(angle, wheel, runs.channel("command"), experiment.rate, stated, chosen, threads=1)
    except Exception as error:  # as in `run_trial`
        return error


def _row(head: Head, name: str, estimates: batch.Batch | Exception, k: int) -> Row:
    if isinstance(estimates, Exception):
        return head.row(name, "inertia", estimates, REFUSED)
    value, u = float(estimates.inertia[k]), float(estimates.u[k])
    if not math.isfinite(value):
        error = SwingidError("the log holds too few swings", code="too-short")
        return head.row(name, "inertia", error, REFUSED)
    return head.row(name, "inertia", Parameter.of(value, u, "kg m^2"))
