"""The momentum method: inertia and friction from angles alone; no motor constant, no speed, no friction law.

Equation (I) has no motor torque. Multiplied by a modulating function (test function) with compact support and
integrated by parts twice it reads a11 ∫φ'' q1 + a12 ∫φ'' q2 + b ∫φ sin q1 + ∫φ F = 0: linear in a11 and in the terms of
friction, with nothing but angles. The paper's mirror motions (3) are its even windows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from swingid.balance.choice import IMPULSES, MEMORY, Choice
from swingid.balance.errors import errors_of, sensitivities
from swingid.balance.fits import BASIS, LAG, WindowFit, fit_rows, known_side, with_declared
from swingid.balance.friction import FrictionLaw
from swingid.balance.friction_laws import parameter_weights
from swingid.balance.level import wandering, with_bias
from swingid.balance.motor import motor_balance
from swingid.balance.rows import Rows, Signals, rows_of
from swingid.balance.systematics import (
    COMPARED,
    PlaceFit,
    common_instants,
    disagreement,
    drift_with_length,
    gravity_conflict,
    grid_spread,
    noise_weights,
    place_fits,
    place_torque,
    timing_spread,
)
from swingid.balance.windows import even_windows, swing_windows
from swingid.checks.angle_scale import SCALE
from swingid.checks.answer import check_answer, check_motor, check_sign, free_reading
from swingid.checks.closure import check_closure
from swingid.checks.latency import check_latency
from swingid.checks.level import chosen_at_level
from swingid.checks.place import PLACE, check_place, spring_note
from swingid.checks.rig_file import CONFLICT, contradictions
from swingid.checks.stability import PARTS, Stability
from swingid.checks.stated import check_encoders
from swingid.errors import NotIdentifiableError, UnanswerableError, UsageError
from swingid.format import plus_minus
from swingid.methods.momentum.together import momentum_together
from swingid.model.rig import Rig
from swingid.model.terms import TERMS, power_of, units_on
from swingid.numerics.arrays import Array
from swingid.numerics.test_functions import CURVATURE_POWER
from swingid.preparation.prepared import Part, Prepared
from swingid.recording.findings import Kind
from swingid.result.provenance import exact_in_row_one
from swingid.result.result import Details, Message, Result, SwingSeries
from swingid.uncertainty.budget import Evaluated, Parameter, Scatter, Source, evaluate, joined, systematic
from swingid.uncertainty.freedom import bartlett, scatter_freedom

NEGLIGIBLE = 1e-3
"""Share of the scatter's uncertainty below which another of type A is omitted from the budget."""


@dataclass(frozen=True)
class _Estimate:
    """All fits of one log: the chosen law windows, those of other lengths, the other kinds, the friction.

    common: errors that the scatter of the rows does not contain, by source.
    """

    law: WindowFit
    tried: dict[float, WindowFit]
    swing: WindowFit | None
    even: WindowFit | None
    friction: FrictionLaw
    common: dict[str, float]
    turning_rows: Rows
    place: list[PlaceFit]
    stability: Stability


def momentum(prepared: Prepared, *, memory: str = "auto") -> Result:
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
        prepared, part, choice, moved = chosen_at_level(prepared, memory)
    except UnanswerableError as error:
        # spin-up and torque steps: windows that need none; a pendulum that its wheel cannot have turned over was pushed
        turns = prepared.equation.drive == "direct" or (
            prepared.equation.drive == "reaction-wheel" and prepared.equation.stated.get("gravity_torque") == 0
        )
        if error.code != "no-turning-points" or not turns:
            raise
        return momentum_together([prepared])
    rig, equation = prepared.rig, prepared.equation
    signals = choice.signals
    estimate = _estimate(choice, rig)
    check_sign(estimate.law, prepared.log.source.path or "the log", live=prepared.log.is_live)
    found = with_bias(_answer(estimate, rig, signals), estimate.law, part)
    parameters, u = found.parameters, found.parameters["inertia"].standard_uncertainty or 0.0
    # what contradicts the rig file is named, and neither makes an answer hopeless nor hides its causes
    shared = sum(estimate.common[source] ** 2 for source in (CONFLICT, PLACE, PARTS))
    alone = Parameter.of(estimate.law.inertia, max(u**2 - shared, 0.0) ** 0.5, equation.unit)
    amplitude = float(np.max(np.abs(signals.motion.turning_angles)))
    try:
        checked = check_answer(parameters | {"inertia": alone}, found.budget, estimate.law, amplitude, rig)
        warnings, notes = checked.warnings, [checked.identifiability, *checked.notes]
    except NotIdentifiableError as error:
        if not prepared.one_of_several or not equation.seeks("gravity_torque"):
            raise
        warnings, notes = [Message(error.code, error.message, Kind.NOT_IDENTIFIABLE)], []
    balance = motor_balance(part.log, rig, signals, estimate.law.rows.windows, part.noise)
    without = None if balance else free_reading(rig, signals, part.noise, parameters["inertia"])
    motor = check_motor(balance, signals, without=without)
    extra = estimate.stability.extra() | ({} if balance is None else {"motor_balance_residual": balance.as_stated})
    lost = (
        _loss_unexplained(signals, estimate.friction, equation.value("gravity_torque"))
        if equation.drive == "none" and equation.value("gravity_torque")
        else None
    )
    if lost is not None:
        extra["loss_unexplained"] = lost
    notes = [part.note, *exact_in_row_one(rig), *notes, *motor.all_notes()]
    off = contradictions(choice, part, alone.standard_uncertainty or 0.0)
    off += check_encoders(estimate.law, rig, signals)
    if all(one.code == SCALE for one in off):  # errors of the angle seem to be such a torque, too
        off += check_place(estimate.law, estimate.place, estimate.law.total)
    off += [] if off else check_closure(estimate.law)
    off += check_latency(choice, part, u, memory)
    size = parameters["inertia"].value, alone.standard_uncertainty or 0.0
    off += [] if off or warnings else estimate.stability.disagreement(*size)
    slow, slow_notes = estimate.stability.messages(*size, corrected=True)
    off += slow
    notes += [*moved.notes, *_impulse(estimate.law), *slow_notes]
    notes += spring_note(estimate.law, estimate.place, signals, alone.standard_uncertainty or 0.0)
    warnings = [*warnings, *off, *moved.warnings, *motor.warnings]
    return prepared.result(
        "momentum",
        replace(
            found, sensitivities=sensitivities(estimate.law.rows, estimate.law.equation, estimate.law.fit.influence[0])
        ),
        part,
        warnings,
        notes,
        replace(_details(estimate, signals, part), extra=extra),
        {} if memory == "auto" else {"memory": memory},
        found=moved.corrections,
        covariance=_covariance(estimate.law) if equation.seeks("gravity_torque") else {},
    )


