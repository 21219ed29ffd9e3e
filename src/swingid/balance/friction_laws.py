"""Friction laws that the methods try, a law with its curve, and any function of the speed as columns of the balance.

A law is F(v) = Σ c_k f_k(v) over its terms f_k. Stribeck's peak sgn v exp(−(v/vs)²) is the one term that has a
parameter of its own, the Stribeck speed vs.

The modulated integral ∫φ f(q1') dt of any function f: its jump at rest is integrated exactly between the turning points
found in the angle, for a smoothed speed is wrong there. Only the continuous part needs the speed, and a basis of hat
functions serves every f.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np

from swingid.balance.fits import NamedFit
from swingid.balance.rows import Rows, Signals, Windows
from swingid.errors import UsageError
from swingid.model import shapes, terms
from swingid.model.terms import units_on
from swingid.numerics.arrays import Array, Ints
from swingid.numerics.once import once
from swingid.numerics.quadrature import GaussNodes
from swingid.numerics.test_functions import project_hats
from swingid.result.data import FrictionCurve

TERMS: dict[str, Callable[[Array], Array]] = {
    name: term.of_speed
    for name, term in terms.TERMS.items()
    if name in terms.NAMED and term.power is not None and term.kind == shapes.ONE
}
"""The terms that are functions of the speed alone and have no parameter of their own."""

SIDES = {"positive": 1.0, "negative": -1.0}
"""Directions of motion of which a coefficient may be, as in coulomb_positive."""

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
"""Odd laws tried. One with a coefficient that is negative beyond its uncertainty does not dissipate and is rejected."""

DIRECTIONS: dict[str, tuple[str, ...]] = {
    "": (),
    ", offset": ("offset",),
    ", direction-dependent": ("offset", "viscous_even"),
}

STRIBECK_SHARES = np.geomspace(0.01, 0.3, 8)
"""Stribeck speeds tried, as shares of the highest speed."""


NEAR_REST = {"near_rest_slow": 0.02, "near_rest_medium": 0.06, "near_rest_fast": 0.18}
"""Stribeck's peaks that are fitted together, with their speeds as shares of the highest one: any peak near rest is
nearly a sum of them, so no search for its speed is necessary beside the inertia."""

EXACT = tuple(TERMS)
"""Terms with a column of their own."""

CURVE_KNOTS = 7
"""Speeds of a curve of friction, on each side of rest."""

NO_CANDIDATES: Mapping[str, float] = {}

DIRECTED_TERMS = ("coulomb", "stribeck", "viscous", "viscous_even", "offset")
"""Terms whose coefficients are combined to the parameters of a law, see `parameter_weights`."""

COULOMB, OFFSET = EXACT.index("coulomb"), EXACT.index("offset")

KNOTS = 28
"""Hat functions on each side of rest."""


@cache
def law_terms(name: str, code: str = "unknown-law") -> tuple[str, ...]:
    """Terms of a law by its name with direction. Raises UsageError with this code for an unknown name."""
    odd, comma, direction = name.partition(",")
    if odd not in LAWS or comma + direction not in DIRECTIONS:
        text = f'unknown friction law {name!r}; choose "auto" or one of {", ".join(LAWS)}'
        raise UsageError(f'{text}, each also with ", offset" or ", direction-dependent".', code=code)
    return LAWS[odd] + DIRECTIONS[comma + direction]


def law_columns(terms: tuple[str, ...], speeds: Array, stribeck_speed: float) -> Array:
    """Values of the terms at `speeds`, shape (speeds, terms)."""
    return np.column_stack([_term_at(term, speeds, stribeck_speed) for term in terms])


def _term_at(term: str, speeds: Array, stribeck_speed: float) -> Array:
    """A term at `speeds`; that of one direction is 0 in the other."""
    if term == "stribeck":
        return stribeck_peak(speeds, stribeck_speed)
    if term in TERMS:
        return TERMS[term](speeds)
    name, _, side = term.rpartition("_")
    return np.where(speeds * SIDES[side] > 0, TERMS[name](speeds), 0.0)


def stribeck_peak(speeds: Array, stribeck_speed: Array | float) -> Array:
    """Stribeck's peak sgn v exp(−(v/vs)²) at `speeds`."""
    result: Array = np.sign(speeds) * np.exp(-((speeds / stribeck_speed) ** 2))
    return result


