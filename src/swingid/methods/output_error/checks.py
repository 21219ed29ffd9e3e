"""Does the output-error answer make sense? Its residuals against the sensors, its model against the swings' balance."""

from __future__ import annotations

import math

import numpy as np

from swingid.balance.identifiability import BLIND, HOPELESS, Identifiability, advice, examine_information, require_seen
from swingid.checks.answer import Fault, check_answer, check_motor
from swingid.checks.consistency import Consistency, differs_from_momentum
from swingid.errors import UnanswerableError
from swingid.format import number, percent
from swingid.methods.output_error.answer import Estimate
from swingid.methods.output_error.constants import SCALE, constant_value
from swingid.methods.output_error.declared import shift_of_momentum
from swingid.methods.output_error.problem import Problem
from swingid.methods.output_error.solver import Fit, inverse_of
from swingid.methods.output_error.unknowns import FRICTION, ZERO, Unknowns
from swingid.model.rig import Rig
from swingid.preparation.motion import Motion
from swingid.preparation.scale import Scale
from swingid.result.provenance import exact_constants
from swingid.result.result import Message
from swingid.uncertainty.budget import Evaluated, Parameter
from swingid.uncertainty.significance import DETECTED

LEANS = 1e-3
"""Relative change of the inertia by that of a constant which is worth telling."""

POOR = 2.0
"""Residual, in what noise and declared imperfections of the sensors explain, from which on the fit is poor."""

SETTLED = 0.2
"""Step of the inertia, in standard uncertainties, that the search may leave undone."""

OUTSIDE = 10.0
"""Noise of one reading beyond which an angle's zero is worth a note."""

UNSEEN = 1e-11
"""Share of the information matrix' largest power below which a direction is rounding."""

MOVES = (
    "drive.motor.torque_per_volt",
    "drive.motor.efficiency",
    "drive.wheel.inertia",
    "drive.motor.gear_ratio",
)


def check_fit(
    answer: Evaluated,
    estimate: Estimate,
    problem: Problem,
    consistency: Consistency,
    rig: Rig,
    scale: Scale,
    motion: Motion,
) -> tuple[list[Message], list[Message]]:
    """Warnings and notes; raises UnanswerableError where the data do not determine what is sought."""
    parameters, sensitivities = answer.parameters, answer.sensitivities
    inertia, fit = parameters["inertia"], estimate.searched.fit
    unknowns = estimate.unknowns
    seen = examine_information(unknowns.names, [item.unit for item in unknowns.items], fit.reduced.matrix)
    require_seen(seen)
    _require_told_apart(estimate)
    spread = math.sqrt(estimate.covariance[0, 0])
    poor = _poor_fit(estimate, problem, scale)
    motor = check_motor(
        consistency.balance, consistency.signals, method="this fit", uses_motor=problem.input == "voltage"
    )
    held = motor.held
    whole = inertia.standard_uncertainty or spread
    if poor and (spread > HOPELESS * inertia.value or whole > inertia.value):
        cause = (held or poor)[0].message.rpartition("; ")[0]
        raise UnanswerableError(_hopeless_fit(cause, whole / inertia.value, problem), code="poor-fit")
    if spread > HOPELESS * inertia.value:
        values = dict(zip(unknowns.names, estimate.values, strict=True))
        raise UnanswerableError(
            f"the motion does not determine the inertia (uncertain by {percent(spread / inertia.value)}): "
            f"{seen.scaled_to(spread).combination(values)}; {advice(seen)}, or leave fewer constants free.",
            code="not-identifiable",
        )
    warnings = [*poor, *_moved_far(estimate, rig), *_search_doubts(estimate)]
    notes = exact_constants([key for key in rig.constants_without_uncertainty() if key in sensitivities])
    if consistency.windows is not None:
        amplitude = float(np.max(np.abs(motion.turning_angles), initial=0.0))
        scattered = Parameter.of(inertia.value, spread, inertia.unit)
        checked = check_answer(parameters | {"inertia": scattered}, answer.budget, consistency.windows, amplitude)
        warnings += checked.warnings
        notes += checked.notes
        if not estimate.robust:
            shift = shift_of_momentum(consistency, estimate.searched, rig, scale)
            warnings += _against_momentum(inertia, spread, consistency, problem, scale, shift)
    notes.append(_conditioning(seen, unknowns))
    notes.append(_search_note(estimate, problem))
    notes += _zero_note(estimate, problem)
    warnings += consistency.gravity
    notes += motor.notes
    warnings, notes = (held + warnings, notes) if problem.input == "voltage" else (warnings, notes + held)
    # constants that do not fit show in the residuals, or the motor is not used; another reading of the wheel too
    fits = problem.input == "voltage" and not poor
    if motor.fault is not Fault.CONSTANTS and not (fits and motor.fault is Fault.READING):
        warnings += motor.warnings
    if problem.input == "voltage":
        notes.append(_leaning_on_motor(rig, sensitivities, inertia))
    return warnings, notes


