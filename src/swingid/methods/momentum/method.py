"""The symmetric momentum method: inertia and friction from angles alone; no motor constant, no speed, no law.

Row (I) holds no motor torque. Multiplied by a test function with compact support and integrated by parts twice it
reads a11 ∫φ'' q1 + a12 ∫φ'' q2 + b ∫φ sin q1 + ∫φ F = 0: linear in a11 and in the terms of friction, with
nothing but angles. The paper's mirror motions (3) are its even windows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from swingid.balance.agreement import JUDGE, disagreement, drift_with_length
from swingid.balance.choice import Choice, choose
from swingid.balance.declared import with_declared
from swingid.balance.fits import BASIS, LAG, WindowFit, fit_rows, known_side
from swingid.balance.friction import FrictionLaw
from swingid.balance.friction_laws import parameter_weights
from swingid.balance.imperfections import imperfections, sensitivities
from swingid.balance.motor import motor_balance
from swingid.balance.rows import Rows, Signals, rows_of
from swingid.balance.systematics import common_instants, grid_spread, noise_weights, timing_spread
from swingid.balance.windows import even_windows, swing_windows
from swingid.checks.answer import check_answer, check_motor, check_sign
from swingid.checks.encoders import check_encoders
from swingid.checks.gravity import check_gravity
from swingid.checks.zero import check_zero
from swingid.errors import NotIdentifiableError
from swingid.methods.momentum.latency import Seen, check_latency, with_latency
from swingid.methods.momentum.loss import loss_unexplained
from swingid.model.rig import Rig
from swingid.model.terms import TERMS, units_on
from swingid.numerics.arrays import Array, median
from swingid.numerics.test_functions import CURVATURE_POWER
from swingid.preparation.motion import Motion
from swingid.preparation.noise import Noise
from swingid.preparation.prepared import Part, Prepared
from swingid.preparation.scale import Scale
from swingid.recording.findings import Kind
from swingid.result.provenance import exact_in_row_one
from swingid.result.result import Details, Message, Result, SwingSeries
from swingid.uncertainty.budget import Declared, Evaluated, Scatter, Source, evaluate, joined, stated, systematic
from swingid.uncertainty.freedom import bartlett, scatter_freedom

NEGLIGIBLE = 1e-3
"""Share of the scatter's uncertainty below which another of type A is left out of the budget."""


@dataclass(frozen=True)
class _Estimate:
    """All fits of one log: the chosen law windows, those of other lengths, the other kinds, the friction.

    common: errors that the scatter of the rows does not show, by source.
    """

    law: WindowFit
    tried: dict[float, WindowFit]
    swing: WindowFit | None
    even: WindowFit | None
    friction: FrictionLaw
    common: dict[str, float]
    turning_rows: Rows


def momentum(prepared: Prepared) -> Result:
    """Identify inertia, friction and, where it is "unknown", the gravity torque from the angles of a log.

    The estimate is that of the "law" windows (see `windows`); "swing" and "even" windows check it. Type A comes from
    the scatter of the rows, from the declared sensors and from disagreement between windows; type B from rig.toml.
    Where one of several logs does not determine both unknowns, which together they may, that is a warning.

    Raises InputError where a channel is missing, UnanswerableError where the motion does not determine the inertia.
    """
    part = prepared.part(reread=True)
    log, rig, scale, noise, encoders = prepared.log, prepared.rig, prepared.scale, part.noise, part.encoders
    seen = Seen(part.log, part.motion, rig, scale, noise, encoders)
    first = choose(Signals.of(part.log, rig, part.motion, encoders), rig, scale, noise)
    choice, moved = with_latency(first, seen)
    signals, motion = choice.signals, choice.signals.motion
    estimate = _estimate(choice, rig, scale, noise)
    check_sign(estimate.law, scale, log.source.path or "the log")
    found = _answer(estimate, rig, signals, scale)
    parameters = found.parameters
    amplitude = float(np.max(np.abs(motion.turning_angles)))
    try:
        checked = check_answer(parameters, found.budget, estimate.law, scale, amplitude)
        warnings, notes = checked.warnings, [checked.identifiability, *checked.notes]
    except NotIdentifiableError as error:
        if not prepared.one_of_several or scale.b is not None:
            raise
        warnings, notes = [Message(error.code, error.message, Kind.NOT_IDENTIFIABLE)], []
    balance = motor_balance(part.log, rig, signals, estimate.law.rows.windows, noise)
    motor = check_motor(balance, signals)
    extra = {} if balance is None else {"motor_balance_residual": balance.as_stated}
    lost = loss_unexplained(signals, estimate.friction, scale.b) if scale.drive == "none" and scale.b else None
    if lost is not None:
        extra["loss_unexplained"] = lost
    notes = [part.note, *exact_in_row_one(rig), *notes, *motor.all_notes()]
    u = parameters["inertia"].standard_uncertainty or 0.0
    off = check_zero(estimate.law, signals, scale, u)
    if not off:  # a zero that is off bends the gravity torque, too
        off = check_gravity(estimate.law, estimate.tried.values(), signals, rig, scale, noise)
    off += check_encoders(estimate.law, rig, signals, scale, noise)
    off += check_latency(choice, seen, u)
    notes += moved.notes
    warnings = [*warnings, *off, *moved.warnings, *motor.warnings]
    return prepared.result(
        "momentum",
        replace(found, sensitivities=sensitivities(rig, estimate.law.rows, estimate.law.fit.influence[0])),
        part,
        warnings,
        notes,
        replace(_details(estimate, signals, scale, part, motion), extra=extra),
        found=moved.corrections,
        covariance=_covariance(estimate.law) if scale.b is None else {},
    )


