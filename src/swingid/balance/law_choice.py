"""The choice of a friction law by the Bayesian information criterion, all laws on one Gram matrix."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np

from swingid.balance.fits import LAG
from swingid.balance.friction_laws import (
    DIRECTIONS,
    EXACT,
    LAWS,
    STRIBECK_SHARES,
    FrictionRows,
    law_terms,
    law_weights,
    places_of,
    slope_weights,
)
from swingid.numerics.arrays import Array, Ints, median
from swingid.numerics.compiled import njit
from swingid.numerics.regression import gram, symmetric_inverse
from swingid.preparation.motion import Motion

ROUNDING = 1e-10
"""Share of the power of the known side below which a residual is that of the arithmetic, not of a law."""


@dataclass(frozen=True)
class Trial:
    """A law tried: its terms, Stribeck speed (nan without), coefficients, and criterion (lower is better)."""

    terms: tuple[str, ...]
    stribeck_speed: float
    values: Array
    score: float


class LawChoice:
    """All laws on the Gram matrix of [body | friction columns | known side]; `trials` by name.

    slowest: Stribeck speed below which a peak is not identifiable; by default no law with a peak is tried. odd_only:
    only the odd part is used, so every law has all terms of the direction.
    The dependence on the direction is chosen among the laws without Stribeck's peak, which does not affect it.
    """

    def __init__(
        self, friction: FrictionRows, body: Array, target: Array, slowest: float = np.inf, *, odd_only: bool = False
    ) -> None:
        self.friction, self.body = friction, body.shape[1]
        self.gram = gram(np.ascontiguousarray(np.column_stack([body, friction.columns, target]).T))
        self.independent = len(target) / (LAG / 2)
        self.trials: dict[str, Trial] = {}
        self.stribeck_speeds = np.empty(0)
        peaks = [odd for odd, terms in LAWS.items() if "stribeck" in terms]
        for odd in (odd for odd in LAWS if odd not in peaks):
            for direction in list(DIRECTIONS)[-1:] if odd_only else DIRECTIONS:
                self._attempt(odd + direction)
        if slowest < STRIBECK_SHARES[-1] * friction.fastest:
            least = max(STRIBECK_SHARES[0], slowest / friction.fastest)
            self.stribeck_speeds = friction.fastest * np.geomspace(least, STRIBECK_SHARES[-1], len(STRIBECK_SHARES))
            direction = "".join(self.best.partition(",")[1:])
            for odd in peaks:
                self._attempt(odd + direction)

    @property
    def best(self) -> str:
        """Name of the law of the least criterion."""
        return min(self.trials, key=lambda name: self.trials[name].score)

    @property
    def scores(self) -> dict[str, float]:
        """Criterion of every law above the best."""
        least = self.trials[self.best].score
        # of exact fits the least is minus infinity
        return {name: trial.score - least if trial.score > least else 0.0 for name, trial in self.trials.items()}

    @property
    def weights(self) -> dict[str, float]:
        """Posterior probability of each law by its criterion; they sum to 1."""
        likely = {name: float(np.exp(-score / 2)) for name, score in self.scores.items()}
        total = sum(likely.values())
        return {name: value / total for name, value in likely.items()}

    def beside(self, weights: Array, more: Array) -> tuple[float, Array, Array]:
        """Residuals of a law with these weights on the friction columns, and their products with further columns.

        more: weights of the further columns. Returns the sum of squared residuals, and the products of the further
        columns, with law and body projected out, with each other and with the residuals.
        """
        body = np.eye(self.body, self.body + len(weights))
        law = np.vstack([np.hstack([np.zeros((weights.shape[1], self.body)), weights.T]), body])
        others = np.hstack([np.zeros((more.shape[1], self.body)), more.T])
        inner, right, power = self.gram[:-1, :-1], self.gram[:-1, -1], float(self.gram[-1, -1])
        fitted = law @ inner
        scale = 1.0 / np.sqrt(np.maximum(np.diag(fitted @ law.T), 1e-300))
        scaled = (fitted @ law.T) * np.outer(scale, scale) + 1e-13 * np.eye(len(scale))
        mixed = fitted @ others.T
        taken = np.linalg.solve(scaled, scale[:, None] * np.column_stack([mixed, law @ right])) * scale[:, None]
        left = max(power - float(taken[:, -1] @ (law @ right)), 1e-15 * power, 1e-300)
        shared: Array = others @ right - mixed.T @ taken[:, -1]
        return left, others @ inner @ others.T - mixed.T @ taken[:, :-1], shared

    def _attempt(self, name: str) -> None:
        terms, starts = law_terms(name), np.empty(0)
        if "stribeck" in terms:
            # another law with a peak has found about the same speed
            found = [trial.stribeck_speed for trial in self.trials.values() if "stribeck" in trial.terms]
            starts = np.array(found) if found else self.stribeck_speeds
        speed, lost, values, sound = _tried(
            self.gram,
            self.body,
            places_of(terms),
            self.friction.knots,
            starts,
            self.stribeck_speeds,
            _sides(terms),
            self.independent,
        )
        if not self.trials or sound:
            count = len(terms) + ("stribeck" in terms)
            score = self.independent * math.log(lost) + count * math.log(self.independent)
            self.trials[name] = Trial(terms, speed, values, score)


def slowest_peak(motion: Motion, noise: float) -> float:
    """Stribeck speed below which a peak is not identifiable; noise: standard deviation of one sample of the angle.

    A peak that passes while the angle moves less than its noise is not distinguishable from an error of the angle.
    """
    acceleration = median(np.abs(motion.speed.acceleration(motion.turning_times)))
    return float(np.sqrt(acceleration * noise))


@njit
def _tried(
    gram: Array,
    body: int,
    places: Ints,
    knots: Array,
    starts: Array,
    speeds: Array,
    sides: Array,
    independent: float,
) -> tuple[float, float, Array, bool]:
    """Stribeck speed of a law (nan without starts), its squared residuals, its coefficients, and whether it dissipates.

    It does where no coefficient, in either direction, is negative beyond its standard uncertainty.
    """
    speed = np.nan if len(starts) == 0 else _likeliest_speed(gram, body, places, knots, starts, speeds)
    lost, values, inverse = _lost(gram, body, law_weights(places, knots, speed))
    lost = max(lost, ROUNDING * gram[-1, -1])
    return speed, lost, values[: len(places)], _none_below(sides, values, inverse, lost / independent)


@njit
def _likeliest_speed(gram: Array, body: int, places: Ints, knots: Array, starts: Array, speeds: Array) -> float:
    """The likeliest Stribeck speed: the best of `starts`, then Gauss–Newton while it gets better within `speeds`."""
    count, terms = len(EXACT) + len(knots), len(places)
    speed, least, values, peak, widened = starts[0], np.inf, np.empty(0), 0, np.empty((count, terms + 1))
    for start in starts:
        lost, found, _ = _lost(gram, body, law_weights(places, knots, start))
        if lost < least:
            speed, least, values = start, lost, found
    while places[peak] >= 0:
        peak += 1
    for _ in range(5):
        weights, slope = law_weights(places, knots, speed), slope_weights(knots, speed)
        for k in range(count):
            for j in range(terms):
                widened[k, j] = weights[k, j]
            widened[k, terms] = slope[k] * values[peak]
        step = min(max(_lost(gram, body, widened)[1][terms], -0.4 * speed), 0.6 * speed)
        lost, found, _ = _lost(gram, body, law_weights(places, knots, speed + step))
        if lost >= least or not speeds[0] <= speed + step <= speeds[-1]:
            break
        settled = abs(step) < 1e-3 * speed
        speed, least, values = speed + step, lost, found
        if settled:
            break
    return float(speed)


@njit
def _lost(gram: Array, body: int, weights: Array) -> tuple[float, Array, Array]:
    """Sum of squared residuals of a law, its coefficients, and what scales their covariance (of the inverse).

    weights: of the law's terms on the friction columns.
    """
    values, inverse, explained = _solved(gram, body, weights)
    power = gram[-1, -1]
    # less than the rounding of the power is not resolved
    return max(power - explained, 1e-15 * power, 1e-300), values, inverse


@njit
def _solved(gram: Array, body: int, weights: Array) -> tuple[Array, Array, float]:
    """Least squares for the columns [friction · weights | body] of a Gram matrix of [body | friction | known side].

    Returns the values of the first ones, their part of the inverse, and the sum of squares explained.
    """
    count, terms = weights.shape
    size = terms + body
    blended = np.zeros((size, len(gram)))  # the blend of columns times the Gram matrix
    for k in range(body):
        for i in range(len(gram)):
            blended[terms + k, i] = gram[k, i]
    for k in range(terms):
        for j in range(count):
            if weights[j, k] != 0.0:
                for i in range(len(gram)):
                    blended[k, i] += weights[j, k] * gram[body + j, i]
    inner = np.zeros((size, size))
    right = np.empty(size)
    for k in range(size):
        right[k] = blended[k, len(gram) - 1]
        for i in range(body):
            inner[k, terms + i] = blended[k, i]
        for j in range(count):
            for i in range(terms):
                inner[k, i] += weights[j, i] * blended[k, body + j]
    scale = np.empty(size)
    for k in range(size):
        scale[k] = 1.0 / np.sqrt(max(inner[k, k], 1e-300))
    for k in range(size):
        for i in range(size):
            inner[k, i] *= scale[k] * scale[i]
        inner[k, k] += 1e-13
    inverse, values, explained = symmetric_inverse(inner), np.zeros(size), 0.0
    for k in range(size):
        for i in range(size):
            inverse[k, i] *= scale[k] * scale[i]
            values[k] += inverse[k, i] * right[i]
        explained += values[k] * right[k]
    return values, inverse, explained


@njit
def _none_below(rows: Array, values: Array, inverse: Array, variance: float) -> bool:
    """Whether no row of `rows` @ values lies below minus its standard uncertainty, of covariance inverse · variance."""
    for i in range(len(rows)):
        value = power = 0.0
        for k in range(rows.shape[1]):
            value += rows[i, k] * values[k]
            for j in range(rows.shape[1]):
                power += rows[i, k] * inverse[k, j] * rows[i, j]
        if value <= -np.sqrt(max(power * variance, 0.0)):
            return False
    return True


@cache
def _sides(terms: tuple[str, ...]) -> Array:
    """Weights of the coefficients of a law in either direction."""
    unit = {term: np.eye(len(terms))[k] for k, term in enumerate(terms)}
    sides = [unit[term] for term in terms if term not in ("offset", "viscous_even")]
    if "viscous_even" in unit:
        viscous, even = unit.get("viscous", np.zeros(len(terms))), unit["viscous_even"]
        sides += [viscous + even, viscous - even]
    if "offset" in unit and "coulomb" in unit:
        sides += [unit["coulomb"] + unit["offset"], unit["coulomb"] - unit["offset"]]
    return np.array(sides)
