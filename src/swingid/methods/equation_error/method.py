"""Equation error, the standard of robotics: equation (I) pointwise, filtered, differentiated, by least squares.

    a11 q1'' + b sin q1 + F(q1') = −a12 q2''    (direct drive: τ on the right; free decay: b known sets the scale)

Zero-phase Butterworth filter (see `cutoff` for the rule), central differences, every term through the same filter,
decimation, then least squares or instrumental variables (see `fit`). It needs a friction law and smooth sensors, which
`momentum` does not. (Gautier 1997; Khalil and Dombre 2002, ch. 12; Janot, Vandanjon and Gautier 2014.)
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from swingid.balance.fits import BASIS, WindowFit, fit_rows
from swingid.balance.friction_laws import law_terms
from swingid.balance.motor import motor_balance
from swingid.balance.reversals import IMPULSES
from swingid.balance.rows import Signals, rows_of
from swingid.balance.windows import law_windows
from swingid.checks.answer import MotorCheck, check_answer, check_motor, check_sign, free_reading
from swingid.checks.consistency import CLOSE, against_momentum, best_windows, without_momentum
from swingid.checks.rig_file import RigFileCheck
from swingid.errors import UnanswerableError
from swingid.methods.equation_error.answer import answer, details
from swingid.methods.equation_error.cutoff import choose_cutoff
from swingid.methods.equation_error.estimate import Selection, estimate
from swingid.methods.equation_error.filtered import OnGrid
from swingid.methods.equation_error.fit import RowFit
from swingid.preparation.prepared import Part, Prepared
from swingid.result.provenance import exact_in_row_one
from swingid.result.result import Message, Result
from swingid.uncertainty.budget import Parameter
from swingid.uncertainty.dark import dark_uncertainty
from swingid.uncertainty.significance import INDICATED


def equation_error(
    prepared: Prepared,
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
    part = prepared.part(reread=True)
    rig, equation = prepared.rig, prepared.equation
    signals = Signals.of(part.log, rig, part.motion, part.encoders)
    on_grid = OnGrid.of(signals, equation, part.noise, part.longest_gap)
    if len(part.motion.turning_times) < 2:
        message = "the used part of the log contains no whole swing; record a longer motion to and fro."
        raise UnanswerableError(message, code="no-turning-points")
    motor = _consistency(part, signals)
    span = float(part.log.time[0]), float(part.log.time[-1])
    cut = choose_cutoff(part.motion.speed, *span, part.noise, cutoff)
    selected = estimate(on_grid, cut, None if friction == "auto" else friction, instruments=instruments)
    chosen = selected.chosen
    windows, apart = _from_momentum(chosen, signals)
    rig_file = RigFileCheck.of(prepared, part, signals)
    selected = replace(selected, from_momentum=apart, conflict=rig_file.conflict if rig_file else 0.0)
    found = answer(selected, rig)
    amplitude = float(np.max(np.abs(part.motion.turning_angles)))
    inertia = found.parameters["inertia"]
    alone = rig_file.alone(inertia) if rig_file else inertia
    checked = check_answer(found.parameters | {"inertia": alone}, found.budget, chosen.of_used, amplitude, rig)
    how = _how(selected, given=friction != "auto")
    notes = [part.note, *how, *exact_in_row_one(rig), checked.identifiability, *checked.notes, *motor.all_notes()]
    warnings = [*checked.warnings, *_unlikely(selected), *motor.warnings]
    if windows is not None:
        cause = "noise in the acceleration or friction that does not depend on the speed alone"
        warnings += against_momentum(inertia, without_momentum(found.budget), windows, cause)
    options = {"friction": selected.law.name, "instruments": instruments, "cutoff": selected.cutoff.frequency}
    if rig_file is not None:
        warnings += rig_file.warnings(inertia)
        notes += rig_file.notes(inertia)
        found = rig_file.widened(found)
    covariance = chosen.covariances("inertia", "gravity_torque") if equation.seeks("gravity_torque") else {}
    drawn = details(selected, span)
    return prepared.result("equation-error", found, part, warnings, notes, drawn, options, covariance=covariance)


def _consistency(part: Part, signals: Signals) -> MotorCheck:
    """Check signs by equation (I) on modulating functions, and the wheel angle by (II).

    Raises InputError for a wrong sign. Windows over half a swing have little noise where filtered rows may have much.
    """
    rig, equation, noise = part.rig, part.equation, part.noise
    windows = law_windows(signals, part.motion.half_period / 4)
    fit = fit_rows(rows_of(signals, windows), equation, noise, BASIS)
    if fit is not None:
        check_sign(fit, part.log.source.path or "the log", live=part.log.is_live)
    balance = motor_balance(part.log, rig, signals, windows, noise) if len(windows) else None
    without = None
    if balance is None and fit is not None:
        without = free_reading(rig, signals, noise, Parameter.of(fit.inertia, fit.u, equation.unit))
    return check_motor(balance, signals, method="this method", without=without)


def _from_momentum(chosen: RowFit, signals: Signals) -> tuple[WindowFit | None, float]:
    """The fit on modulating functions with the least relative uncertainty, and the dark uncertainty by the difference.

    They differentiate no angle, and long ones have less noise and attenuation than filtered rows.
    """
    impulses = (name for name in IMPULSES if name in chosen.unknowns)
    other = best_windows(signals, chosen.equation, chosen.noise, (*BASIS, *impulses))
    if other is None:
        return None, 0.0
    own = chosen.variance(chosen.of("inertia"))
    # a difference of `CLOSE` is not worth a warning
    variance = own + other.u**2 + (CLOSE / INDICATED * other.a11) ** 2
    return other, dark_uncertainty(other.a11 - chosen.a11, variance, float(np.sqrt(own)))


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
    if selected.between_laws < np.sqrt(chosen.variance(chosen.of("inertia"))):
        return []
    other = next(fit for law, fit, _ in selected.laws if law.name == best.name)
    text = (
        f"the log is inconsistent with the friction law {selected.law.name!r}: with {best.name!r} the inertia is "
        f"{other.inertia:.6g} {chosen.equation.unit}; leave friction out, or give that one."
    )
    return [Message("unlikely-friction-law", text)]
