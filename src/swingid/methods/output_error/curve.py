"""The friction law of a fit as a curve over speed."""

from __future__ import annotations

import numpy as np

from swingid.balance.friction_laws import TERMS, stribeck_peak, stribeck_slope
from swingid.methods.output_error.search import Searched
from swingid.methods.output_error.unknowns import FRICTION, Unknowns
from swingid.model.friction import static_curve
from swingid.model.parameters import COULOMB_N, STATIC_N
from swingid.numerics.arrays import Array
from swingid.result.result import FrictionCurve

KNOTS = 12
"""Speeds of the curve on each side."""


def friction_curve(searched: Searched, covariance: Array, fastest: float, law: str) -> FrictionCurve:
    """The fitted law up to the speed `fastest`, with uncertainties from the unknowns' covariance (m, m) of type A."""
    unknowns, values = searched.unknowns, searched.fit.values
    p = unknowns.vector(values)
    side = fastest * np.linspace(0, 1, KNOTS) ** 1.5
    side[0] = 1e-6 * fastest
    speeds = np.concatenate([-side[::-1], side])
    torques = np.array([static_curve(v, p) for v in speeds])
    slopes = np.zeros((len(speeds), len(unknowns)))
    p_speed = _peak_speed(unknowns, values)
    up = speeds > 0
    shapes = {name: term(speeds) for name, term in TERMS.items()}
    if p_speed:
        shapes["stribeck"] = stribeck_peak(speeds, p_speed)
        shapes["stribeck_speed"] = (p[STATIC_N] - p[COULOMB_N]) * stribeck_slope(speeds, p_speed)
    for side_name, here in (("positive", up), ("negative", ~up)):
        shapes |= {f"{name}_{side_name}": np.where(here, shapes[name], 0.0) for name in ("coulomb", "viscous")}
    for k, name in enumerate(unknowns.names):
        if name in FRICTION:
            slopes[:, k] = shapes[name]
    spread = np.sqrt(np.maximum(np.einsum("ni,ij,nj->n", slopes, covariance, slopes), 0.0))
    return FrictionCurve(speeds, torques, spread, law, torques, searched.candidates)


def _peak_speed(unknowns: Unknowns, values: Array) -> float:
    return float(values[unknowns.names.index("stribeck_speed")]) if "stribeck_speed" in unknowns.names else 0.0