def stribeck_slope(speeds: Array, stribeck_speed: float) -> Array:
    """Derivative of Stribeck's peak by the Stribeck speed, at `speeds`."""
    square = (speeds / stribeck_speed) ** 2
    result: Array = 2 * np.sign(speeds) * square * np.exp(-square) / stribeck_speed
    return result


def parameter_weights(terms: tuple[str, ...]) -> dict[str, Array]:
    """Weights of each friction parameter on the coefficients of a law: parameter = weights @ coefficients.

    A direction-dependent law c0 sgn v + c1 v + d0 + d1 |v| has coulomb_positive = c0 + d0, coulomb_negative =
    c0 − d0, viscous_positive = c1 + d1, viscous_negative = c1 − d1. A last "term" stribeck_speed is a parameter itself,
    and so is any further term of friction behind the law's own.
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
    weights |= {name: weights_of_term for name, weights_of_term in unit.items() if name not in DIRECTED_TERMS}
    if "offset" in unit and not (directed and "coulomb" in unit):
        weights["offset"] = unit["offset"]
    return weights


def parameters_of(fit: NamedFit, terms: tuple[str, ...]) -> tuple[dict[str, tuple[float, str]], dict[str, Array]]:
    """What a fit seeks of its equation, and its parameters of friction of these terms: values with units, by name.

    Also their weights on the unknowns, of the inertia those of a11.
    """
    unit = dict(zip(fit.unknowns, np.eye(len(fit.unknowns)), strict=True))
    weights = {name: unit[name] for name in fit.unknowns if fit.equation.seeks(name)}
    columns = np.array([unit[name] for name in terms])
    weights |= {name: row @ columns for name, row in parameter_weights(terms).items()}
    units = units_on(linear=fit.equation.linear)
    values = {name: (float(row @ fit.fit.values), units[name]) for name, row in weights.items()}
    return values | {"inertia": (fit.inertia, units["inertia"])}, weights


@dataclass(frozen=True)
class Law:
    """A friction law: its terms and their coefficients (terms,); stribeck_speed: NaN in a law without Stribeck's peak.

    A term may be that of one direction, as coulomb_positive.
    """

    name: str
    terms: tuple[str, ...]
    coefficients: Array
    stribeck_speed: float

    @property
    def unknowns(self) -> tuple[str, ...]:
        """The terms and, where one of them is Stribeck's peak, its speed."""
        return (*self.terms, "stribeck_speed") if "stribeck" in self.terms else self.terms

    @property
    def values(self) -> Array:
        """Values of the unknowns."""
        return np.append(self.coefficients, [self.stribeck_speed] if "stribeck" in self.terms else [])

    @property
    def peak(self) -> float:
        """Height of Stribeck's peak, 0 without one."""
        return float(self.coefficients[self.terms.index("stribeck")]) if "stribeck" in self.terms else 0.0

    def torque(self, speeds: Array) -> Array:
        """Friction torque (N m or N) at `speeds`."""
        result: Array = law_columns(self.terms, speeds, self.stribeck_speed) @ self.coefficients
        return result

    def curve_at(
        self,
        speeds: Array,
        covariance: Array,
        candidates: Mapping[str, float] = NO_CANDIDATES,
        beyond: Array | float = 0.0,
        variance: Array | float = 0.0,
    ) -> FrictionCurve:
        """The law at `speeds` with its standard uncertainty by the covariance of its unknowns.

        beyond: what the friction of the log is above the law, with the `variance` that is not the law's.
        """
        slopes = law_columns(self.terms, speeds, self.stribeck_speed)
        torques = slopes @ self.coefficients
        if "stribeck" in self.terms:
            slopes = np.column_stack([slopes, self.peak * stribeck_slope(speeds, self.stribeck_speed)])
        power = np.einsum("ij,jk,ik->i", slopes, covariance, slopes) + variance
        spread = np.sqrt(np.maximum(power, 0.0))
        return FrictionCurve(speeds, torques + beyond, spread, self.name, torques, dict(candidates))


def curve_speeds(fastest: float, count: int = CURVE_KNOTS, *, rest: bool = True) -> Array:
    """Speeds of a curve of friction, `count` on each side, denser near rest; rest: also one on each side of it."""
    side = speed_knots(fastest, count)[count + 1 :]
    side = np.append(1e-6 * fastest, side) if rest else side
    return np.concatenate([-side[::-1], side])


