"""Checks of an output-error estimate: residuals against the sensors, the model against the momentum balance."""

from __future__ import annotations

import math

import numpy as np

from swingid.balance.identifiability import BLIND, HOPELESS, Identifiability, advice, examine_information, require_seen
from swingid.checks.answer import Fault, MotorCheck, check_answer
from swingid.checks.consistency import motor_sensitivities
from swingid.checks.hypothesis import matters
from swingid.errors import UnanswerableError
from swingid.format import number, percent
from swingid.methods.output_error.answer import Estimate
from swingid.methods.output_error.constants import SCALE, constant_value
from swingid.methods.output_error.search import Searched
from swingid.methods.output_error.setup import Setup
from swingid.methods.output_error.unknowns import FRICTION, ZERO, Unknowns
from swingid.numerics.arrays import Bools
from swingid.result.checked import Checked, noted, warned
from swingid.result.provenance import exact_constants
from swingid.result.result import Message
from swingid.uncertainty.budget import Evaluated, Parameter
from swingid.uncertainty.significance import DETECTED

POOR = 2.0
"""Ratio of the residual to what noise and declared imperfections explain, from which on the fit is poor."""

FEW = 2.0
"""Degrees of freedom of an uncertainty up to which it is itself uncertain by half (JCGM 100 E.4.3), and Student's
distribution has no variance."""

COARSE = 0.12
"""Half-width of the 95 % interval, as a share of the inertia, from which on a poor fit is a warning.

Of 109 answers with status ok of simulated logs with faults 3 were above it, all wrong by 22 to 46 % (a hard stop, a
softer one, a scale of the angle of 4); of 43 of foreign logs none, the next at 0.10.
"""

SETTLED = 0.2
"""Remaining step of the inertia, in standard uncertainties, up to which a search counts as converged."""

OUTSIDE = 10.0
"""Zero offset of the angle, in standard deviations of a reading, that is worth a note."""

UNSEEN = 1e-11
"""Share of the information matrix' largest power below which a direction is rounding, if no prior determines it."""


def check_fit(answer: Evaluated, estimate: Estimate, differs: Checked | None) -> Checked:
    """The checks of a fit; raises UnanswerableError where the data do not determine an unknown.

    differs: from momentum's inertia, None where it is not compared.
    """
    setup, unknowns, check = estimate.setup, estimate.unknowns, estimate.setup.check
    parameters, sensitivities = answer.parameters, answer.sensitivities
    inertia, fit, under_voltage = parameters["inertia"], estimate.searched.fit, setup.source == "voltage"
    units = [setup.equation.shown(item.unit) for item in unknowns.items]
    seen = examine_information(unknowns.names, units, fit.reduced.matrix)
    require_seen(seen)
    _require_identifiable(estimate)
    spread = math.sqrt(estimate.covariance[0, 0])
    excess = _excess(estimate)
    motor, alone = check.motor(inertia, method="this fit", uses_motor=under_voltage), check.alone(answer)
    low, high = inertia.interval95 or (0.0, 0.0)
    if excess and (spread > HOPELESS * inertia.value or low <= 0.0):
        raise _too_poor(inertia.standard_uncertainty or spread, inertia.value, excess, motor, setup)
    if spread > HOPELESS * inertia.value:
        values = dict(zip(unknowns.names, estimate.values, strict=True))
        raise UnanswerableError(
            f"the motion does not determine the inertia (uncertain by {percent(spread / inertia.value)}): "
            f"{seen.scaled_to(spread).combination(values)}; {advice(seen)}, or leave fewer constants free.",
            code="not-identifiable",
        )
    exact = exact_constants([key for key in setup.rig.constants_without_uncertainty() if key in sensitivities])
    checked = warned(*motor.held) if under_voltage else Checked()
    checked += _inconsistent_constants(estimate, alone) + warned(*_not_converged(estimate)) + noted(*exact)
    if check.evidence is not None:
        amplitude = float(np.max(np.abs(setup.part.motion.turning_angles), initial=0.0))
        scattered = parameters | {"inertia": Parameter.of(inertia.value, spread, inertia.unit)}
        checked += check_answer(scattered, answer.budget, check.evidence.law, amplitude, setup.rig)
    # the covariance contains the lack of fit, and the momentum balance shows what that does to the inertia; it does
    # not test the motor's equation (II)
    coarse = high - low > 2 * COARSE * inertia.value
    untested = under_voltage or differs is None or bool(differs.warnings)
    matters = untested or coarse or inertia.degrees_of_freedom <= FEW
    checked += (warned if matters else noted)(*_poor_fit(setup, excess)) + (differs or Checked())
    checked += noted(_conditioning(seen, unknowns), _search_note(estimate), *_zero_note(estimate))
    checked += check.tested(alone) + Checked(notes=motor.notes, ran=motor.ran)
    # constants that do not fit show in the residuals, or the motor is not used; another reading of the wheel too
    fits = under_voltage and not excess
    if motor.fault is not Fault.CONSTANTS and not (fits and motor.fault is Fault.READING):
        checked += warned(*motor.warnings)
    if not under_voltage:
        return checked + noted(*motor.held)
    text = f"simulated with the held voltage: {motor_sensitivities(setup.rig, sensitivities, inertia)}"
    return checked + noted(Message("leans-on-the-motor", f'{text}; input="wheel" needs no motor constant.'))


