"""The gravity torque of a body that was weighed: mass times lever times the acceleration of free fall."""

from __future__ import annotations

import math
from collections.abc import Mapping

from pydantic import ValidationInfo
from pydantic_core import PydanticCustomError

from swingid.model.rig.fields import read_quantity, refuse
from swingid.uncertainty.uncertain import Uncertain
from swingid.units import Quantity

UNKNOWN_PLACE = Quantity(9.80665, 0.015)
"""Acceleration of free fall (m/s²) where nothing is stated of the place: on the ground it is 9.780 to 9.833."""

NORMAL_GRAVITY = 1e-3
"""Standard deviation (m/s²) of free fall from normal gravity at sea level: heights to 600 m, anomalies of 5e-4."""


def normal_gravity(latitude: float) -> float:
    """Normal gravity (m/s²) at a geodetic latitude (rad) and sea level, by Somigliana's formula for GRS 80.

    H. Moritz, Geodetic Reference System 1980, Journal of Geodesy 74 (2000) 128.
    """
    square = math.sin(latitude) ** 2
    return 9.7803267715 * (1 + 0.001931851353 * square) / math.sqrt(1 - 0.00669438002290 * square)


KEYS = ("mass", "lever", "centre_of_mass", "g", "latitude")


def weighed(raw: Mapping[str, object], info: ValidationInfo) -> Mapping[str, object]:
    """The table [axis] with the gravity torque that its mass and lever give; as it is where it states none of `KEYS`.

    What has the wrong unit or sign stays, for its own field to refuse. Raises PydanticCustomError for keys that
    contradict one another or are missing.
    """
    given = [key for key in KEYS if key in raw]
    if not given:
        return raw
    for first, second in (("gravity_torque", given[0]), ("lever", "centre_of_mass"), ("g", "latitude")):
        if first in raw and second in raw:
            refuse("contradiction", f"is given beside axis.{second}; keep one", first)
    lever = "centre_of_mass" if "centre_of_mass" in raw else "lever"
    for key in ("mass", lever):
        if key not in raw:
            refuse("missing-key", f"is missing beside {given[0]}: the gravity torque is mass times lever times g", key)
    units = {"mass": "kg", lever: "m", "g": "m/s^2"}
    try:
        factors = {key: read_quantity(raw[key], info, unit) for key, unit in units.items() if key in raw}
        if "latitude" in raw:
            latitude = read_quantity(raw["latitude"], info, "rad").value
            factors["g"] = Quantity(normal_gravity(latitude), NORMAL_GRAVITY)
    except PydanticCustomError:
        return raw
    factors.setdefault("g", UNKNOWN_PLACE)
    product = Uncertain(1.0)
    for key, factor in factors.items():
        product *= factor.uncertain(f"axis.{key}")
    if any(factor.value < 0 for factor in factors.values()) or not math.isfinite(product.value):
        return raw
    return {**raw, "gravity_torque": Quantity.of(product)}


def in_place_of_weighing(values: Mapping[str, object]) -> dict[str, object]:
    """Changes of a rig (see `Rig.changed`), where a gravity torque takes the place of mass, lever and free fall."""
    if values.get("axis.gravity_torque") is None:
        return dict(values)
    return {**{f"axis.{key}": None for key in KEYS}, **values}
