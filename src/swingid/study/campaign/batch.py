"""Trials done together: the ensemble simulates all runs of a point in a block, the batched estimators read them.

Some hundred times faster than one by one, and less: the inertia with its type A uncertainty alone, arrays instead of
files, no measures of the loop. For thousands of runs; `identify` is the answer to a single log.
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
from swingid.result.result import Parameter
from swingid.simulation.draws import draw_constants
from swingid.simulation.ensemble import simulate_ensemble
from swingid.study.campaign.trial import FAILED, REFUSED, Head, Known, Row, bounds_of, experiment_at
from swingid.study.experiment import Experiment, encoder_places, through_file

if TYPE_CHECKING:
    from swingid.batch import Batch, Plan
    from swingid.simulation.ensemble import Ensemble
    from swingid.study.campaign.plan import Plan as CampaignPlan

FOR_CHOICES = 3
"""Runs of each point from which `plan_batch` chooses windows and smoothing for all of them."""


def batch_rows(plan: CampaignPlan, trials: Sequence[int]) -> list[Row]:
    """The rows of some trials, in their order: a group for each point among them."""
    rows = []
    for point, group in groupby(trials, key=lambda trial: plan.place(trial)[0]):
        rows += _rows(plan, point, list(group))
    return rows


def _rows(plan: CampaignPlan, point: int, trials: list[int]) -> list[Row]:
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
            return _rows(plan, point, trials[:half]) + _rows(plan, point, trials[half:])
        return [Head.of(plan, trials[0]).row(name, "inertia", error, FAILED) for name in names]
    found = [_estimates(method, runs, experiment, chosen) for _, method, _ in experiment.methods]
    rows = []
    for k, trial in enumerate(trials):
        truth = {"inertia": _inertia(experiment, seeds[k])}
        bounds = bounds_of(plan, experiment, runs.recording(k)) if plan.tables.bound else {}
        head = replace(Head.of(plan, trial), truth=truth, bounds=bounds)
        rows += [_row(head, name, batch, k) for name, batch in zip(names, found, strict=True)]
    return rows


@lru_cache(maxsize=64)
def _choices(known: Known, point: int) -> Plan:
    """What the batched estimators choose once for a point, from its first runs."""
    plan, experiment = known.plan, experiment_at(known, point)
    logs = [experiment.log(plan.seed(point, repeat)) for repeat in range(FOR_CHOICES)]
    return plan_batch([through_file(log, experiment.stated) for log in logs], experiment.stated)


def _estimates(method: str, runs: Ensemble, experiment: Experiment, chosen: Plan) -> Batch | Exception:
    """The estimates of all runs by one method, or why there are none."""
    angle, stated = runs.channel("angle"), experiment.stated
    wheel = runs.channel("wheel_angle") if stated.drive.kind == "reaction-wheel" else None
    try:
        if method == "momentum-batch":
            return momentum_batch(angle, wheel, experiment.rate, stated, chosen, threads=1)
        return energy_batch(angle, wheel, runs.channel("command"), experiment.rate, stated, chosen, threads=1)
    except Exception as error:  # the row says what happened
        return error


def _inertia(experiment: Experiment, seed: int) -> float:
    """The twin's inertia, as drawn."""
    assert experiment.twin.axis.inertia is not None
    drawn = draw_constants(experiment.twin, seed) if experiment.draw else {}
    return drawn.get("axis.inertia", experiment.twin.axis.inertia.value)


def _row(head: Head, name: str, batch: Batch | Exception, k: int) -> Row:
    if isinstance(batch, Exception):
        return head.row(name, "inertia", batch, REFUSED)
    value, u = float(batch.inertia[k]), float(batch.u[k])
    if not math.isfinite(value):
        error = SwingidError("the log holds too few swings", code="too-short")
        return head.row(name, "inertia", error, REFUSED)
    return head.row(name, "inertia", Parameter.of(value, u, "kg m^2"))
