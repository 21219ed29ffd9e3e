"""Friction as columns of the balance: the projection ∫φ f(q1') dt of any function f of the speed.

What f does at rest, its jump, is projected exactly between the turning points found in the angle; a smoothed speed is
wrong there. Only the continuous rest needs the speed, and a basis of hat functions serves every f.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from swingid.balance.friction_laws import TERMS, stribeck_peak, stribeck_slope
from swingid.balance.rows import Rows, Signals, Windows
from swingid.numerics.arrays import Array, Ints
from swingid.numerics.compiled import njit
from swingid.numerics.test_functions import project_hats

EXACT = tuple(TERMS)
"""Terms with a column of their own."""

COULOMB, OFFSET = EXACT.index("coulomb"), EXACT.index("offset")

KNOTS = 28
"""Hat functions on each side of rest."""


@dataclass(frozen=True)
class FrictionRows:
    """Rows and the friction columns: those of the terms in EXACT, then the hat functions on `knots`.

    knots: rad/s or m/s, rising, 0 in the middle; columns (windows, terms + knots).
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
        return law_weights(places_of(terms), self.knots, stribeck_speed)

    def stribeck_slope(self, stribeck_speed: float) -> Array:
        """Weights of the derivative of Stribeck's peak by its speed."""
        return slope_weights(self.knots, stribeck_speed)

    def function(self, values: Array, above: float, below: float) -> Array:
        """Weights of a function with `values` at the knots and the limits `above` and `below` rest."""
        return _function_weights(self.knots, values, above, below)


@cache
def places_of(terms: tuple[str, ...]) -> Ints:
    """Column of each term, −1 for Stribeck's peak, which has none of its own. ValueError for what is no term."""
    return np.array([-1 if term == "stribeck" else EXACT.index(term) for term in terms])


@njit
def law_weights(places: Ints, knots: Array, stribeck_speed: float) -> Array:
    """As `FrictionRows.law`, of the terms at `places`."""
    weights = np.zeros((len(EXACT) + len(knots), len(places)))
    for k in range(len(places)):
        if places[k] >= 0:
            weights[places[k], k] = 1.0
        else:
            peak = _smooth(knots, stribeck_peak(knots, stribeck_speed))
            column = _function_weights(knots, peak, 1.0, -1.0)
            for j in range(len(column)):
                weights[j, k] = column[j]
    return weights


@njit
def slope_weights(knots: Array, stribeck_speed: float) -> Array:
    """As `FrictionRows.stribeck_slope`."""
    return _function_weights(knots, _smooth(knots, stribeck_slope(knots, stribeck_speed)), 0.0, 0.0)


@njit
def _function_weights(knots: Array, values: Array, above: float, below: float) -> Array:
    """As `FrictionRows.function`."""
    weights = np.zeros(len(EXACT) + len(knots))
    jump, mean = (above - below) / 2, (above + below) / 2
    weights[COULOMB], weights[OFFSET] = jump, mean
    for k in range(len(knots)):
        if k != len(knots) // 2:
            weights[len(EXACT) + k] = values[k] - jump * np.sign(knots[k]) - mean
    return weights


@njit
def _smooth(knots: Array, values: Array) -> Array:
    """Values whose interpolation by straight lines is right on the mean: f − h² f''/12, but next to rest."""
    result, middle = values.copy(), len(knots) // 2
    for k in range(1, len(knots) - 1):
        if abs(k - middle) > 1:
            before, after = knots[k] - knots[k - 1], knots[k + 1] - knots[k]
            change = (values[k + 1] - values[k]) / after - (values[k] - values[k - 1]) / before
            result[k] -= before * after * change / (before + after) / 6
    return result


def _hats(signals: Signals, windows: Windows, knots: Array) -> Array:
    """∫φ Λ of the hat functions, computed once for all windows of one length."""
    key = ("hats", float(windows.half[0]))
    if key not in signals.kept:
        signals.kept[key] = project_hats(*signals.finely, knots, windows.centres, windows.half)
    return signals.kept[key]


def speed_knots(fastest: float, count: int) -> Array:
    """Speeds on both sides of rest, `count` each and 0, denser near it."""
    side = fastest * (np.arange(1, count + 1) / count) ** 1.5
    return np.concatenate([-side[::-1], [0.0], side])
