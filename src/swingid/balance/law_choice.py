"""The choice of a friction law by the Bayesian information criterion, all laws on one Gram matrix."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property

import numpy as np

from swingid.balance.covariance import LAG
from swingid.balance.friction_laws import (
    DIRECTIONS,
    EXACT,
    LAWS,
    STRIBECK_SHARES,
    Law,
    law_terms,
    peak_weights,
    places_of,
    slope_weights,
)
from swingid.numerics.arrays import Array, Bools, Ints, median
from swingid.numerics.regression import gram
from swingid.preparation.motion import Motion
from swingid.uncertainty.significance import bayesian

CANDIDATES = tuple(odd + direction for odd in LAWS for direction in DIRECTIONS)
"""All laws."""

DIRECTED = tuple(odd + list(DIRECTIONS)[-1] for odd, terms in LAWS.items() if "stribeck" not in terms)
"""Laws without a peak, with all terms of the direction: where only the odd part of the friction is used."""

ROUNDING = 1e-10
"""Share of the power of the known side below which a residual is that of the arithmetic, not of a law."""

RIDGE, RESOLVED = 1e-13, 1e-15
"""What is added to scaled normal equations, and the share of a power that its rounding is: less is not resolved."""

STEPS, CLOSE = 5, 1e-3
"""Most steps of the search for a Stribeck speed, and the relative step that ends it."""

MOST_SIDES = 8
"""Torques of a law that must not be negative, at most, see `_sides`."""

Criterion = Callable[[float, int, float], float]


@dataclass(frozen=True)
class Trial:
    """A law fitted beside the body: sum of squared residuals, and the values of all columns, 0 of those it lacks.

    variance: of the first of these, by residuals that are white.
    """

    law: Law
    lost: float
    values: Array
    variance: float


@dataclass(frozen=True)
class LawChoice:
    """Laws on the Gram matrix of [body | friction columns | known side], of so many independent rows.

    The friction columns are those of EXACT, then either hat functions of the speed on `knots`, with which the speed of
    Stribeck's peak is sought, or a peak for each of the speeds `peaks`. A law is rejected where a torque is negative by
    more than `level` standard uncertainties, in either direction; but for the law `kept`. The dependence on the
    direction is chosen among the laws without a peak whose speed is sought, which does not affect it.

    slowest: Stribeck speed below which a peak is not identifiable; by default none is sought. origin (columns,): for a
    model that is not linear, the values about which it is linearised; the known side is what they leave.
    """

    gram: Array
    body: int
    independent: float
    names: tuple[str, ...] = CANDIDATES
    kept: str = CANDIDATES[0]
    knots: Array = field(default_factory=lambda: np.empty(0))
    slowest: float = np.inf
    peaks: Array = field(default_factory=lambda: np.empty(0))
    origin: Array | None = None
    level: float = 1.0

    @classmethod
    def of(cls, body: Array, friction: Array, target: Array, knots: Array, slowest: float = np.inf) -> LawChoice:
        """Take the rows: columns of the body (rows, body) and of friction (rows, terms of EXACT and knots), known
        side.
        """
        products = gram(np.ascontiguousarray(np.column_stack([body, friction, target]).T))
        return cls(products, body.shape[1], len(target) / (LAG / 2), knots=knots, slowest=slowest)

    def only(self, name: str) -> LawChoice:
        """The same with one law alone, whether it dissipates or not, its Stribeck speed as it comes out."""
        return replace(self, names=(name,), kept=name, slowest=0.0)

    @cached_property
    def trials(self) -> dict[str, Trial]:
        """The laws that were not rejected, by name."""
        tried = self._tried()
        if len(self.knots) and self.slowest < STRIBECK_SHARES[-1] * self.knots[-1]:
            scores = self._criteria(tried, bayesian)
            direction = min(scores, key=lambda name: scores[name]).partition(",")[2] if tried else None
            for name in (name for name in self.names if "stribeck" in law_terms(name)):
                if direction in (None, name.partition(",")[2]):
                    speed = np.array([self._likeliest_speed(name, tried)])
                    products = self._with(peak_weights(self.knots, speed), range(self.body + len(EXACT)))
                    tried |= replace(self, gram=products, names=(name,), peaks=speed)._tried()
        return tried

    @cached_property
    def best(self) -> Trial:
        """The law of the least criterion."""
        scores = self.scores()
        return self.trials[min(scores, key=lambda name: scores[name])]

    def scores(self, criterion: Criterion = bayesian) -> dict[str, float]:
        """Criterion of every law above the least."""
        scores = self._criteria(self.trials, criterion)
        least = min(scores.values())
        return {name: score - least for name, score in scores.items()}

    def weights(self, criterion: Criterion = bayesian) -> dict[str, float]:
        """Probability of every law by its criterion; they sum to 1."""
        likely = {name: float(np.exp(-score / 2)) for name, score in self.scores(criterion).items()}
        total = sum(likely.values())
        return {name: value / total for name, value in likely.items()}

    def beside(self, weights: Array, more: Array) -> tuple[float, Array, Array]:
        """Residuals of a law with these weights on the friction columns, and their products with further columns.

        more: weights of the further columns. Returns the sum of squared residuals, and the products of the further
        columns, with law and body projected out, with each other and with the residuals.
        """
        matrix, size = self._with(np.hstack([weights, more]).T, range(self.body)), self.body + weights.shape[1]
        fitted, mixed = matrix[:size, :size], matrix[:size, size:]
        scale = 1.0 / np.sqrt(np.maximum(np.diag(fitted), 1e-300))
        scaled = fitted * np.outer(scale, scale) + RIDGE * np.eye(size)
        taken = np.linalg.solve(scaled, scale[:, None] * mixed) * scale[:, None]
        rest = matrix[size:, size:] - mixed.T @ taken
        return max(float(rest[-1, -1]), RESOLVED * float(matrix[-1, -1]), 1e-300), rest[:-1, :-1], rest[:-1, -1]

    def _criteria(self, trials: dict[str, Trial], criterion: Criterion) -> dict[str, float]:
        return {
            name: criterion(trial.lost, len(trial.law.unknowns), self.independent) for name, trial in trials.items()
        }

    def _tried(self) -> dict[str, Trial]:
        """The laws whose terms have columns, all at once; of several peaks that of the least residuals."""
        laws, used, sides = _layout(self.names, self.body, len(self.peaks))
        at = [*range(used.shape[1]), len(self.gram) - 1]
        lost, values, inverse = _solved(self.gram[at][:, at], used, self.origin)
        lost = np.maximum(lost, ROUNDING * float(self.gram[-1, -1]))
        variance = lost / self.independent
        dissipates = _none_below(sides, values, inverse, variance, self.level)
        best: dict[str, Trial] = {}
        for k, (name, peak, places) in enumerate(laws):
            if (dissipates[k] or name == self.kept) and (name not in best or lost[k] < best[name].lost):
                law = Law(name, law_terms(name), values[k, places], np.nan if peak < 0 else float(self.peaks[peak]))
                best[name] = Trial(law, float(lost[k]), values[k], float(inverse[k, 0, 0] * variance[k]))
        return best

    def _likeliest_speed(self, name: str, others: dict[str, Trial]) -> float:
        """The likeliest speed of a peak: the best of a grid, then by Gauss–Newton while better and within the grid.

        Another law with a peak has found about the same speed, and that is where it begins.
        """
        fastest = float(self.knots[-1])
        least = max(STRIBECK_SHARES[0], self.slowest / fastest)
        grid = fastest * np.geomspace(least, STRIBECK_SHARES[-1], len(STRIBECK_SHARES))
        speeds = [trial.law.stribeck_speed for trial in others.values() if trial.law.peak]
        starts = np.array(speeds) if speeds else grid
        lost, heights = self._with_peak(name, peak_weights(self.knots, starts), np.eye(len(starts)))
        best = int(np.argmin(lost))
        speed, smallest, height = float(starts[best]), float(lost[best]), float(heights[best, best])
        for _ in range(STEPS):
            peak = peak_weights(self.knots, np.array([speed]))[0]
            both = np.stack([peak, slope_weights(self.knots, speed) * height])
            step = float(self._with_peak(name, both, np.ones((1, 2)))[1][0, 1])
            step = min(max(step, -0.4 * speed), 0.6 * speed)
            lost, heights = self._with_peak(name, peak_weights(self.knots, np.array([speed + step])), np.ones((1, 1)))
            if not lost[0] < smallest or not grid[0] <= speed + step <= grid[-1]:
                break
            small = abs(step) < CLOSE * speed
            speed, smallest, height = speed + step, float(lost[0]), float(heights[0, 0])
            if small:
                break
        return speed

    def _with_peak(self, name: str, weights: Array, used: Array) -> tuple[Array, Array]:
        """Squared residuals (fits,) of a law with columns of these weights (columns, …) in the place of its peak.

        used (fits, columns): which of them each fit has. Also their coefficients (fits, columns).
        """
        places = [self.body + place for place in places_of(law_terms(name)) if place >= 0]
        matrix = self._with(weights, [*range(self.body), *places])
        columns = np.ones((len(used), len(matrix) - 1), dtype=bool)
        columns[:, -len(weights) :] = used
        lost, values, _ = _solved(matrix, columns)
        return lost, values[:, -len(weights) :]

    def _with(self, weights: Array, kept: Sequence[int]) -> Array:
        """The Gram matrix of some columns, further ones of these weights (…, friction columns), and the known side."""
        blend = np.zeros((len(kept) + len(weights) + 1, len(self.gram)))
        blend[range(len(kept)), kept] = 1.0
        blend[len(kept) : -1, self.body : -1], blend[-1, -1] = weights, 1.0
        result: Array = blend @ self.gram @ blend.T
        return result


def slowest_peak(motion: Motion, noise: float) -> float:
    """Stribeck speed below which a peak is not identifiable; noise: standard deviation of one sample of the angle.

    A peak that passes while the angle moves less than its noise is not distinguishable from an error of the angle.
    """
    acceleration = median(np.abs(motion.speed.acceleration(motion.turning_times)))
    return float(np.sqrt(acceleration * noise))


def _solved(matrix: Array, used: Bools, origin: Array | None = None) -> tuple[Array, Array, Array]:
    """Least squares for the `used` columns (fits, n) of a Gram matrix of [columns | known side], all at once.

    origin (n,): values at which the known side is what is left. Returns the squared residuals (fits,), the values
    (fits, n), 0 of columns that are not used, and what scales their covariance (fits, n, n).
    """
    inner, right, power = matrix[:-1, :-1], matrix[None, :-1, -1], matrix[-1, -1]
    if origin is not None:
        # what the columns contribute that a fit does not have
        lacking = np.column_stack([np.where(used, 0.0, origin), np.ones(len(used))])
        right, power = lacking @ matrix[:, :-1], ((lacking @ matrix) * lacking).sum(axis=1)
    scale = used / np.sqrt(np.maximum(np.diagonal(inner), 1e-300))
    both = scale[:, :, None] * scale[:, None, :]
    scaled, places = inner * both, np.arange(len(inner))
    scaled[:, places, places] += np.where(used, RIDGE, 1.0)
    inverse = np.linalg.inv(scaled) * both
    values = (inverse @ right[:, :, None])[:, :, 0]
    lost = np.maximum(np.maximum(power - (values * right).sum(axis=1), RESOLVED * power), 1e-300)
    return lost, values if origin is None else values + np.where(used, origin, 0.0), inverse


def _none_below(sides: Array, values: Array, inverse: Array, variance: Array, level: float) -> Bools:
    """Which laws dissipate: no torque of `sides` (laws, n, columns) is below −`level` standard uncertainties.

    values (laws, columns), of covariance inverse · variance (laws,). Rows of zeros in `sides` do not count.
    """
    powers = ((sides @ inverse) * sides).sum(axis=2) * variance[:, None]
    torques = (sides @ values[:, :, None])[:, :, 0]
    result: Bools = ((torques > -level * np.sqrt(np.maximum(powers, 0.0))) | ~sides.any(axis=2)).all(axis=1)
    return result


@cache
def _layout(names: tuple[str, ...], body: int, peaks: int) -> tuple[list[tuple[str, int, Ints]], Bools, Array]:
    """The laws with columns [body | EXACT | peaks]: name, which peak or −1, and places of the terms, for each.

    Also which columns each has (laws, columns), and `_sides` in these (laws, MOST_SIDES, columns).
    """
    laws = [(name, -1) for name in names if "stribeck" not in law_terms(name)]
    laws += [(name, k) for name in names if "stribeck" in law_terms(name) for k in range(peaks)]
    used = np.zeros((len(laws), body + len(EXACT) + peaks), dtype=bool)
    sides, layouts = np.zeros((len(laws), MOST_SIDES, used.shape[1])), []
    for k, (name, peak) in enumerate(laws):
        places = places_of(law_terms(name))
        places = body + np.where(places < 0, len(EXACT) + peak, places)
        sides_of_law = _sides(law_terms(name))
        used[k, :body], used[k, places], sides[k, : len(sides_of_law), places] = True, True, sides_of_law.T
        layouts.append((name, peak, places))
    return layouts, used, sides


def _sides(terms: tuple[str, ...]) -> Array:
    """Weights of the coefficients of a law that give its torques in either direction."""
    unit = {term: np.eye(len(terms))[k] for k, term in enumerate(terms)}
    sides = [side for term, side in unit.items() if term not in ("offset", "viscous_even")]
    if "viscous_even" in unit:
        viscous, even = unit.get("viscous", np.zeros(len(terms))), unit["viscous_even"]
        sides += [viscous + even, viscous - even]
    if "offset" in unit and "coulomb" in unit:
        sides += [unit["coulomb"] + unit["offset"], unit["coulomb"] - unit["offset"]]
    return np.array(sides)
