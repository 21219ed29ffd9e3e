"""Equation error, the standard of robotics: equation (I) pointwise, filtered, differentiated, by least squares.

    a11 q1'' + b sin q1 + F(q1') = −a12 q2''    (direct drive: τ on the right; free decay: b known sets the scale)

Zero-phase Butterworth filter (see `cutoff` for the rule), central differences, every term through the same filter,
decimation, then least squares or instrumental variables (see `fit`). It needs a friction law and smooth sensors, which
`momentum` does not. (Gautier 1997; Khalil and Dombre 2002, ch. 12; Janot, Vandanjon and Gautier 2014.)
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from swingid.balance.fits import BASIS, WindowFit
from swingid.balance.fits import fit_rows as fit_windows
from swingid.balance.friction_laws import law_terms
from swingid.balance.motor import motor_balance
from swingid.balance.rows import Signals, rows_of
from swingid.balance.windows import law_windows
from swingid.checks.answer import MotorCheck, check_answer, check_motor, check_sign, free_reading
from swingid.checks.consistency import CLOSE, against_momentum, best_windows, without_momentum
from swingid.checks.rig_file import RigFileCheck
from swingid.errors import UnanswerableError
from swingid.methods.equation_error.answer import answer, details
from swingid.methods.equation_error.cutoff import choose_cutoff
from swingid.methods.equation_error.estimate import OnGrid, Selection, estimate
from swingid.methods.equation_error.fit import RowFit
from swingid.methods.equation_error.grid import Grid
from swingid.methods.equation_error.laws import Laws
from swingid.methods.equation_error.scatter import Fitted
from swingid.model.equation import Equation
from swingid.model.rig import Rig
from swingid.preparation.noise import Noise
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
    rig, equation, noise = prepared.rig, prepared.equation, part.noise
    on_grid = OnGrid.of(part, rig, equation)
    if len(part.motion.turning_times) < 2:
        message = "the used part of the log contains no whole swing; record a longer motion to and fro."
        raise UnanswerableError(message, code="no-turning-points")
    signals = Signals.of(part.log, rig, part.motion, part.encoders)
    motor = _consistency(part, signals, rig, equation, noise)
    span = float(part.log.time[0]), float(part.log.time[-1])
    cut = choose_cutoff(part.motion.speed, *span, noise, cutoff)
    selected, laws = estimate(on_grid, signals, equation, cut, None if friction == "auto" else friction, instruments)
    chosen = selected.chosen
    windows, apart = _from_momentum(selected, signals)
    rig_file = RigFileCheck.of(prepared, part, signals)
    selected = replace(selected, from_momentum=apart, conflict=rig_file.conflict if rig_file else 0.0)
    found = answer(selected, rig, equation)
    amplitude = float(np.max(np.abs(part.motion.turning_angles)))
    inertia = found.parameters["inertia"]
    alone = rig_file.alone(inertia) if rig_file else inertia
    checked = check_answer(found.parameters | {"inertia": alone}, found.budget, _as_windows(chosen), amplitude, rig)
    how = _how(on_grid.grid, selected, laws, given=friction != "auto")
    notes = [part.note, *how, *exact_in_row_one(rig), checked.identifiability, *checked.notes, *motor.all_notes()]
    warnings = [*checked.warnings, *_unlikely(selected, laws, equation), *motor.warnings]
    if windows is not None:
        cause = "noise in the acceleration or friction that does not depend on the speed alone"
        warnings += against_momentum(inertia, without_momentum(found.budget), windows, cause)
    warnings += rig_file.warnings(inertia) if rig_file else []
    used = chosen.row_filter.cutoff.frequency
    options: dict[str, object] = {"friction": selected.law.name, "instruments": instruments, "cutoff": used}
    covariance = _covariance(chosen.fit) if equation.seeks("gravity_torque") else {}
    drawn = details(selected, equation, span)
    if rig_file is not None:
        notes += rig_file.notes(inertia)
        found = rig_file.widened(found)
    return prepared.result("equation-error", found, part, warnings, notes, drawn, options, covariance=covariance)


def _covariance(fit: RowFit) -> dict[str, dict[str, float]]:
    """Type A covariance of inertia and gravity torque, the first two unknowns."""
    names = fit.unknowns[:2]
    return {one: {other: float(fit.covariance[i, j]) for j, other in enumerate(names)} for i, one in enumerate(names)}


def _as_windows(one: Fitted) -> WindowFit:
    """The rows used and their fit as one on windows, for the checks in common with momentum."""
    used = one.fit.weights > 0
    fit = replace(one.fit.fit, residuals=one.fit.fit.residuals[used], influence=one.fit.fit.influence[:, used])
    half = 1 / one.row_filter.cutoff.frequency
    return WindowFit(one.fit.unknowns, fit, one.fit.covariance, one.rows.select(used), one.equation, one.noise, half)


def _consistency(part: Part, signals: Signals, rig: Rig, equation: Equation, noise: Noise) -> MotorCheck:
    """Check signs by equation (I) on modulating functions, and the wheel angle by (II).

    Raises InputError for a wrong sign. Windows over half a swing have little noise where filtered rows may have much.
    """
    windows = law_windows(signals, part.motion.half_period / 4)
    fit = fit_windows(rows_of(signals, windows), equation, noise, BASIS)
    if fit is not None:
        check_sign(fit, part.log.source.path or "the log", live=part.log.is_live)
    balance = motor_balance(part.log, rig, signals, windows, noise) if len(windows) else None
    without = None
    if balance is None and fit is not None:
        without = free_reading(rig, signals, noise, Parameter.of(fit.inertia, fit.u, equation.unit))
    return check_motor(balance, signals, method="this method", without=without)


def _from_momentum(selected: Selection, signals: Signals) -> tuple[WindowFit | None, float]:
    """The fit on modulating functions with the least relative uncertainty, and the dark uncertainty by the difference.

    They differentiate no angle, and long ones have less noise and attenuation than filtered rows.
    """
    chosen = selected.chosen
    terms = (*BASIS, "memory") if "memory" in chosen.fit.unknowns else BASIS
    other = best_windows(signals, chosen.equation, chosen.noise, terms)
    if other is None:
        return None, 0.0
    own = chosen.variance(np.eye(len(chosen.fit.unknowns))[0])
    # a difference of `CLOSE` is not worth a warning
    variance = own + other.u**2 + (CLOSE / INDICATED * other.a11) ** 2
    return other, dark_uncertainty(other.a11 - chosen.fit.a11, variance, float(np.sqrt(own)))


def _how(grid: Grid, selected: Selection, laws: Laws, *, given: bool) -> list[Message]:
    """Notes on what was done to the log."""
    cutoff = selected.chosen.row_filter.cutoff
    text = f"low-pass at {cutoff.frequency:.3g} Hz ({cutoff.reason}), zero phase, every term alike."
    notes = [Message("cutoff", text)]
    law = f"the friction law was taken as {selected.law.name}"
    if given:
        law += ", as given"
    else:
        law += f", the most probable of those tried ({laws.likely[0][1]:.0%})"
    if "memory" in selected.chosen.fit.unknowns:
        law += ", with an impulse at each reversal (dynamic friction)"
    notes.append(Message("friction-law", f"{law}; a wrong one biases the inertia."))
    if grid.resampled:
        notes.append(Message("resampled", "the stamps are uneven; the log was resampled to an even grid by splines."))
    lag = selected.chosen.lag * selected.chosen.row_filter.row_step
    if lag > 0:
        text = f"instruments: the regressors {lag:.3g} s earlier; noise so far apart is taken as independent."
        notes.append(Message("instruments", text))
    return notes


def _unlikely(selected: Selection, laws: Laws, equation: Equation) -> list[Message]:
    """A warning where the given law is improbable, and the difference to the best one matters for the inertia."""
    if selected.law.name in {law.name for law, _ in laws.likely}:
        return []
    own = np.eye(len(selected.chosen.fit.unknowns))[0]
    if selected.between_laws < np.sqrt(selected.chosen.variance(own)):
        return []
    other = next(fit for law, fit, _ in selected.laws if law.name == laws.best.name)
    text = (
        f"the log is inconsistent with the friction law {selected.law.name!r}: with {laws.best.name!r} the inertia is "
    )
    text += f"{other.fit.a11 - equation.carried:.6g} {equation.unit}; leave friction out, or give that one."
    return [Message("unlikely-friction-law", text)]
