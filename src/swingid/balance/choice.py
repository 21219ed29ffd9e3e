"""The choice of the law windows: their length, and whether an impulse at each reversal is fitted (dynamic friction).

The length minimises the relative standard uncertainty of the inertia: short windows amplify sensor noise, long ones the
lack of fit of the friction terms, and both show in the scatter of the rows.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from swingid.balance.delays import dry_levels, late_reversals
from swingid.balance.errors import bends, late_error
from swingid.balance.fits import BASIS, WindowFit, fit_rows, residuals_beside, with_declared
from swingid.balance.friction import FrictionLaw, first_torque, fit_friction
from swingid.balance.friction_laws import NEAR_REST, TERMS, with_near_rest
from swingid.balance.lengths import each, longest_of_best, search
from swingid.balance.reversals import IMPULSES, impulse_found, impulses_expected, impulses_of
from swingid.balance.rows import Rows, Signals, retimed, rows_of
from swingid.balance.slow import SlowKind, slow_kinds, with_slow
from swingid.balance.systematics import grid_spread
from swingid.balance.windows import law_windows
from swingid.errors import UnanswerableError
from swingid.model.equation import Equation
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.preparation.noise import Noise
from swingid.uncertainty.significance import bayesian, misfit

FLAT = 1.25
"""Of windows whose uncertainties are equal within this factor the longest is taken."""

CALM = 1.5
"""The same for friction, whose longer windows are also the calmer ones."""

PASSES = 4
"""Iterations between friction and turning points, at most."""

SETTLED = 0.1
"""Relative change of the delays that ends the iteration."""

MOMENTS = 4000
"""Instants of the motion for means over it."""

ONE_SWING = 0.55
"""Half-length, in swings, up to which windows determine friction: longer ones depend on little but its alternation."""


class Choice(NamedTuple):
    """The "law" fit of least uncertainty, declared imperfections included, and all fits tried by half-length in s.

    signals: with the turning points corrected for their delay. impulse: standard uncertainty (N m s or N s) of the
    impulse at each reversal that the correction leaves. friction: law and curve fitted with these turning points. slow:
    what changes within the log, whose coefficients are unknowns of the fits.
    """

    law: WindowFit
    tried: dict[float, WindowFit]
    signals: Signals
    impulse: float
    friction: FrictionLaw
    slow: tuple[SlowKind, ...] = ()


FURTHER = {(*NEAR_REST,): 21.1, ("cubic",): 15.1, (*NEAR_REST, "cubic"): 23.5}
"""Terms of friction that are tried together beside BASIS, each with the fall of −2 log likelihood from which on it is
taken: χ² with 3, 1 and 4 degrees of freedom, 1e-4, one test per log, for it changes the model of the fit."""

MEMORY = ("auto", "on", "off")
"""Whether an impulse at each reversal is fitted: where it is significant, in any case, or not."""


def choose(signals: Signals, rig: Rig, equation: Equation, noise: Noise, memory: str = "auto") -> Choice:
    """Windows and terms for the inertia, and turning points corrected for the friction that is estimated with them.

    A peak of friction at rest delays the turning points, and its estimate depends on them: both are found by iteration.
    Raises UnanswerableError for a log too short for any window.
    """
    searched, signals = _search(signals, equation, noise, BASIS)
    moments = _moments(signals)
    seen = friction_windows(signals, searched, moments)
    torque, before = first_torque(signals, seen.rows, equation), np.zeros(0)

    def declared(fit: WindowFit) -> WindowFit:
        return with_declared(fit, rig, corrected)

    for _ in range(PASSES):
        levels = dry_levels(signals, seen.value)
        late = late_reversals(signals, torque, abs(seen.a11), noise, levels)
        corrected = signals.earlier(late)
        rows = {half: retimed(fit.rows, corrected) for half, fit in searched.items()}
        prior = impulses_expected(signals.motion, late, torque, levels)
        tried, impulse = _with_memory(corrected, rows, equation, noise, prior, memory)
        tried = _with_further(corrected, tried)
        tried = each(tried, declared)
        law = _longest_of_best(tried)
        calm = friction_windows(corrected, tried, moments)
        known = {name: law.value(name) for name in IMPULSES if name in law.unknowns}
        impulse_u = law.uncertainty("memory") if known else impulse
        friction = fit_friction(corrected, calm.rows, equation, known, impulse_u, noise.angle)
        settled = before.size > 0 and float(np.max(np.abs(late - before))) < SETTLED * float(np.max(np.abs(late)))
        if settled or "stribeck" not in friction.terms:
            break
        torque, before = friction.torque, late
    kinds = slow_kinds(calm, corrected, _other_causes(calm, corrected))
    changing = each(each(tried, lambda fit: with_slow(fit, corrected, kinds)), declared) if kinds else {}
    if changing:
        tried, law = changing, _longest_of_best(changing)
    return Choice(law, tried, corrected, impulse, friction, kinds if changing else ())


def _longest_of_best(tried: dict[float, WindowFit]) -> WindowFit:
    """The fit on the longest windows of about the least relative uncertainty."""
    law = longest_of_best(tried.values(), lambda fit: fit.relative(fit.total), FLAT)
    if law is None:
        raise UnanswerableError(
            "no fit of the log has a finite uncertainty, so it does not determine the inertia; record a larger motion, "
            "or leave out the parts in which nothing moves (--part).",
            code="not-identifiable",
        )
    return law


def _other_causes(fit: WindowFit, signals: Signals) -> Iterator[Array]:
    """Columns of what may look like a slow change: friction beyond the basis, errors of the angles.

    In a decay the amplitude changes with time, so friction of another law seems to be one that changes.
    """
    rows = with_near_rest(signals, fit.rows)
    laws = [rows[name] for name in (*NEAR_REST, "cubic") if name not in fit.unknowns]
    yield np.array(laws).reshape(-1, len(rows)).T  # none, where the fit has all
    yield from _errors_of_angles(fit, signals)


def _with_memory(
    signals: Signals, rows: dict[float, Rows], equation: Equation, noise: Noise, prior: tuple[float, float], memory: str
) -> tuple[dict[float, WindowFit], float]:
    """Fits of the rows, and the standard uncertainty of the impulse at each reversal.

    prior: the impulse by errors of the turning points, and the usual one of such friction (N m s or N s).

    It is an unknown by the rule of `impulse_found`; its uncertainty includes the grid phase.
    """
    motion, tried = signals.motion, each(rows, lambda of_half: fit_rows(of_half, equation, noise, BASIS))
    # over a whole swing and more, an impulse at each reversal looks like inertia
    short = {half: rows_of_half for half, rows_of_half in rows.items() if half < ONE_SWING * motion.half_period}
    remembered = each(short, lambda of_half: fit_rows(of_half, equation, noise, (*BASIS, "memory")))
    if not remembered or memory == "off":
        return tried, prior[0]
    sharpest = min(remembered.values(), key=lambda fit: fit.uncertainty("memory"))
    spread = float(np.hypot(sharpest.uncertainty("memory"), grid_spread(sharpest, signals, "memory")))
    plain = min(tried.values(), key=lambda fit: fit.uncertainty("coulomb"))  # an impulse is collinear with dry friction
    impulse = impulse_found(equation, motion, (sharpest.value("memory"), spread), prior, plain.value("coulomb"))
    terms = (impulse.terms or impulses_of(motion)) if memory == "on" else impulse.terms
    if not terms:
        return tried, impulse.left
    if terms != ("memory",):
        remembered = each(short, lambda of_half: fit_rows(of_half, equation, noise, (*BASIS, *terms)))
    return remembered, impulse.left


def _with_further(signals: Signals, tried: dict[float, WindowFit]) -> dict[float, WindowFit]:
    """The fits with the terms of friction beyond BASIS that the log shows: peaks near rest, a cubic term.

    What BASIS leaves of them biases the inertia by some 1e-5 and looks like a wrong gravity torque, a late channel or a
    nonlinear encoder. The last two are as likely: the best explanation of the residuals by the Bayesian criterion is
    taken.
    """
    plain = min(tried.values(), key=lambda fit: fit.relative(fit.u))
    if plain.is_exact:
        return tried
    rows, fits = with_near_rest(signals, plain.rows), {}
    for terms, level in FURTHER.items():
        fit = _beside(plain, rows, terms)
        if fit is not None and _dissipates(fit) and gain(plain, fit) > level:
            fits[terms] = fit
    if not fits:
        return tried
    score = {terms: bayesian(fit.lost, len(terms), plain.independent) for terms, fit in fits.items()}
    terms = min(score, key=lambda name: score[name])
    for columns in _errors_of_angles(plain, signals):
        least = float(np.sum(residuals_beside(plain, columns) ** 2))
        if bayesian(least, columns.shape[1], plain.independent) < score[terms]:
            return tried
    return each(tried, lambda fit: _beside(fit, with_near_rest(signals, fit.rows), terms))


def _beside(fit: WindowFit, rows: Rows, terms: tuple[str, ...]) -> WindowFit | None:
    """The fit with further terms of friction, which are columns of `rows`."""
    return fit_rows(rows, fit.equation, fit.noise, (*fit.friction, *terms))


def _dissipates(fit: WindowFit) -> bool:
    """Return whether friction at rest is positive, and no less than where its peak has passed."""
    peaks = [fit.value(name) for name in NEAR_REST if name in fit.unknowns]
    return not peaks or (fit.value("coulomb") > 0 and sum(peaks) > 0)


def gain(plain: WindowFit, more: WindowFit) -> float:
    """Fall of −2 log likelihood from a fit to one of the same rows with further terms, see `FURTHER`."""
    return misfit(plain.lost, plain.independent) - misfit(more.lost, plain.independent)


def _errors_of_angles(fit: WindowFit, signals: Signals) -> list[Array]:
    """Columns of a once-per-turn nonlinearity of the encoders, and of a late channel, where the balance has them."""
    bent = bends(fit.rows, signals, fit.coefficients)
    errors = [bent] if bent.size else []
    if not fit.equation.driven:
        return errors
    return [*errors, late_error(fit.rows, signals, fit.coefficients)[:, None]]


def _search(
    signals: Signals, equation: Equation, noise: Noise, friction: tuple[str, ...]
) -> tuple[dict[float, WindowFit], Signals]:
    """Fits by half-length, see `lengths.search`, and the signals on blocks short enough for the shortest of them."""
    time = signals.nodes.time
    longest = min(0.75 * signals.motion.half_period, (time[-1] - time[0]) / 5)
    shortest = 4 * noise.step

    def fit_at(half: float) -> WindowFit | None:
        nonlocal signals
        signals = signals.suited(half)
        return fit_rows(rows_of(signals, law_windows(signals, half)), equation, noise, friction)

    tried = search(fit_at, longest, shortest)
    if not tried:
        raise UnanswerableError(
            f"the log contains {time[-1] - time[0]:.3g} s of usable motion, too little to fit inertia and friction; "
            "record at least five swings.",
            code="too-short",
        )
    return tried, signals


def friction_windows(signals: Signals, tried: dict[float, WindowFit], moments: Array) -> WindowFit:
    """The fit with the least variance of friction, averaged over the motion; among equals the longest.

    The same principle as for the inertia. Long windows average what depends on the angle, which no law of the speed
    describes; short ones resolve the speeds within one swing, which a decay covers by its many swings. moments: as
    `_moments`.
    """
    within = (fit for half, fit in tried.items() if half <= ONE_SWING * signals.motion.half_period)
    calm = longest_of_best(within, lambda fit: _torque_variance(fit, moments), CALM**2)
    return min(tried.values(), key=lambda fit: fit.half) if calm is None else calm


def _moments(signals: Signals) -> Array:
    """Mean products of the terms of BASIS over the motion."""
    speeds = signals.speed.ravel()
    speeds = speeds[:: max(1, len(speeds) // MOMENTS)]
    columns = np.stack([TERMS[name](speeds) for name in BASIS])
    result: Array = columns @ columns.T / len(speeds)
    return result


def _torque_variance(fit: WindowFit, moments: Array) -> float:
    """Variance of the friction torque, type A, averaged over a motion with these moments of the terms of BASIS."""
    at = [fit.unknowns.index(name) for name in BASIS]
    return float(np.sum(fit.covariance[np.ix_(at, at)] * moments))
