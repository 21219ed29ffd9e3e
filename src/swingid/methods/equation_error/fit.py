"""Weighted least squares or instrumental variables on filtered rows, with uncertainties that account for the filter.

Least squares is biased where the regressors are noisy: by the share of noise in the power of the acceleration. White
noise of the sensors is the least of it: a camera's is correlated between frames, and the residuals show all of it. If
all their power is noise of the acceleration, a11 (1 + s) has no bias, s = residuals² / (a11 q1'')²: that is the
regression of the acceleration on the other side, and least squares and it bound the inertia (Frisch 1934, "Statistical
Confluence Analysis by means of Complete Regression Systems"). Which share of the residuals it is, a higher cut-off
shows, for there s is larger (`noise_share`); X'W X less that noise gives values without the bias (bias-compensated
least squares; Stoica and Söderström 1982, "Bias correction in least-squares identification").

Instruments remove the bias: the same regressors some time earlier, Σ z_k (y_k − x_k θ) = 0 with z_k = x_(k−lag). The
lag is longer than the impulse response of the filter, so the noise of the two is independent; and it points to the
past, so that the response of a controller to that noise is not in the instruments either. Of such lags the one of least
variance is taken. Regressors of the direction of motion, as Coulomb friction, have no noise and are their own
instruments. (Delayed signals as instruments: Söderström and Stoica 1983, "Instrumental Variable Methods for System
Identification". In robotics, Janot, Vandanjon and Gautier 2014, instruments are simulated; for equation (I) that takes
a controller, which is unknown, or the measured wheel angle as input, whose noise is not independent.)
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from swingid.balance.fits import WindowFit, columns_of, known_side
from swingid.balance.friction_laws import Law
from swingid.balance.reversals import IMPULSES
from swingid.errors import UnanswerableError
from swingid.methods.equation_error.cutoff import SETTLING
from swingid.methods.equation_error.filtered import OnGrid, RowFilter, autocorrelation
from swingid.numerics.arrays import Array, Bools, median
from swingid.numerics.regression import fit_oblique, hac_covariance, parzen
from swingid.uncertainty.dark import dark_uncertainty
from swingid.uncertainty.freedom import effective_freedom, scatter_freedom

ROBUST = 5.0
"""Robust standard deviations of a residual beyond which its row weighs less (Huber)."""

ROWS_PER_UNKNOWN = 5
"""Least rows per unknown: as many as a period of the cut-off has, in which two are independent."""

ROUNDS = 4
"""Of Huber's weights, at most: eight more change no inertia of 38 foreign logs by more than 1e-3 u."""

LAGS_TRIED = 40
"""Lags in that range: the best is missed by an 80th of a period at most, where instruments lose cos(2π/80), 0.3 %."""

EARLIER = 0.75
"""Least lag of the instruments in half periods, within which a controller has responded to the noise."""

LAGS = 1.0
"""Range, in periods of the motion, in which the lag of the instruments is sought."""

OF_DIRECTION = ("coulomb", "stribeck", "stribeck_speed", "offset", *IMPULSES)
"""Regressors of the direction of motion: without noise except at the reversals, so their own instruments."""


@dataclass(frozen=True)
class Combination:
    """What the type A variance of a combination of the unknowns of a fit is made of.

    influence (rows,): of the rows. per_sample (2, n): contribution of the noise of each sample of both angles. beyond:
    variance by lack of fit, that of the scatter beyond white noise. grid (8,): errors at eight grid phases.
    """

    influence: Array
    per_sample: Array
    beyond: float
    grid: Array

    @property
    def white(self) -> float:
        """Variance by white noise of both angles."""
        return float(np.vdot(self.per_sample, self.per_sample))

    @property
    def variance(self) -> float:
        """Type A variance."""
        return self.white + self.beyond

    @property
    def spread(self) -> float:
        """Standard uncertainty from the scatter, the sensors' noise and the grid phase."""
        return float(np.hypot(np.sqrt(self.variance), rms(self.grid)))


