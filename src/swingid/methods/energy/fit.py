"""Inertia and friction together, by least squares on the energies at mirrored nodes of all swings.

Every block of nodes around a turning point has its own constant of energy, so that only differences within it count:
that is every pass between any two of its nodes. On mirrored nodes ½ q1'² is even about the turning point and the work
of any friction odd in speed is odd, so the inertia hardly depends on the friction law; unlike (6), (7) neither B1 = B2
nor matched speeds are assumed.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from swingid.balance.fits import BASIS, NamedFit, columns_of, known_side
from swingid.methods.energy.balance import PassRows
from swingid.model.equation import Equation
from swingid.numerics.arrays import Array
from swingid.numerics.regression import block_covariance, fit_linear, fit_oblique

SMALLEST = 1e-6
"""Least singular value of the scaled columns, as a share of the largest, of a direction that is identifiable."""


@dataclass(frozen=True)
class PassFit(NamedFit):
    """A fit of the balance on nodes, or a fixed rule on them as (6) and (7): linear in the known side either way.

    The covariance is NaN where it cannot be evaluated; residuals (blocks · nodes,) in J.
    """

    rows: PassRows

    @property
    def has_scatter(self) -> bool:
        """Return whether the covariance could be evaluated."""
        return bool(np.isfinite(self.covariance[0, 0]))

    @cached_property
    def sensor(self) -> float:
        """Variance of a11 from white noise of the angles, through the smoothed speeds and the turn of the wheel."""
        rows, of = self.rows, self.coefficients
        axis, wheel, v1, v2 = rows.course.axis, rows.course.wheel, rows.speed, rows.wheel_speed
        a11, a12, a22 = of["inertia"], of.get("wheel", 0.0), of.get("wheel_inertia", 0.0)
        variance = _power(rows, self.fit.influence[0] * (a11 * v1 + a12 * v2), axis.half_width) * axis.noise**2
        if wheel is None:
            return variance
        return variance + _power(rows, self.fit.influence[0] * (a12 * v1 + a22 * v2), wheel.half_width) * wheel.noise**2


def fit_passes(
    rows: PassRows, equation: Equation, terms: tuple[str, ...] = BASIS, *, instruments: bool = False
) -> PassFit:
    """Least squares over all nodes, with these terms of friction.

    instruments: the squared speed of the next turning point, at the same depths, is the instrument of that of each.
    Noise of the speeds lowers the inertia of least squares by its share of the power of the squared speed; it is
    independent from swing to swing, so not that of instrumental variables (Söderström and Stoica 1983). The covariance
    is from the scatter of blocks, of which neighbours may be correlated.
    """
    unknowns, columns = columns_of(rows, equation, terms)
    matrix, target = rows.within(columns.T).T, rows.within(known_side(rows, equation))
    if instruments:
        blocks, others = len(rows.instants), matrix.copy()
        others[:, 0] = rows.blocks(matrix[:, 0])[np.append(np.arange(1, blocks), blocks - 2)].ravel()
        fit, _ = fit_oblique(matrix, target, others, smallest=SMALLEST)
    else:
        fit = fit_linear(matrix, target, smallest=SMALLEST)
    scores = rows.blocks(fit.influence * fit.residuals).sum(axis=2)
    return PassFit(unknowns, fit, block_covariance(scores, len(unknowns)), rows, equation)


def slope_overlap(distance: Array) -> Array:
    """Correlation of the slopes of two local cubics whose centres are `distance` half-widths apart (white noise)."""
    d = np.abs(distance)
    near = 1.0 + d * (-1.5 + d * (-4.2 + d * (5.5 + d * d * (-1.3125 + d * d * 0.13125))))
    return np.where(d < 2.0, near, 0.0)


def _power(rows: PassRows, weights: Array, half_width: float) -> float:
    """Variance of Σ weights · slope within blocks, for slopes of unit variance; instants rise in a block."""
    instants, weights = rows.instants, rows.blocks(weights)
    total = float(np.sum(weights**2))
    for lag in range(1, instants.shape[1]):
        distance = (instants[:, lag:] - instants[:, :-lag]) / half_width
        if not np.any(distance < 2.0):
            break
        total += 2.0 * float(np.sum(weights[:, lag:] * weights[:, :-lag] * slope_overlap(distance)))
    return total
