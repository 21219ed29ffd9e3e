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
    peak_weights,
    places_of,
    slope_weights,
)
from swingid.numerics.arrays import Array, Bools, median
from swingid.numerics.regression import gram
from swingid.preparation.motion import Motion

ROUNDING = 1e-10
"""Share of the power of the known side below which a residual is that of the arithmetic, not of a law."""


MOST_SIDES = 8
"""Torques of a law that must not be negative, at most, see `_sides`."""


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
        directions = list(DIRECTIONS)[-1:] if odd_only else list(DIRECTIONS)
        self._attempt_exact([odd + direction for odd in LAWS if odd not in peaks for direction in directions])
        if slowest < STRIBECK_SHARES[-1] * friction.fastest:
            least = max(STRIBECK_SHARES[0], slowest / friction.fastest)
            self.stribeck_speeds = friction.fastest * np.geomspace(least, STRIBECK_SHARES[-1], len(STRIBECK_SHARES))
            direction = "".join(self.best.partition(",")[1:])
            for odd in peaks:
                self._attempt_peak(odd + direction)

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

    def _attempt_exact(self, names: list[str]) -> None:
        """Try the laws without Stribeck's peak, whose terms have columns of their own, all at once."""
        laws, size = tuple(law_terms(name) for name in names), self.body + len(EXACT)
        at = [*range(size), len(self.gram) - 1]
        used, sides = np.ones((len(laws), size), dtype=bool), np.zeros((len(laws), MOST_SIDES, size))
        used[:, self.body :], sides[:, :, self.body :] = _in_exact(laws)
        matrix = self.gram[at][:, at]
        lost, values, inverse = _solved(np.broadcast_to(matrix, (len(laws), *matrix.shape)), used)
        lost = np.maximum(lost, ROUNDING * float(self.gram[-1, -1]))
        kept = _none_below(sides, values, inverse, lost / self.independent)
        for k, (name, terms) in enumerate(zip(names, laws, strict=True)):
            if kept[k] or not self.trials:
                self._keep(name, np.nan, float(lost[k]), values[k, self.body + places_of(terms)])

    def _attempt_peak(self, name: str) -> None:
        """Try a law with Stribeck's peak at its likeliest speed."""
        terms = law_terms(name)
        # another law with a peak has found about the same speed
        found = [trial.stribeck_speed for trial in self.trials.values() if "stribeck" in trial.terms]
        law = _PeakLaw(self.gram, self.body, terms, self.friction.knots)
        starts = np.array(found) if found else self.stribeck_speeds
        speed, lost, values, inverse = law.likeliest(starts, self.stribeck_speeds)
        lost, own = max(lost, ROUNDING * float(self.gram[-1, -1])), law.order
        sides = np.zeros((1, MOST_SIDES, len(values)))
        sides[0, : len(_sides(terms)), own] = _sides(terms).T
        if not self.trials or _none_below(sides, values[None], inverse[None], np.array([lost / self.independent]))[0]:
            self._keep(name, speed, lost, values[own])

    def _keep(self, name: str, speed: float, lost: float, values: Array) -> None:
        """Keep a law with its criterion."""
        terms = law_terms(name)
        count = len(terms) + ("stribeck" in terms)
        score = self.independent * math.log(lost) + count * math.log(self.independent)
        self.trials[name] = Trial(terms, speed, values, score)


def slowest_peak(motion: Motion, noise: float) -> float:
    """Stribeck speed below which a peak is not identifiable; noise: standard deviation of one sample of the angle.

    A peak that passes while the angle moves less than its noise is not distinguishable from an error of the angle.
    """
    acceleration = median(np.abs(motion.speed.acceleration(motion.turning_times)))
    return float(np.sqrt(acceleration * noise))