@dataclass(frozen=True, kw_only=True)
class RowFit(WindowFit):
    """A fit of filtered rows, with what its uncertainty depends on.

    weights (rows,): of the rows, 0 where they are not used. inverse (p, p): of Z'W X. lag: of the instruments in rows
    (0: least squares). reach: rows up to which correlation is taken into account. compensated: share of a11 by which
    the bias of noise in the acceleration was corrected. unsure: standard uncertainty of that, None before.
    """

    weights: Array
    inverse: Array
    lag: int
    reach: int
    row_filter: RowFilter
    part: OnGrid
    compensated: float = 0.0
    unsure: float | None = None

    @property
    def of_used(self) -> WindowFit:
        """The rows used and their fit as one on windows, for the checks in common with momentum."""
        used = self.weights > 0
        fit = replace(self.fit, residuals=self.fit.residuals[used], influence=self.fit.influence[:, used])
        rows = self.rows.select(used)
        return WindowFit(self.unknowns, fit, self.covariance, rows, self.equation, self.noise, self.half)

    def of(self, unknown: str) -> Combination:
        """An unknown as a combination of all."""
        return self.combination(np.eye(len(self.unknowns))[self.unknowns.index(unknown)])

    @cached_property
    def of_inertia(self) -> Combination:
        """The inertia a11."""
        return self.of("inertia")

    def combination(self, weights: Array) -> Combination:
        """The combination of the unknowns with these weights (p,).

        The scatter of the rows over a finite time also contains power of the differentiated noise at frequencies beside
        the motion's. The expected power of the noise there is subtracted, and one standard deviation of it: the
        difference is never negative, so its fluctuation would widen it.
        """
        influence, noise = weights @ self.fit.influence, self.noise
        of_rows, channels = self.row_filter.adjoint(influence), (("angle", noise.angle), ("wheel", noise.wheel))
        samples = [std * self.part.acting(channel, of_rows, self.coefficients) for channel, std in channels]
        smeared = float(self.white_products @ autocorrelation(influence, self.reach))
        # number of independent stretches of a Parzen kernel, as in `hac_covariance`
        chance = smeared * np.sqrt(2 * (self.reach + 1) / (1.85 * np.count_nonzero(self.weights)))
        beyond = max(float(weights @ self.covariance @ weights) - smeared - float(chance), 0.0)
        return Combination(influence, np.array(samples), beyond, self._grid(influence, weights))

    def freedom_of(self, combination: Combination) -> float:
        """Degrees of freedom of the variance: those of its part beyond the white noise of both angles."""
        rows = scatter_freedom(combination.influence, parzen(self.reach), len(self.unknowns))
        return effective_freedom(((combination.white**0.5, math.inf), (combination.beyond**0.5, rows)))

    def _grid(self, influence: Array, weights: Array) -> Array:
        """Errors at eight grid phases of the encoder (`systematics.grid_spread`); 0 without a grid.

        They repeat at every swing, so those of the instruments are correlated with those of the row.
        """
        if not self.noise.resolution > 0:
            return np.zeros(1)
        errors = self.part.grid_errors(self.row_filter)
        effects: Array = errors @ influence
        if self.lag:
            pairs = self.weights[self.lag :] * errors[:, self.lag :] * errors[:, : -self.lag]
            effects = effects + (weights @ self.inverse[:, 0]) * pairs.sum(axis=1)
        return effects * abs(self.a11)

    @cached_property
    def white_products(self) -> Array:
        """Expected products of the residuals by white noise of both angles, by their lags, as `hac_covariance` weighs.

        Rows are 0 to `reach` apart.
        """
        products, (curved, spread, both) = np.zeros(self.reach + 1), self.row_filter.correlations
        near = min(len(curved), len(products))
        pull = self.part.stiffness(self.coefficients)
        inertia, wheel = self.a11, self.value("wheel") * self.noise.wheel
        axis = inertia**2 * curved[:near] + pull**2 * spread[:near] + 2 * inertia * pull * both[:near]
        products[:near] = self.noise.angle**2 * axis + wheel**2 * curved[:near]
        return np.where(np.arange(len(products)) == 0, 1.0, 2.0) * parzen(self.reach) * products

    def common(self, unknown: str = "inertia") -> dict[str, float]:
        """Errors of an unknown that are common to all rows, by source."""
        errors, k = {}, self.unknowns.index(unknown)
        if self.lag == 0:
            share = abs(float(self.inverse[k, 0] / self.inverse[0, 0])) if k else 1.0
            errors["noise in the acceleration (least squares)"] = abs(self.a11) * self.bias * share
        if self.noise.resolution > 0:
            errors["place of the encoder's grid"] = rms((self.of(unknown) if k else self.of_inertia).grid)
        return errors

    @cached_property
    def attenuation(self) -> float:
        """Share by which white noise of the angle in its own regressor lowers the inertia of least squares."""
        _, response = self.row_filter.response
        variance = self.noise.angle**2 * float(response @ response)
        return float(variance * self.weights.sum() * self.inverse[0, 0])

    @property
    def bias(self) -> float:
        """Standard uncertainty of the bias by noise in the acceleration, as a share of a11."""
        return self.attenuation if self.unsure is None else self.unsure

    @cached_property
    def scattered(self) -> float:
        """Share by which noise of the acceleration lowers a11 if it is all that the residuals of the rows are."""
        power = float(self.weights @ self.fit.residuals**2)
        return power / max(self.a11**2, 1e-300) * float(self.inverse[0, 0])

    def without_bias(self, share: float, spread: float) -> RowFit:
        """The fit without the bias by noise of the acceleration, `share` ± `spread` of the residuals' power."""
        lost = share * self.scattered
        change = lost * self.inverse[:, 0] / self.inverse[0, 0]
        shift = np.eye(len(self.unknowns))
        shift[:, 0] += change
        residuals = self.fit.residuals - self.columns @ (change * self.a11)
        fit = replace(
            self.fit, values=shift @ self.fit.values, residuals=residuals, influence=shift @ self.fit.influence
        )
        return replace(
            self,
            fit=fit,
            covariance=shift @ self.covariance @ shift.T,
            inverse=shift @ self.inverse,
            compensated=lost,
            unsure=spread * self.scattered,
        )

    def relative_with_bias(self) -> float:
        """Standard uncertainty of a11 by the sensors, lack of fit and attenuation, as a share of its magnitude."""
        return self.relative(float(np.hypot(self.of_inertia.spread, self.a11 * self.attenuation)))

    def contradicted(self, other: RowFit) -> float:
        """Dark uncertainty by the difference to another fit of the same log, beyond what explains it.

        That is the noise of the sensors, or the difference of the variances (Hausman 1978), which has the lack of fit.
        """
        first, second = self.of_inertia.variance, other.of_inertia.variance
        variance = max(self.variance_of_difference(other), abs(first - second))
        return dark_uncertainty(other.a11 - self.a11, variance, float(np.sqrt(first)))

    def variance_of_difference(self, other: RowFit) -> float:
        """Variance of the difference of a11 to another fit of the same log, from the sensors.

        Both fits are linear in the same noise, so its effect on their difference is known, that of the grid too.
        """
        noise = self.of_inertia.per_sample - other.of_inertia.per_sample
        variance = float(np.vdot(noise, noise)) + rms(self.of_inertia.grid - other.of_inertia.grid) ** 2
        if self.lag == 0:
            variance += (self.a11 * (self.bias - other.bias)) ** 2
        return variance


