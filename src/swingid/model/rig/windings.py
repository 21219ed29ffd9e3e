"""The constants of a motor from its windings: torque per volt and back-EMF by torque constant, resistance and gear."""

from __future__ import annotations

from collections.abc import Mapping

from pydantic import ValidationInfo
from pydantic_core import PydanticCustomError

from swingid.model.rig.fields import read_quantity, refuse
from swingid.uncertainty.uncertain import Uncertain
from swingid.units import Quantity

POWERS: dict[str, dict[str, int]] = {
    "torque_per_volt": {"gear_ratio": 1, "torque_constant": 1, "resistance": -1},
    "back_emf": {"gear_ratio": 2, "torque_constant": 2, "resistance": -1},
}
"""Powers of what the file states in what follows: N k/R and N² k²/R, with the current (u − k N q')/R."""

UNITS = {"torque_constant": "N*m/A", "resistance": "ohm", "gear_ratio": ""}


def without_unknown(raw: Mapping[str, object]) -> dict[str, object]:
    """The table [drive.motor] without constants that it states as "unknown"."""
    sought = [key for key in POWERS if raw.get(key) == "unknown"]
    return {key: value for key, value in raw.items() if key not in sought}


def of_windings(raw: Mapping[str, object], info: ValidationInfo) -> Mapping[str, object]:
    """The table [drive.motor] with torque_per_volt and back_emf where it states torque_constant and resistance.

    What has the wrong unit or sign stays, for its own field to refuse. Raises PydanticCustomError for one without the
    other, and for either beside what follows from them.
    """
    given = [key for key in ("torque_constant", "resistance") if key in raw]
    if not given:
        return raw
    for key in ("torque_constant", "resistance"):
        if key not in raw:
            refuse("missing-key", f"is missing beside {given[0]}: the torque per volt is their quotient", key)
    for key in POWERS:
        if key in raw:
            refuse("contradiction", "is given beside torque_constant; keep one", key)
    try:
        factors = {key: read_quantity(raw[key], info, unit) for key, unit in UNITS.items() if key in raw}
    except PydanticCustomError:
        return raw
    if any(not factor.value > 0 for factor in factors.values()):
        return raw
    return {**raw, **{key: _product(factors, powers) for key, powers in POWERS.items()}}


def _product(factors: Mapping[str, Quantity], powers: Mapping[str, int]) -> Quantity:
    """Product of powers of independent quantities; exact where all of them are."""
    product = Uncertain(1.0)
    for key, factor in factors.items():
        if key in powers:
            product *= factor.uncertain(key) ** powers[key]
    return Quantity.of(product)