@dataclass(frozen=True)
class FrictionRows:
    """Rows and the friction columns: those of the terms in EXACT, then the hat functions on `knots`.

    knots: rad/s or m/s, rising, 0 in the middle; columns (windows, terms + knots).
    """

    rows: Rows
    knots: Array
    columns: Array

    @classmethod
    def of(cls, signals: Signals, rows: Rows, *, hats: bool = True) -> FrictionRows:
        """Friction columns of rows of "law" windows, of one length. hats: False for laws without a peak at rest."""
        knots = speed_knots(signals.fastest, KNOTS) if hats else np.empty(0)
        columns = [rows[name] for name in EXACT]
        if hats:
            columns.append(_hats(rows.windows, *signals.finely, knots))
        return cls(rows, knots, np.column_stack(columns))

    def law(self, terms: tuple[str, ...], stribeck_speed: float) -> Array:
        """Weights on `columns` that give the columns of a law's terms, shape (columns, terms)."""
        weights = np.zeros((self.columns.shape[1], len(terms)))
        for k, place in enumerate(places_of(terms)):
            if place >= 0:
                weights[place, k] = 1.0
            else:
                weights[:, k] = peak_weights(self.knots, np.array([stribeck_speed]))[0]
        return weights


def with_near_rest(signals: Signals, rows: Rows) -> Rows:
    """Rows of "law" windows, of one length, with the columns of `NEAR_REST`."""
    friction = FrictionRows.of(signals, rows)
    peaks = {
        name: friction.columns @ friction.law(("stribeck",), share * signals.fastest)[:, 0]
        for name, share in NEAR_REST.items()
    }
    return rows.beside(peaks)


@cache
def places_of(terms: tuple[str, ...]) -> Ints:
    """Column of each term, −1 for Stribeck's peak, which has none of its own. ValueError for what is no term."""
    return np.array([-1 if term == "stribeck" else EXACT.index(term) for term in terms])


def peak_weights(knots: Array, stribeck_speeds: Array) -> Array:
    """Weights on `FrictionRows.columns` that give Stribeck's peak for each of the speeds, (speeds, columns)."""
    return function_weights(knots, _smooth(knots, stribeck_peak(knots, stribeck_speeds[:, None])), 1.0, -1.0)


def slope_weights(knots: Array, stribeck_speed: float) -> Array:
    """Weights of the derivative of Stribeck's peak by its speed, (columns,)."""
    return function_weights(knots, _smooth(knots, stribeck_slope(knots, stribeck_speed)), 0.0, 0.0)


def function_weights(knots: Array, values: Array, above: float, below: float) -> Array:
    """Weights of functions with these values (..., knots) at the knots and the limits `above` and `below` rest."""
    jump, mean = (above - below) / 2, (above + below) / 2
    weights = np.zeros((*values.shape[:-1], len(EXACT) + len(knots)))
    weights[..., COULOMB], weights[..., OFFSET] = jump, mean
    if len(knots):
        weights[..., len(EXACT) :] = values - jump * np.sign(knots) - mean
        weights[..., len(EXACT) + len(knots) // 2] = 0.0
    return weights


def _smooth(knots: Array, values: Array) -> Array:
    """Values (..., knots) whose linear interpolation has the right mean: f − h² f''/12, except next to rest."""
    result, steps, middle = values.copy(), knots[1:] - knots[:-1], len(knots) // 2
    before, after = steps[:-1], steps[1:]
    slopes = (values[..., 1:] - values[..., :-1]) / steps
    change = slopes[..., 1:] - slopes[..., :-1]
    change[..., max(middle - 2, 0) : middle + 1] = 0.0
    result[..., 1:-1] -= change * (before * after / (before + after) / 6)
    return result


@once
def _hats(windows: Windows, nodes: GaussNodes, speeds: Array, knots: Array) -> Array:
    """∫φ Λ of the hat functions of the speeds at the nodes."""
    return project_hats(nodes, speeds, knots, windows.centres, windows.half)


@lru_cache(maxsize=16)
def speed_knots(fastest: float, count: int) -> Array:
    """Speeds on both sides of rest, `count` each and 0, denser near it."""
    side = fastest * (np.arange(1, count + 1) / count) ** 1.5
    return np.concatenate([-side[::-1], [0.0], side])
