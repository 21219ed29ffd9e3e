"""Least squares over the rows of all swings, once over everything or swing by swing in constant memory; the estimates.

Both give the same values. The recursion stores sums only: the information matrix X'X, X'y, and the second moments of
the swings' own sums, from which the scatter of the swings follows for any values. y is relative to a first solution, so
that no large numbers cancel in those sums.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from swingid.balance.fits import Effect
from swingid.balance.perturbations import RowError
from swingid.balance.rows import Windows
from swingid.format import number
from swingid.model.equation import Equation
from swingid.model.terms import units_on
from swingid.numerics.arrays import Array, Bools
from swingid.numerics.regression import fit_linear
from swingid.numerics.test_functions import curvature_overlap
from swingid.preparation.noise import Noise
from swingid.recursive.blocks import Block
from swingid.uncertainty.budget import BudgetEntry, Parameter, Scatter, evaluate
from swingid.uncertainty.freedom import bartlett, effective_freedom, lag_weights_power
from swingid.uncertainty.significance import DETECTED

MEMORY = "memory"
"""The unknown that is estimated only where it is significant: an impulse of friction at each reversal."""

SPARE = 3
"""Swings beyond the number of unknowns from which their scatter gives an uncertainty."""


SCATTER = "scatter of the swings and sensor noise"

PLAIN = ("gravity_torque", "coulomb", "viscous", "quadratic")
"""Unknowns that are reported beside the inertia; what depends on the direction is fitted too, and not reported."""


@dataclass(frozen=True)
class Solution:
    """Values of the unknowns (p,), type A covariance (None: too few swings), effects of what is declared.

    freedom: degrees of freedom of the covariance.
    """

    values: Array
    covariance: Array | None
    effects: tuple[Effect, ...]
    freedom: float


def first_solution(blocks: list[Block]) -> Array:
    """Values from the first swings, from which the recursion starts; without an impulse at reversals."""
    columns, target = _stacked(blocks)
    return fit_linear(columns * _plain(blocks[0].unknowns), target).values


def solve_all(blocks: list[Block], origin: Array, equation: Equation, noise: Noise) -> Solution:
    """The solution over all swings at once, by orthogonal decomposition of all their rows.

    origin: of `first_solution`; declared imperfections and the sensors' noise are evaluated at these values.
    """
    return _chosen(lambda sought: _solve_stacked(blocks, sought, origin, equation, noise), blocks[0].unknowns)


def _solve_stacked(blocks: list[Block], sought: Bools, origin: Array, equation: Equation, noise: Noise) -> Solution:
    """The solution for the unknowns `sought`, the others 0."""
    columns, target = _stacked(blocks)
    fit = fit_linear(columns * sought, target)
    ends = np.cumsum([len(block.target) for block in blocks])[:-1]
    pairs = zip(np.split(columns, ends), np.split(fit.residuals, ends), strict=True)
    scores = np.array([part.T @ left for part, left in pairs])
    cross = scores[1:].T @ scores[:-1]
    sensor = np.zeros((len(origin), len(origin)))
    for k, block in enumerate(blocks):
        sensor += _sensor(block, blocks[k - 1] if k else None, origin, equation, noise)
    declared = [block.declared(origin) for block in blocks]
    effects = tuple(
        Effect(one, fit.influence @ np.concatenate([items[k].rows for items in declared]) * one.std)
        for k, one in enumerate(declared[0])
    )
    scatter = scores.T @ scores + (cross + cross.T) / 2
    covariance, freedom = _covariance(fit.influence @ fit.influence.T, scatter, sensor, len(blocks), int(sought.sum()))
    return Solution(fit.values, covariance, effects, freedom)


def _plain(unknowns: tuple[str, ...]) -> Bools:
    """Which unknowns are estimated in any case."""
    return np.array([name != MEMORY for name in unknowns])


def _chosen(solve: Callable[[Bools], Solution], unknowns: tuple[str, ...]) -> Solution:
    """The solution with an impulse at reversals where it is significant, as in `momentum`; else the one without."""
    plain = solve(_plain(unknowns))
    if MEMORY not in unknowns:
        return plain
    full, k = solve(np.ones(len(unknowns), bool)), unknowns.index(MEMORY)
    if full.covariance is None:
        return plain
    variance = float(full.covariance[k, k])
    # of rounding errors alone, as with exact data, the variance may be below 0
    return full if variance > 0 and abs(full.values[k]) > DETECTED * np.sqrt(variance) else plain


def _stacked(blocks: list[Block]) -> tuple[Array, Array]:
    return np.vstack([block.columns for block in blocks]), np.concatenate([block.target for block in blocks])


def _sensor(block: Block, before: Block | None, origin: Array, equation: Equation, noise: Noise) -> Array:
    """X' Ω X of a block and with the one before, Ω the covariance of the rows by white noise of both angles."""
    if block.windows is None:
        return np.zeros((len(origin), len(origin)))
    power = ((origin[0] * noise.angle) ** 2 + (equation.value("wheel") * noise.wheel) ** 2) * noise.step
    own = block.columns.T @ _overlap(block.windows, block.windows) @ block.columns
    if before is not None and before.windows is not None:
        shared = before.columns.T @ _overlap(before.windows, block.windows) @ block.columns
        own = own + shared + shared.T
    result: Array = own * power
    return result


