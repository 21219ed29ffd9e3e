"""Inertia and friction together, by least squares on the energies at mirrored nodes of all swings.

Every block of nodes around a turning point has its own constant of energy, so that only differences within it count:
that is every pass between any two of its nodes. On mirrored nodes ½ q1'² is even about the turning point and the work
of any friction odd in speed is odd, so the inertia hardly depends on the friction law; unlike (6), (7) neither B1 = B2
nor matched speeds are assumed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swingid.methods.energy.balance import Course, States
from swingid.model.equation import Equation
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.numerics.regression import block_covariance

BASIS = ("coulomb", "viscous", "quadratic", "offset", "viscous_even")
"""Odd friction c0 sgn v + c1 v + c2 v|v|, and even friction (what depends on the direction) 1 and |v|."""


@dataclass(frozen=True)
class NodeFit:
    """A fit of the balance on nodes, or a fixed rule on them as (6) and (7): linear in the known side either way.

    unknowns names the values ("inertia" first: a11 of the whole axis). influence (p, blocks · nodes): values =
    influence @ known side. covariance is of type A, None where it cannot be evaluated.
    residuals (blocks, nodes), J.
    """

    unknowns: tuple[str, ...]
    values: Array
    influence: Array
    covariance: Array | None
    residuals: Array

    def value(self, name: str) -> float:
        """Value of an unknown, 0 where it was not sought."""
        return float(self.values[self.unknowns.index(name)]) if name in self.unknowns else 0.0

    def u(self, name: str = "inertia") -> float:
        """Type A standard uncertainty of an unknown, NaN where it cannot be evaluated."""
        k = self.unknowns.index(name)
        return float("nan") if self.covariance is None else float(np.sqrt(self.covariance[k, k]))

    @property
    def a11(self) -> float:
        """Inertia of the whole axis, a11 = J1 + J2 + Jr."""
        return float(self.values[0])


def columns_at(states: States, equation: Equation, terms: tuple[str, ...]) -> dict[str, Array]:
    """Columns of the unknowns at the nodes, each (blocks, nodes)."""
    named = {"inertia": 0.5 * states.speed**2}
    if equation.seeks("gravity_torque"):
        named["gravity_torque"] = -states.height
    named |= {name: column for name, column in states.further.items() if equation.seeks(name)}
    return named | {name: states.friction[name] for name in terms}


def within_blocks(values: Array) -> Array:
    """Differences of values (..., blocks, nodes) from each block's mean, blocks and nodes in one row."""
    nodes = values.shape[-1]
    result: Array = values - (values.sum(axis=-1) / nodes)[..., None]
    return result.reshape(*values.shape[:-2], -1)


def fit_nodes(
    states: States, rig: Rig, equation: Equation, terms: tuple[str, ...] = BASIS, *, instruments: bool = False
) -> NodeFit:
    """Fit over all nodes with these terms of friction, see `fit_columns`."""
    return fit_columns(columns_at(states, equation, terms), states.known(rig, equation), instruments=instruments)


def fit_columns(columns: dict[str, Array], known: Array, *, instruments: bool = False) -> NodeFit:
    """Least squares over all nodes; columns and known side (blocks, nodes).

    instruments: the squared speed of the next turning point, at the same depths, is the instrument of that of each.
    Noise of the speeds lowers the inertia of least squares by its share of the power of the squared speed; it is
    independent from swing to swing, so not that of instrumental variables (Söderström and Stoica 1983). The covariance
    is from the scatter of blocks, of which neighbours may be correlated.
    """
    matrix = within_blocks(np.array(list(columns.values()))).T
    target = within_blocks(known)
    if instruments:
        next_one = np.append(np.arange(1, len(known)), len(known) - 2)
        others = matrix.copy()
        others[:, 0] = matrix[:, 0].reshape(known.shape)[next_one].ravel()
        influence = np.linalg.pinv(others.T @ matrix, rcond=1e-12) @ others.T
    else:
        influence = influence_of(matrix)
    values = influence @ target
    residuals = target - matrix @ values
    scores = (influence * residuals).reshape(len(columns), len(known), -1).sum(axis=2)
    covariance = block_covariance(scores, len(columns))
    return NodeFit(tuple(columns), values, influence, covariance, residuals.reshape(known.shape))


def influence_of(matrix: Array) -> Array:
    """Pseudo-inverse from the normal equations of the scaled columns: a third of the time of an SVD of all rows.

    Directions of less than 1e-6 of the largest singular value are dropped (the square is what is left of 16 digits).
    """
    scale = np.linalg.norm(matrix, axis=0)
    scale[scale == 0] = 1.0
    scaled = matrix / scale
    powers, directions = np.linalg.eigh(scaled.T @ scaled)
    inverse = np.where(powers > 1e-12 * powers[-1], 1 / np.maximum(powers, 1e-300), 0.0)
    result: Array = ((directions * inverse) @ directions.T @ scaled.T) / scale[:, None]
    return result


def sensor_variance(fit: NodeFit, states: States, course: Course, rig: Rig) -> float:
    """Variance of a11 from white noise of the angles, through the smoothed speeds and the turn of the wheel."""
    weights = fit.influence[0].reshape(states.instants.shape)
    axis, wheel, v1, v2 = course.axis, course.wheel, states.speed, states.wheel_speed
    if wheel is None:
        return _power(states.instants, weights * fit.a11 * v1, axis.half_width) * axis.noise**2
    a12, a22 = rig.drive.a12, rig.drive.a22
    of_axis = _power(states.instants, weights * (fit.a11 * v1 + a12 * v2), axis.half_width)
    of_wheel = _power(states.instants, weights * (a12 * v1 + a22 * v2), wheel.half_width)
    return of_axis * axis.noise**2 + of_wheel * wheel.noise**2


def slope_overlap(distance: Array) -> Array:
    """Correlation of the slopes of two local cubics whose centres are `distance` half-widths apart (white noise)."""
    d = np.abs(distance)
    near = 1.0 + d * (-1.5 + d * (-4.2 + d * (5.5 + d * d * (-1.3125 + d * d * 0.13125))))
    return np.where(d < 2.0, near, 0.0)


def _power(instants: Array, weights: Array, half_width: float) -> float:
    """Variance of Σ weights · slope within blocks (rows), for slopes of unit variance; instants rise in a row."""
    total = float(np.sum(weights**2))
    for lag in range(1, instants.shape[1]):
        distance = (instants[:, lag:] - instants[:, :-lag]) / half_width
        if not np.any(distance < 2.0):
            break
        total += 2.0 * float(np.sum(weights[:, lag:] * weights[:, :-lag] * slope_overlap(distance)))
    return total
