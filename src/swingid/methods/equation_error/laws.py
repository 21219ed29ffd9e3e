"""The friction law of the rows: that of least BIC, and other possible ones.

All laws are compared on the Gram matrix of the filtered rows (`balance/law_choice.py`). The spread of the inertia over
them, weighted by their criterion, is an uncertainty (Bayesian model averaging; Hoeting, Madigan, Raftery and Volinsky
1999).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from swingid.balance.fits import columns_of, known_side
from swingid.balance.friction_laws import (
    EXACT,
    KNOTS,
    STRIBECK_SHARES,
    FrictionRows,
    law_columns,
    law_terms,
    speed_knots,
)
from swingid.balance.law_choice import LawChoice, slowest_peak
from swingid.balance.rows import Rows
from swingid.methods.equation_error.regressors import Regressors
from swingid.methods.equation_error.rows import RowFilter
from swingid.model.equation import Equation
from swingid.numerics.arrays import Array

POSSIBLE = 1e-3
"""Probability below which a law is not fitted."""

TOGETHER = 8
"""Hat functions that are filtered together."""

FINER = 4
"""Grids of Stribeck speeds for a given law, each between the neighbours of the best of the one before."""


@dataclass(frozen=True)
class Law:
    """A friction law with the coefficients of its terms; stribeck_speed: 1.0 where it has no peak."""

    name: str
    terms: tuple[str, ...]
    coefficients: Array
    stribeck_speed: float

    @property
    def unknowns(self) -> tuple[str, ...]:
        """The unknowns beside the inertia: the terms, and the speed of Stribeck's peak."""
        return (*self.terms, "stribeck_speed") if "stribeck" in self.terms else self.terms

    @property
    def peak(self) -> float:
        """Height of Stribeck's peak, 0 without one."""
        return float(self.coefficients[self.terms.index("stribeck")]) if "stribeck" in self.terms else 0.0

    def torque(self, speeds: Array) -> Array:
        """Friction torque at `speeds`."""
        result: Array = law_columns(self.terms, speeds, self.stribeck_speed) @ self.coefficients
        return result


@dataclass(frozen=True)
class Laws:
    """The possible laws with their weights; the most probable first."""

    tried: tuple[tuple[Law, float], ...]

    @property
    def best(self) -> Law:
        """The most probable law."""
        return self.tried[0][0]

    @property
    def likely(self) -> tuple[tuple[Law, float], ...]:
        """The laws of more than negligible probability, with that."""
        total = sum(weight for _, weight in self.tried)
        return tuple((law, weight / total) for law, weight in self.tried if weight > POSSIBLE * total)

    def where(self, sound: Callable[[Law], bool]) -> Laws:
        """The laws without Stribeck's peak, and those of `likely` that are `sound`."""
        worth = {law.name for law, _ in self.likely}
        plain = [(law, weight) for law, weight in self.tried if "stribeck" not in law.terms]
        kept = [(law, weight) for law, weight in self.tried if law.name in worth and law.peak and sound(law)]
        return Laws(tuple(sorted([*kept, *plain], key=lambda item: -item[1])))


class LawTable:
    """Filtered columns of every function of the speed, for the choice of a law.

    Regressors of the direction of motion are filtered again when the turning points change, the others once.
    """

    def __init__(self, row_filter: RowFilter, regressors: Regressors, noise: float) -> None:
        smooth = regressors.smooth
        self.fastest = float(np.quantile(np.abs(smooth), 0.999))
        self.knots = speed_knots(self.fastest, KNOTS)
        self.slowest = slowest_peak(regressors.motion, noise)
        self.hats = np.vstack([row_filter(*columns) for columns in _hats(smooth, self.knots)]).T

    def choose(self, rows: Rows, weights: Array, equation: Equation) -> Laws:
        """The laws for these rows with their robust weights; rows must contain all terms of `EXACT`."""
        friction, body, target = self._columns(rows, weights, equation)
        choice = LawChoice(friction, body, target, slowest=self.slowest)
        ranked = sorted(choice.weights.items(), key=lambda item: -item[1])
        laws = []
        for name, weight in ranked:
            trial = choice.trials[name]
            speed = trial.stribeck_speed if "stribeck" in trial.terms else 1.0
            laws.append((Law(name, trial.terms, trial.values, speed), weight))
        return Laws(tuple(laws))

    def fitted(self, name: str, rows: Rows, weights: Array, equation: Equation) -> Law:
        """The law of this name with the coefficients, and the Stribeck speed, that fit the rows best."""
        friction, body, target = self._columns(rows, weights, equation)
        terms = law_terms(name)
        best, least = Law(name, terms, np.zeros(len(terms)), 1.0), np.inf
        speeds = self.fastest * STRIBECK_SHARES if "stribeck" in terms else np.ones(1)
        for _ in range(FINER if "stribeck" in terms else 1):
            for speed in speeds:
                columns = np.column_stack([friction.columns @ friction.law(terms, speed), body])
                values = np.linalg.lstsq(columns, target, rcond=1e-12)[0]
                lost = float(np.sum((target - columns @ values) ** 2))
                if lost < least:
                    coefficients = np.asarray(values[: len(terms)], dtype=np.float64)
                    best, least = Law(name, terms, coefficients, float(speed)), lost
            ratio = speeds[-1] / speeds[-2] if len(speeds) > 1 else 1.0
            speeds = best.stribeck_speed * np.geomspace(1 / ratio, ratio, len(speeds))
        return best

    def _columns(self, rows: Rows, weights: Array, equation: Equation) -> tuple[FrictionRows, Array, Array]:
        used = weights > 0
        root = np.sqrt(weights[used])
        exact = np.column_stack([rows[name] for name in EXACT])
        columns = np.column_stack([exact, self.hats])[used] * root[:, None]
        _, body = columns_of(rows, equation, ())
        friction = FrictionRows(rows.select(used), self.fastest, self.knots, columns)
        return friction, body[used] * root[:, None], known_side(rows, equation)[used] * root


def _hats(speeds: Array, knots: Array) -> Iterator[Array]:
    """Hat functions on rising `knots` at `speeds` (n,), constant beyond them, `TOGETHER` at a time: (columns, n)."""
    left = np.clip(np.searchsorted(knots, speeds, side="right") - 1, 0, len(knots) - 2)
    share = np.clip((speeds - knots[left]) / np.diff(knots)[left], 0.0, 1.0)
    columns = np.zeros((len(knots), len(speeds)))
    at = left * len(speeds) + np.arange(len(speeds))
    columns.ravel()[at], columns.ravel()[at + len(speeds)] = 1 - share, share
    for first in range(0, len(knots), TOGETHER):
        yield columns[first : first + TOGETHER]
