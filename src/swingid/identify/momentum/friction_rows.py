"""Friction as columns of the balance: the projection ∫φ f(q1') dt of any function f of the speed.

What f does at rest, its jump, is projected exactly between the turning points found in the angle; a smoothed speed is
wrong there. Only the continuous rest needs the speed, and a basis of hat functions serves every f.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from swingid.identify.friction_laws import stribeck_peak, stribeck_slope
from swingid.identify.momentum.balance import Rows, Signals, Windows
from swingid.numerics.compiled import njit
from swingid.numerics.hats import project_hats

Array = NDArray[np.float64]

EXACT = ("coulomb", "offset", "viscous", "quadratic", "viscous_even", "cubic")
"""Terms with a column of their own."""

KNOTS = 28
"""Hat functions on each side of rest."""


@dataclass(frozen=True)
class FrictionRows:
    """Rows and the friction columns: those of the terms in EXACT, then the hat functions on `knots`.

    knots: rad/s or m/s, rising, 0 in the middle; columns (windows, 6 + knots).
    """

    rows: Rows
    fastest: float
    knots: Array
    columns: Array

    @classmethod
    def of(cls, signals: Signals, rows: Rows, *, hats: bool = True) -> FrictionRows:
        """Friction columns of rows of "law" windows, of one length. hats: False for laws without a peak at rest."""
        knots = speed_knots(signals.fastest, KNOTS) if hats else np.empty(0)
        columns = [rows.friction[name] for name in EXACT]
        if hats:
            columns.append(_hats(signals, rows.windows, knots))
        return cls(rows, signals.fastest, knots, np.column_stack(columns))

    def law(self, terms: tuple[str, ...], stribeck_speed: float) -> Array:
        """Weights on `columns` that give the columns of a law's terms, shape (columns, terms)."""
        weights = _own_columns(terms, len(EXACT) + len(self.knots))
        if "stribeck" in terms:
            weights = weights.copy()
            peak = self._smooth(stribeck_peak(self.knots, stribeck_speed))
            weights[:, terms.index("stribeck")] = self.function(peak, 1.0, -1.0)
        return weights

    def stribeck_slope(self, stribeck_speed: float) -> Array:
        """Weights of the derivative of Stribeck's peak by its speed."""
        return self.function(self._smooth(stribeck_slope(self.knots, stribeck_speed)), 0.0, 0.0)

    def _smooth(self, values: Array) -> Array:
        """Values whose interpolation by straight lines is right on the mean: f − h² f''/12, but next to rest."""
        result = values.copy()
        result[1:-1] -= _bends(self.knots, values)
        middle = len(values) // 2
        result[middle - 1 : middle + 2] = values[middle - 1 : middle + 2]
        return result

    def function(self, values: Array, above: float, below: float) -> Array:
        """Weights of a function with `values` at the knots and the limits `above` and `below` rest."""
        jump, mean = (above - below) / 2, (above + below) / 2
        rest = values - jump * np.sign(self.knots) - mean
        rest[len(rest) // 2] = 0.0
        weights = np.zeros(len(EXACT) + len(rest))
        weights[EXACT.index("coulomb")], weights[EXACT.index("offset")] = jump, mean
        weights[len(EXACT) :] = rest
        return weights


@cache
def _own_columns(terms: tuple[str, ...], count: int) -> Array:
    """Weights of the terms that have a column of their own."""
    weights = np.zeros((count, len(terms)))
    for k, term in enumerate(terms):
        if term in EXACT:
            weights[EXACT.index(term), k] = 1.0
    return weights


def _hats(signals: Signals, windows: Windows, knots: Array) -> Array:
    """∫φ Λ of the hat functions, computed once for all windows of one length."""
    key = ("hats", float(windows.half[0]))
    if key not in signals.kept:
        signals.kept[key] = project_hats(*signals.finely, knots, windows.centres, windows.half)
    return signals.kept[key]


@njit
def _bends(knots: Array, values: Array) -> Array:
    """h² f''/12 at the inner knots, from the values at their neighbours."""
    result = np.empty(len(knots) - 2)
    for k in range(len(result)):
        before, after = knots[k + 1] - knots[k], knots[k + 2] - knots[k + 1]
        change = (values[k + 2] - values[k + 1]) / after - (values[k + 1] - values[k]) / before
        result[k] = before * after * change / (before + after) / 6
    return result


def speed_knots(fastest: float, count: int) -> Array:
    """Speeds on both sides of rest, `count` each and 0, denser near it."""
    side = fastest * (np.arange(1, count + 1) / count) ** 1.5
    return np.concatenate([-side[::-1], [0.0], side])
