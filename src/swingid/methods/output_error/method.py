"""Output error: least squares of simulated against measured angles (the paper's NLS, section 5; MATLAB's nlgreyest).

The default simulates equations (I) and (II) under the held voltage, so it depends on the motor's constants;
input="wheel" takes the measured wheel as the input of (I) and needs none. Either way the model contains a friction law:
a wrong one biases the inertia, which the residuals show. `momentum` needs no law.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from swingid.checks.momentum import MomentumCheck
from swingid.errors import UnanswerableError
from swingid.methods.output_error.answer import answer_of, details_of, estimate_of, type_a
from swingid.methods.output_error.checks import check_fit, is_poor, left_of_channels
from swingid.methods.output_error.declared import constants_found
from swingid.methods.output_error.problem import Problem
from swingid.methods.output_error.search import (
    DISTINCT,
    RICHEST,
    Choice,
    Searched,
    best_start,
    choose_law,
    first_values,
    search,
)
from swingid.methods.output_error.setup import Setup
from swingid.methods.output_error.unknowns import Unknowns
from swingid.numerics.arrays import Array
from swingid.numerics.gauss_newton import CLOSE, solve, solve_from
from swingid.result.result import Result
from swingid.uncertainty.dark import dark_uncertainty
from swingid.uncertainty.significance import bayesian, misfit

SHORTEST = 48
"""Rows of the shortest segment."""

SHARES = (64, 16, 8, 4)
"""Numbers of parts of a segment within which residuals may be correlated."""

SWINGS = 4
"""Half swings per segment: longer ones add little information, shorter ones spend it on their initial values."""


def output_error(
    check: MomentumCheck,
    *,
    input: str | None = None,
    law: str = "auto",
    free: str | Sequence[str] = (),
    loss: str = "linear",
    starts: int = 3,
    segment: float | None = None,
) -> Result:
    """Identify inertia and friction by least squares of simulated against measured angles.

    input: "voltage" (default with a whole voltage, the wheel's angle and motor constants) or "wheel" (default
    otherwise), of a wheel rig.
    law: a friction law of `friction_laws.LAWS`, with ", offset" or ", direction-dependent" after it where wanted, or
    "auto": the law of least Bayesian information criterion. free: further unknowns, as a sequence or with commas:
    gravity_torque, torque_per_volt, back_emf, motor_viscous, motor_coulomb, efficiency, rotor_inertia, wheel_inertia.
    loss: "linear", "huber" or "soft_l1". starts: number of starting points of the search. segment: length of the
    segments with initial values of their own, s; four half swings by default.

    Raises UsageError for unknown options, InputError where a channel is missing or has the wrong sign,
    UnanswerableError where the motor's constants are missing or the motion does not determine the inertia.
    """
    setup = Setup.of(check, input, law, free, loss, starts, segment)
    estimate = estimate_of(*_best_fit(setup, law))
    searched = estimate.searched
    answer, differs = answer_of(estimate), None
    if check.evidence is not None and not estimate.robust:  # outliers have their whole weight in momentum
        cause = "wrong motor constants" if setup.source == "voltage" else "friction that is not of this law"
        answer, differs = check.compared(answer, cause)
    checked = check_fit(answer, estimate, differs)
    answer = check.widened(answer)
    options: dict[str, object] = {"input": setup.source, "law": searched.law, "loss": loss, "starts": starts}
    if setup.free:
        options["free"] = setup.free
    constants = constants_found(searched, setup.rig)
    return check.prepared.result(
        "output-error",
        answer,
        setup.part,
        checked,
        details_of(estimate, left_of_channels(searched)),
        options,
        more={"constants_found": constants} if constants else {},
    )


def _best_fit(setup: Setup, law: str) -> tuple[Setup, Searched]:
    """The fit and its setup. Raises UnanswerableError where its simulated motion diverges.

    What rig.toml states with an uncertainty is estimated only where the model then explains the log: with a wrong model
    it would compensate for what the model lacks.
    """
    searched = _fit(setup, law)
    if any(setup.uncertain) and is_poor(searched):
        setup = replace(setup, moves=False)
        searched = _fit(setup, law)
    if not np.isfinite(searched.fit.cost):
        raise UnanswerableError(
            f"no parameters make the model follow this log: with the friction law {searched.law!r} the simulated "
            f"motion diverges; take {setup.alternative}, or correct the rig file.",
            code="poor-fit",
        )
    return setup, searched


def _fit(setup: Setup, law: str) -> Searched:
    # Stribeck's peak has minima of its own, so its speed is sought about a motion without it
    peaked = "stribeck" in law
    rough = _rough_fit(setup, RICHEST if law == "auto" or peaked else law, near=not peaked)
    return _final_fit(setup, rough, law) if np.isfinite(rough.fit.cost) else rough


def _rough_fit(setup: Setup, law: str, *, near: bool) -> Searched:
    """A first fit, on segments of the given length, or of one that suits.

    With a model that is not quite the rig's the simulation drifts away from the log over a long segment. Where the fit
    is poor the segments are halved (quartered where the search does not converge), and those with the least standard
    uncertainty of the inertia are taken. near: first as from values that are nearly the best (`search`).
    """
    unknowns = setup.unknowns(law)
    values = first_values(setup, unknowns)
    length = SWINGS * setup.part.motion.half_period if setup.segment is None else setup.segment
    tried: list[Searched] = []
    while True:
        problem = setup.problem(length)
        if tried:
            searched = search(problem, unknowns, values, setup.loss)
        else:
            searched = _first_search(setup, problem, unknowns, values, near=near)
        tried.append(replace(searched, law=law))
        # where the search does not converge the segments are far too long
        length /= 2 if searched.fit.converged else 4
        if setup.segment is not None or not is_poor(searched) or length * setup.part.log.rate < SHORTEST:
            break
    if len(tried) == 1:
        return tried[0]
    spread = np.array([type_a(setup, searched) for searched in tried])
    best = int(np.argmin(np.where(np.isfinite(spread), spread, np.inf)))
    searched = tried[best]
    drift = 0.0
    if best > 0 and np.isfinite(spread[best - 1]):
        # of the same readings, so the variance of the difference is that of the variances (Hausman 1978)
        change = float(searched.fit.values[0] - tried[best - 1].fit.values[0])
        drift = dark_uncertainty(change, float(spread[best - 1] ** 2 - spread[best] ** 2), float(spread[best]))
    return replace(searched, drift=drift)


def _first_search(setup: Setup, problem: Problem, unknowns: Unknowns, values: Array, *, near: bool) -> Searched:
    """A search on segments of the given length from the best of several starts."""
    begin, agreeing = best_start(problem, unknowns, values, setup.loss, setup.starts)
    for how in (True, False) if near and setup.starts > 1 else (False,):
        searched = search(problem, unknowns, begin, setup.loss, near=how)
        searched = replace(searched, starts=setup.starts, agreeing=agreeing)
        if not (unknowns.zero_bound(searched.fit.values) or is_poor(searched)):
            return searched
    # a zero offset of more than a step counts where it alone makes the model explain the log
    other = search(problem, unknowns.with_zero_of(None), values, setup.loss)
    return searched if is_poor(other) else other


def _final_fit(setup: Setup, rough: Searched, law: str) -> Searched:
    """The fit with the given law, or with the law of least Bayesian information criterion.

    The laws are compared to first order about the motion of `RICHEST`. A law whose fit is then worse than what the next
    one promises is not near this motion (a peak of friction narrower than the steps of speed) or needs torques that
    are negative there: the next is fitted too, and the best fit is taken.
    """
    if rough.law == law:
        return replace(rough, fit=solve_from(rough.fit))
    independent, names = _independent(rough), DISTINCT if law == "auto" else (law,)
    fitted: list[tuple[float, Searched]] = []
    while names:
        choice = choose_law(rough, independent, setup.fastest, names)
        searched = _fit_of(setup, rough, choice)
        criterion = bayesian(searched.fit.cost, choice.size, independent) - misfit(rough.fit.cost, independent)
        fitted.append((criterion, searched))
        best, searched = min(fitted, key=lambda pair: pair[0])
        if best <= choice.following:
            break
        names = tuple(name for name in names if name != choice.law)
    return searched


def _fit_of(setup: Setup, rough: Searched, choice: Choice) -> Searched:
    """The fit with the law of `choice`, from its values."""
    problem, unknowns = rough.problem, setup.unknowns(choice.law).with_zero_of(rough.unknowns)
    begin, shooting = np.array([choice.values[name] for name in unknowns.names]), problem.shooting(unknowns, setup.loss)
    if rough.near and "stribeck" not in choice.law:  # whose peak is not linear in its speed
        fit = solve(shooting, begin, choice.states, damping=CLOSE)
    else:
        fit = solve(shooting, begin, rough.fit.states)
    if not np.isfinite(fit.cost):  # values by a linear change of the motion, which may have a negative friction
        fit = search(problem, unknowns, first_values(setup, unknowns), setup.loss).fit
    return replace(
        rough, unknowns=unknowns, fit=fit, candidates=choice.candidates, law=choice.law, spread=choice.spread
    )


def _independent(searched: Searched) -> float:
    """Effective number of independent readings: fewer where residuals of neighbours are correlated."""
    problem, total, runs = searched.problem, 0.0, np.zeros(len(SHARES))
    for first, last in zip(problem.rows[:-1], problem.rows[1:], strict=True):
        for channel in (False, True):
            residuals = searched.fit.residuals[first:last][problem.wheel[first:last] == channel]
            total += float(residuals @ residuals)
            for k, share in enumerate(SHARES):
                size = max(len(residuals) // share, 1)
                runs[k] += float(np.sum(residuals[: len(residuals) // size * size].reshape(-1, size).sum(axis=1) ** 2))
    inflation = max(float(np.max(runs)) / total, 1.0) if total > 0 else 1.0
    return max(len(problem.measured) / inflation, 8.0)
