"""The momentum method: inertia and friction from angles alone; no motor constant, no speed, no friction law.

Equation (I) has no motor torque. Multiplied by a modulating function (test function) with compact support and
integrated by parts twice it reads a11 ∫φ'' q1 + a12 ∫φ'' q2 + b ∫φ sin q1 + ∫φ F = 0: linear in a11 and in the terms of
friction, with nothing but angles. The paper's mirror motions (3) are its even windows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from swingid.balance.choice import MEMORY
from swingid.balance.covariance import LAG
from swingid.balance.errors import errors_of, sensitivities
from swingid.balance.fits import BASIS, WindowFit, fit_rows, known_side, with_declared
from swingid.balance.friction import FrictionLaw
from swingid.balance.friction_laws import parameter_weights
from swingid.balance.level import wandering, with_bias
from swingid.balance.reversals import IMPULSES, TIMING
from swingid.balance.rows import Rows, Signals, rows_of
from swingid.balance.systematics import (
    COMPARED,
    common_instants,
    disagreement,
    drift_with_length,
    grid_spread,
    noise_weights,
    timing_spread,
)
from swingid.balance.windows import even_windows, swing_windows
from swingid.checks.answer import IDENTIFIABILITY, check_answer, check_sign, identifiability_note
from swingid.checks.free_decay import loss_unexplained
from swingid.checks.hypothesis import Evidence, Judged
from swingid.checks.momentum import MomentumCheck
from swingid.checks.stability import agreement
from swingid.checks.table import NAMED, check_hypotheses, entries
from swingid.errors import NotIdentifiableError, UnanswerableError, UsageError
from swingid.methods.momentum.together import momentum_together
from swingid.model.rig import Rig
from swingid.model.terms import TERMS, power_of, units_on
from swingid.numerics.arrays import Array
from swingid.recording.findings import Kind
from swingid.result.checked import noted, warned
from swingid.result.provenance import exact_in_row_one
from swingid.result.result import Details, Message, Result, SwingSeries
from swingid.uncertainty.budget import Evaluated, Parameter, Scatter, evaluate, joined, systematic
from swingid.uncertainty.freedom import bartlett, scatter_freedom

NEGLIGIBLE = 1e-3
"""Share of the scatter's uncertainty below which another of type A is omitted from the budget."""


@dataclass(frozen=True)
class _Estimate:
    """The balance of one log with its chosen law windows; fits on other kinds of windows by name.

    common: errors that the scatter of the rows does not contain, by source.
    """

    evidence: Evidence
    others: dict[str, WindowFit]
    common: dict[str, float]
    turning_rows: Rows


