"""Type A uncertainty of a fit of filtered rows: the sensors' noise through filter and fit, and lack of fit."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from swingid.balance.rows import Rows
from swingid.methods.equation_error.fit import RowFit
from swingid.methods.equation_error.grid import curvature
from swingid.methods.equation_error.regressors import Regressors
from swingid.methods.equation_error.rows import RowFilter, autocorrelation
from swingid.model.equation import Equation
from swingid.model.terms import stated_stiffness
from swingid.numerics.arrays import Array
from swingid.numerics.regression import parzen
from swingid.preparation.noise import Noise
from swingid.uncertainty.dark import dark_uncertainty
from swingid.uncertainty.freedom import effective_freedom, scatter_freedom


@dataclass(frozen=True)
class Fitted:
    """A fit of filtered rows with its filter, its rows, and what its uncertainty depends on.

    lag: of the instruments in rows (0: least squares). reach: rows up to which correlation is taken into account.
    stiffness: b, known or fitted, N m (0 on a linear axis).
    """

    fit: RowFit
    row_filter: RowFilter
    regressors: Regressors
    rows: Rows
    lag: int
    reach: int
    stiffness: float
    equation: Equation
    noise: Noise

    def variance(self, own: Array) -> float:
        """Type A variance of a combination of the unknowns: of white noise of both angles, and of the lack of fit.

        The scatter of the rows over a finite time also contains power of the differentiated noise at frequencies beside
        the motion's. The expected power of the noise there is subtracted, and one standard deviation of it: the
        difference is never negative, so its fluctuation would widen it.
        """
        key = own.tobytes()
        if key not in self._variances:
            self._variances[key] = self._variance(own)
        return self._variances[key]

    def _variance(self, own: Array) -> float:
        weights = own @ self.fit.fit.influence
        seen = float(own @ self.fit.covariance @ own)
        smeared = float(self._lagged @ autocorrelation(weights, self.reach))
        # number of independent stretches of a Parzen kernel, as in `hac_covariance`
        chance = smeared * np.sqrt(2 * (self.reach + 1) / (1.85 * np.count_nonzero(self.fit.weights)))
        return float(self._white(own) + max(seen - smeared - chance, 0.0))

    def freedom(self, own: Array) -> float:
        """Degrees of freedom of `variance`: those of its part beyond the white noise of both angles."""
        weights = own @ self.fit.fit.influence
        white = self._white(own)
        rows = scatter_freedom(weights, parzen(self.reach), len(self.fit.unknowns))
        beyond = max(self.variance(own) - white, 0.0)
        return effective_freedom(((white**0.5, math.inf), (beyond**0.5, rows)))

    @cached_property
    def _pull(self) -> Array:
        """Stiffness of gravity and of the terms that the rig states, at every row of the grid (N m/rad or N/m)."""
        stated = stated_stiffness(self.equation.further, self.row_filter.grid.angle)
        return np.asarray(self.stiffness * self.regressors.cosine + stated)

    @cached_property
    def _variances(self) -> dict[bytes, float]:
        """`variance` of combinations of the unknowns, as far as needed."""
        return {}

    @cached_property
    def _of_grid(self) -> dict[str, Array]:
        """`grid_effects` by the names of the unknowns, as far as needed."""
        return {}

    @cached_property
    def _of_unknown(self) -> dict[int, tuple[Array, Array]]:
        """`_per_sample` of single unknowns, by their numbers, as far as needed."""
        return {}

    def _white(self, own: Array) -> float:
        """Variance of a combination of the unknowns from white noise of both angles."""
        axis, wheel = self._per_sample(own)
        return float(axis @ axis + wheel @ wheel)

    def _per_sample(self, own: Array) -> tuple[Array, Array]:
        """Contribution of the noise of each sample of both angles to a combination of the unknowns, as deviations."""
        grid, kept = self.row_filter.grid, self._of_unknown
        for k in map(int, np.flatnonzero(own)):
            if k not in kept:
                spread = self.row_filter.adjoint(self.fit.fit.influence[k])
                curved = curvature(spread, grid.step)
                axis = self.fit.a11 * curved + self._pull * spread
                kept[k] = axis * self.noise.angle, curved * (self.equation.value("wheel") * self.noise.wheel)
        (first, *others) = ((own[k], *kept[k]) for k in map(int, np.flatnonzero(own)))
        axis, wheel = first[0] * first[1], first[0] * first[2]
        for weight, more, turn in others:
            axis, wheel = axis + weight * more, wheel + weight * turn
        return axis, wheel

    @cached_property
    def _lagged(self) -> Array:
        """Weights of the autocorrelation of a row's influence in the variance by white noise, lags 0 to `reach`."""
        found, (curved, spread, both) = np.zeros(self.reach + 1), self.row_filter.correlations
        near = min(len(curved), len(found))
        pull, inertia, wheel = float(np.mean(self._pull)), self.fit.a11, self.equation.value("wheel") * self.noise.wheel
        axis = inertia**2 * curved[:near] + pull**2 * spread[:near] + 2 * inertia * pull * both[:near]
        found[:near] = self.noise.angle**2 * axis + wheel**2 * curved[:near]
        return np.where(np.arange(len(found)) == 0, 1.0, 2.0) * parzen(self.reach) * found

    def common(self, unknown: str = "inertia") -> dict[str, float]:
        """Errors of an unknown that are common to all rows, by source."""
        found, k = {}, self.fit.unknowns.index(unknown)
        if self.lag == 0:
            share = abs(float(self.fit.inverse[k, 0] / self.fit.inverse[0, 0])) if k else 1.0
            found["noise in the acceleration (least squares)"] = abs(self.fit.a11) * self.attenuation * share
        if self.noise.resolution > 0:
            found["place of the encoder's grid"] = rms(self.grid_effects(unknown))
        return found

    @cached_property
    def attenuation(self) -> float:
        """Share by which white noise of the angle in its own regressor lowers the inertia of least squares."""
        _, response = self.row_filter.response
        variance = self.noise.angle**2 * float(response @ response)
        return float(variance * self.fit.weights.sum() * self.fit.inverse[0, 0])

    def grid_effects(self, unknown: str = "inertia") -> Array:
        """Errors of an unknown at eight grid phases of the encoder (`systematics.grid_spread`).

        They repeat at every swing, so those of the instruments are correlated with those of the row.
        """
        if unknown not in self._of_grid:
            self._of_grid[unknown] = abs(self.fit.a11) * self._grid_errors(self.fit.unknowns.index(unknown))
        return self._of_grid[unknown]

    def _grid_errors(self, k: int) -> Array:
        """The same as shares of a11, of unknown k."""
        influence, resolution = self.fit.fit.influence[k], self.noise.resolution
        if self.lag == 0:
            result: Array = self.regressors.grid_columns(resolution) @ self.row_filter.weights(influence) * resolution
            return result
        errors = self.regressors.grid_errors(self.row_filter, resolution)
        pairs = self.fit.weights[self.lag :] * errors[:, self.lag :] * errors[:, : -self.lag]
        return np.asarray(errors @ influence + self.fit.inverse[k, 0] * pairs.sum(axis=1))

    def spread(self, unknown: str) -> float:
        """Standard uncertainty of an unknown from the scatter, the sensors' noise and the grid phase."""
        own = np.eye(len(self.fit.unknowns))[self.fit.unknowns.index(unknown)]
        grid = rms(self.grid_effects(unknown)) if self.noise.resolution > 0 else 0.0
        return float(np.hypot(np.sqrt(self.variance(own)), grid))

    def relative(self) -> float:
        """Standard uncertainty of a11 by the sensors, lack of fit and attenuation, as a share of its magnitude."""
        own = abs(self.fit.a11)
        return float(np.hypot(self.spread("inertia"), own * self.attenuation)) / max(own, 1e-300)

    def contradicted(self, other: Fitted) -> float:
        """Dark uncertainty by the difference to another fit of the same log, beyond what explains it.

        That is the noise of the sensors, or the difference of the variances (Hausman 1978), which has the lack of fit.
        """
        own, others = (one.variance(np.eye(len(one.fit.unknowns))[0]) for one in (self, other))
        variance = max(self.variance_of_difference(other), abs(own - others))
        return dark_uncertainty(other.fit.a11 - self.fit.a11, variance, float(np.sqrt(own)))

    def variance_of_difference(self, other: Fitted) -> float:
        """Variance of the difference of a11 to another fit of the same log, from the sensors.

        Both fits are linear in the same noise, so its effect on their difference is known, that of the grid too.
        """
        mine, theirs = (one._per_sample(np.eye(len(one.fit.unknowns))[0]) for one in (self, other))
        variance = sum(float((a - b) @ (a - b)) for a, b in zip(mine, theirs, strict=True))
        if self.lag == 0:
            variance += (self.fit.a11 * (self.attenuation - other.attenuation)) ** 2
        if self.noise.resolution > 0:
            variance += rms(self.grid_effects() - other.grid_effects()) ** 2
        return variance


def rms(values: Array) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(values**2)))