def _impulse(law: WindowFit) -> list[Message]:
    """The note on an impulse at each reversal, which is an unknown beside the parameters."""
    if "memory" not in law.unknowns:
        return []
    unit = f"{law.equation.torque_unit} s"
    text = (
        f"an impulse of {plus_minus(law.value('memory'), law.uncertainty('memory'), unit)} at each reversal was "
        "estimated beside the friction law: dynamic friction, backlash or short sticking."
    )
    return [Message("reversal-impulse", text)]


def _covariance(law: WindowFit) -> dict[str, dict[str, float]]:
    """Type A covariance of inertia and gravity torque, which are correlated at one frequency."""
    names = ("inertia", "gravity_torque")
    at = [law.unknowns.index(name) for name in names]
    return {
        one: {other: float(law.covariance[i, j]) for other, j in zip(names, at, strict=True)}
        for one, i in zip(names, at, strict=True)
    }


def _estimate(choice: Choice, rig: Rig) -> _Estimate:
    law, signals = choice.law, choice.signals
    swing = fit_rows(rows_of(signals, swing_windows(signals)), law.equation, law.noise, BASIS)
    turning_rows = rows_of(signals, even_windows(signals, signals.motion.half_period / 2))
    even = fit_rows(turning_rows, law.equation, law.noise, ("offset",))
    if even is not None:
        even = with_declared(even, rig, signals)
        even = _with(even, _asymmetry(even, law), grid_spread(signals, even, "inertia"))
    if swing is not None:
        swing = with_declared(swing, rig, signals)
        swing = _with(swing, grid_spread(signals, swing, "inertia"))
    place = place_fits(law, signals, choice.tried.values())
    common = {
        "place of the encoder's grid": grid_spread(signals, law, "inertia"),
        "timing of the turning points": timing_spread(law, choice.impulse),
        "drift with the length of the windows": drift_with_length(law, choice.tried, signals),
        CONFLICT: gravity_conflict(law, rig, signals),
        PLACE: place_torque(place, law.u),
    }
    stability = Stability.of(choice)
    common |= stability.common(law.u)
    return _Estimate(law, choice.tried, swing, even, choice.friction, common, turning_rows, place, stability)


def _asymmetry(even: WindowFit, law: WindowFit) -> float:
    """Bias of the even fit by friction, because the motion is not exactly symmetric; from the fitted law."""
    terms = (name for name in law.friction if name in even.rows.columns)
    odd = {name: law.value(name) for name in terms if name in IMPULSES or TERMS[name].odd}
    return float(even.fit.influence[0] @ even.rows.sum_of(odd))


def _with(fit: WindowFit, *more: float) -> WindowFit:
    """The fit with further standard uncertainties of a11."""
    covariance = fit.covariance.copy()
    covariance[0, 0] += sum(extra**2 for extra in more)
    return replace(fit, covariance=covariance)


