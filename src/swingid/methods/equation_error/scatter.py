"""Type A uncertainty of a fit of filtered rows: the sensors' noise through filter and fit, and lack of fit."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from swingid.balance.rows import Rows
from swingid.methods.equation_error.cutoff import SETTLING
from swingid.methods.equation_error.fit import RowFit
from swingid.methods.equation_error.grid import STENCIL, curvature
from swingid.methods.equation_error.rows import RowFilter
from swingid.model.terms import stated_stiffness
from swingid.numerics.arrays import Array
from swingid.numerics.regression import parzen
from swingid.preparation.motion import Motion
from swingid.preparation.noise import Noise
from swingid.preparation.scale import Scale
from swingid.uncertainty.dark import dark_uncertainty
from swingid.uncertainty.freedom import effective_freedom, scatter_freedom

GRID_PHASES = 8


@dataclass(frozen=True)
class Fitted:
    """A fit of filtered rows with its filter, its rows, and what its uncertainty depends on.

    lag: of the instruments in rows (0: least squares). reach: rows up to which correlation is taken into account.
    stiffness: b, known or fitted, N m (0 on a linear axis).
    """

    fit: RowFit
    row_filter: RowFilter
    rows: Rows
    lag: int
    reach: int
    stiffness: float
    scale: Scale
    noise: Noise

    def variance(self, own: Array) -> float:
        """Type A variance of a combination of the unknowns: of white noise of both angles, and of the lack of fit.

        The scatter of the rows over a finite time also contains power of the differentiated noise at frequencies beside
        the motion's. The expected power of the noise there is subtracted, and one standard deviation of it: the
        difference is never negative, so its fluctuation would widen it.
        """
        weights = own @ self.fit.fit.influence
        seen = float(own @ self.fit.covariance @ own)
        lags = zip(parzen(self.reach), self._autocovariance, strict=True)
        smeared = sum(
            (1.0 if k == 0 else 2.0) * kernel * noise * float(weights[k:] @ weights[: len(weights) - k])
            for k, (kernel, noise) in enumerate(lags)
        )
        # number of independent stretches of a Parzen kernel, as in `hac_covariance`
        chance = smeared * np.sqrt(2 * (self.reach + 1) / (1.85 * np.count_nonzero(self.fit.weights)))
        return float(self._white(weights) + max(seen - smeared - chance, 0.0))

    def freedom(self, own: Array) -> float:
        """Degrees of freedom of `variance`: those of its part beyond the white noise of both angles."""
        weights = own @ self.fit.fit.influence
        white = self._white(weights)
        rows = scatter_freedom(weights, parzen(self.reach), len(self.fit.unknowns))
        beyond = max(self.variance(own) - white, 0.0)
        return effective_freedom(((white**0.5, math.inf), (beyond**0.5, rows)))

    @property
    def _pull(self) -> Array:
        """Stiffness of gravity and of the terms that the rig states, at every row of the grid (N m/rad or N/m)."""
        angle = self.row_filter.grid.angle
        return np.asarray(self.stiffness * np.cos(angle) + stated_stiffness(self.scale.further, angle))

    def _white(self, weights: Array) -> float:
        """Variance of Σ weights · row from white noise of both angles."""
        axis, wheel = self._per_sample(weights)
        return float(axis @ axis + wheel @ wheel)

    def _per_sample(self, weights: Array) -> tuple[Array, Array]:
        """Contribution of the noise of each sample of both angles to Σ weights · row, as standard deviations."""
        grid = self.row_filter.grid
        spread = self.row_filter.adjoint(weights)
        curved = curvature(spread, grid.step)
        axis = self.fit.a11 * curved + self._pull * spread
        return axis * self.noise.angle, curved * (self.scale.a12 * self.noise.wheel)

    @cached_property
    def _autocovariance(self) -> Array:
        """Covariance by white noise of both angles of rows 0 to `reach` apart."""
        every = self.row_filter.every
        spread, curved = self._responses
        axis = self.fit.a11 * curved + float(np.mean(self._pull)) * spread
        result = np.zeros(self.reach + 1)
        for k in range(min(self.reach, len(curved) // every) + 1):
            late = slice(k * every, None), slice(None, len(curved) - k * every)
            wheel = (self.scale.a12 * self.noise.wheel) ** 2 * float(curved[late[0]] @ curved[late[1]])
            result[k] = wheel + self.noise.angle**2 * float(axis[late[0]] @ axis[late[1]])
        return result

    @property
    def _responses(self) -> tuple[Array, Array]:
        """Weights of one row on the samples of an angle around it, and on those of its second derivative."""
        row_filter = self.row_filter
        weights = np.zeros(len(row_filter.instants))
        weights[len(weights) // 2] = 1.0
        spread = row_filter.adjoint(weights)
        curved = curvature(spread, row_filter.grid.step)
        middle = STENCIL + len(weights) // 2 * row_filter.every
        reach = int(2 * SETTLING / (row_filter.cutoff.frequency * row_filter.grid.step))
        near = slice(max(middle - reach, 0), middle + reach)
        return spread[near], curved[near]

    def common(self, motion: Motion, unknown: str = "inertia") -> dict[str, float]:
        """Errors of an unknown that are common to all rows, by source."""
        found, k = {}, self.fit.unknowns.index(unknown)
        if self.lag == 0:
            share = abs(float(self.fit.inverse[k, 0] / self.fit.inverse[0, 0])) if k else 1.0
            found["noise in the acceleration (least squares)"] = abs(self.fit.a11) * self.attenuation * share
        if self.noise.resolution > 0:
            found["place of the encoder's grid"] = rms(self.grid_effects(motion, unknown))
        return found

    @property
    def attenuation(self) -> float:
        """Share by which white noise of the angle in its own regressor lowers the inertia of least squares."""
        _, response = self._responses
        variance = self.noise.angle**2 * float(response @ response)
        return float(variance * self.fit.weights.sum() * self.fit.inverse[0, 0])

    def grid_effects(self, motion: Motion, unknown: str = "inertia") -> Array:
        """Errors of an unknown at eight grid phases of the encoder (`systematics.grid_spread`).

        They repeat at every swing, so those of the instruments are correlated with those of the row.
        """
        grid, speed, step = self.row_filter.grid, motion.speed, self.noise.resolution
        k = self.fit.unknowns.index(unknown)
        smooth = speed.angle_at(np.clip(grid.time, speed.grid[0], speed.grid[-1]))
        shifted = smooth / step + np.arange(GRID_PHASES)[:, None] / GRID_PHASES
        errors = self.row_filter(*(curvature(x, grid.step) for x in (np.round(shifted) - shifted) * step))
        effects = errors @ self.fit.fit.influence[k]
        if self.lag > 0:
            pairs = self.fit.weights[self.lag :] * errors[:, self.lag :] * errors[:, : -self.lag]
            effects = effects + self.fit.inverse[k, 0] * pairs.sum(axis=1)
        result: Array = abs(self.fit.a11) * effects
        return result

    def spread(self, unknown: str, motion: Motion) -> float:
        """Standard uncertainty of an unknown from the scatter, the sensors' noise and the grid phase."""
        own = np.eye(len(self.fit.unknowns))[self.fit.unknowns.index(unknown)]
        grid = rms(self.grid_effects(motion, unknown)) if self.noise.resolution > 0 else 0.0
        return float(np.hypot(np.sqrt(self.variance(own)), grid))

    def relative(self, motion: Motion) -> float:
        """Standard uncertainty of a11 by the sensors, lack of fit and attenuation, as a share of its magnitude."""
        own = abs(self.fit.a11)
        return float(np.hypot(self.spread("inertia", motion), own * self.attenuation)) / max(own, 1e-300)

    def contradicted(self, other: Fitted, motion: Motion) -> float:
        """Dark uncertainty by the difference to another fit of the same log, beyond what explains it.

        That is the noise of the sensors, or the difference of the variances (Hausman 1978), which has the lack of fit.
        """
        own, others = (one.variance(np.eye(len(one.fit.unknowns))[0]) for one in (self, other))
        variance = max(self.variance_of_difference(other, motion), abs(own - others))
        return dark_uncertainty(other.fit.a11 - self.fit.a11, variance, float(np.sqrt(own)))

    def variance_of_difference(self, other: Fitted, motion: Motion) -> float:
        """Variance of the difference of a11 to another fit of the same log, from the sensors.

        Both fits are linear in the same noise, so its effect on their difference is known, that of the grid too.
        """
        mine, theirs = (one._per_sample(one.fit.fit.influence[0]) for one in (self, other))
        variance = sum(float((a - b) @ (a - b)) for a, b in zip(mine, theirs, strict=True))
        if self.lag == 0:
            variance += (self.fit.a11 * (self.attenuation - other.attenuation)) ** 2
        if self.noise.resolution > 0:
            variance += rms(self.grid_effects(motion) - other.grid_effects(motion)) ** 2
        return variance


def rms(values: Array) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(values**2)))