class _PeakLaw:
    """A law with Stribeck's peak on the Gram matrix: [peak | other terms | body | known side] of its columns.

    order: places of the terms, in their order, among these.
    """

    def __init__(self, matrix: Array, body: int, terms: tuple[str, ...], knots: Array) -> None:
        others = [body + place for place in places_of(terms) if place >= 0]
        self.at = [*others, *range(body), len(matrix) - 1]
        self.friction = slice(body, len(matrix) - 1)
        self.matrix, self.knots = matrix, knots
        self.shared = matrix[self.at][:, self.at]
        following = iter(range(1, len(terms)))
        self.order = [0 if term == "stribeck" else next(following) for term in terms]

    def peaks(self, speeds: Array) -> Array:
        """Weights of the peak on the friction columns for each Stribeck speed, (speeds, 1, columns)."""
        return peak_weights(self.knots, speeds)[:, None]

    def fitted(self, weights: Array) -> tuple[Array, Array, Array]:
        """Squared residuals, coefficients and inverses with the first columns these blends (laws, blends, columns)."""
        laws, blends, _ = weights.shape
        blended = weights @ self.matrix[self.friction]
        size = blends + len(self.at)
        matrix = np.empty((laws, size, size))
        matrix[:, :blends, :blends] = blended[..., self.friction] @ weights.transpose(0, 2, 1)
        matrix[:, :blends, blends:] = blended[..., self.at]
        matrix[:, blends:, :blends] = blended[..., self.at].transpose(0, 2, 1)
        matrix[:, blends:, blends:] = self.shared
        return _solved(matrix, np.ones((laws, size - 1), dtype=bool))

    def likeliest(self, starts: Array, speeds: Array) -> tuple[float, float, Array, Array]:
        """The likeliest Stribeck speed: the best of `starts`, then Gauss–Newton while better and within `speeds`.

        With it its squared residuals, coefficients and inverse.
        """
        lost, found, inverse = self.fitted(self.peaks(starts))
        best = int(np.argmin(lost))
        result = float(starts[best]), float(lost[best]), found[best], inverse[best]
        for _ in range(5):
            speed, least, values, _ = result
            both = np.stack([self.peaks(np.array([speed]))[0, 0], slope_weights(self.knots, speed) * values[0]])
            step = float(self.fitted(both[None])[1][0, 1])
            step = min(max(step, -0.4 * speed), 0.6 * speed)
            lost, found, inverse = self.fitted(self.peaks(np.array([speed + step])))
            if not lost[0] < least or not speeds[0] <= speed + step <= speeds[-1]:
                break
            result = speed + step, float(lost[0]), found[0], inverse[0]
            if abs(step) < 1e-3 * speed:
                break
        return result


def _solved(matrix: Array, used: Bools) -> tuple[Array, Array, Array]:
    """Least squares for the `used` columns of Gram matrices of [columns | known side], all at once.

    matrix (laws, n + 1, n + 1), used (laws, n). Returns the squared residuals (laws,), the coefficients (laws, n), 0 of
    those not used, and what scales their covariance (laws, n, n).
    """
    inner, right, power = matrix[:, :-1, :-1], matrix[:, :-1, -1], matrix[:, -1, -1]
    scale = used / np.sqrt(np.maximum(np.diagonal(inner, axis1=1, axis2=2), 1e-300))
    both = scale[:, :, None] * scale[:, None, :]
    places = np.arange(inner.shape[1])
    scaled = inner * both
    scaled[:, places, places] += np.where(used, 1e-13, 1.0)
    inverse = np.linalg.inv(scaled) * both
    values = (inverse @ right[:, :, None])[:, :, 0]
    # less than the rounding of the power is not resolved
    lost = np.maximum(np.maximum(power - np.einsum("ij,ij->i", values, right), 1e-15 * power), 1e-300)
    return lost, values, inverse


def _none_below(sides: Array, values: Array, inverse: Array, variance: Array) -> Bools:
    """Which laws dissipate: no torque of `sides` (laws, n, columns) is negative beyond its standard uncertainty.

    values (laws, columns), of covariance inverse · variance (laws,). Rows of zeros in `sides` do not count.
    """
    powers = ((sides @ inverse) * sides).sum(axis=2) * variance[:, None]
    torques = (sides @ values[:, :, None])[:, :, 0]
    result: Bools = ((torques > -np.sqrt(np.maximum(powers, 0.0))) | ~sides.any(axis=2)).all(axis=1)
    return result


@cache
def _in_exact(laws: tuple[tuple[str, ...], ...]) -> tuple[Bools, Array]:
    """Which columns of EXACT each law has (laws, columns), and `_sides` in these (laws, MOST_SIDES, columns)."""
    used, sides = np.zeros((len(laws), len(EXACT)), dtype=bool), np.zeros((len(laws), MOST_SIDES, len(EXACT)))
    for k, terms in enumerate(laws):
        used[k, places_of(terms)] = True
        sides[k, : len(_sides(terms)), places_of(terms)] = _sides(terms).T
    return used, sides


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
