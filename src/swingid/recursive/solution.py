"""Least squares over the rows of all swings, swing by swing in constant memory, and the estimates that it gives.

The recursion stores sums only: the information matrix X'X, X'y, and the second moments of the swings' own sums, from
which the scatter of the swings follows for any values. y is relative to a first solution, so that no large numbers
cancel in those sums.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from swingid.balance.delays import dry_levels, late_reversals
from swingid.balance.fits import BASIS
from swingid.balance.friction_laws import Law
from swingid.balance.perturbations import RowError, propagated
from swingid.balance.reversals import TIMING, Impulse, impulse_found, impulses_expected
from swingid.balance.rows import Signals, Windows
from swingid.format import number
from swingid.model.equation import Equation
from swingid.model.terms import units_on
from swingid.numerics.arrays import Array, Bools
from swingid.numerics.regression import fit_linear, inverse_of_gram
from swingid.numerics.test_functions import curvature_overlap
from swingid.preparation.noise import Noise
from swingid.recursive.blocks import Block
from swingid.uncertainty.budget import BudgetEntry, Parameter, Scatter, evaluate, systematic
from swingid.uncertainty.freedom import bartlett, effective_freedom, lag_weights_power

MEMORY = "memory"
"""The unknown that is estimated only where `impulse_found` says so: an impulse of friction at each reversal."""

SPARE = 3
"""Swings beyond the number of unknowns from which their scatter gives an uncertainty."""

SCATTER = "scatter of the swings and sensor noise"

PLAIN = ("gravity_torque", "coulomb", "viscous", "quadratic")
"""Unknowns that are reported beside the inertia; what depends on the direction is fitted too, and not reported."""


@dataclass(frozen=True)
class Solution:
    """Values of the unknowns (p,), inverse (p, p) of X'X, type A covariance (None: too few swings) and its freedom.

    timing (p,): standard uncertainty of each by an impulse at reversals that is left out.
    """

    values: Array
    inverse: Array
    covariance: Array | None
    freedom: float
    timing: Array | None = None


@dataclass
class Recursion:
    """The least-squares solution over the rows of all swings so far, by sums of fixed size.

    origin (p,): values of the `unknowns` relative to which y is taken, and at which the noise of the sensors and what
    rig.toml declares are evaluated. errors: the declared perturbations, by source, with X'ρ in the place of their rows.
    moments: of the swings' sums [X'y, X'X] with themselves; crossed: with those of the swing before.
    """

    unknowns: tuple[str, ...]
    origin: Array
    equation: Equation
    noise: Noise
    swings: int = 0
    errors: dict[str, RowError] = field(default_factory=dict)
    _gram: Array = field(init=False)
    _right: Array = field(init=False)
    _moments: Array = field(init=False)
    _crossed: Array = field(init=False)
    _sensor: Array = field(init=False)
    _squares: float = 0.0
    _before: Block | None = None
    _sums: Array | None = None

    @classmethod
    def of(cls, blocks: list[Block], equation: Equation, noise: Noise) -> Recursion:
        """Begun with the solution of the first swings, without an impulse at reversals; it contains none of them."""
        unknowns = blocks[0].unknowns
        columns = np.vstack([block.columns for block in blocks]) * _plain(unknowns)
        first = fit_linear(columns, np.concatenate([block.target for block in blocks]))
        return cls(unknowns, first.values, equation, noise)

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
        self._sensor += self._noise_of(block)
        for error in block.declared(self.origin):
            before = self.errors[error.source].rows if error.source in self.errors else 0.0
            self.errors[error.source] = replace(error, rows=before + block.columns.T @ error.rows)
        self._before, self._sums = block, sums
        self.swings += 1

    def solution(self) -> Solution:
        """The solution with an impulse at reversals by the rule of `impulse_found`, as in `momentum`."""
        plain, block = self._solve(_plain(self.unknowns)), self._before
        if block is None or block.signals is None or plain.covariance is None:
            return plain
        full, k = self._solve(np.ones(len(self.unknowns), bool)), self.unknowns.index(MEMORY)
        # of rounding errors alone, as with exact data, the variance may be below 0
        spread = 0.0 if full.covariance is None else math.sqrt(max(float(full.covariance[k, k]), 0.0))
        if spread == 0.0:
            return plain
        impulse = self._impulse(block.signals, plain.values, (float(full.values[k]), spread))
        if impulse.terms:
            return full
        return replace(plain, timing=np.abs(plain.inverse @ self._gram[:, k]) * impulse.left)

    def estimate(self, block: Block, relative: float, skipped: int, lost: int) -> SwingEstimate:
        """The estimate after `block`, the last one taken, with the scatter of single swings; relative: see `evaluate`.

        skipped, lost: rows and swings without an estimate so far.
        """
        solution, equation = self.solution(), self.equation
        units = units_on(linear=equation.linear)
        names = [name for name in dict.fromkeys(("inertia", *PLAIN, *equation.sought)) if name in block.unknowns]
        at = [block.unknowns.index(name) for name in names]
        values = {name: (float(solution.values[k]), units[name]) for name, k in zip(names, at, strict=True)}
        values["inertia"] = values["inertia"][0] - equation.carried, units["inertia"]
        known, scattered = solution.covariance is not None, None
        if solution.covariance is not None:
            freedom = np.full(len(at), solution.freedom)
            scattered = Scatter(SCATTER, solution.covariance[np.ix_(at, at)], freedom)
        declared = propagated(self.errors.values(), solution.inverse[at])
        timing = np.zeros(len(at)) if solution.timing is None else solution.timing[at]
        common = [(systematic(TIMING), name, float(u)) for name, u in zip(names, timing, strict=True)]
        evaluated = evaluate(values, scattered, common, declared, () if known else values, relative)
        # the inertia of one swing, less the friction of all swings
        regressor, residuals = block.columns[:, 0], block.target - block.columns @ solution.values
        alone = values["inertia"][0] + float(regressor @ residuals / (regressor @ regressor))
        self._squares += (alone - values["inertia"][0]) ** 2
        spread = float(np.sqrt(self._squares / (self.swings - 1))) if known else None
        return SwingEstimate(
            swing=self.swings,
            time=block.time,
            side=block.side,
            swing_inertia=Parameter.of(alone, spread, equation.unit),
            parameters=evaluated.parameters,
            budget=tuple(evaluated.budget),
            rows_skipped=skipped,
            swings_lost=lost,
        )

    def _impulse(self, signals: Signals, values: Array, fitted: tuple[float, float]) -> Impulse:
        """Return whether the impulse `fitted` (value, standard uncertainty) is an unknown; values: of the plain
        solution.
        """
        known = dict(zip(self.unknowns, values.tolist(), strict=True))
        torque = Law("", BASIS, np.array([known[name] for name in BASIS]), np.nan).torque
        levels = dry_levels(signals, lambda name: known.get(name, 0.0))
        late = late_reversals(signals, torque, abs(known["inertia"]), self.noise, levels)
        expected = impulses_expected(signals.motion, late, torque, levels)
        return impulse_found(self.equation, signals.motion, fitted, expected, known["coulomb"])

    def _solve(self, sought: Bools) -> Solution:
        """The solution for the unknowns `sought`, the others 0."""
        both = np.outer(sought, sought)
        inverse = inverse_of_gram(self._gram * both, 1e-15) * both
        step = inverse @ self._right
        # one step of iterative refinement for the error of the inverse
        step = step + inverse @ (self._right - self._gram @ step)
        p = len(step)
        # the score of a swing is X'y − X'X step: linear in its sums
        to_score = np.hstack([np.eye(p), -np.kron(np.eye(p), step)])
        cross = to_score @ self._crossed @ to_score.T
        scores = to_score @ self._moments @ to_score.T + (cross + cross.T) / 2
        covariance, freedom = self._covariance(inverse, scores, int(sought.sum()))
        return Solution(self.origin + step, inverse, covariance, freedom)

    def _covariance(self, inverse: Array, scores: Array, unknowns: int) -> tuple[Array | None, float]:
        """Covariance from the scatter of swings (neighbours may be correlated), or from sensor noise if that is larger.

        Also its degrees of freedom: those of the scatter's part beyond the noise, which is computed.
        """
        swings = self.swings
        if swings < unknowns + SPARE:
            return None, math.inf
        seen = inverse @ scores @ inverse * (swings / (swings - unknowns))
        expected = inverse @ self._sensor @ inverse
        if seen[0, 0] <= expected[0, 0]:
            return (expected if seen[0, 0] <= 0 else seen * (expected[0, 0] / seen[0, 0])), math.inf
        noise = math.sqrt(max(float(expected[0, 0]), 0.0))
        beyond = math.sqrt(float(seen[0, 0]) - noise**2)
        of_scatter = max((swings - unknowns) / lag_weights_power(bartlett(1)), 1.0)
        return seen, effective_freedom(((noise, math.inf), (beyond, of_scatter)))

    def _noise_of(self, block: Block) -> Array | float:
        """X' Ω X of a block and with the one before, Ω the covariance of the rows by white noise of both angles."""
        if block.windows is None:
            return 0.0
        noise, before = self.noise, self._before
        power = ((self.origin[0] * noise.angle) ** 2 + (self.equation.value("wheel") * noise.wheel) ** 2) * noise.step
        products = block.columns.T @ _overlap(block.windows, block.windows) @ block.columns
        if before is not None and before.windows is not None:
            shared = before.columns.T @ _overlap(before.windows, block.windows) @ block.columns
            products = products + shared + shared.T
        result: Array = products * power
        return result


def _plain(unknowns: tuple[str, ...]) -> Bools:
    """Which unknowns are estimated in any case."""
    return np.array([name != MEMORY for name in unknowns])


def _overlap(first: Windows, second: Windows) -> Array:
    """Covariance of ∫φ'' n of windows for noise n of unit power density."""
    half = (first.half[:, None] + second.half) / 2
    return np.asarray(curvature_overlap((first.centres[:, None] - second.centres) / half) / half**3)


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