def _covariance(law: WindowFit) -> dict[str, dict[str, float]]:
    """Type A covariance of inertia and gravity torque, which move together at one frequency."""
    names = ("inertia", "gravity_torque")
    at = [law.unknowns.index(name) for name in names]
    return {
        one: {other: float(law.covariance[i, j]) for other, j in zip(names, at, strict=True)}
        for one, i in zip(names, at, strict=True)
    }


def _estimate(choice: Choice, rig: Rig, scale: Scale, noise: Noise) -> _Estimate:
    law, tried, signals = choice.law, choice.tried, choice.signals
    swing = fit_rows(rows_of(signals, swing_windows(signals)), scale, noise, BASIS)
    turning_rows = rows_of(signals, even_windows(signals, signals.motion.half_period / 2))
    even = fit_rows(turning_rows, scale, noise, ("offset",))
    if even is not None:
        even = with_declared(even, rig, signals, scale, noise)
        even = _with(even, _asymmetry(even, law), grid_spread(signals, even, scale, noise, "inertia"))
    if swing is not None:
        swing = with_declared(swing, rig, signals, scale, noise)
        swing = _with(swing, grid_spread(signals, swing, scale, noise, "inertia"))
    common = {
        "place of the encoder's grid": grid_spread(signals, law, scale, noise, "inertia"),
        "timing of the turning points": timing_spread(law, choice.impulse),
        "drift with the length of the windows": drift_with_length(choice, scale, noise),
    }
    return _Estimate(law, tried, swing, even, choice.friction, common, turning_rows)


def _asymmetry(even: WindowFit, law: WindowFit) -> float:
    """Bias of the even fit that friction causes because the real motion is not quite symmetric, from the fitted law."""
    odd = [name for name in law.unknowns if name in even.rows.friction and (name == "memory" or TERMS[name].odd)]
    torque = sum((law.value(name) * even.rows.friction[name] for name in odd), np.zeros(len(even.rows.windows)))
    return float(even.fit.influence[0] @ torque)


def _with(fit: WindowFit, *more: float) -> WindowFit:
    """The fit with more standard uncertainties of a11 added."""
    covariance = fit.covariance.copy()
    covariance[0, 0] += sum(extra**2 for extra in more)
    return replace(fit, covariance=covariance)


