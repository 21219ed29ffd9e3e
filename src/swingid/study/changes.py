"""A rig with some of its values changed, as plans and faults write it: new values, multiples, keys taken away."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from swingid.errors import InputError
from swingid.model.rig import Rig
from swingid.model.terms import stated_at
from swingid.units import Quantity

ABSENT = "absent"
"""The value that takes a key of the rig away."""


@dataclass(frozen=True)
class Times:
    """A multiple of what is stated at a key."""

    factor: float


def changed(rig: Rig, values: Mapping[str, Any]) -> Rig:
    """The rig with values at dotted keys; "absent" takes a key away, `Times` multiplies what is stated."""
    if not values:
        return rig
    return rig.changed({key: _value(rig, key, value) for key, value in values.items()})


def _value(rig: Rig, key: str, value: Any) -> Any:
    if value == ABSENT:
        return None
    if not isinstance(value, Times):
        return value
    stated = stated_at(rig, key)
    if isinstance(stated, Quantity):
        return Quantity(stated.value * value.factor, stated.std)
    several: Any = rig
    for part in key.split("."):
        several = getattr(several, part, None)
    if isinstance(several, tuple):
        return [value.factor * number for number in several]
    raise InputError(f"{key} is not stated as a number, so there is no multiple of it", code="wrong-value")