def momentum(check: MomentumCheck, *, memory: str = "auto") -> Result:
    """Identify inertia, friction and, where it is "unknown", the gravity torque from the angles of a log.

    The estimate is that of the "law" windows (see `windows`); "swing" and "even" windows check it. Type A: scatter of
    the rows, declared noise of the sensors and disagreement of windows; type B: what rig.toml states. One of several
    logs that does not determine both unknowns gets a warning, for together the logs may.

    memory: whether an impulse at each reversal (dynamic friction, backlash) is fitted, "on", "off" or "auto".

    Raises UsageError for another, InputError where a channel is missing, UnanswerableError where the motion does not
    determine the inertia.
    """
    if memory not in MEMORY:
        raise UsageError(f"memory must be one of {', '.join(MEMORY)}, and is {memory!r}.", code="bad-option")
    try:
        prepared, part, choice, moved = check.balanced
    except UnanswerableError as error:
        prepared = check.read
        # spin-up and torque steps: windows that need none; a pendulum that its wheel cannot have turned over was pushed
        turns = "torque" in prepared.equation.coefficients or (
            "wheel" in prepared.equation.coefficients and prepared.equation.stated.get("gravity_torque") == 0
        )
        if error.code != "no-turning-points" or not turns:
            raise
        return momentum_together([prepared])
    rig, equation = prepared.rig, prepared.equation
    assert check.evidence is not None
    estimate = _estimate(check.evidence)
    law, signals = choice.law, choice.signals
    check_sign(law, prepared.log.source.path or "the log", live=prepared.log.is_live)
    evaluated = with_bias(_answer(estimate, rig, signals), law, part)
    parameters, u = evaluated.parameters, evaluated.parameters["inertia"].standard_uncertainty or 0.0
    alone = max(u**2 - sum(estimate.common[source] ** 2 for source in NAMED), 0.0) ** 0.5
    amplitude = float(np.max(np.abs(signals.motion.turning_angles)))
    try:
        inertia = Parameter.of(law.inertia, alone, equation.unit)
        checked = check_answer(parameters | {"inertia": inertia}, evaluated.budget, law, amplitude, rig)
        checked = noted(identifiability_note(law)) + checked
    except NotIdentifiableError as error:
        if not prepared.one_of_several or not equation.seeks("gravity_torque"):
            raise
        checked = warned(Message(error.code, error.message, Kind.NOT_IDENTIFIABLE), ran=IDENTIFIABILITY)
    balance, motor = check.motor_balance, check.motor(parameters["inertia"])
    limits = {"alone": alone, "angle": alone, "timing": u, "whole": u}
    limits |= dict.fromkeys(("gravity", "balance", "place"), law.total)
    judged = Judged(parameters["inertia"].value, law.a11, limits, own=True)
    checked += check_hypotheses(estimate.evidence, judged, [warning.code for warning in checked.warnings])
    return prepared.result(
        "momentum",
        replace(evaluated, sensitivities=sensitivities(law.rows, law.equation, law.fit.influence[0])),
        part,
        noted(*exact_in_row_one(rig)) + checked + moved.checked + motor.unused(),
        _details(estimate, None if balance is None else balance.as_stated),
        {} if memory == "auto" else {"memory": memory},
        corrections=moved.corrections,
        # which are correlated at one frequency
        covariance=law.covariances("inertia", "gravity_torque") if equation.seeks("gravity_torque") else {},
    )


def _estimate(evidence: Evidence) -> _Estimate:
    law, signals = evidence.law, evidence.signals
    turning_rows = rows_of(signals, even_windows(signals, signals.motion.half_period / 2))
    kinds = {
        "swing": fit_rows(rows_of(signals, swing_windows(signals)), law.equation, law.noise, BASIS),
        "even": fit_rows(turning_rows, law.equation, law.noise, ("offset",)),
    }
    others = {}
    for name, fitted in kinds.items():
        if fitted is not None:
            fit = with_declared(fitted, evidence.part.rig, signals)
            covariance = fit.covariance.copy()
            covariance[0, 0] += grid_spread(fit, signals) ** 2
            covariance[0, 0] += _asymmetry(fit, law) ** 2 if name == "even" else 0.0
            others[name] = replace(fit, covariance=covariance)
    common = {
        "place of the encoder's grid": grid_spread(law, signals),
        TIMING: timing_spread(law, evidence.choice.impulse),
        "drift with the length of the windows": drift_with_length(law, evidence.choice.tried, signals),
    }
    common |= entries(evidence, law.u, of_balance=True)
    common |= {f'disagreement of "{name}" windows': disagreement(law, other) for name, other in others.items()}
    return _Estimate(evidence, others, common, turning_rows)


def _asymmetry(even: WindowFit, law: WindowFit) -> float:
    """Bias of the even fit by friction, because the motion is not exactly symmetric; from the fitted law."""
    terms = (name for name in law.friction if name in even.rows.columns)
    odd = {name: law.value(name) for name in terms if name in IMPULSES or TERMS[name].odd}
    return float(even.fit.influence[0] @ even.rows.sum_of(odd))


