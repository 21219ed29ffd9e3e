"""Friction laws that the methods try: terms of the speed, laws made of them, and their names in rig.toml.

A law is F(v) = Σ c_k f_k(v) over its terms f_k. Stribeck's peak sgn v exp(−(v/vs)²) is the one term that has a
parameter of its own, the Stribeck speed vs.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from swingid.model import terms
from swingid.numerics.arrays import Array
from swingid.numerics.compiled import njit

Law = Callable[[Array], Array]

TERMS: dict[str, Law] = {
    name: term.of_speed
    for name, term in terms.TERMS.items()
    if name in terms.NAMED and term.power is not None and term.kind == terms.ONE
}
"""The terms that are functions of the speed alone and have no parameter of their own."""

LAWS: dict[str, tuple[str, ...]] = {
    "viscous": ("viscous",),
    "coulomb + viscous": ("coulomb", "viscous"),
    "coulomb + quadratic": ("coulomb", "quadratic"),
    "viscous + quadratic": ("viscous", "quadratic"),
    "viscous + cubic": ("viscous", "cubic"),
    "coulomb + viscous + quadratic": ("coulomb", "viscous", "quadratic"),
    "stribeck": ("coulomb", "viscous", "stribeck"),
    "stribeck + quadratic": ("coulomb", "viscous", "stribeck", "quadratic"),
}
"""Odd laws tried. One whose coefficients come out negative beyond their uncertainty is no law of friction."""

DIRECTIONS: dict[str, tuple[str, ...]] = {
    "": (),
    ", offset": ("offset",),
    ", direction-dependent": ("offset", "viscous_even"),
}

STRIBECK_SHARES = np.geomspace(0.01, 0.3, 8)
"""Stribeck speeds tried, as shares of the highest speed."""


@cache
def law_terms(name: str) -> tuple[str, ...]:
    """Terms of a law by its name with direction."""
    odd, comma, direction = name.partition(",")
    return LAWS[odd] + DIRECTIONS[comma + direction]


def law_columns(terms: tuple[str, ...], speeds: Array, stribeck_speed: float) -> Array:
    """Values of the terms at `speeds`, shape (speeds, terms)."""
    terms_at = {name: term(speeds) for name, term in TERMS.items() if name in terms}
    if "stribeck" in terms:
        terms_at["stribeck"] = stribeck_peak(speeds, stribeck_speed)
    return np.column_stack([terms_at[term] for term in terms])


@njit
def stribeck_peak(speeds: Array, stribeck_speed: float) -> Array:
    """Stribeck's peak sgn v exp(−(v/vs)²) at `speeds`."""
    return np.asarray(np.sign(speeds) * np.exp(-((speeds / stribeck_speed) ** 2)))


@njit
def stribeck_slope(speeds: Array, stribeck_speed: float) -> Array:
    """Derivative of Stribeck's peak by the Stribeck speed, at `speeds`."""
    square = (speeds / stribeck_speed) ** 2
    return np.asarray(2 * np.sign(speeds) * square * np.exp(-square) / stribeck_speed)


def parameter_weights(terms: tuple[str, ...]) -> dict[str, Array]:
    """Weights of each friction parameter on the coefficients of a law: parameter = weights @ coefficients.

    A direction-dependent law c0 sgn v + c1 v + d0 + d1 |v| has coulomb_positive = c0 + d0, coulomb_negative =
    c0 − d0, viscous_positive = c1 + d1, viscous_negative = c1 − d1. A last "term" stribeck_speed stands for itself.
    """
    unit = {term: np.eye(len(terms))[k] for k, term in enumerate(terms)}
    nothing = np.zeros(len(terms))
    weights: dict[str, Array] = {}
    directed = "viscous_even" in unit
    if "coulomb" in unit and directed:
        weights["coulomb_positive"] = unit["coulomb"] + unit["offset"]
        weights["coulomb_negative"] = unit["coulomb"] - unit["offset"]
    elif "coulomb" in unit:
        weights["coulomb"] = unit["coulomb"]
    if "stribeck" in unit:
        weights["static"] = unit["coulomb"] + unit["stribeck"]
    if directed:
        viscous = unit.get("viscous", nothing)
        weights["viscous_positive"] = viscous + unit["viscous_even"]
        weights["viscous_negative"] = viscous - unit["viscous_even"]
    elif "viscous" in unit:
        weights["viscous"] = unit["viscous"]
    weights |= {name: unit[name] for name in ("quadratic", "cubic", "stribeck_speed") if name in unit}
    if "offset" in unit and not (directed and "coulomb" in unit):
        weights["offset"] = unit["offset"]
    return weights
