"""Output error: least squares of simulated against measured angles (the paper's NLS, section 5; MATLAB's nlgreyest).

The default simulates both rows under the held voltage and so stands on the motor's constants; input="wheel" takes the
measured wheel as the input of row (I) and needs none. Either way a friction law is part of the model: a wrong one
biases the inertia, and shows in the residuals. `momentum` needs no law.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from swingid.errors import InputError, UnanswerableError, UsageError
from swingid.identify.energy.checks import SecondOpinion, second_opinion
from swingid.identify.motion import Motion, find_motion
from swingid.identify.noise import channel_noise
from swingid.identify.output_error.answer import answer_of, details_of, estimate_of
from swingid.identify.output_error.checks import check_fit, misfit
from swingid.identify.output_error.problem import Input, Problem, problem_of
from swingid.identify.output_error.search import RICHEST, Searched, choose_law, first_values, search
from swingid.identify.output_error.solver import CLOSE_ENOUGH, LOSSES, solve
from swingid.identify.output_error.unknowns import friction_unknowns, unknowns_of
from swingid.identify.provenance import provenance
from swingid.identify.result import Message, Result
from swingid.identify.scale import Scale, require_channels
from swingid.identify.segment import usable_part
from swingid.model.rig import Rig
from swingid.recording.recording import Recording

SWINGS = 4
"""Half swings per segment: longer ones tell hardly more, shorter ones spend it on their initial values."""


def output_error(
    log: Recording,
    rig: Rig,
    *,
    input: str | None = None,
    law: str = "auto",
    free: str | Sequence[str] = (),
    loss: str = "linear",
    starts: int = 3,
    segment: float | None = None,
) -> Result:
    """Identify inertia and friction by least squares of simulated against measured angles.

    input: "voltage" (default with a voltage and motor constants) or "wheel" (default without), of a reaction wheel.
    law: a friction law of `friction_laws.LAWS`, with ", offset" or ", direction-dependent" after it where wanted, or
    "auto": the law of least Bayesian information criterion. free: further unknowns, as a sequence or with commas:
    gravity_torque, torque_per_volt, back_emf, motor_viscous, motor_coulomb, efficiency, rotor_inertia, wheel_inertia.
    loss: "linear", "huber" or "soft_l1". starts: from how many points the search begins. segment: length of the
    segments with initial values of their own, s; four half swings by default.

    Raises UsageError for unknown options, InputError where a channel is missing or has the wrong sign,
    UnanswerableError where the motor's constants are missing or the motion cannot tell.
    """
    free = tuple(name.strip() for name in free.split(",") if name.strip()) if isinstance(free, str) else tuple(free)
    _check_options(law, loss, starts, segment)
    scale = Scale.of(rig)
    require_channels(log, rig)
    source = _input(input, log, rig, scale)
    noise = channel_noise(log, rig)
    whole = find_motion(log.time, log.angle, noise.angle)
    start, stop, note = usable_part(whole, rig.drive.kind, float(log.time[0]), float(log.time[-1]))
    used = log.segment(start, stop)
    motion = whole.within(float(used.time[0]), float(used.time[-1]))
    opinion = second_opinion(used, rig, motion, scale, noise)
    length = SWINGS * motion.half_period if segment is None else segment
    problem = problem_of(used, rig, noise, source, length, max(4.5 * noise.step, 0.05 * motion.half_period))
    searched, law = _searched(problem, rig, scale, opinion, motion, law, free, loss, starts)
    estimate = estimate_of(searched, problem, used, rig, scale, motion, noise)
    parameters, budget, sensitivities = answer_of(estimate, scale, opinion.windows)
    warnings, notes = check_fit(parameters, budget, sensitivities, estimate, problem, opinion, rig, scale, motion)
    notes = [note, *notes]
    for finding in log.findings:
        (warnings if finding.level == "warning" else notes).append(Message(finding.code, finding.message))
    details = details_of(estimate, problem, scale, motion, (start, stop), law)
    extra = {f"residual_{name}": left for name, (left, _) in misfit(estimate, problem, rig).items()}
    options: dict[str, object] = {"input": source, "law": law, "loss": loss, "starts": starts}
    return Result(
        method="output-error",
        status="warning" if warnings else "ok",
        parameters=parameters,
        warnings=tuple(warnings),
        notes=tuple(notes),
        budget=tuple(budget),
        provenance=provenance(log, rig, options | ({"free": free} if free else {})),
        details=replace(details, extra=extra),
        sensitivities=sensitivities,
    )


def _check_options(law: str, loss: str, starts: int, segment: float | None) -> None:
    if law != "auto":
        friction_unknowns(law)
    if loss not in LOSSES:
        raise UsageError(f"unknown loss {loss!r}; choose one of {', '.join(LOSSES)}.", code="unknown-loss")
    if not (isinstance(starts, int) and 1 <= starts <= 20):
        raise UsageError(f"starts is {starts!r}; give a whole number from 1 to 20.", code="bad-starts")
    if segment is not None and not (isinstance(segment, int | float) and segment > 0):
        raise UsageError(f"segment is {segment!r}; give a length in seconds.", code="bad-segment")


def _input(wanted: str | None, log: Recording, rig: Rig, scale: Scale) -> Input:
    """What drives the simulation. Raises where the log or the rig lacks it."""
    if scale.drive != "reaction-wheel":
        if wanted is not None:
            raise UsageError(f"input belongs to a reaction wheel, not to drive {scale.drive!r}.", code="no-input")
        return "torque" if scale.drive == "direct" else "none"
    if wanted not in (None, "voltage", "wheel"):
        raise UsageError(f'unknown input {wanted!r}; choose "voltage" or "wheel".', code="unknown-input")
    motor = rig.drive.motor
    constants = motor is not None and motor.torque_per_volt.value > 0
    if wanted == "wheel" or (wanted is None and (log.voltage is None or not constants)):
        return "wheel"
    if log.voltage is None:
        raise InputError(
            f"{log.source.path or 'the log'} has no voltage; name its column as voltage under [log], or take "
            'input="wheel", which needs none.',
            code="missing-voltage",
        )
    if not constants:
        raise UnanswerableError(
            f"rig {rig.name}: drive.motor.torque_per_volt is not given, but the simulation under the voltage needs the "
            'motor\'s constants; give them, or take input="wheel", which needs none.',
            code="no-motor-constants",
        )
    return "voltage"


def _searched(
    problem: Problem,
    rig: Rig,
    scale: Scale,
    opinion: SecondOpinion,
    motion: Motion,
    law: str,
    free: tuple[str, ...],
    loss: str,
    starts: int,
) -> tuple[Searched, str]:
    """The fit and its friction law."""
    if opinion.windows is None:
        raise UnanswerableError(
            "the log holds too few swings to begin the search from; record at least five swings.", code="too-short"
        )
    windows = opinion.windows
    fastest = float(np.max(np.abs(motion.speed.speed)))
    first = RICHEST if law == "auto" else law
    unknowns = unknowns_of(rig, scale, first, free, fastest)
    values = first_values(unknowns, windows, rig, scale, fastest)
    found = search(problem, unknowns, values, loss, starts, 1e-4 if law == "auto" else CLOSE_ENOUGH)
    if law != "auto":
        return found, law
    independent = _independent(problem, found)
    law, candidates, spread = choose_law(problem, unknowns, found.fit, independent, fastest)
    unknowns = unknowns_of(rig, scale, law, free, fastest)
    begin = first_values(unknowns, windows, rig, scale, fastest)
    known = dict(zip(found.unknowns.names, found.fit.values, strict=True))
    for name in ("coulomb", "viscous"):
        known[name] = 0.5 * (known[f"{name}_positive"] + known[f"{name}_negative"])
    begin = np.array([known.get(name, value) for name, value in zip(unknowns.names, begin, strict=True)])
    fit = solve(problem, unknowns, begin, found.fit.states, loss)
    return replace(found, unknowns=unknowns, fit=fit, candidates=candidates, spread=spread), law


def _independent(problem: Problem, found: Searched) -> float:
    """Number of readings that count as independent: fewer where residuals of neighbours are alike."""
    total, runs = 0.0, 0.0
    for first, last in zip(problem.rows[:-1], problem.rows[1:], strict=True):
        for channel in (False, True):
            own = found.fit.residuals[first:last][problem.wheel[first:last] == channel]
            if len(own) < 64:
                continue
            size = max(len(own) // 16, 8)
            blocks = own[: len(own) // size * size].reshape(-1, size)
            total += float(np.sum(blocks**2))
            runs += float(np.sum(blocks.sum(axis=1) ** 2))
    inflation = max(runs / total, 1.0) if total > 0 else 1.0
    return max(len(problem.measured) / inflation, 8.0)
