"""Gauss–Newton with Levenberg and Marquardt's damping on a `Problem`: bounds, robust loss, initial values eliminated.

A segment's initial values affect its own rows only, so a Schur complement eliminates them from the normal equations:
the system solved has as many unknowns as the model, however long the log.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from swingid.methods.output_error.problem import Prediction, Problem
from swingid.methods.output_error.unknowns import Unknowns
from swingid.numerics.arrays import Array, Bools
from swingid.numerics.regression import SINGLE

LOSSES = ("linear", "huber", "soft_l1")

BEND = 3.0
"""Residual, in standard deviations of the residuals, above which a robust loss reduces the weight of a reading."""

CLOSE_ENOUGH = 1e-7
"""The search ends when the predicted decrease of the cost is below this share of it."""

EXACT = 1e-6
"""Mean squared residual, over the sensors' variance, below which the fit is exact."""

STALLED = 1e-9
"""Least relative decrease of the cost by a step for the search to continue."""

SAME, EXPLAINED = 0.01, 4.0
"""Relative difference of the inertia up to which two searches have found the same minimum; a cost that is that of the
sensors' noise."""

STRAIGHT = 0.02
"""Square of a change of the angles over the motion, in standard deviations of the mean of all readings, up to which the
change is linear in the unknowns."""

LEAP = 0.4
"""Least ratio of the inertia after a step to that before; its inverse is the greatest."""

FAR, CLOSE = 1e-4, 1e-8
"""Damping of the first step of a search, and of one that begins at values of another fit."""

MOST_STEPS, MOST_ROUGH_STEPS = 30, 15
HARDEST = 1e10

SINGULAR = 1e-12
"""Relative damping of a segment's own initial values."""


@dataclass(frozen=True)
class Reduced:
    """Normal equations without the initial values: matrix (m, m), right side (m,), and the blocks that restore those.

    own, cross (k, s, s), (k, s, m), right_own (k, s): blocks of every segment, from its products `grams_of`.
    """

    matrix: Array
    right: Array
    own: Array
    cross: Array
    right_own: Array
    grams: Array

    def states(self, step: Array) -> Array:
        """Step of the initial values (k, s) that belongs to a step (m,) of the unknowns."""
        right = self.right_own - self.cross @ step
        solved: Array = np.asarray(np.linalg.solve(self.own, right[..., None])[..., 0], dtype=np.float64)
        return solved


@dataclass(frozen=True)
class Fit:
    """Where the search ended: values (m,) of the unknowns, initial values (k, s), and the prediction there.

    residuals (r,) in standard deviations of the sensor, weights (r,) of the robust loss, cost the mean of the loss.
    converged: whether the predicted decrease of the cost fell below the limit.
    """

    values: Array
    states: Array
    prediction: Prediction
    residuals: Array
    weights: Array
    cost: float
    reduced: Reduced
    converged: bool


def inverse_of(reduced: Reduced) -> Array:
    """Pseudo-inverse (m, m) of the normal equations' matrix, unknowns scaled alike."""
    scale = 1 / np.sqrt(np.maximum(np.diag(reduced.matrix), 1e-300))
    inverse = np.linalg.pinv(reduced.matrix * np.outer(scale, scale), rcond=1e-13, hermitian=True)
    result: Array = inverse * np.outer(scale, scale)
    return result


def influence_of(problem: Problem, slopes: Array, weights: Array, reduced: Reduced, own: Array | None = None) -> Array:
    """Influence (m, r) of residuals (in standard deviations of the sensor) on the unknowns.

    own (q, m): combinations of the unknowns, of which it is (q, r).
    """
    inverse = inverse_of(reduced)
    of_slopes = inverse if own is None else own @ inverse
    of_states = of_slopes @ np.linalg.solve(reduced.own, reduced.cross).transpose(0, 2, 1)
    result = np.empty((len(of_slopes), len(slopes)))
    for k, (first, last) in enumerate(pairwise(problem.rows)):
        # less what the segment's initial values explain
        both = np.column_stack([-of_states[k], of_slopes])
        np.matmul(both, slopes[first:last].T, out=result[:, first:last])
    result *= weights / problem.sigma
    return result


