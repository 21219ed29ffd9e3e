"""A body with a tensor on an axis: the rig with which the twin swings it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from swingid.errors import UsageError
from swingid.model.rig import Rig
from swingid.model.rig.gravity import UNKNOWN_PLACE
from swingid.numerics.arrays import Array


def inertia_about(
    tensor: Array, mass: float, centre_of_mass: Sequence[float], direction: Sequence[float], point: Sequence[float]
) -> tuple[float, float]:
    """Inertia (kg m²) about an axis along `direction` through `point`, and distance (m) of the centre of mass from it.

    tensor (3, 3): about the centre of mass; all in the body frame.
    """
    n = np.asarray(direction, dtype=np.float64)
    n = n / np.linalg.norm(n)
    off = np.cross(n, np.asarray(centre_of_mass, dtype=np.float64) - np.asarray(point, dtype=np.float64))
    d = float(np.linalg.norm(off))
    return float(n @ np.asarray(tensor) @ n) + mass * d**2, d


def rig_about(
    rig: Rig,
    tensor: Array,
    mass: float,
    centre_of_mass: Sequence[float],
    direction: Sequence[float],
    point: Sequence[float] = (0.0, 0.0, 0.0),
    gravity: float = UNKNOWN_PLACE.value,
) -> Rig:
    """The rig with the body on its horizontal axis: what `axis` has of its own stays, as that of the fixture.

    tensor (3, 3) (kg m²) about the centre of mass (m), direction of the axis and a point on it (m) in the body frame.
    The body hangs with its centre of mass below the axis, as does the fixture's. Raises UsageError for a linear axis,
    and InputError for values that no rig file takes.
    """
    if rig.axis.kind != "rotary":
        raise UsageError("a body with a tensor needs a rotary axis", code="linear-axis")
    inertia, d = inertia_about(tensor, mass, centre_of_mass, direction, point)
    stated = rig.axis.inertia.value if rig.axis.inertia is not None else 0.0
    torque = getattr(rig.axis.gravity_torque, "value", 0.0)
    return rig.changed({"axis.inertia": stated + inertia, "axis.gravity_torque": torque + mass * gravity * d})