def noise_share(fit: RowFit, higher: RowFit) -> tuple[float, float]:
    """Share of the residuals' power that is noise of the acceleration, with its standard uncertainty.

    White noise of the axis is part of it, that of the wheel is not, nor is what grows less than in proportion to the
    cut-off: an error of the acceleration redder than white noise is a force. Between these bounds the share is uniform
    a priori. The estimate falls to a fit at another, higher cut-off by this share of what `scattered` grows, within
    the uncertainty of their difference.
    """
    wheel = (fit.value("wheel") * fit.noise.wheel / max(abs(fit.a11) * fit.noise.angle, 1e-300)) ** 2
    power = max(fit.scattered, fit.attenuation * (1 + wheel), 1e-300)
    growth = higher.row_filter.cutoff.frequency / fit.row_filter.cutoff.frequency - 1
    low, high = fit.attenuation / power, 1 - fit.attenuation * wheel / power
    high = max(min(high, (higher.scattered - fit.scattered) / (growth * power)), low)
    variance = max(fit.variance_of_difference(higher), abs(fit.of_inertia.variance - higher.of_inertia.variance))
    slope = fit.a11 * (higher.scattered - fit.scattered)
    prior = (high - low) ** 2 / 12
    weight = prior * slope**2 / max(prior * slope**2 + variance, 1e-300)
    middle = (low + high) / 2
    share = middle + weight * ((fit.a11 - higher.a11) / slope - middle if slope else 0.0)
    return min(max(share, low), high), float(np.sqrt(prior * (1 - weight)))