def grams_of(problem: Problem, slopes: Array, residuals: Array, weights: Array) -> Array:
    """Weighted products of all columns and the residuals (k, m + 1, m + 1), segment by segment."""
    weighted, scale = bool(np.any(weights != 1.0)), 1 / problem.sigma
    parts = (slice(first, last) for first, last in pairwise(problem.rows))
    return np.array([_gram(slopes[k], residuals[k], scale[k], weights[k] if weighted else None) for k in parts])


def grams_among(problem: Problem, fit: Fit, chosen: Bools) -> Array:
    """The products of a fit over the readings where `chosen` (r,) alone."""
    result, slopes = fit.reduced.grams.copy(), fit.prediction.slopes
    for k, (first, last) in enumerate(pairwise(problem.rows)):
        if not chosen[first:last].all():
            own = first + np.flatnonzero(chosen[first:last])
            result[k] = _gram(slopes[own], fit.residuals[own], 1 / problem.sigma[own], fit.weights[own])
    return result


def _gram(slopes: Array, residuals: Array, scale: Array, weights: Array | None) -> Array:
    """Products (m + 1, m + 1) of the scaled columns and the residuals."""
    m = slopes.shape[1]
    size = max(SINGLE // (m + 1) ** 2, 1)
    result, part = np.zeros((m + 1, m + 1)), np.empty((min(size, len(slopes)), m + 1))
    for first in range(0, len(slopes), size):
        rows = slice(first, first + size)
        own = part[: len(residuals[rows])]
        np.multiply(slopes[rows], scale[rows, None], out=own[:, :m])
        own[:, m] = residuals[rows]
        result += (own if weights is None else own * weights[rows, None]).T @ own
    return result


def reduce(problem: Problem, slopes: Array, residuals: Array, weights: Array) -> Reduced:
    """Normal equations of weighted residuals with every segment's initial values eliminated."""
    return eliminated(problem.states, grams_of(problem, slopes, residuals, weights))


def eliminated(s: int, grams: Array, damping: float = SINGULAR) -> Reduced:
    """Normal equations without the s initial values of each segment, of products as of `grams_of`.

    damping: of the step of the initial values, relative.
    """
    m = grams.shape[1] - s - 1
    own, cross, right_own = grams[:, :s, :s], grams[:, :s, s:-1], grams[:, :s, -1]
    # where the wheel rests at once, a combination of its initial speeds has no effect, and the block is singular
    sizes = np.diagonal(own, axis1=1, axis2=2)
    own = own + np.eye(s) * (damping * np.maximum(sizes, SINGULAR * sizes.max(axis=1, keepdims=True)))[:, None]
    held = np.linalg.solve(own, grams[:, :s, s:])
    left = grams[:, s:-1, s:].sum(axis=0) - np.tensordot(cross, held, axes=((0, 1), (0, 1)))
    return Reduced(left[:, :m], left[:, m], own, cross, right_own, grams)


def informed(reduced: Reduced, unknowns: Unknowns, values: Array) -> Reduced:
    """The normal equations with the prior of the unknowns (m,)."""
    return replace(
        reduced,
        matrix=reduced.matrix + np.diag(unknowns.power),
        right=reduced.right - unknowns.power * values,
    )


def loss_of(residuals: Array, loss: str) -> tuple[float, Array]:
    """Mean loss and weights of residuals; a robust loss grows linearly beyond `BEND` times their robust spread."""
    squares = residuals**2
    if loss == "linear":
        return float(np.mean(squares)), np.ones_like(residuals)
    bend = BEND * max(1.0, 1.4826 * float(np.median(np.abs(residuals))))
    x = squares / bend**2
    if loss == "soft_l1":
        root = np.sqrt(1 + x)
        return float(np.mean(2 * bend**2 * (root - 1))), 1 / root
    size = np.sqrt(np.maximum(x, 1.0))
    return float(np.mean(bend**2 * np.where(x <= 1, x, 2 * size - 1))), 1 / size


def solve(
    problem: Problem,
    unknowns: Unknowns,
    values: Array,
    states: Array,
    loss: str,
    enough: float = CLOSE_ENOUGH,
    damping: float = FAR,
    known: Fit | None = None,
) -> Fit:
    """Least squares from `values` (m,) and `states` (k, s); the best point found, converged or not.

    enough: least predicted relative decrease of the cost for the search to continue. damping: of the first step. known:
    a minimum at which the search may end, too.
    """
    low, high = unknowns.bounds
    here = _at(problem, unknowns, np.clip(values, low, high), states, loss)
    return solve_from(here, problem, unknowns, loss, enough, damping, known)


def solve_from(
    here: Fit,
    problem: Problem,
    unknowns: Unknowns,
    loss: str,
    enough: float = CLOSE_ENOUGH,
    damping: float = FAR,
    known: Fit | None = None,
) -> Fit:
    """As `solve`, from a point where the problem is evaluated."""
    if not np.isfinite(here.cost):
        return here
    low, high = unknowns.bounds
    refused, least = False, FAR if damping < FAR else 0.0
    inertia = unknowns.names.index("inertia")
    for _ in range(MOST_STEPS if enough <= CLOSE_ENOUGH else MOST_ROUGH_STEPS):
        # damped further than at first, the step of the initial values is, too: the motion may have a bend right at the
        # begin of a segment, where the wheel reverses
        reduced = _damped(here, problem, unknowns, damping) if damping > FAR else here.reduced
        step, promised = _step(here, reduced, low, high, damping)
        trial = np.clip(here.values + step, low, high)
        trial[inertia] = np.clip(trial[inertia], here.values[inertia] * LEAP, here.values[inertia] / LEAP)
        if promised <= enough * max(here.cost, EXACT) and damping <= 1e-2:
            here = _stepped(here, problem, unknowns, trial) if enough <= CLOSE_ENOUGH else here
            return replace(here, converged=bool(np.isfinite(here.cost)))
        moved = here.states + reduced.states(trial - here.values)
        if known is not None and _leads_to(known, here, trial[inertia], promised, inertia):
            return replace(here, values=trial)
        # refusals come in runs: after one the cost is looked at before the sensitivities are computed
        seen, cost = None, 0.0
        if refused or problem.input == "voltage":  # where the motion is a step of its own
            seen, cost = _seen(problem, unknowns, trial, moved, loss)
        there = _at(problem, unknowns, trial, moved, loss, seen) if cost < here.cost else here
        cost = cost if there is here else there.cost
        refused = not cost < here.cost
        if not refused:
            gained, here, damping = here.cost - cost, there, max(damping / 10, 1e-12)
            if gained <= STALLED * cost:
                return replace(here, converged=True)
        elif damping > HARDEST or (promised <= 1e-4 * here.cost and cost - here.cost <= 1e-9 * here.cost):
            return replace(here, converged=promised <= 1e-4 * here.cost or here.cost <= EXACT)
        else:
            damping = max(10 * damping, least)
    return replace(here, converged=here.cost <= EXACT)


def stepped_states(problem: Problem, unknowns: Unknowns, values: Array, loss: str) -> Array:
    """The initial values (k, s) after one step of least squares in these alone."""
    found = _at(problem, unknowns, values, problem.starts, loss)
    if not np.isfinite(found.cost):
        return problem.starts
    states = problem.starts + found.reduced.states(np.zeros(len(values)))
    return states if np.isfinite(states).all() else problem.starts


def solve_near(problem: Problem, unknowns: Unknowns, values: Array, states: Array, loss: str, enough: float) -> Fit:
    """As `solve`, rough, from values that are nearly the best.

    Where the model explains the readings and they need to change by so little that the square of that is negligible,
    one simulation will do.
    """
    low, high = unknowns.bounds
    here = _at(problem, unknowns, np.clip(values, low, high), states, loss)
    if not here.cost < EXPLAINED:
        return solve_from(here, problem, unknowns, loss, enough, CLOSE)
    motion = float(np.std(problem.measured[~problem.wheel] / problem.sigma[~problem.wheel]))
    negligible = STRAIGHT * motion / np.sqrt(len(here.residuals))
    for k in range(MOST_ROUGH_STEPS):
        step, promised = _step(here, here.reduced, low, high, CLOSE)
        if promised <= enough * max(here.cost, EXACT):
            return replace(here, converged=True)
        if k == 0 and promised > negligible:
            break
        here = _stepped(here, problem, unknowns, np.clip(here.values + step, low, high))
    return solve_from(here, problem, unknowns, loss, enough, CLOSE)


def _seen(
    problem: Problem, unknowns: Unknowns, values: Array, states: Array, loss: str
) -> tuple[Prediction | None, float]:
    """The motion, where the sensitivities follow along it, and its cost, infinite where it diverges."""
    prediction = problem.moved(unknowns, values, states)
    residuals = (problem.measured - prediction.outputs) / problem.sigma
    if not (prediction.finite and np.isfinite(residuals).all()):
        return None, np.inf
    cost = loss_of(residuals, loss)[0] + float(unknowns.power @ values**2) / len(residuals)
    return prediction if prediction.steps is not None else None, cost


def _at(
    problem: Problem, unknowns: Unknowns, values: Array, states: Array, loss: str, same: Prediction | None = None
) -> Fit:
    known = {} if same is None else {"same": same}
    prediction = problem.fitted(unknowns, values, states, **known)
    residuals = (problem.measured - prediction.outputs) / problem.sigma
    empty = Reduced(*(np.zeros((0, 0)) for _ in range(6)))
    diverged = Fit(values, states, prediction, residuals, residuals, np.inf, empty, converged=False)
    if not (prediction.finite and np.isfinite(residuals).all() and np.isfinite(prediction.slopes).all()):
        return diverged
    cost, weights = loss_of(residuals, loss)
    cost += float(unknowns.power @ values**2) / len(residuals)
    with np.errstate(over="ignore", invalid="ignore"):  # squares of sensitivities that are finite may not be
        reduced = informed(reduce(problem, prediction.slopes, residuals, weights), unknowns, values)
    if not (np.isfinite(cost) and np.isfinite(reduced.matrix).all() and np.isfinite(reduced.right).all()):
        return diverged
    return Fit(values, states, prediction, residuals, weights, cost, reduced, converged=False)


def _leads_to(known: Fit, here: Fit, there: float, promised: float, inertia: int) -> bool:
    """Whether the next step, to the inertia `there`, is to end at a known minimum that explains the log."""
    wanted, explains = known.values[inertia], known.cost < EXPLAINED
    near = max(abs(there - wanted), abs(here.values[inertia] - wanted)) < SAME * wanted
    return bool(known.converged and explains and near and here.cost - promised < EXPLAINED)


def _stepped(fit: Fit, problem: Problem, unknowns: Unknowns, values: Array) -> Fit:
    """The fit at `values` so near that the change is linear, with the sensitivities and the cost before."""
    step = values - fit.values
    states = fit.reduced.states(step)
    both = np.column_stack([states, np.broadcast_to(step, (len(states), len(step)))])
    change, grams = np.empty(len(fit.residuals)), fit.reduced.grams.copy()
    for own, gram, (first, last) in zip(both, grams, pairwise(problem.rows), strict=True):
        np.matmul(fit.prediction.slopes[first:last], own, out=change[first:last])
        gram[:-1, -1] -= gram[:-1, :-1] @ own
        gram[-1] = gram[:, -1]
    residuals = fit.residuals - change / problem.sigma
    prediction = replace(fit.prediction, outputs=fit.prediction.outputs + change)
    reduced = informed(eliminated(problem.states, grams), unknowns, values)
    return replace(
        fit, values=values, states=fit.states + states, prediction=prediction, residuals=residuals, reduced=reduced
    )


def _damped(fit: Fit, problem: Problem, unknowns: Unknowns, damping: float) -> Reduced:
    """The normal equations of a fit with the step of its initial values damped."""
    return informed(eliminated(problem.states, fit.reduced.grams, damping), unknowns, fit.values)


def _step(fit: Fit, reduced: Reduced, low: Array, high: Array, damping: float) -> tuple[Array, float]:
    """Damped step of the unknowns, those fixed that would leave their bounds; the predicted decrease of the cost."""
    matrix, right = reduced.matrix, reduced.right
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
    own = np.linalg.solve(reduced.own, reduced.right_own[..., None])[..., 0]
    fall = float(2 * step @ right - step @ matrix @ step + np.sum(own * reduced.right_own))
    return step, fall / max(len(fit.residuals), 1)
