"""Gauss–Newton with Levenberg and Marquardt's damping on a `Shooting`: bounds, robust loss, several starts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from swingid.numerics.arrays import Array
from swingid.numerics.shooting import Fit, Reduced, Shooting

CLOSE_ENOUGH = 1e-7
"""The search ends when the predicted decrease of the cost is below this share of it."""

EXACT = 1e-6
"""Mean squared residual, over the sensors' variance, below which the fit is exact."""

STALLED = 1e-9
"""Least relative decrease of the cost by a step for the search to continue."""

SAME, EXPLAINED = 0.01, 4.0
"""Relative difference of the first unknown up to which two searches have found the same minimum; a cost that is that of
the sensors' noise."""

FAR, CLOSE, LEAST = 1e-4, 1e-8, 1e-12
"""Damping of the first step of a search, of one that begins at values of another fit, and the least of all steps."""

MOST_STEPS, MOST_ROUGH_STEPS = 30, 15
HARDEST = 1e10


def fit_at(shooting: Shooting, values: Array, states: Array, below: float = np.inf) -> Fit:
    """The point of a search at these values (m,) and states (k, s); without derivatives unless its cost is `below`."""
    motion = shooting.simulate(values, states, None) if shooting.move is None else shooting.move(values, states)
    residuals = shooting.residuals(motion)
    empty = Reduced(*(np.zeros((0, 0)) for _ in range(6)))
    diverged = Fit(shooting, values, states, motion, residuals, residuals, np.inf, empty)
    if not (motion.finite and np.isfinite(residuals).all()):
        return diverged
    cost, weights = shooting.cost(residuals, values)
    if not cost < below:
        return replace(diverged, cost=cost)
    prediction = motion if shooting.move is None else shooting.simulate(values, states, motion)
    if not np.isfinite(prediction.slopes).all():
        return diverged
    with np.errstate(over="ignore", invalid="ignore"):  # squares of sensitivities that are finite may not be
        reduced = shooting.reduced(shooting.grams(prediction.slopes, residuals, weights), values)
    if not (np.isfinite(reduced.matrix).all() and np.isfinite(reduced.right).all()):
        return diverged
    return Fit(shooting, values, states, prediction, residuals, weights, cost, reduced)


def solve(
    shooting: Shooting,
    values: Array,
    states: Array,
    enough: float = CLOSE_ENOUGH,
    damping: float = FAR,
    known: Fit | None = None,
) -> Fit:
    """Least squares from `values` (m,) and `states` (k, s); the best point found, converged or not.

    enough: least predicted relative decrease of the cost for the search to continue. damping: of the first step. known:
    a minimum at which the search may end, too.
    """
    return solve_from(fit_at(shooting, shooting.nearest(values, values), states), enough, damping, known)


def solve_from(here: Fit, enough: float = CLOSE_ENOUGH, damping: float = FAR, known: Fit | None = None) -> Fit:
    """Solve as `solve` does, from a point where the problem is evaluated."""
    if not np.isfinite(here.cost):
        return here
    shooting, least = here.shooting, FAR if damping < FAR else 0.0
    for _ in range(MOST_STEPS if enough <= CLOSE_ENOUGH else MOST_ROUGH_STEPS):
        # damped further than at first, the step of the initial values is, too: the motion may have a bend right at the
        # begin of a segment, where a speed reverses
        reduced = shooting.reduced(here.reduced.grams, here.values, damping) if damping > FAR else here.reduced
        step, promised = _step(here, reduced, damping)
        trial = shooting.nearest(here.values + step, here.values)
        if promised <= enough * max(here.cost, EXACT) and damping <= 1e-2:
            here = here.moved(trial) if enough <= CLOSE_ENOUGH else here
            return replace(here, converged=bool(np.isfinite(here.cost)))
        states = here.states + reduced.states(trial - here.values)
        if known is not None and _leads_to(known, here, trial, promised):
            return replace(here, values=trial)
        there = fit_at(shooting, trial, states, here.cost)
        cost = there.cost
        if cost < here.cost:
            gained, here, damping = here.cost - cost, there, max(damping / 10, LEAST)
            if gained <= STALLED * cost:
                return replace(here, converged=True)
        elif damping > HARDEST or (promised <= 1e-4 * here.cost and cost - here.cost <= 1e-9 * here.cost):
            return replace(here, converged=promised <= 1e-4 * here.cost or here.cost <= EXACT)
        else:
            damping = max(10 * damping, least)
    return replace(here, converged=here.cost <= EXACT)


def solve_near(here: Fit, enough: float, negligible: float) -> Fit:
    """Solve as `solve_from` does, roughly, from values that are nearly the best.

    Where the model explains the readings and a step is to lower the cost by less than `negligible`, the change is
    linear in the unknowns, and one simulation will do.
    """
    if not here.cost < EXPLAINED:
        return solve_from(here, enough, CLOSE)
    for k in range(MOST_ROUGH_STEPS):
        step, promised = _step(here, here.reduced, CLOSE)
        if promised <= enough * max(here.cost, EXACT):
            return replace(here, converged=True)
        if k == 0 and promised > negligible:
            break
        low, high = here.shooting.bounds
        here = here.moved(np.clip(here.values + step, low, high))
    return solve_from(here, enough, CLOSE)


def _leads_to(known: Fit, here: Fit, trial: Array, promised: float) -> bool:
    """Return whether the next step, to the values `trial`, is to end at a known minimum that explains the log."""
    wanted, explains = known.values[0], known.cost < EXPLAINED
    near = max(abs(trial[0] - wanted), abs(here.values[0] - wanted)) < SAME * wanted
    return bool(known.converged and explains and near and here.cost - promised < EXPLAINED)


def _step(fit: Fit, reduced: Reduced, damping: float) -> tuple[Array, float]:
    """Damped step of the unknowns, those fixed that would leave their bounds; the predicted decrease of the cost."""
    (low, high), matrix, right = fit.shooting.bounds, reduced.matrix, reduced.right
    free = np.ones(len(right), dtype=bool)
    step, powers = np.zeros(len(right)), np.diag(matrix)
    # an unknown without effect, as the speed of a peak of no height, stays where it is
    scale = np.where(powers > 0, 1 / np.sqrt(np.maximum(powers, 1e-300)), 0.0)
    for _ in range(len(right)):
        at = np.nonzero(free)[0]
        inner = matrix[np.ix_(at, at)] * np.outer(scale[at], scale[at]) + damping * np.eye(len(at))
        step[:] = 0.0
        step[at] = scale[at] * np.linalg.lstsq(inner, scale[at] * right[at], rcond=1e-14)[0]
        pushed = free & (((fit.values <= low) & (step < 0)) | ((fit.values >= high) & (step > 0)))
        if not pushed.any():
            break
        free &= ~pushed
    fall = float(2 * step @ right - step @ matrix @ step) + reduced.gained
    return step, fall / max(len(fit.residuals), 1)
