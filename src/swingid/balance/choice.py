"""The choice of the law windows: their length, and whether friction has a memory.

The length minimises the standard uncertainty of the inertia: short windows amplify sensor noise, long ones let through
what the friction basis does not describe, and both show in the scatter of the rows.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from swingid.balance.declared import with_declared
from swingid.balance.delays import dry_levels, impulse_of, late_reversals
from swingid.balance.fits import BASIS, WindowFit, fit_rows
from swingid.balance.friction import FrictionLaw, first_torque, fit_friction
from swingid.balance.friction_laws import TERMS
from swingid.balance.rows import Rows, Signals, retimed, rows_of
from swingid.balance.systematics import grid_spread
from swingid.balance.windows import law_windows
from swingid.errors import UnanswerableError
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.preparation.noise import Noise
from swingid.preparation.scale import Scale
from swingid.uncertainty.significance import DETECTED

FLAT = 1.25
"""Of windows whose uncertainties are equal within this factor the longest is taken."""

CALM = 1.5
"""The same for friction, whose longer windows are also the calmer ones."""

PASSES = 4
"""Times that friction and turning points are found in turns, at most, and the change of the delay that ends it."""

SETTLED = 0.1

MOMENTS = 4000
"""Instants of the motion that the mean over it is taken of."""

ONE_SWING = 0.55
"""Half-length, in swings, up to which windows tell friction: longer ones see its alternation and little else."""


class Choice(NamedTuple):
    """The "law" fit of least uncertainty, declared imperfections included, and all fits tried by half-length in s.

    signals: with the turning points corrected for their delay. impulse: standard uncertainty (N m s or N s) of what
    that leaves at each reversal. friction: what the balance leaves with them.
    """

    law: WindowFit
    tried: dict[float, WindowFit]
    signals: Signals
    impulse: float
    friction: FrictionLaw


def choose(signals: Signals, rig: Rig, scale: Scale, noise: Noise) -> Choice:
    """Windows and terms for the inertia, and the turning points that the friction found with them corrects.

    A peak of friction at rest delays the turning points further, and they decide what is seen of it: both are found
    in turns. Raises UnanswerableError for a log too short for any window.
    """
    searched, signals = _search(signals, scale, noise, BASIS)
    seen = friction_windows(signals, searched)
    torque, before = first_torque(signals, seen.rows, scale), np.zeros(0)
    for _ in range(PASSES):
        levels = dry_levels(signals, seen)
        late = late_reversals(signals, torque, abs(seen.a11), noise, levels)
        corrected = signals.earlier(late)
        rows = {half: retimed(fit.rows, corrected) for half, fit in searched.items()}
        tried, impulse = _with_memory(corrected, rows, scale, noise, impulse_of(late, torque, levels))
        tried = {half: with_declared(fit, rig, corrected, scale, noise) for half, fit in tried.items()}
        least = min(fit.total for fit in tried.values())
        law = max((fit for fit in tried.values() if fit.total <= FLAT * least), key=lambda fit: fit.half)
        calm = friction_windows(corrected, tried)
        memory = (law.value("memory"), law.uncertainty("memory") if "memory" in law.unknowns else impulse)
        friction = fit_friction(corrected, calm.rows, scale, memory, noise.angle)
        settled = before.size > 0 and float(np.max(np.abs(late - before))) < SETTLED * float(np.max(np.abs(late)))
        if settled or "stribeck" not in friction.terms:
            break
        torque, before = friction.torque, late
    return Choice(law, tried, corrected, impulse, friction)


def _with_memory(
    signals: Signals, rows: dict[float, Rows], scale: Scale, noise: Noise, impulse: float
) -> tuple[dict[float, WindowFit], float]:
    """Fits of the rows, and how uncertain the impulse at each reversal is that `impulse` (N m s or N s) bounds.

    If friction has a memory, an impulse at each reversal (the old direction lives on for a moment: LuGre's
    bristles, backlash, a short stick) is fitted too, where it is seen beyond noise and encoder grid.
    """
    tried = _fits(rows, scale, noise, BASIS)
    # over a whole swing and more, an impulse at each reversal looks like inertia
    short = {half: own for half, own in rows.items() if half < ONE_SWING * signals.motion.half_period}
    remembered = _fits(short, scale, noise, (*BASIS, "memory"))
    if not remembered:
        return tried, impulse
    sharpest = min(remembered.values(), key=lambda fit: fit.uncertainty("memory"))
    found = abs(sharpest.value("memory"))
    spread = float(np.hypot(sharpest.uncertainty("memory"), grid_spread(signals, sharpest, scale, noise, "memory")))
    return (remembered if found > DETECTED * spread else tried), impulse_left(impulse, found, spread)


def impulse_left(prior: float, found: float, spread: float) -> float:
    """How uncertain the impulse at each reversal is (N m s or N s) where the rows find `found` ± `spread`.

    The correction of the turning points is as uncertain as it is large (`prior`), for friction at rest is extrapolated
    from faster motion, where a short peak doesn't show: a prior of the impulse, which the rows then tell more about.
    """
    told = prior**2 / max(prior**2 + spread**2, 1e-300)
    return float(np.hypot(told * found, np.sqrt(told) * spread))


def _fits(rows: dict[float, Rows], scale: Scale, noise: Noise, friction: tuple[str, ...]) -> dict[float, WindowFit]:
    fits = {half: fit_rows(own, scale, noise, friction) for half, own in rows.items()}
    return {half: fit for half, fit in fits.items() if fit is not None}


def _search(
    signals: Signals, scale: Scale, noise: Noise, friction: tuple[str, ...]
) -> tuple[dict[float, WindowFit], Signals]:
    """Fits by half-length: octaves downwards while they get better, then the half octaves beside the best.

    Also the signals on blocks short enough for the shortest of them.
    """
    time = signals.nodes.time
    longest = min(0.75 * signals.motion.half_period, (time[-1] - time[0]) / 5)
    shortest = 4 * noise.step
    tried: dict[float, WindowFit] = {}

    def attempt(half: float) -> WindowFit | None:
        nonlocal signals
        signals = signals.suited(half)
        fit = fit_rows(rows_of(signals, law_windows(signals, half)), scale, noise, friction)
        if fit is not None and np.isfinite(fit.u):
            tried[half] = fit
        return tried.get(half)

    half = longest
    while half > shortest:
        fit = attempt(half)
        if fit is not None and fit.u > 2.5 * min(other.u for other in tried.values()):
            break
        half /= 2
    if not tried:
        raise UnanswerableError(
            f"the log holds {time[-1] - time[0]:.3g} s of usable motion, too little to fit inertia and friction; "
            "record at least five swings.",
            code="too-short",
        )
    best = min(tried, key=lambda length: tried[length].u)
    for neighbour in (best / np.sqrt(2), best * np.sqrt(2)):
        if shortest < neighbour < longest:
            attempt(neighbour)
    return tried, signals


def friction_windows(signals: Signals, tried: dict[float, WindowFit]) -> WindowFit:
    """The fit whose windows know the friction best, on the mean over the motion; among equals the longest.

    The same principle as for the inertia. Long windows average what depends on the place, which no law of the speed
    describes; short ones tell the speeds of one swing apart, which a decay tells by its many swings.
    """
    moments = _moments(signals)
    within = [fit for half, fit in tried.items() if half <= ONE_SWING * signals.motion.half_period]
    if not within:
        return min(tried.values(), key=lambda fit: fit.half)
    spread = {fit.half: _torque_variance(fit, moments) for fit in within}
    least = min(spread.values())
    return max((fit for fit in within if spread[fit.half] <= CALM**2 * least), key=lambda fit: fit.half)


def _moments(signals: Signals) -> Array:
    """Mean products of the terms of BASIS over the motion, computed once."""
    key = ("moments", float(MOMENTS))
    if key not in signals.kept:
        speeds = signals.speed.ravel()
        speeds = speeds[:: max(1, len(speeds) // MOMENTS)]
        columns = np.stack([TERMS[name](speeds) for name in BASIS])
        signals.kept[key] = columns @ columns.T / len(speeds)
    return signals.kept[key]


def _torque_variance(fit: WindowFit, moments: Array) -> float:
    """Variance of the friction torque, type A, on the mean over a motion with these moments of the terms of BASIS."""
    at = [fit.unknowns.index(name) for name in BASIS]
    return float(np.sum(fit.covariance[np.ix_(at, at)] * moments))
