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
from swingid.balance.friction_laws import EXACT, KNOTS, Law, speed_knots
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


@dataclass(frozen=True)
class Laws:
    """The possible laws with their weights; the most probable first."""

    tried: tuple[tuple[Law, float], ...]

    @classmethod
    def of(cls, choice: LawChoice) -> Laws:
        """Those of a choice."""
        found = [(choice.trials[name].law, weight) for name, weight in choice.weights().items()]
        return cls(tuple(sorted(found, key=lambda item: -item[1])))

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
        self.knots = speed_knots(float(np.quantile(np.abs(smooth), 0.999)), KNOTS)
        self.slowest = slowest_peak(regressors.motion, noise)
        self.hats = np.vstack([row_filter(*columns) for columns in _hats(smooth, self.knots)]).T

    def choice(self, rows: Rows, weights: Array, equation: Equation) -> LawChoice:
        """The laws for these rows with their robust weights; rows must contain all terms of `EXACT`."""
        used = weights > 0
        root = np.sqrt(weights[used])
        exact = np.column_stack([rows[name] for name in EXACT])
        friction = np.column_stack([exact, self.hats])[used] * root[:, None]
        _, body = columns_of(rows, equation, ())
        target = known_side(rows, equation)[used] * root
        return LawChoice.of(body[used] * root[:, None], friction, target, self.knots, self.slowest)


def _hats(speeds: Array, knots: Array) -> Iterator[Array]:
    """Hat functions on rising `knots` at `speeds` (n,), constant beyond them, `TOGETHER` at a time: (columns, n)."""
    left = np.clip(np.searchsorted(knots, speeds, side="right") - 1, 0, len(knots) - 2)
    share = np.clip((speeds - knots[left]) / np.diff(knots)[left], 0.0, 1.0)
    columns = np.zeros((len(knots), len(speeds)))
    at = left * len(speeds) + np.arange(len(speeds))
    columns.ravel()[at], columns.ravel()[at + len(speeds)] = 1 - share, share
    for first in range(0, len(knots), TOGETHER):
        yield columns[first : first + TOGETHER]