def _answer(estimate: _Estimate, rig: Rig, signals: Signals, scale: Scale) -> Evaluated:
    """Parameters with their budget: type A of both fits, what the scatter does not show, what rig.toml declares."""
    law, friction = estimate.law, estimate.friction
    values = {"inertia": (law.a11 - scale.carried, scale.unit)}
    if scale.b is None:
        values["gravity_torque"] = law.value("gravity_torque"), scale.torque_unit
    units = units_on(linear=scale.linear)
    values |= {name: (law.value(name), units[name]) for name in scale.unknown}
    body = [law.unknowns.index(name) for name in values]
    weights = parameter_weights(friction.unknowns)
    values |= {name: (float(own @ friction.values), units[name]) for name, own in weights.items()}
    own = np.array(list(weights.values())).reshape(len(weights), len(friction.unknowns))
    b = law.value("gravity_torque") if scale.b is None else scale.b
    effects = {effect.source: effect for effect in law.declared}
    declared = []
    for item in imperfections(rig, signals, friction.rows, law.a11, b):
        of_body = effects[item.source].shifts[body] / item.std
        of_body[0] += item.direct
        slopes = np.concatenate([of_body, own @ friction.influence @ item.rows])
        declared.append(Declared(stated(item.source, item.shared_id), item.std, slopes))
    return evaluate(values, _scatter(law, friction, body, own), _common(estimate), declared)


def _scatter(law: WindowFit, friction: FrictionLaw, body: list[int], own: Array) -> Scatter:
    """Type A covariance of the parameters of the body and of the friction, which come from two fits of one log.

    body: of the first, among the unknowns of the law windows. own: weights of the friction parameters. What the two
    fits have in common is what white noise of the samples gives them.
    """
    first, influence = law.fit.influence[body], own @ friction.influence
    pairs = ((law.rows.windows, first), (friction.rows.windows, influence))
    instants = common_instants([windows for windows, _ in pairs])
    noise = [noise_weights(windows, rows, instants) for windows, rows in pairs]
    of_body = law.covariance[np.ix_(body, body)]
    of_friction = own @ friction.covariance @ own.T
    matrix = joined(of_body, of_friction, noise[0] @ noise[1].T, noise[0] @ noise[0].T, noise[1] @ noise[1].T)
    count = len(friction.unknowns) + len(body)
    freedom = [scatter_freedom(row, bartlett(LAG), count) for row in influence]
    return Scatter("scatter of the windows and sensor noise", matrix, np.array([*[law.freedom] * len(body), *freedom]))


def _common(estimate: _Estimate) -> list[tuple[Source, str, float]]:
    """Errors of the inertia that the scatter does not show, and disagreement of the kinds of windows."""
    found = estimate.common | {
        f'disagreement of "{name}" windows': disagreement(estimate.law, other)
        for name, other in (("swing", estimate.swing), ("even", estimate.even))
    }
    least = NEGLIGIBLE * estimate.law.u
    return [(systematic(source), "inertia", spread) for source, spread in found.items() if spread > least]


def _details(
    estimate: _Estimate,
    signals: Signals,
    scale: Scale,
    part: Part,
    motion: Motion,
) -> Details:
    law = estimate.law
    kinds = {"law": law, "swing": estimate.swing, "even": estimate.even}
    return Details(
        start=part.start,
        stop=part.stop,
        turning_times=motion.turning_times,
        turning_angles=motion.turning_angles,
        window=law.half,
        swings=_per_swing(estimate, signals, scale, part.noise),
        friction=estimate.friction.curve,
        estimates={
            name: (fit.a11 - scale.carried, fit.u)
            for name, fit in kinds.items()
            if fit is not None and fit.u < JUDGE * abs(law.a11)
        },
        residual_times=law.rows.windows.centres,
        residuals=law.fit.residuals / (law.rows.windows.half * 32 / 35),
    )


def _per_swing(estimate: _Estimate, signals: Signals, scale: Scale, noise: Noise) -> SwingSeries:
    """One inertia per turning point: its even window with the fitted friction taken off."""
    law = estimate.law
    rows = estimate.turning_rows
    columns = rows.friction | rows.further
    others = sum((law.value(name) * columns[name] for name in law.unknowns if name in columns), 0.0)
    known = known_side(rows, scale) - law.value("gravity_torque") * rows.gravity - others
    values = known / rows.inertia - scale.carried
    power = (law.a11 * noise.angle) ** 2 + (scale.a12 * noise.wheel) ** 2
    sensor = np.sqrt(CURVATURE_POWER * power * noise.step / rows.windows.half**3) / np.abs(rows.inertia)
    spread = 1.4826 * median(np.abs(values - median(values))) if len(values) else 0.0
    sides = signals.motion.sides[np.searchsorted(signals.motion.turning_times, rows.windows.centres)]
    return SwingSeries(rows.windows.centres, sides, values, np.maximum(sensor, spread))
