"""Equation error, the standard of robotics: row (I) pointwise, filtered, differentiated, by weighted least squares.

    a11 q1'' + b sin q1 + F(q1') = −a12 q2''    (direct drive: τ on the right; free decay: b known sets the scale)

Zero-phase Butterworth filter (see `cutoff` for the rule), central differences, every term through the same filter,
decimation, then least squares or instrumental variables (see `fit`). It needs a friction law and smooth sensors, which
`momentum` does not; it is here because the field uses it. (Gautier 1997; Khalil and Dombre 2002, ch. 12; Janot,
Vandanjon and Gautier 2014.)
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from swingid.errors import UnanswerableError, UsageError
from swingid.identify.energy.checks import CLOSE
from swingid.identify.equation_error.answer import Estimate, answer, details
from swingid.identify.equation_error.cutoff import SETTLING, Cutoff, choose_cutoff
from swingid.identify.equation_error.fit import RowFit, best_lag, fit_rows
from swingid.identify.equation_error.grid import Grid, even_grid
from swingid.identify.equation_error.rows import RowFilter, filtered_rows, friction_columns
from swingid.identify.equation_error.scatter import Fitted
from swingid.identify.friction_laws import DIRECTIONS, LAWS, STRIBECK_SHARES, law_terms
from swingid.identify.momentum.balance import Signals, rows_of
from swingid.identify.momentum.checks import check_answer, check_motor, check_sign
from swingid.identify.momentum.fits import BASIS, WindowFit
from swingid.identify.momentum.fits import fit_rows as fit_windows
from swingid.identify.momentum.gravity import check_gravity
from swingid.identify.momentum.imperfections import sensitivities
from swingid.identify.momentum.windows import law_windows
from swingid.identify.motion import Motion, find_motion
from swingid.identify.motor_balance import motor_balance
from swingid.identify.noise import Noise, channel_noise
from swingid.identify.provenance import add_findings, exact_in_row_one, provenance
from swingid.identify.result import Message, Result
from swingid.identify.scale import Scale, require_channels
from swingid.identify.segment import usable_part
from swingid.model.rig import Rig
from swingid.recording.recording import Recording

RICHER = "coulomb + viscous + quadratic, direction-dependent"
"""The law that judges the chosen one."""

EARLIER = 0.75
"""Least lag of the instruments in half periods, for a controller to have answered the noise."""

LAGS = 1.0
"""Periods of the motion over which the lag of the instruments is sought."""


@dataclass(frozen=True)
class _Part:
    """The part of the log that is used, on its grid, its motion, and intervals that are closed to rows."""

    log: Recording
    motion: Motion
    grid: Grid
    closed: np.ndarray
    noise: Noise
    span: tuple[float, float]
    note: Message


def equation_error(
    log: Recording,
    rig: Rig,
    *,
    cutoff: float | None = None,
    friction: str = "coulomb + viscous",
    instruments: bool = False,
) -> Result:
    """Identify inertia, friction and, where it is "unknown", the gravity torque by inverse dynamics.

    cutoff: of the low-pass in Hz; left out, the rule of `cutoff.choose_cutoff`. friction: a name of
    `friction_laws.LAWS`, also with ", offset" or ", direction-dependent". instruments: instrumental variables against
    the bias of noisy regressors, for noise that is independent from swing to swing.

    Raises UsageError for unknown options, InputError where a channel is missing or has the wrong sign,
    UnanswerableError where the motion cannot tell. Prefer `momentum` for coarse, noisy or slow sensors.
    """
    terms = _terms(friction)
    scale = Scale.of(rig)
    require_channels(log, rig)
    noise = channel_noise(log, rig)
    part = _used_part(log, rig, noise)
    if len(part.motion.turning_times) < 2:
        message = "the part of the log that can be used holds no whole swing; record a longer motion to and fro."
        raise UnanswerableError(message, code="no-turning-points")
    doubts = _second_opinion(part, rig, scale, noise)
    chosen = choose_cutoff(part.motion.speed, *part.span, noise, cutoff)
    estimate = _estimate(part, scale, chosen, friction, terms, instruments)
    budget, parameters = answer(estimate, rig, scale, part.motion)
    amplitude = float(np.max(np.abs(part.motion.turning_angles)))
    warnings, notes = check_answer(parameters, budget, _as_windows(estimate.chosen), scale, amplitude)
    how = _how(part, chosen, friction, estimate.chosen.lag * estimate.chosen.row_filter.row_step)
    notes = [part.note, *how, *exact_in_row_one(rig), *notes, *doubts[1]]
    warnings = [*warnings, *doubts[0]]
    add_findings(log, warnings, notes)
    options: dict[str, object] = {"friction": friction, "instruments": instruments, "cutoff": chosen.frequency}
    return Result(
        method="equation-error",
        status="warning" if warnings else "ok",
        parameters=parameters,
        warnings=tuple(warnings),
        notes=tuple(notes),
        budget=tuple(budget),
        provenance=provenance(log, rig, options),
        details=details(estimate, scale, part.motion, part.span),
        sensitivities=sensitivities(rig, estimate.chosen.rows, estimate.chosen.fit.fit.influence[0]),
        covariance=_covariance(estimate.chosen.fit) if scale.b is None else {},
    )


def _covariance(fit: RowFit) -> dict[str, dict[str, float]]:
    """Type A covariance of inertia and gravity torque, the first two unknowns."""
    names = fit.unknowns[:2]
    return {one: {other: float(fit.covariance[i, j]) for j, other in enumerate(names)} for i, one in enumerate(names)}


def _terms(friction: str) -> tuple[str, ...]:
    odd, comma, direction = friction.partition(",")
    if odd not in LAWS or comma + direction not in DIRECTIONS:
        raise UsageError(
            f"unknown friction law {friction!r}; choose one of {', '.join(LAWS)}, also with "
            f"{' or '.join(repr(name) for name in DIRECTIONS if name)} behind it.",
            code="unknown-friction",
        )
    return law_terms(friction)


def _used_part(log: Recording, rig: Rig, noise: Noise) -> _Part:
    found = find_motion(log.time, log.angle, noise.angle)
    start, stop, note = usable_part(found, rig.drive.kind, float(log.time[0]), float(log.time[-1]))
    used = log.segment(start, stop)
    span = float(used.time[0]), float(used.time[-1])
    motion = found.within(*span)
    longest = max(4.5 * noise.step, 0.05 * motion.half_period)
    late = np.nonzero(np.diff(used.time) > longest)[0]
    gaps = np.column_stack([used.time[late], used.time[late + 1]])
    closed = np.vstack([motion.rests, gaps])
    return _Part(used, motion, even_grid(used, rig), closed, noise, span, note)


def _estimate(
    part: _Part, scale: Scale, cutoff: Cutoff, law: str, terms: tuple[str, ...], instruments: bool
) -> Estimate:
    fastest = float(np.max(np.abs(part.motion.speed.speed)))
    speeds = fastest * STRIBECK_SHARES if "stribeck" in terms else np.ones(1)

    def fitted(at: Cutoff, with_terms: tuple[str, ...], speed: float) -> Fitted:
        return _fit(part, scale, at, with_terms, speed, instruments)

    tried = [fitted(cutoff, terms, speed) for speed in speeds]
    best = int(np.argmin([one.fit.weights @ one.fit.fit.residuals**2 for one in tried]))
    speed = float(speeds[best])
    others = {
        f"cut-off {beside.frequency:.3g} Hz": fitted(beside, terms, speed)
        for beside in cutoff.beside(1 / part.grid.step)
    }
    richer = law_terms(RICHER)
    if set(richer) - set(terms):
        others["a richer law of friction"] = fitted(cutoff, richer, 1.0)
    others["a memory of friction"] = fitted(cutoff, (*terms, "memory"), speed)
    return Estimate(tried[best], law, terms, speed, others)


def _fit(
    part: _Part, scale: Scale, cutoff: Cutoff, terms: tuple[str, ...], stribeck_speed: float, instruments: bool
) -> Fitted:
    """The fit at one cut-off with one law."""
    row_filter = RowFilter.of(part.grid, cutoff, part.closed)
    friction = friction_columns(part.motion, part.grid, terms, stribeck_speed)
    rows = filtered_rows(row_filter, friction, linear=scale.linear)
    period = 2 * part.motion.half_period / row_filter.row_step
    lag = 0
    if instruments:
        least = max(SETTLING / cutoff.frequency, EARLIER * part.motion.half_period)
        shortest = int(np.ceil(least / row_filter.row_step))
        lag = best_lag(rows, scale, terms, row_filter.usable, shortest, shortest + int(LAGS * period))
    reach = min(int(2 * period), len(rows.windows) // 4)
    fit = fit_rows(rows, scale, terms, row_filter.usable, reach, lag)
    b = fit.value("gravity_torque") if scale.b is None else scale.b
    return Fitted(fit, row_filter, rows, lag, reach, 0.0 if scale.linear else b, scale, part.noise)


def _as_windows(one: Fitted) -> WindowFit:
    """The rows used and their fit as one on windows, for the checks that both methods share."""
    used = one.fit.weights > 0
    fit = replace(one.fit.fit, residuals=one.fit.fit.residuals[used], influence=one.fit.fit.influence[:, used])
    half = 1 / one.row_filter.cutoff.frequency
    return WindowFit(one.rows.select(used), one.fit.unknowns, fit, one.fit.covariance, half)


def _second_opinion(part: _Part, rig: Rig, scale: Scale, noise: Noise) -> tuple[list[Message], list[Message]]:
    """What test functions say of signs (raises InputError), and what row (II) says of the wheel angle.

    Windows over half a swing are calm where filtered rows may be mostly noise.
    """
    signals = Signals.of(part.log, rig, part.motion)
    windows = law_windows(signals, part.motion.half_period / 4)
    fit = fit_windows(rows_of(signals, windows), scale, noise, BASIS)
    doubts: list[Message] = []
    if fit is not None:
        check_sign(fit, scale, part.log.source.path or "the log")
        # an impulse at each reversal is let in, for friction with a memory looks like another gravity without it
        lengths = (part.motion.half_period / 4, part.motion.half_period / 6)
        terms = (*BASIS, "memory")
        fits = [fit_windows(rows_of(signals, law_windows(signals, half)), scale, noise, terms) for half in lengths]
        longest, *others = [one for one in fits if one is not None] or [fit]
        doubts = check_gravity(longest, others, signals, rig, scale, noise, least=CLOSE)
    balance = motor_balance(part.log, rig, signals, windows, noise) if len(windows) else None
    warnings, notes = check_motor(balance, signals)
    own = [
        [replace(m, message=m.message.replace("momentum", "this method")) for m in side] for side in (warnings, notes)
    ]
    return [*doubts, *own[0]], own[1]


def _how(part: _Part, cutoff: Cutoff, friction: str, lag: float) -> list[Message]:
    """Notes on what was done to the log."""
    text = f"low-pass at {cutoff.frequency:.3g} Hz ({cutoff.reason}), zero phase, every term alike."
    notes = [Message("cutoff", text)]
    notes.append(Message("friction-law", f"the friction law was taken as {friction}; a wrong one biases the inertia."))
    if part.grid.resampled:
        notes.append(Message("resampled", "the stamps are uneven, so splines carried the log to an even grid first."))
    if lag > 0:
        text = f"instruments: the regressors {lag:.3g} s earlier, which takes noise so far apart as independent."
        notes.append(Message("instruments", text))
    return notes
