"""Equation error, the standard of robotics: equation (I) pointwise, filtered, differentiated, by least squares.

    a11 q1'' + b sin q1 + F(q1') = −a12 q2''    (direct drive: τ on the right; free decay: b known sets the scale)

Zero-phase Butterworth filter (see `cutoff` for the rule), central differences, every term through the same filter,
decimation, then least squares or instrumental variables (see `fit`). It needs a friction law and smooth sensors, which
`momentum` does not. (Gautier 1997; Khalil and Dombre 2002, ch. 12; Janot, Vandanjon and Gautier 2014.)
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from swingid.balance.friction_laws import law_terms
from swingid.balance.rows import Signals
from swingid.checks.answer import check_answer, identifiability_note
from swingid.checks.momentum import MomentumCheck
from swingid.errors import UnanswerableError
from swingid.methods.equation_error.answer import answer, details
from swingid.methods.equation_error.cutoff import choose_cutoff
from swingid.methods.equation_error.estimate import Selection, estimate
from swingid.methods.equation_error.filtered import OnGrid
from swingid.result.checked import noted, warned
from swingid.result.provenance import exact_in_row_one
from swingid.result.result import Message, Result


def equation_error(
    check: MomentumCheck,
    *,
    cutoff: float | None = None,
    friction: str = "auto",
    instruments: bool = False,
) -> Result:
    """Identify inertia, friction and, where it is "unknown", the gravity torque by inverse dynamics.

    cutoff: of the low-pass in Hz; left out, the rule of `cutoff.choose_cutoff`. friction: a name of
    `friction_laws.LAWS`, also with ", offset" or ", direction-dependent", or "auto", the law of least BIC.
    instruments: instrumental variables against the bias of noisy regressors, for noise that is independent from swing
    to swing.

    Raises UsageError for unknown options, InputError where a channel is missing or has the wrong sign,
    UnanswerableError where the motion does not determine the inertia. `momentum` is better for coarse, noisy or slow
    sensors.
    """
    if friction != "auto":
        law_terms(friction, code="unknown-friction")
    prepared = check.prepared
    part = prepared.part(reread=True)
    rig, equation = prepared.rig, prepared.equation
    signals = Signals.of(part.log, rig, part.motion, part.encoders)
    on_grid = OnGrid.of(signals, equation, part.noise, part.longest_gap)
    if len(part.motion.turning_times) < 2:
        message = "the used part of the log contains no whole swing; record a longer motion back and forth."
        raise UnanswerableError(message, code="no-turning-points")
    span = float(part.log.time[0]), float(part.log.time[-1])
    cut = choose_cutoff(part.motion.speed, *span, part.noise, cutoff)
    selected = estimate(on_grid, cut, None if friction == "auto" else friction, instruments=instruments)
    chosen = selected.chosen
    cause = "noise in the acceleration or friction that does not depend on the speed alone"
    evaluated, differs = check.compared(answer(replace(selected, conflict=check.conflict), rig), cause)
    amplitude = float(np.max(np.abs(part.motion.turning_angles)))
    alone, motor = check.alone(evaluated), check.motor(evaluated.parameters["inertia"], method="this method")
    checked = check_answer(evaluated.parameters | {"inertia": alone}, evaluated.budget, chosen.of_used, amplitude, rig)
    how = noted(*_how(selected, given=friction != "auto"), *exact_in_row_one(rig), identifiability_note(chosen.of_used))
    checked = how + checked + warned(*_unlikely(selected)) + motor.unused() + differs + check.tested(alone)
    options = {"friction": selected.law.name, "instruments": instruments, "cutoff": selected.cutoff.frequency}
    evaluated = check.widened(evaluated)
    covariance = chosen.covariances("inertia", "gravity_torque") if equation.seeks("gravity_torque") else {}
    drawn = details(selected, span)
    return prepared.result("equation-error", evaluated, part, checked, drawn, options, covariance=covariance)


def _how(selected: Selection, *, given: bool) -> list[Message]:
    """Notes on what was done to the log."""
    chosen, cutoff = selected.chosen, selected.cutoff
    text = f"low-pass at {cutoff.frequency:.3g} Hz ({cutoff.reason}), zero phase, every term alike."
    notes = [Message("cutoff", text)]
    law = f"the friction law was taken as {selected.law.name}"
    if given:
        law += ", as given"
    else:
        law += f", the most probable of those tried ({selected.likely[0][1]:.0%})"
    if "memory" in chosen.unknowns:
        law += ", with an impulse at each reversal (dynamic friction)"
    notes.append(Message("friction-law", f"{law}; a wrong one biases the inertia."))
    if chosen.part.grid.resampled:
        notes.append(Message("resampled", "the stamps are uneven; the log was resampled to an even grid by splines."))
    lag = chosen.lag * chosen.row_filter.row_step
    if lag > 0:
        text = f"instruments: the regressors {lag:.3g} s earlier; noise so far apart is taken as independent."
        notes.append(Message("instruments", text))
    return notes


def _unlikely(selected: Selection) -> list[Message]:
    """A warning where the given law is improbable, and the difference to the best one matters for the inertia."""
    chosen, best = selected.chosen, selected.likely[0][0]
    if selected.law.name in {law.name for law, _ in selected.likely}:
        return []
    if selected.between_laws < np.sqrt(chosen.of_inertia.variance):
        return []
    other = next(fit for law, fit, _ in selected.laws if law.name == best.name)
    text = (
        f"the log is inconsistent with the friction law {selected.law.name!r}: with {best.name!r} the inertia is "
        f"{other.inertia:.6g} {chosen.equation.shown(chosen.equation.unit)}; leave friction out, or give that one."
    )
    return [Message("unlikely-friction-law", text)]