def _overlap(first: Windows, second: Windows) -> Array:
    """Covariance of ∫φ'' n of windows for noise n of unit power density."""
    half = (first.half[:, None] + second.half) / 2
    return np.asarray(curvature_overlap((first.centres[:, None] - second.centres) / half) / half**3)


def _covariance(inverse: Array, scores: Array, sensor: Array, swings: int, unknowns: int) -> tuple[Array | None, float]:
    """Covariance from the scatter of swings (neighbours may be correlated), or from sensor noise if that is larger.

    Also its degrees of freedom: those of the scatter's part beyond the noise, which is computed.
    """
    if swings < unknowns + SPARE:
        return None, math.inf
    seen = inverse @ scores @ inverse * (swings / (swings - unknowns))
    expected = inverse @ sensor @ inverse
    if seen[0, 0] <= expected[0, 0]:
        return (expected if seen[0, 0] <= 0 else seen * (expected[0, 0] / seen[0, 0])), math.inf
    noise = math.sqrt(max(float(expected[0, 0]), 0.0))
    beyond = math.sqrt(float(seen[0, 0]) - noise**2)
    of_scatter = max((swings - unknowns) / lag_weights_power(bartlett(1)), 1.0)
    return seen, effective_freedom(((noise, math.inf), (beyond, of_scatter)))