def _too_poor(u: float, inertia: float, excess: str, motor: MotorCheck, setup: Setup) -> UnanswerableError:
    """The refusal of a fit whose residuals, by the cause `excess`, make the inertia uncertain by u (kg m² or kg)."""
    share = percent(u / inertia) if u < inertia else "more than its value"
    measured = "the voltage is not held from row to row (state log.drive_held = false if it was measured)"
    cause = measured if motor.held else excess
    return UnanswerableError(
        f"{cause}, and the inertia is uncertain by {share}; take {setup.alternative}, or correct the rig file.",
        code="poor-fit",
    )


def _require_identifiable(estimate: Estimate) -> None:
    """Raise UnanswerableError where the log determines only a combination of the free constants."""
    unknowns, matrix = estimate.unknowns, estimate.searched.fit.reduced.matrix
    scale = 1 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    powers, directions = np.linalg.eigh(matrix * np.outer(scale, scale))
    # beside a log that is exact to 1e-6 a prior looks like rounding, which may also be below 0
    prior, least = (unknowns.power * scale**2) @ directions**2, np.finfo(np.float64).eps * powers[-1]
    unseen = (powers < UNSEEN * powers[-1]) & (prior < np.maximum(powers, least) / 2)
    share = (directions[:, unseen] ** 2).sum(axis=1)
    blind = [
        item.name
        for item, part in zip(unknowns.items, share, strict=True)
        if part > BLIND and item.is_sought and item.name not in FRICTION
    ]
    if blind:
        raise UnanswerableError(
            f"{' and '.join(blind)} cannot be distinguished from other free constants in this log; leave fewer free.",
            code="not-identifiable",
        )


def misfit(searched: Searched) -> dict[str, tuple[float, float]]:
    """Residual (rms, rad or m) of each channel, and what noise, jitter and the input's nonlinearity explain of it."""
    problem, fit, misfits = searched.problem, searched.fit, {}
    for channel, (here, rms) in _left(searched).items():
        sensor = problem.encoders.angle if channel == "angle" else problem.encoders.wheel
        rate = float(np.sqrt(np.mean(fit.prediction.rates[here] ** 2)))
        # a nonlinearity that is no unknown, and that of the wheel as input, which enters the prediction
        key = f"sensors.{'' if channel == 'angle' else 'wheel.'}nonlinearity."
        nonlinearity = 0.0 if any(name.startswith(key) for name in searched.unknowns.names) else sensor.nonlinearity
        of_input = problem.encoders.wheel.nonlinearity if problem.input == "wheel" else 0.0
        parts = (problem.sigma[here][0], nonlinearity, of_input, sensor.jitter * rate)
        misfits[channel] = rms, float(np.sqrt(np.sum(np.square(parts))))
    return misfits


def _left(searched: Searched) -> dict[str, tuple[Bools, float]]:
    """Readings of each channel, and their residual (rms, rad or m)."""
    wheel, residuals = searched.problem.wheel, searched.fit.residuals * searched.problem.sigma
    channels = {"angle": ~wheel, "wheel": wheel}
    return {
        name: (here, float(np.sqrt(np.mean(residuals[here] ** 2)))) for name, here in channels.items() if here.any()
    }


def left_of_channels(searched: Searched) -> dict[str, float]:
    """Residual (rms) of each channel as a share of its motion."""
    return {
        f"{name}_left": rms / max(float(np.std(searched.problem.measured[here])), 1e-300)
        for name, (here, rms) in _left(searched).items()
    }


def is_poor(searched: Searched) -> bool:
    """Return whether a residual is above what the sensors explain, or the motion diverges."""
    if not np.isfinite(searched.fit.cost):
        return True
    return max(rms / expected for rms, expected in misfit(searched).values()) > POOR