def fit_rows(
    part: OnGrid, row_filter: RowFilter, terms: tuple[str, ...], law: Law | None = None, lag: int | None = 0
) -> RowFit:
    """Fit the rows by least squares (lag 0), or with the regressors `lag` rows earlier as instruments.

    terms: of friction, see `OnGrid.rows`; lag: None for the best one.
    Raises UnanswerableError where too few rows are left.
    """
    rows, equation, usable = part.rows(row_filter, terms, law), part.equation, row_filter.usable
    unknowns, columns = columns_of(rows, equation, terms)
    lag = _best_lag(part, row_filter, columns, unknowns) if lag is None else lag
    target, (instruments, usable) = known_side(rows, equation), lagged(columns, usable, lag, unknowns)
    if usable.sum() < ROWS_PER_UNKNOWN * len(unknowns):
        raise UnanswerableError(
            f"{usable.sum()} filtered rows are left, too few for {len(unknowns)} unknowns; record a longer run, "
            "or give a higher cutoff.",
            code="too-short",
        )
    weights = usable.astype(np.float64)
    for _ in range(ROUNDS):
        fit, inverse = fit_oblique(columns, target, instruments, weights)
        before, weights = weights, usable * _huber(fit.residuals, usable)
        if np.array_equal(weights, before):
            break
    # correlation counts up to two periods
    reach = min(int(4 * part.motion.half_period / row_filter.row_step), len(rows) // 4)
    covariance = hac_covariance(fit.influence * fit.residuals, reach, len(unknowns), int(usable.sum()))
    half = 1 / row_filter.cutoff.frequency
    return RowFit(
        unknowns,
        fit,
        covariance,
        rows,
        equation,
        part.noise,
        half,
        weights=weights,
        inverse=inverse,
        lag=lag,
        reach=reach,
        row_filter=row_filter,
        part=part,
    )


def lagged(columns: Array, usable: Bools, lag: int, unknowns: tuple[str, ...]) -> tuple[Array, Bools]:
    """The columns `lag` rows earlier, but for those of the direction, and the rows that are usable with them."""
    if lag == 0:
        return columns, usable
    earlier, sound = np.zeros_like(columns), np.zeros_like(usable)
    earlier[lag:] = columns[:-lag]
    kept = [k for k, name in enumerate(unknowns) if name in OF_DIRECTION]
    earlier[:, kept] = columns[:, kept]
    sound[lag:] = usable[lag:] & usable[:-lag]
    return earlier, sound


def _best_lag(part: OnGrid, row_filter: RowFilter, columns: Array, unknowns: tuple[str, ...]) -> int:
    """The lag of the instruments, in rows, that gives the inertia the least variance under white residuals."""
    least = max(SETTLING / row_filter.cutoff.frequency, EARLIER * part.motion.half_period)
    shortest = int(np.ceil(least / row_filter.row_step))
    range_of_lags = int(LAGS * (2 * part.motion.half_period / row_filter.row_step))
    columns = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    best, smallest = 0, np.inf
    for lag in range(shortest, shortest + range_of_lags + 1, max(1, range_of_lags // LAGS_TRIED)):
        earlier, sound = lagged(columns, row_filter.usable, lag, unknowns)
        z, x = earlier[sound], columns[sound]
        if len(z) < 5 * x.shape[1]:
            break
        inverse = np.linalg.pinv(z.T @ x, rcond=1e-12)
        variance = float(inverse[0] @ (z.T @ z) @ inverse[0])
        if variance < smallest:
            best, smallest = lag, variance
    if best == 0:
        raise UnanswerableError(
            "the log is too short for instruments from an earlier swing; record a longer run, or leave them out.",
            code="too-short",
        )
    return best


def _huber(residuals: Array, usable: Bools) -> Array:
    """Huber's weights from the robust spread of the usable residuals."""
    spread = 1.4826 * median(np.abs(residuals[usable]))
    size = np.abs(residuals) / max(ROBUST * spread, 1e-300)
    return np.asarray(1 / np.maximum(size, 1.0))


def rms(values: Array) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(values**2)))