def _answer(estimate: _Estimate, rig: Rig, signals: Signals) -> Evaluated:
    """Parameters with their budget: type A of both fits, errors beyond the scatter, what rig.toml declares."""
    law, friction, equation = estimate.law, estimate.friction, estimate.law.equation
    values = {"inertia": (law.inertia, equation.unit)}
    units = units_on(linear=equation.linear)
    values |= {name: (law.value(name), units[name]) for name in equation.sought[1:]}
    body = [law.unknowns.index(name) for name in values]
    weights = parameter_weights(friction.unknowns)
    values |= {name: (float(own @ friction.values), units[name]) for name, own in weights.items()}
    own = np.array(list(weights.values())).reshape(len(weights), len(friction.unknowns))
    effects = {effect.item.source: effect for effect in law.declared}
    declared = []
    for item in errors_of(friction.rows, signals, rig, equation, law.coefficients):
        if item.of.of_noise:
            continue
        of_body = effects[item.source].shifts[body] / item.std
        of_friction = own @ friction.influence @ item.rows
        if item.of.scales_speed:
            of_friction -= [power_of(name) * values[name][0] for name in weights]
        declared.append(item.on(np.concatenate([of_body, of_friction])))
    scattered = _scatter(law, friction, body, own, signals)
    return evaluate(values, scattered, _common(estimate), declared, relative=rig.axis.model_uncertainty)


def _scatter(law: WindowFit, friction: FrictionLaw, body: list[int], own: Array, signals: Signals) -> Scatter:
    """Type A covariance of the parameters of the body and of the friction, which come from two fits of one log.

    body: of the first, among the unknowns of the law windows. own: weights of the friction parameters. Their
    correlation is that by white noise of the samples.
    """
    first, influence = law.fit.influence[body], own @ friction.influence
    pairs = ((law.rows.windows, first), (friction.rows.windows, influence))
    instants = common_instants([windows for windows, _ in pairs])
    noise = [noise_weights(windows, rows, instants) for windows, rows in pairs]
    of_body = law.covariance[np.ix_(body, body)]
    of_friction = own @ (friction.covariance + wandering(law, friction, signals)) @ own.T
    matrix = joined(of_body, of_friction, noise[0] @ noise[1].T, noise[0] @ noise[0].T, noise[1] @ noise[1].T)
    count = len(friction.unknowns) + len(body)
    freedom = [scatter_freedom(row, bartlett(LAG), count) for row in influence]
    return Scatter("scatter of the windows and sensor noise", matrix, np.array([*[law.freedom] * len(body), *freedom]))


def _common(estimate: _Estimate) -> list[tuple[Source, str, float]]:
    """Errors of the inertia that the scatter does not contain, and disagreement of the kinds of windows."""
    found = estimate.common | {
        f'disagreement of "{name}" windows': disagreement(estimate.law, other)
        for name, other in (("swing", estimate.swing), ("even", estimate.even))
    }
    least = NEGLIGIBLE * estimate.law.u
    return [(systematic(source), "inertia", spread) for source, spread in found.items() if spread > least]


def _details(estimate: _Estimate, signals: Signals, part: Part) -> Details:
    law = estimate.law
    kinds = {"law": law, "swing": estimate.swing, "even": estimate.even}
    return Details(
        start=part.start,
        stop=part.stop,
        turning_times=signals.motion.turning_times,
        turning_angles=signals.motion.turning_angles,
        window=law.half,
        swings=_per_swing(estimate, signals),
        friction=estimate.friction.curve,
        estimates={
            name: (fit.inertia, fit.u)
            for name, fit in kinds.items()
            if fit is not None and fit.u < COMPARED * abs(law.a11)
        },
        residual_times=law.rows.windows.centres,
        residuals=law.fit.residuals / (law.rows.windows.half * 32 / 35),
        changing=tuple(estimate.stability.changing),
        agreement=estimate.stability.agreement(law.equation.carried),
    )


def _per_swing(estimate: _Estimate, signals: Signals) -> SwingSeries:
    """One inertia per turning point: its even window, less the fitted friction."""
    law, rows = estimate.law, estimate.turning_rows
    equation, noise = law.equation, law.noise
    others = {name: law.value(name) for name in law.unknowns[1:] if name in rows.columns}
    values = (known_side(rows, equation) - rows.sum_of(others)) / rows["inertia"] - equation.carried
    power = (law.a11 * noise.angle) ** 2 + (equation.value("wheel") * noise.wheel) ** 2
    sensor = np.sqrt(CURVATURE_POWER * power * noise.step / rows.windows.half**3) / np.abs(rows["inertia"])
    sides = signals.motion.sides[np.searchsorted(signals.motion.turning_times, rows.windows.centres)]
    return SwingSeries.of(rows.windows.centres, sides, values, sensor)


def _loss_unexplained(signals: Signals, law: FrictionLaw, b: float) -> float | None:
    """RMS of the lack of fit of the loss per full swing, over the RMS of the loss; None with too few swings.

    At a turning point all energy is potential, b (1 − cos q), so its fall over one full swing is the work of friction
    ∫F(q1') q1' dt. b: gravity torque in N m.
    """
    motion = signals.motion
    if len(motion.turning_times) < 4:
        return None
    potential = b * (1 - np.cos(motion.turning_angles))
    speed, (instants, weights) = signals.speed.ravel(), signals.nodes.flat
    work = np.interp(motion.turning_times, instants, np.cumsum(law.torque(speed) * speed * weights))
    lost = potential[:-2] - potential[2:]
    left = lost - (work[2:] - work[:-2])
    return float(np.sqrt(np.mean(left**2) / np.mean(lost**2)))