def _excess(estimate: Estimate) -> str:
    """How far residuals are above what the sensors explain, "" where they are not."""
    shares = [
        f"{rms / expected:.3g} times for the {channel}"
        for channel, (rms, expected) in misfit(estimate.searched).items()
        if rms > POOR * expected
    ]
    return f"the residuals are above what the sensors explain ({', '.join(shares)})" if shares else ""


def _poor_fit(setup: Setup, excess: str) -> list[Message]:
    if not excess:
        return []
    causes = ["the friction law"]
    if setup.source == "voltage":
        causes.append("the motor constants")
    elif setup.source == "torque":
        causes.append("the timing or the gain of the torque")
    text = (
        f"{excess}, so the model is not that of this rig: check {' and '.join(causes)}; the interval contains the "
        "lack of fit as far as it changes from swing to swing and shows in the momentum balance."
    )
    return [Message("poor-fit", text)]


def _not_converged(estimate: Estimate) -> list[Message]:
    """A warning where a further step would change the inertia by a good part of its uncertainty.

    Friction terms that are hardly identifiable give a flat valley, in which slow convergence does no harm.
    """
    fit = estimate.searched.fit
    if fit.converged or abs(float(fit.left[0])) < SETTLED * np.sqrt(estimate.covariance[0, 0]):
        return []
    text = "the search for the least squares did not converge; take fewer unknowns or a simpler friction law."
    return [Message("not-converged", text)]


def _inconsistent_constants(estimate: Estimate, alone: Parameter) -> Checked:
    """A warning, or a note, where the estimate of constants or sensors contradicts what rig.toml states of them.

    A note where the inertia with them held as stated differs by what hardly matters; the budget has it as a conflict.
    alone: the inertia without that.
    """
    contradicted: list[str] = []
    off: list[int] = []
    for k, (item, value) in enumerate(zip(estimate.unknowns.items, estimate.values, strict=True)):
        if item.is_sought or item.name in (ZERO, SCALE) or abs(value) < DETECTED * item.std:
            continue
        off.append(k)
        fitted = value + constant_value(estimate.setup.rig, item.name)[0] if item.places else value
        edge = " or beyond" if value in (item.low, item.high) else ""
        size = f"{abs(value) / item.std:.2g} standard uncertainties from it"
        contradicted.append(f"{item.name} of {number(fitted, estimate.setup.equation.shown(item.unit))}{edge}, {size}")
    if not contradicted:
        return Checked()
    inverse = estimate.searched.fit.inverse
    change = float(inverse[0, off] @ np.linalg.solve(inverse[np.ix_(off, off)], estimate.values[off]))
    text = (
        f"the log contradicts what the rig file states: it fits with {' and '.join(contradicted)}, which changes the "
        f"inertia by {percent(change / alone.value, sign=True)}; correct the rig file, or check the model."
    )
    weighs = matters(change, alone.standard_uncertainty or 0.0, alone.value)
    return (warned if weighs else noted)(Message("constants-off", text))


def _conditioning(seen: Identifiability, unknowns: Unknowns) -> Message:
    sought = ", ".join(item.name for item in unknowns.items if item.is_sought)
    moved = [item.name for item in unknowns.items if not item.is_sought and item.name not in (ZERO, SCALE)]
    text = f"estimated together: {sought}"
    if moved:
        text += f"; with what the rig file states as prior: {', '.join(moved)}"
    return Message("identifiability", f"{text}; condition {seen.condition:.2g}, and {seen.price}.")


def _search_note(estimate: Estimate) -> Message:
    searched, segments = estimate.searched, len(estimate.searched.problem.rows) - 1
    text = f"{segments} segment{'s' if segments > 1 else ''} of {len(searched.problem.measured) // segments} readings"
    text += ", each with initial values of its own"
    if searched.starts > 1:
        text += f"; {searched.agreeing} of {searched.starts} starts ended at the same inertia"
    return Message("search", f"{text}.")


def _zero_note(estimate: Estimate) -> list[Message]:
    """A note where the zero offset of the angle is larger than a step of its grid."""
    zero, problem = estimate.unknowns.zero, estimate.searched.problem
    if zero is None or abs(estimate.values[zero]) < OUTSIDE * problem.sigma[~problem.wheel][0]:
        return []
    text = f"the angle has a zero offset of {number(estimate.values[zero], 'rad')} from where the body hangs; it was "
    return [Message("zero-found", f"{text}corrected.")]
