"""Least squares of simulated against measured readings, on segments that each have initial values of their own.

Multiple shooting without continuity conditions (Bock 1983): the errors of a model do not grow over a long or unstable
motion, and the work is proportional to its length. A segment's initial values affect its own readings only, so a Schur
complement eliminates them from the normal equations: the system solved has as many unknowns as the model, however long
the log. About a solution the fit is linear, θ = K y: an error ρ of the readings changes the unknowns by K ρ.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from swingid.numerics.arrays import Array, Bools, Ints
from swingid.numerics.regression import gram, inverse_of_gram

LOSSES = ("linear", "huber", "soft_l1")

BEND = 3.0
"""Residual, in standard deviations of the residuals, above which a robust loss reduces the weight of a reading."""

SINGULAR = 1e-12
"""Relative damping of a segment's own initial values."""

_NONE = np.empty(0)


@dataclass(frozen=True)
class Prediction:
    """Simulated readings (r,), their rates (r,) where known, and their derivatives (r, s + m).

    The derivatives are by the s initial values of the reading's segment, then by the m unknowns. finite: whether the
    motion stayed so. steps: of the motion, where its derivatives follow along them; of_sensors: those by unknowns of
    the sensors, by their places, which do not.
    """

    outputs: Array
    slopes: Array
    finite: bool = True
    rates: Array = field(default_factory=lambda: _NONE)
    steps: Any = None
    of_sensors: Mapping[int, Array] = field(default_factory=dict)


@dataclass(frozen=True)
class Shooting:
    """The readings of a log in k segments, in order of time, and their simulation under m unknowns.

    measured, sigma (r,): readings and standard deviations of the sensor. rows (k + 1,): first reading of each segment.
    starts (k, s): first initial values. simulate: a prediction at values (m,) and states (k, s), perhaps of a motion
    that is simulated already. move: the same without derivatives, where that is cheaper than with them.
    bounds: lowest and highest values (m,). power (m,): information of a prior of each unknown about 0. loss: one of
    `LOSSES`. nearest: the values allowed (m,) that are next to the first argument, in a step from the second.
    """

    measured: Array
    sigma: Array
    rows: Ints
    starts: Array
    simulate: Callable[[Array, Array, Prediction | None], Prediction]
    bounds: tuple[Array, Array]
    power: Array
    nearest: Callable[[Array, Array], Array]
    move: Callable[[Array, Array], Prediction] | None = None
    loss: str = "linear"

    @property
    def states(self) -> int:
        """Initial values per segment."""
        return int(self.starts.shape[1])

    def residuals(self, prediction: Prediction) -> Array:
        """Readings less their prediction, in standard deviations of the sensor (r,)."""
        residuals: Array = (self.measured - prediction.outputs) / self.sigma
        return residuals

    def cost(self, residuals: Array, values: Array) -> tuple[float, Array]:
        """Mean loss of residuals (r,) and of the prior at `values` (m,), and the weights (r,) of the readings."""
        mean, weights = loss_of(residuals, self.loss)
        return mean + float(self.power @ values**2) / len(residuals), weights

    def grams(self, slopes: Array, residuals: Array, weights: Array) -> Array:
        """Weighted products of all columns and the residuals (k, s + m + 1, s + m + 1), segment by segment."""
        products = []
        for first, last in pairwise(self.rows):
            segment, rows = slice(first, last), np.empty((last - first, slopes.shape[1] + 1))
            root = np.sqrt(weights[segment])
            np.multiply(slopes[segment], (root / self.sigma[segment])[:, None], out=rows[:, :-1])
            np.multiply(residuals[segment], root, out=rows[:, -1])
            products.append(gram(rows.T))
        return np.array(products)

    def reduced(self, grams: Array, values: Array | None = None, damping: float = SINGULAR) -> Reduced:
        """Normal equations of products `grams` without initial values; with the prior at `values` (m,) where given.

        damping: of the step of the initial values, relative.
        """
        s, m = self.states, grams.shape[1] - self.states - 1
        block, cross, right_own = grams[:, :s, :s], grams[:, :s, s:-1], grams[:, :s, -1]
        # where a speed is 0 throughout, a combination of its initial values has no effect, and the block is singular
        sizes = np.diagonal(block, axis1=1, axis2=2)
        block = block + np.eye(s) * (damping * np.maximum(sizes, SINGULAR * sizes.max(axis=1, keepdims=True)))[:, None]
        held = np.linalg.solve(block, grams[:, :s, s:])
        schur = grams[:, s:-1, s:].sum(axis=0) - np.tensordot(cross, held, axes=((0, 1), (0, 1)))
        matrix, right = schur[:, :m], schur[:, m]
        if values is not None:
            matrix, right = matrix + np.diag(self.power), right - self.power * values
        return Reduced(matrix, right, block, cross, right_own, grams)


