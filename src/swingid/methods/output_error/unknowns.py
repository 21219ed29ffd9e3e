"""The unknowns of a fit, and their places in the rig's vector of constants.

The vector is linear in the unknowns θ, p = base + D θ: the Coulomb friction has four places, the wheel's inertia those
of a11, a12 and a22. Friction is a law of `balance.friction_laws`; Stribeck's peak is estimated as its height over the
Coulomb friction, so that bounds keep the law dissipative. A constant that rig.toml states with an uncertainty is an
unknown too: its deviation from the stated value, with prior.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from swingid.balance.friction_laws import law_terms
from swingid.errors import UsageError
from swingid.methods.output_error import constants
from swingid.methods.output_error.constants import SCALE, Places, constant_places, constant_value, free_key
from swingid.model.equation import Equation
from swingid.model.parameters import (
    A11,
    AXIS_STICKS,
    COEFFICIENT,
    PLACES,
    WHEEL_TILT,
    add_term,
    can_stick,
    vector,
)
from swingid.model.rig import Rig
from swingid.model.terms import TERMS, power_of, units_on
from swingid.numerics.arrays import Array, Ints

Entries = tuple[Ints, Ints, Array]

FRICTION: dict[str, Places] = {
    name: tuple((place, 1.0) for place in places)
    for name, places in PLACES.items()
    if name == "stribeck" or TERMS[name].key.startswith("axis.friction.")
}
"""Places of the friction unknowns."""

NEVER_FREE = ("drive.motor.gear_ratio", "log.torque_gain")
"""Constants whose places hold for small deviations only, or that only another constant determines."""

ZERO = "angle_zero"
"""Zero offset: reading of the angle's encoder at angle 0, unknown within a step of its grid."""

FARTHEST_ZERO = 0.1
"""Largest zero offset (rad) that is sought where one within a step of the grid does not explain the log."""

NOTHING: Mapping[str, float] = {}

ANY_SCALE = 1.0
"""Standard deviation of the motor's scale: so wide that the prior has no influence."""

FARTHEST = 30.0
"""Bounds of a constant about its stated value, in standard uncertainties."""


@dataclass(frozen=True)
class Unknown:
    """One unknown: name, unit, bounds, and the places of the vector that it moves with their weights.

    std: standard deviation of the prior about 0, finite for what is no result: the zero offset, and the deviation of
    a constant from what rig.toml states, whose name is its key.
    """

    name: str
    unit: str
    low: float
    high: float
    places: Places
    std: float = np.inf

    @property
    def is_sought(self) -> bool:
        """Return whether it is a result: without prior."""
        return not np.isfinite(self.std)


@dataclass(frozen=True)
class Unknowns:
    """The unknowns in order ("inertia" first), and the vector with all of them at zero."""

    items: tuple[Unknown, ...]
    base: Array

    def __len__(self) -> int:
        return len(self.items)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the unknowns."""
        return tuple(item.name for item in self.items)

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Lowest and highest values."""
        return np.array([item.low for item in self.items]), np.array([item.high for item in self.items])

    @cached_property
    def zero(self) -> int | None:
        """Place of the angle's zero among the unknowns, where it is one."""
        return self.names.index(ZERO) if ZERO in self.names else None

    @cached_property
    def power(self) -> Array:
        """Information of the prior of each unknown: 1/std² about 0."""
        return np.array([item.std**-2.0 for item in self.items])

    def zero_bound(self, values: Array) -> bool:
        """Return whether `values` (m,) have the zero offset at its bound."""
        return self.zero is not None and abs(values[self.zero]) >= self.items[self.zero].high

    def with_zero_of(self, other: Unknowns | None) -> Unknowns:
        """The same with the zero offset as in `other`, or for None anywhere within `FARTHEST_ZERO`."""
        zeros = (
            [_zero_within(FARTHEST_ZERO)]
            if other is None
            else [unknown for unknown in other.items if unknown.name == ZERO]
        )
        items = (zeros[0] if zeros and item.name == ZERO else item for item in self.items)
        return replace(self, items=tuple(items))

    @cached_property
    def _entries(self) -> Entries:
        return entries_of([item.places for item in self.items], 0)

    def entries(self, states: int) -> Entries:
        """Every place that an unknown moves, see `entries_of`; columns count from `states`."""
        places, columns, weights = self._entries
        return places, states + columns, weights

    def vector(self, values: Array) -> Array:
        """The rig's vector (SIZE,) for values of the unknowns."""
        p, (places, columns, weights) = self.base.copy(), self._entries
        np.add.at(p, places, weights * values[columns])
        p[AXIS_STICKS] = can_stick(p)
        return p


def entries_of(moved: Sequence[Places], first: int) -> Entries:
    """(place, column, weight) of every place of the vector that a column moves; columns count from `first`."""
    flat = [(place, first + k, weight) for k, places in enumerate(moved) for place, weight in places]
    places, columns, weights = zip(*flat, strict=True) if flat else ((), (), ())
    return np.array(places, np.int64), np.array(columns, np.int64), np.array(weights, np.float64)


def _zero_within(width: float) -> Unknown:
    """A zero offset anywhere within ± width (rad) / 2, and beyond by noise only."""
    return Unknown(ZERO, "rad", -width, width, (), width / np.sqrt(12))