def _hopeless_fit(cause: str, share: float, problem: Problem) -> str:
    """One sentence for a fit so poor that it tells nothing of the inertia, which is no fault of the motion."""
    spread = percent(share) if share < 1 else "more than its value"
    advice = "take the momentum method, or mend the rig file"
    if problem.input == "voltage":
        advice = 'take input="wheel", which needs no motor, or the momentum method, or mend the rig file'
    return f"{cause}, and the inertia is uncertain by {spread}; {advice}."


def _require_told_apart(estimate: Estimate) -> None:
    """Raise UnanswerableError where constants left free show only in a combination."""
    unknowns, matrix = estimate.unknowns, estimate.searched.fit.reduced.matrix
    scale = 1 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    powers, directions = np.linalg.eigh(matrix * np.outer(scale, scale))
    share = (directions[:, powers < UNSEEN * powers[-1]] ** 2).sum(axis=1)
    blind = [
        item.name
        for item, own in zip(unknowns.items, share, strict=True)
        if own > BLIND and item.is_sought and item.name not in FRICTION
    ]
    if blind:
        raise UnanswerableError(
            f"{' and '.join(blind)} cannot be told apart in this log, only a combination of them; leave fewer free.",
            code="not-identifiable",
        )


def misfit(fit: Fit, unknowns: Unknowns, problem: Problem) -> dict[str, tuple[float, float]]:
    """Residual (rms, rad or m) of each channel, and what noise, jitter and the input's nonlinearity explain of it."""
    found = {}
    for channel, here in (("angle", ~problem.wheel), ("wheel", problem.wheel)):
        if not here.any():
            continue
        sensor = problem.encoders.angle if channel == "angle" else problem.encoders.wheel
        left = float(np.sqrt(np.mean((fit.residuals * problem.sigma)[here] ** 2)))
        rate = float(np.sqrt(np.mean(fit.prediction.rates[here] ** 2)))
        # a nonlinearity that is no unknown, and that of the wheel as input, which enters the prediction
        key = f"sensors.{'' if channel == 'angle' else 'wheel.'}nonlinearity."
        own = 0.0 if any(name.startswith(key) for name in unknowns.names) else sensor.nonlinearity
        bent = problem.encoders.wheel.nonlinearity if problem.input == "wheel" else 0.0
        parts = (problem.sigma[here][0], own, bent, sensor.jitter * rate)
        found[channel] = left, float(np.sqrt(np.sum(np.square(parts))))
    return found


def left_of_channels(fit: Fit, problem: Problem) -> dict[str, float]:
    """Residual (rms) of each channel as a share of its motion."""
    found = {}
    for channel, here in (("angle", ~problem.wheel), ("wheel", problem.wheel)):
        if here.any():
            size = max(float(np.std(problem.measured[here])), 1e-300)
            found[f"{channel}_left"] = float(np.sqrt(np.mean((fit.residuals * problem.sigma)[here] ** 2))) / size
    return found


def misfit_ratios(fit: Fit, unknowns: Unknowns, problem: Problem) -> dict[str, float]:
    """Residual of each channel over what is explained; infinite where the motion ran away."""
    if not np.isfinite(fit.cost):
        return {"angle": np.inf}
    return {channel: left / expected for channel, (left, expected) in misfit(fit, unknowns, problem).items()}


def _poor_fit(estimate: Estimate, problem: Problem, scale: Scale) -> list[Message]:
    """A warning where the residuals are far above what the sensors explain."""
    told = []
    for channel, (left, expected) in misfit(estimate.searched.fit, estimate.unknowns, problem).items():
        if left > POOR * expected:
            told.append(f"{left / expected:.3g} times for the {channel}")
    if not told:
        return []
    causes = ["the friction law"]
    if problem.input == "voltage":
        causes.append("the motor constants")
    elif scale.drive == "direct":
        causes.append("the timing or the gain of the torque")
    text = (
        f"the residuals are above what the sensors explain ({', '.join(told)}), so the model is not this rig: doubt "
        f"{' and '.join(causes)}; the interval does not hold that error."
    )
    return [Message("poor-fit", text)]


