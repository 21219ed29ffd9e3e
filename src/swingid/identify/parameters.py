"""From fitted terms of friction to the friction parameters of rig.toml."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from swingid.identify.friction import FrictionLaw

Array = NDArray[np.float64]


def friction_units(linear: bool) -> dict[str, str]:
    """Unit of each friction parameter of a rotary or linear axis."""
    torque, speed = ("N", "m/s") if linear else ("N m", "rad/s")
    viscous = "N s/m" if linear else "N m s"
    quadratic = "N s^2/m^2" if linear else "N m s^2"
    units = dict.fromkeys(("coulomb", "coulomb_positive", "coulomb_negative", "static", "offset"), torque)
    units |= dict.fromkeys(("viscous", "viscous_positive", "viscous_negative"), viscous)
    cubic = "N s^3/m^3" if linear else "N m s^3"
    return units | {"quadratic": quadratic, "cubic": cubic, "stribeck_speed": speed}


def friction_parameters(law: FrictionLaw) -> dict[str, Array]:
    """Weights of each friction parameter on the terms of the law: parameter = weights @ law.values.

    A direction-dependent law c0 sgn v + c1 v + d0 + d1 |v| has coulomb_positive = c0 + d0, coulomb_negative =
    c0 − d0, viscous_positive = c1 + d1, viscous_negative = c1 − d1.
    """
    unit = {term: np.eye(len(law.terms))[k] for k, term in enumerate(law.terms)}
    nothing = np.zeros(len(law.terms))
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
    weights |= {name: unit[name] for name in ("quadratic", "cubic") if name in unit}
    if "offset" in unit and not (directed and "coulomb" in unit):
        weights["offset"] = unit["offset"]
    return weights