def friction_unknowns(law: str) -> tuple[str, ...]:
    """Names of the unknowns of a friction law. Raises UsageError for an unknown law."""
    terms = law_terms(law)
    directed = "viscous_even" in terms
    names: list[str] = []
    for term in terms:
        if directed and term in ("coulomb", "viscous"):
            names += [f"{term}_positive", f"{term}_negative"]
        elif not (term == "viscous_even" or (term == "offset" and directed and "coulomb" in terms)):
            names.append(term)
    if directed and "viscous" not in terms:
        names += ["viscous_positive", "viscous_negative"]
    return (*names, "stribeck_speed") if "stribeck" in terms else tuple(names)


def unknowns_of(
    rig: Rig,
    equation: Equation,
    law: str,
    free: Sequence[str],
    fastest: float,
    strongest: float,
    resolution: float = 0.0,
    uncertain: Sequence[str] = (),
    readings: Mapping[str, float] = NOTHING,
) -> Unknowns:
    """Inertia, gravity torque where it is "unknown" or free, the friction law, and the free constants.

    fastest: highest speed of the motion (rad/s); strongest: a torque (N m) that no friction exceeds. They bound the
    Stribeck speed and the coefficients. resolution: step of the angle's grid (rad): an encoder is set to 0 where the
    body hangs with an error of up to half a step, on which gravity depends. uncertain: keys of constants that are
    estimated with the stated value as prior; readings: the same of the sensors, with the standard deviations.
    Raises UsageError for an unknown law or constant.
    """
    places, units = constant_places(rig, equation), units_on(linear=equation.linear)
    base = _stated(rig, equation, places)
    items = [Unknown("inertia", equation.unit, 1e-12, np.inf, ((A11, 1.0),))]
    for name in dict.fromkeys((*(("gravity_torque",) if equation.seeks("gravity_torque") else ()), *free)):
        key = free_key(name)
        kept = {*NEVER_FREE, *(key for term in equation.slots for key in (term.term.key, term.term.shift))}
        offered = [other for other in places if other not in kept]
        if key not in offered:
            has = ", ".join(constants.free_name(other) for other in offered)
            raise UsageError(f"{name!r} cannot be free for this rig; choose of {has}.", code="unknown-constant")
        items.append(Unknown(name, constants.unit_of(key, equation), 0.0, np.inf, places[key]))
    for term, place in zip(equation.slots, constants.slots(equation), strict=True):
        if term.value is None:
            low = -np.inf if term.term.signed else 0.0
            items.append(Unknown(term.name, units[term.name], low, np.inf, ((place + COEFFICIENT, 1.0),)))
    for name in friction_unknowns(law):
        low = -strongest if name == "offset" else 0.0
        high = strongest / fastest ** power_of(name)
        if name == "stribeck_speed":
            low, high = 0.003 * fastest, fastest
        unit = units["coulomb" if name == "stribeck" else name]
        items.append(Unknown(name, unit, low, high, FRICTION[name]))
    sought = {free_key(item.name) for item in items if item.name not in FRICTION}
    items += [
        _about_stated(rig, equation, key, places[key]) for key in uncertain if key in places and key not in sought
    ]
    if SCALE in uncertain:
        items.append(Unknown(SCALE, "1", -0.9, FARTHEST * ANY_SCALE, constants.scaled_places(base), ANY_SCALE))
    for key, std in readings.items():
        unit = "s" if key.endswith("latency") else "rad"
        items.append(Unknown(key, unit, -FARTHEST * std, FARTHEST * std, (), std))
    if resolution > 0 and not equation.linear and equation.stated.get("gravity_torque") != 0:
        items.append(_zero_within(resolution))
    for item in items:
        if item.is_sought and item.name not in FRICTION and item.name != "inertia":
            value = 0.0 if item.name in equation.sought else constant_value(rig, free_key(item.name))[0]
            for place, weight in item.places:
                base[place] -= weight * value
    return Unknowns(tuple(items), base)


def _about_stated(rig: Rig, equation: Equation, key: str, places: Places) -> Unknown:
    """The deviation of a constant from its stated value; a positive constant stays positive."""
    value, std = constant_value(rig, key)
    assert std
    widest = FARTHEST * std
    may_be_negative = all(term.key != key or term.signed for term in TERMS.values())
    low = -widest if value <= 0 or may_be_negative else -min(widest, 0.9 * value)
    return Unknown(key, constants.unit_of(key, equation), low, widest, places, std)


def _stated(rig: Rig, equation: Equation, keys: Iterable[str]) -> Array:
    """The vector (SIZE,) of the constants `keys` as the rig states them, with an inertia J1 of 0 and no friction."""
    stated: dict[str, float] = {"axis.inertia": 1.0, "axis.gravity_torque": equation.value("gravity_torque")}
    stated |= {key: constant_value(rig, key)[0] for key in keys if key.startswith("drive.")}
    if rig.drive.motor is not None:
        stated["drive.motor.dead_zone.negative"], stated["drive.motor.dead_zone.positive"] = rig.drive.motor.dead_zone
    if rig.drive.wheel is not None:
        stated[WHEEL_TILT] = math.acos(rig.drive.wheel.along.value)
    base = vector(stated, equation.channel)
    base[A11] -= 1.0
    for term in equation.slots:
        add_term(base, term.term, equation.value(term.name), *term.at)
    return base