def _search_doubts(estimate: Estimate) -> list[Message]:
    """A warning where a further step would move the inertia by a good part of its uncertainty.

    Friction that the log hardly tells apart makes a flat valley along which the search creeps, and does no harm.
    """
    fit = estimate.searched.fit
    step = float(inverse_of(fit.reduced)[0] @ fit.reduced.right)
    if fit.converged or abs(step) < SETTLED * np.sqrt(estimate.covariance[0, 0]):
        return []
    text = "the search for the least squares did not settle; take fewer unknowns or a simpler friction law."
    return [Message("not-converged", text)]


def _against_momentum(
    inertia: Parameter, spread: float, consistency: Consistency, problem: Problem, scale: Scale, shift: float
) -> list[Message]:
    """A warning where the momentum balance of the same swings says otherwise; shift: of the latter for constants."""
    assert consistency.windows is not None
    if not differs_from_momentum(inertia.value - shift, spread, consistency.windows):
        return []
    difference = inertia.value / (consistency.windows.a11 + shift - scale.carried) - 1
    cause = "motor constants that are off" if problem.input == "voltage" else "friction that is not of this law"
    text = (
        f"this inertia is {abs(difference):.1%} {'more' if difference > 0 else 'less'} than the momentum balance of "
        f"the same swings gives; the likely cause is {cause}, and the momentum method leans less on that."
    )
    return [Message("disagrees-with-momentum", text)]


def _moved_far(estimate: Estimate, rig: Rig) -> list[Message]:
    """A warning where the log moves what rig.toml states of a constant or a sensor farther than it says."""
    told = []
    for item, value in zip(estimate.unknowns.items, estimate.values, strict=True):
        if item.is_sought or item.name in (ZERO, SCALE) or abs(value) < DETECTED * item.std:
            continue
        found = number(constant_value(rig, item.name)[0] + value if item.places else value, item.unit)
        edge = " or beyond" if value in (item.low, item.high) else ""
        told.append(f"{item.name} of {found}{edge}, {abs(value) / item.std:.2g} standard uncertainties from it")
    if not told:
        return []
    text = f"the log speaks against what the rig file states: it fits with {' and '.join(told)}; correct what is stated"
    return [Message("constants-off", f"{text}, or doubt the model.")]


def _conditioning(seen: Identifiability, unknowns: Unknowns) -> Message:
    sought = ", ".join(item.name for item in unknowns.items if item.is_sought)
    moved = [item.name for item in unknowns.items if not item.is_sought and item.name not in (ZERO, SCALE)]
    text = f"sought together: {sought}"
    if moved:
        text += f"; left to move within what the rig file states: {', '.join(moved)}"
    return Message("identifiability", f"{text}; condition {seen.condition:.2g}, and {seen.price}.")


def _search_note(estimate: Estimate, problem: Problem) -> Message:
    searched, segments = estimate.searched, len(problem.rows) - 1
    text = f"{segments} segment{'s' if segments > 1 else ''} of {len(problem.measured) // segments} readings"
    text += ", each with initial values of its own"
    if searched.starts > 1:
        text += f"; {searched.agreeing} of {searched.starts} starts ended at the same inertia"
    return Message("search", f"{text}.")


def _zero_note(estimate: Estimate, problem: Problem) -> list[Message]:
    """A note where the angle's zero was found outside a step of its grid."""
    zero = estimate.unknowns.zero
    if zero is None or abs(estimate.values[zero]) < OUTSIDE * problem.sigma[~problem.wheel][0]:
        return []
    text = (
        f"0 of the angle was found {number(estimate.values[zero], 'rad')} beside where the body hangs, and set right."
    )
    return [Message("zero-found", text)]


def _leaning_on_motor(rig: Rig, sensitivities: dict[str, float], inertia: Parameter) -> Message:
    """How far this answer stands on the motor's constants."""
    assert rig.drive.motor is not None
    assert rig.drive.wheel is not None
    motor = rig.drive.motor
    values = (motor.torque_per_volt, motor.efficiency, rig.drive.wheel.inertia, motor.gear_ratio)
    sizes = {
        key: sensitivities[key] * quantity.value / inertia.value
        for key, quantity in zip(MOVES, values, strict=True)
        if key in sensitivities
    }
    moves = [f"{key} by {size:+.2g} %" for key, size in sizes.items() if abs(size) > LEANS]
    text = "simulated with the held voltage"
    if moves:
        text += f": 1 % more of a constant moves this inertia: {', '.join(moves)}"
    return Message("leans-on-the-motor", text + '; input="wheel" needs no motor constant.')