@dataclass
class Recursion:
    """The same solution, swing by swing: sums of fixed size only.

    origin (p,): values of the `unknowns` relative to which y is taken. moments: of the swings' sums [X'y, X'X] with
    themselves; crossed: with those of the swing before.
    """

    unknowns: tuple[str, ...]
    origin: Array
    equation: Equation
    noise: Noise
    swings: int = 0
    _gram: Array = field(init=False)
    _right: Array = field(init=False)
    _moments: Array = field(init=False)
    _crossed: Array = field(init=False)
    _sensor: Array = field(init=False)
    _before: Block | None = None
    _sums: Array | None = None
    _declared: dict[str, tuple[RowError, Array]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        p = len(self.origin)
        self._gram, self._sensor, self._right = np.zeros((p, p)), np.zeros((p, p)), np.zeros(p)
        self._moments, self._crossed = np.zeros((p + p * p, p + p * p)), np.zeros((p + p * p, p + p * p))

    def add(self, block: Block) -> None:
        """Take the rows of one more swing."""
        gram = block.columns.T @ block.columns
        right = block.columns.T @ (block.target - block.columns @ self.origin)
        self._gram += gram
        self._right += right
        sums = np.concatenate([right, gram.ravel()])
        self._moments += np.outer(sums, sums)
        if self._sums is not None:
            self._crossed += np.outer(sums, self._sums)
        self._sensor += _sensor(block, self._before, self.origin, self.equation, self.noise)
        for item in block.declared(self.origin):
            _, total = self._declared.get(item.source, (item, np.zeros(len(right))))
            self._declared[item.source] = item, total + block.columns.T @ item.rows
        self._before, self._sums = block, sums
        self.swings += 1

    def solution(self) -> Solution:
        """The solution over all swings taken so far."""
        return _chosen(self._solve, self.unknowns)

    def _solve(self, sought: Bools) -> Solution:
        """The solution for the unknowns `sought`, the others 0."""
        size = np.sqrt(np.diag(self._gram))
        size[size == 0] = 1.0
        sizes, both = np.outer(size, size), np.outer(sought, sought)
        inverse = np.linalg.pinv(self._gram / sizes * both, rcond=1e-15, hermitian=True) / sizes
        step = inverse @ self._right
        # one step of iterative refinement for the error of the inverse
        step = step + inverse @ (self._right - self._gram @ step)
        p = len(step)
        # the score of a swing is X'y − X'X step: linear in its sums
        to_score = np.hstack([np.eye(p), -np.kron(np.eye(p), step)])
        cross = to_score @ self._crossed @ to_score.T
        scores = to_score @ self._moments @ to_score.T + (cross + cross.T) / 2
        effects = tuple(Effect(item, inverse @ total * item.std) for item, total in self._declared.values())
        covariance, freedom = _covariance(inverse, scores, self._sensor, self.swings, int(sought.sum()))
        return Solution(self.origin + step, covariance, effects, freedom)


@dataclass(frozen=True)
class SwingEstimate:
    """The estimate after swing number `swing` (from 1), whose turning point was at `time` (s).

    side: +1 upper, −1 lower. swing_inertia: of this swing alone, less the friction estimated so far. parameters: of all
    swings so far: inertia, gravity_torque where it is unknown, coulomb, viscous, quadratic; the standard uncertainty is
    None (unknown) for the first swings. budget: its entries. rows_skipped: rows excluded so far; swings_lost: turning
    points without an estimate, for gaps, rests or a hand on the body.
    """

    swing: int
    time: float
    side: float
    swing_inertia: Parameter
    parameters: dict[str, Parameter]
    budget: tuple[BudgetEntry, ...]
    rows_skipped: int
    swings_lost: int

    @property
    def inertia(self) -> Parameter:
        """The inertia of all swings so far."""
        return self.parameters["inertia"]

    def __str__(self) -> str:
        spread = self.inertia.standard_uncertainty
        known = "" if spread is None else f" ± {number(spread, '', 2)}"
        return (
            f"swing {self.swing} at {self.time:.2f} s: {self.swing_inertia.value:.6g}, "
            f"so far {self.inertia.value:.6g}{known} {self.inertia.unit}"
        )


@dataclass
class Reporter:
    """From solutions to estimates, with the scatter of single swings; relative: as in `evaluate`."""

    equation: Equation
    relative: float
    swings: int = 0
    _squares: float = field(default=0.0)

    def estimate(self, block: Block, solution: Solution, skipped: int, lost: int) -> SwingEstimate:
        """The estimate after `block`."""
        units = units_on(linear=self.equation.linear)
        sought = dict.fromkeys(("inertia", *PLAIN, *self.equation.sought))
        names = [name for name in sought if name in block.unknowns]
        at = [block.unknowns.index(name) for name in names]
        values = {name: (float(solution.values[k]), units[name]) for name, k in zip(names, at, strict=True)}
        values["inertia"] = values["inertia"][0] - self.equation.carried, units["inertia"]
        declared = [effect.item.on(effect.shifts[at] / effect.item.std) for effect in solution.effects]
        known, scattered = solution.covariance is not None, None
        if solution.covariance is not None:
            freedom = np.full(len(at), solution.freedom)
            scattered = Scatter(SCATTER, solution.covariance[np.ix_(at, at)], freedom)
        found = evaluate(values, scattered, (), declared, () if known else values, self.relative)
        self.swings += 1
        alone = self._alone(block, solution)
        self._squares += (alone - values["inertia"][0]) ** 2
        spread = float(np.sqrt(self._squares / (self.swings - 1))) if known else None
        return SwingEstimate(
            swing=self.swings,
            time=block.time,
            side=block.side,
            swing_inertia=Parameter.of(alone, spread, self.equation.unit),
            parameters=found.parameters,
            budget=tuple(found.budget),
            rows_skipped=skipped,
            swings_lost=lost,
        )

    def skip(self) -> None:
        """Count a swing that has no estimate of its own."""
        self.swings += 1

    def _alone(self, block: Block, solution: Solution) -> float:
        """The inertia of one swing, less the friction of all swings."""
        own = block.columns[:, 0]
        left = block.target - block.columns[:, 1:] @ solution.values[1:]
        return float(own @ left / (own @ own)) - self.equation.carried