@dataclass(frozen=True)
class Reduced:
    """Normal equations without the initial values: matrix (m, m), right side (m,), and the blocks that restore those.

    own, cross (k, s, s), (k, s, m), right_own (k, s): blocks of every segment, from its products `grams`. A step of the
    initial values is solved for anew, since `own` may be nearly singular: a difference of solutions loses digits.
    """

    matrix: Array
    right: Array
    own: Array
    cross: Array
    right_own: Array
    grams: Array

    @cached_property
    def inverse(self) -> Array:
        """Pseudo-inverse (m, m) of the matrix, unknowns scaled alike."""
        return inverse_of_gram(self.matrix, 1e-13)

    def states(self, step: Array) -> Array:
        """Step of the initial values (k, s) that belongs to a step (m,) of the unknowns."""
        right = self.right_own - self.cross @ step
        return np.asarray(np.linalg.solve(self.own, right[..., None])[..., 0], np.float64)

    @property
    def gained(self) -> float:
        """Decrease of the sum of squares by a step of the initial values alone."""
        return float(np.sum(np.linalg.solve(self.own, self.right_own[..., None])[..., 0] * self.right_own))


@dataclass(frozen=True)
class Fit:
    """A point of the search, or its end: values (m,) of the unknowns, initial values (k, s), and the prediction there.

    residuals (r,) in standard deviations of the sensor, weights (r,) of the robust loss, cost the mean of the loss,
    infinite where the motion diverges. converged: whether the search ended since there was no more to gain.
    """

    shooting: Shooting
    values: Array
    states: Array
    prediction: Prediction
    residuals: Array
    weights: Array
    cost: float
    reduced: Reduced
    converged: bool = False

    @property
    def inverse(self) -> Array:
        """Pseudo-inverse (m, m) of the normal equations' matrix."""
        return self.reduced.inverse

    @cached_property
    def influence(self) -> Array:
        """K (m, r): of residuals in standard deviations of the sensor on the unknowns."""
        return self.influence_on(np.eye(len(self.values)))

    def influence_on(self, wanted: Array) -> Array:
        """Influence (q, r) of the residuals on combinations `wanted` (q, m) of the unknowns."""
        reduced, of_slopes = self.reduced, wanted @ self.inverse
        of_states = of_slopes @ np.linalg.solve(reduced.own, reduced.cross).transpose(0, 2, 1)
        result = np.empty((len(of_slopes), len(self.residuals)))
        for k, (first, last) in enumerate(pairwise(self.shooting.rows)):
            # less what the segment's initial values explain
            both = np.column_stack([-of_states[k], of_slopes])
            np.matmul(both, self.prediction.slopes[first:last].T, out=result[:, first:last])
        result *= self.weights / self.shooting.sigma
        return result

    @property
    def left(self) -> Array:
        """Gauss–Newton's step (m,) of the unknowns that is left here."""
        step: Array = self.inverse @ self.reduced.right
        return step

    @property
    def freedom(self) -> int:
        """Readings beyond all unknowns and initial values, at least 1."""
        return max(len(self.residuals) - len(self.values) - self.states.size, 1)

    def effect(self, changes: Array) -> Array:
        """Change (m,) of the unknowns when the readings change by `changes` (r,) in their unit, K ρ; or of (r, n)."""
        change: Array = (self.influence / self.shooting.sigma) @ changes
        return change

    def white(self, least: float = 0.0) -> Array:
        """Covariance (m, m) under independent errors of the variance of the residuals, in sensors' at least `least`."""
        variance = max(least, float(self.residuals @ self.residuals) / self.freedom)
        result: Array = self.influence @ self.influence.T * variance
        return result

    def scores(self, labels: Ints) -> Array:
        """Sums (m, groups) of what the residuals of each group of readings contribute; labels (r,): the groups."""
        return np.array([np.bincount(labels, row) for row in self.influence * self.residuals])

    def leaning(self, chosen: Bools, less: float) -> tuple[Fit, Fit]:
        """The same point with weight `less` on the readings that are not `chosen` (r,), and on those that are."""
        whole, shooting = self.reduced.grams, self.shooting
        part = shooting.grams(self.prediction.slopes, self.residuals, self.weights * chosen)
        pairs = ((chosen, part + less * (whole - part)), (~chosen, whole - part + less * part))
        first, second = (
            replace(
                self,
                weights=self.weights * np.where(mostly, 1.0, less),
                reduced=shooting.reduced(grams, self.values),
            )
            for mostly, grams in pairs
        )
        return first, second

    def moved(self, values: Array) -> Fit:
        """The fit at `values` (m,) so near that the change is linear, with the sensitivities and the cost before."""
        step = values - self.values
        states = self.reduced.states(step)
        both = np.column_stack([states, np.broadcast_to(step, (len(states), len(step)))])
        change, grams = np.empty(len(self.residuals)), self.reduced.grams.copy()
        for steps, products, (first, last) in zip(both, grams, pairwise(self.shooting.rows), strict=True):
            np.matmul(self.prediction.slopes[first:last], steps, out=change[first:last])
            products[:-1, -1] -= products[:-1, :-1] @ steps
            products[-1] = products[:, -1]
        return replace(
            self,
            values=values,
            states=self.states + states,
            prediction=replace(self.prediction, outputs=self.prediction.outputs + change),
            residuals=self.residuals - change / self.shooting.sigma,
            reduced=self.shooting.reduced(grams, values),
        )


def widened(white: Array, robust: Array) -> tuple[Array, Array]:
    """A covariance (m, m) where no variance is below that of `robust` (m, m), and its ratios (m,) to `white`'s roots.

    The correlations are those of `white`: the scatter of a few groups does not determine them.
    """
    stretch = np.sqrt(np.maximum(np.diag(robust) / np.maximum(np.diag(white), 1e-300), 1.0))
    return white * np.outer(stretch, stretch), stretch


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