def _answer(estimate: _Estimate, rig: Rig, signals: Signals) -> Evaluated:
    """Parameters with their budget: type A of both fits, errors beyond the scatter, what rig.toml declares."""
    law, friction = estimate.evidence.law, estimate.evidence.choice.friction
    equation = law.equation
    values = {"inertia": (law.inertia, equation.unit)}
    units = units_on(linear=equation.linear)
    of_body = (name for name in equation.sought[1:] if name not in friction.of_rig)
    values |= {name: (law.value(name), units[name]) for name in of_body}
    body = [law.unknowns.index(name) for name in values]
    coefficients = friction.coefficients_by_name
    weights = parameter_weights(tuple(coefficients))
    combinations = np.array(list(weights.values())).reshape(len(weights), len(coefficients))
    values |= {
        name: (value, units[name])
        for name, value in zip(weights, combinations @ list(coefficients.values()), strict=True)
    }
    effects = {effect.item.source: effect for effect in law.declared}
    declared = []
    for item in errors_of(friction.rows, signals, rig, equation, law.coefficients):
        if item.of.of_noise:
            continue
        shifts = effects[item.source].shifts[body] / item.std
        of_friction = combinations @ friction.influence @ item.rows
        if item.of.scales_speed:
            of_friction -= [power_of(name) * values[name][0] for name in weights]
        declared.append(item.on(np.concatenate([shifts, of_friction])))
    scattered = _scatter(law, friction, body, combinations, signals)
    least = NEGLIGIBLE * law.u
    common = [(systematic(source), "inertia", spread) for source, spread in estimate.common.items() if spread > least]
    return evaluate(values, scattered, common, declared, relative=rig.axis.model_uncertainty)


def _scatter(law: WindowFit, friction: FrictionLaw, body: list[int], weights: Array, signals: Signals) -> Scatter:
    """Type A covariance of the parameters of the body and of the friction, which come from two fits of one log.

    body: of the first, among the unknowns of the law windows. own: weights of the friction parameters. Their
    correlation is that by white noise of the samples.
    """
    first, influence = law.fit.influence[body], weights @ friction.influence
    pairs = ((law.rows.windows, first), (friction.rows.windows, influence))
    instants = common_instants([windows for windows, _ in pairs])
    noise = [noise_weights(windows, rows, instants) for windows, rows in pairs]
    of_body = law.covariance[np.ix_(body, body)]
    of_friction = weights @ (friction.covariance + wandering(law, friction, signals)) @ weights.T
    matrix = joined(of_body, of_friction, noise[0] @ noise[1].T, noise[0] @ noise[0].T, noise[1] @ noise[1].T)
    count = len(friction.influence) + len(body)
    freedom = [scatter_freedom(row, bartlett(LAG), count) for row in influence]
    return Scatter("scatter of the windows and sensor noise", matrix, np.array([*[law.freedom] * len(body), *freedom]))


def _details(estimate: _Estimate, motor: float | None) -> Details:
    """What the report draws; motor: what equation (II) leaves."""
    evidence = estimate.evidence
    law, signals, part, prediction = evidence.law, evidence.signals, evidence.part, evidence.prediction
    extra = {
        "held_out_residual": None if prediction is None else prediction.ratio,
        "motor_balance_residual": motor,
        "loss_unexplained": loss_unexplained(evidence),
    }
    return Details(
        start=part.start,
        stop=part.stop,
        turning_times=signals.motion.turning_times,
        turning_angles=signals.motion.turning_angles,
        window=law.half,
        swings=_per_swing(estimate, signals),
        friction=evidence.choice.friction.curve,
        estimates={
            name: (fit.inertia, fit.u)
            for name, fit in ({"law": law} | estimate.others).items()
            if fit.u < COMPARED * abs(law.a11)
        },
        residual_times=law.rows.windows.centres,
        residuals=law.fit.residuals / (law.rows.windows.half * 32 / 35),
        changing=tuple(change for _, change in evidence.slow),
        agreement=agreement(evidence.parts, law.equation.carried),
        extra={name: value for name, value in extra.items() if value is not None},
    )


def _per_swing(estimate: _Estimate, signals: Signals) -> SwingSeries:
    """One inertia per turning point: its even window, less the fitted friction."""
    law, rows = estimate.evidence.law, estimate.turning_rows
    others = {name: law.value(name) for name in law.unknowns[1:] if name in rows.columns}
    values = (known_side(rows, law.equation) - rows.sum_of(others)) / rows["inertia"] - law.equation.carried
    sensor = np.sqrt(law.noise_of(rows.windows.half)) / np.abs(rows["inertia"])
    sides = signals.motion.sides[np.searchsorted(signals.motion.turning_times, rows.windows.centres)]
    return SwingSeries.of(rows.windows.centres, sides, values, sensor)
