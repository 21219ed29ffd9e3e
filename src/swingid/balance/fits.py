"""Least-squares fits of the balance on windows; their covariance allows for overlapping windows and sensor noise."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from swingid.balance.covariance import LAG, covariance_of, sensor_variance, with_excess
from swingid.balance.errors import errors_of
from swingid.balance.perturbations import RowError
from swingid.balance.rows import Rows, Signals
from swingid.model.equation import GRAVITY, SOUGHT, Equation
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.numerics.once import once
from swingid.numerics.regression import Beside, LinearFit, fit_linear
from swingid.numerics.test_functions import CURVATURE_POWER
from swingid.preparation.noise import Noise
from swingid.uncertainty.freedom import bartlett, effective_freedom, scatter_freedom

BASIS = ("coulomb", "viscous", "quadratic", "offset", "viscous_even")
"""Odd friction c0 sgn v + c1 v + c2 v|v|, and even friction (what depends on the direction) 1 and |v|.

The even terms lie on even harmonics of the motion, where the inertia does not, so they hardly inflate its variance. A
richer odd basis would be nearly collinear.
"""

ROUNDING = 1e-9
"""Share of the known side below which residuals are those of the arithmetic, which no prior may be weighed by."""

EQUAL = 1e-8
"""Relative change of the weight of a prior from which on the fit is the same."""

SLIGHT = 1e-6
"""Residuals as a share of the known side (RMS) below which no term is missing: they bias the inertia by about as much,
and a latency that was corrected to first order leaves as much."""


@dataclass(frozen=True)
class Effect:
    """Change of the unknowns of a fit, `shifts` (unknowns,) in their units, for one standard deviation of `item`.

    value: of the imperfection where it was fitted, in standard deviations, with its standard uncertainty; 1 where it
    was not fitted.
    """

    item: RowError
    shifts: Array
    value: float = 0.0
    spread: float = 1.0


@dataclass(frozen=True)
class NamedFit:
    """A linear fit of rows, "inertia" the first unknown: a11 of the whole axis; the covariance is of type A."""

    unknowns: tuple[str, ...]
    fit: LinearFit
    covariance: Array
    rows: Rows
    equation: Equation

    def value(self, name: str) -> float:
        """Value of a coefficient, fitted or stated; 0 where the balance does not have it."""
        known = name in self.unknowns
        return float(self.fit.values[self.unknowns.index(name)]) if known else self.equation.value(name)

    def uncertainty(self, name: str) -> float:
        """Type A standard uncertainty of an unknown."""
        k = self.unknowns.index(name)
        return float(np.sqrt(self.covariance[k, k]))

    def covariances(self, *names: str) -> dict[str, dict[str, float]]:
        """Type A covariances of these unknowns, by their names."""
        at = {name: self.unknowns.index(name) for name in names}
        return {first: {second: float(self.covariance[i, j]) for second, j in at.items()} for first, i in at.items()}

    @property
    def values(self) -> dict[str, float]:
        """Fitted values by the names of the unknowns."""
        return dict(zip(self.unknowns, self.fit.values.tolist(), strict=True))

    @cached_property
    def coefficients(self) -> dict[str, float]:
        """All coefficients by the names of their terms, stated and fitted."""
        return self.equation.stated | self.values

    @property
    def a11(self) -> float:
        """Inertia of the whole axis, a11 = J1 + J2 + Jr."""
        return float(self.fit.values[0])

    @property
    def inertia(self) -> float:
        """Inertia J1 of the body."""
        return self.a11 - self.equation.carried

    @property
    def u(self) -> float:
        """Type A standard uncertainty of a11."""
        return float(np.sqrt(self.covariance[0, 0]))


@dataclass(frozen=True)
class WindowFit(NamedFit):
    """A fit of the balance on windows of one kind.

    declared: effect of each declared imperfection of the rig on the unknowns. wandering: those of zero, bias and random
    walk of an integrated rate, which the covariance contains. computed: variance of a11 that is not
    estimated from the scatter of the rows: by the sensors' noise, and of attenuation. bare: the fit without what is
    declared.
    """

    noise: Noise
    half: float
    declared: tuple[Effect, ...] = ()
    wandering: tuple[Effect, ...] = ()
    computed: float = 0.0
    bare: LinearFit | None = None

    @property
    def friction(self) -> tuple[str, ...]:
        """The unknowns that are no terms of the rig's equation: friction, and what was fitted beside it."""
        return tuple(name for name in self.unknowns if name not in self.equation.coefficients)

    @cached_property
    def columns(self) -> Array:
        """Regressors (rows, unknowns)."""
        return columns_of(self.rows, self.equation, self.friction)[1]

    @cached_property
    def known(self) -> Array:
        """Known side of each row, see `known_side`."""
        return known_side(self.rows, self.equation)

    @cached_property
    def plain(self) -> LinearFit:
        """Least squares without what is declared."""
        return self.bare or fit_linear(self.columns, self.known)

    def beside(self, more: Array) -> Beside:
        """These columns (rows, m) beside those of the unknowns, for what the fit leaves."""
        residuals = replace(self.plain, values=self.fit.values, residuals=self.fit.residuals)
        return Beside.of(self.columns, residuals, more)

    @cached_property
    def explained(self) -> Array:
        """What the declared imperfections that were fitted add to the known side of each row."""
        result: Array = self.columns @ self.fit.values + self.fit.residuals - self.known
        return result

    @property
    def freedom(self) -> float:
        """Degrees of freedom of the covariance: those of the scatter; the part by the sensors' noise is computed."""
        of_scatter = scatter_freedom(self.fit.influence[0], bartlett(LAG), len(self.unknowns))
        scattered = float(self.covariance[0, 0]) - self.computed
        scattered = scattered if scattered > 1e-12 * self.computed else 0.0  # else it is that of the arithmetic
        return effective_freedom(((scattered**0.5, of_scatter), (self.computed**0.5, math.inf)))

    @property
    def total(self) -> float:
        """Standard uncertainty of a11 with the declared imperfections."""
        return self.total_of("inertia")

    def total_of(self, name: str) -> float:
        """Standard uncertainty of an unknown with the declared imperfections."""
        k = self.unknowns.index(name)
        return float(np.sqrt(self.covariance[k, k] + sum(effect.shifts[k] ** 2 for effect in self.declared)))

    @cached_property
    def lost(self) -> float:
        """Sum of the squared residuals."""
        return float(self.fit.residuals @ self.fit.residuals)

    @property
    def is_exact(self) -> bool:
        """Return whether no term is missing, see `SLIGHT`."""
        return self.lost < SLIGHT**2 * float(self.known @ self.known)

    def noise_of(self, half: Array) -> Array:
        """Variance of rows on windows of these half-lengths (s) by noise of the angles, through φ''."""
        power = (self.a11 * self.noise.angle) ** 2 + (self.equation.value("wheel") * self.noise.wheel) ** 2
        return power * self.noise.step * CURVATURE_POWER * half**-3.0

    @property
    def independent(self) -> float:
        """Number of independent rows: neighbours share data."""
        return len(self.rows) / (LAG / 2)

    def relative(self, u: float) -> float:
        """A standard uncertainty of a11 as a share of its magnitude.

        Noise in the column of a11 multiplies the estimate and its standard uncertainty by one factor below 1
        (errors in variables), so windows short enough to be attenuated look best in absolute terms and not in these.
        """
        return u / max(abs(self.a11), 1e-300)


def known_side(rows: Rows, equation: Equation) -> Array:
    """Known side of each row, −Σ c ∫φ f of the known coefficients: −a12 ∫φ'' q2 + ∫φ τ − b ∫φ sin q1 and so on."""
    return -rows.sum_of(equation.stated)


def columns_of(rows: Rows, equation: Equation, friction: tuple[str, ...]) -> tuple[tuple[str, ...], Array]:
    """Names of the unknowns and their columns (rows, unknowns)."""
    unknowns = (*equation.sought, *friction)
    return unknowns, np.array([rows[name] for name in unknowns]).T


def fit_rows(rows: Rows, equation: Equation, noise: Noise, friction: tuple[str, ...]) -> WindowFit | None:
    """Fit the balance; None where there are too few rows for the unknowns."""
    unknowns, columns = columns_of(rows, equation, friction)
    if len(rows) < 2 * LAG or len(rows) / (LAG / 2) <= len(unknowns):
        return None
    fit = fit_linear(columns, known_side(rows, equation))
    covariance, computed = covariance_of(fit, rows, unknowns, equation, noise)
    return WindowFit(unknowns, fit, covariance, rows, equation, noise, rows.windows.middle, computed=computed, bare=fit)


def fit_with_prior(
    fit: WindowFit, extra: Sequence[Array] | Array, rounds: int = 2, means: Array | float = 0.0
) -> tuple[LinearFit, Array]:
    """The fit with more unknowns, in units of their standard deviations, under a standard normal prior.

    extra: one regressor (rows,) for each, or several sets of as many (sets, m, rows), of zeros where there are fewer;
    means: of their priors, in one array. rounds: in which the weight of the priors follows from the residuals. Returns
    the fit, whose last rows are the prior, and the standard deviation of a row by which these are weighted: rows share
    data, so each holds less information than its residual alone implies.
    """
    rows = len(fit.rows)
    more = np.asarray(extra) if len(extra) else np.zeros((0, rows))
    beside = Beside.of(fit.columns, fit.plain, more.swapaxes(-1, -2))
    least = ROUNDING * np.sqrt(fit.known @ fit.known / (rows + np.any(more, axis=-1).sum(axis=-1)))

    def error_of(residuals: Array) -> Array:
        result: Array = np.maximum(np.sqrt(LAG / 2 / rows) * np.linalg.norm(residuals, axis=-1), least)
        return result

    error, before = error_of(fit.fit.residuals), np.asarray(np.inf)
    for _ in range(rounds - 1):
        if np.all(np.abs(error - before) < EQUAL * error):
            break
        before, error = error, error_of(beside.left(error, means))
    return beside.solved(error, means), error


def with_declared(fit: WindowFit, rig: Rig, signals: Signals) -> WindowFit:
    """The fit with everything that is stated as uncertain, see `with_errors`."""
    return with_errors(fit, errors_of(fit.rows, signals, rig, fit.equation, fit.coefficients))


def with_errors(fit: WindowFit, items: Sequence[RowError]) -> WindowFit:
    """The fit with the effect of every one of these errors; nonlinearities and latencies of encoders are fitted.

    These enter the rows linearly and their standard deviations are declared, so their amplitudes are unknowns with that
    prior, of which the log determines what it can (THEORY 4, self-calibration). Constants are no unknowns: their
    declared uncertainty is propagated. What is noise of a rate is of type A.
    """
    fitted = [item for item in items if item.of.fitted]
    fit = with_fitted(fit, [fitted])[0] if fitted else replace(fit, declared=())
    effects = [*fit.declared, *_propagated(fit, (item for item in items if not item.of.fitted))]
    noise = tuple(effect for effect in effects if effect.item.of.of_noise)
    return replace(
        fit,
        covariance=fit.covariance + sum(np.outer(effect.shifts, effect.shifts) for effect in noise),
        computed=fit.computed + sum(float(effect.shifts[0]) ** 2 for effect in noise),
        declared=tuple(effect for effect in effects if not effect.item.of.of_noise),
        wandering=noise,
    )


def _propagated(fit: WindowFit, items: Iterable[RowError]) -> tuple[Effect, ...]:
    """The effects of errors that are no unknowns."""
    return tuple(Effect(item, fit.fit.influence @ item.rows * item.std) for item in items)


def with_fitted(fit: WindowFit, several: Sequence[Sequence[RowError]], rounds: int = 2) -> list[WindowFit]:
    """The fits with each list of errors as unknowns under their priors, all at once; these alone are `declared`.

    rounds: in which the weight of the priors follows from the residuals; more where these fall by much.
    """
    rows, p, most = len(fit.rows), len(fit.unknowns), max(len(items) for items in several)
    extra, means = np.zeros((len(several), most, rows)), np.zeros((len(several), most))
    for k, items in enumerate(several):
        for j, item in enumerate(items):
            np.multiply(item.rows, -item.std, out=extra[k, j])
            means[k, j] = item.of.mean
    solved, errors = fit_with_prior(fit, extra, rounds, means)
    data = LinearFit(solved.values[:, :p], solved.residuals[:, :rows], solved.influence[:, :p, :rows], solved.condition)
    covariance, computed = covariance_of(data, fit.rows, fit.unknowns, fit.equation, fit.noise)
    spreads = np.linalg.norm(solved.influence[:, p:], axis=2) * errors[:, None]
    shifts = solved.influence[:, :p, rows:] * errors[:, None, None]
    fits = []
    for k, items in enumerate(several):
        effects = tuple(
            Effect(item, shifts[k, :, j], float(solved.values[k, p + j]), float(spreads[k, j]))
            for j, item in enumerate(items)
        )
        fits.append(replace(fit, fit=data[k], covariance=covariance[k], computed=float(computed[k]), declared=effects))
    return fits


@once
def with_gravity_free(fit: WindowFit, rig: Rig, signals: Signals) -> WindowFit | None:
    """The same windows with the gravity torque an unknown without prior, and all else that is declared propagated.

    None where there are too few rows, and where a further unknown has the regressor of gravity.
    """
    free = fit_rows(fit.rows, fit.equation.but(gravity_torque=SOUGHT), fit.noise, fit.friction)
    if free is None or not np.isfinite(free.fit.condition):
        return None
    # of the stated equation: its clock and tilt act where both gravity torques are compared
    items = errors_of(free.rows, signals, rig, fit.equation, free.coefficients)
    others = (item for item in items if item.source != GRAVITY and not item.of.of_noise)
    return replace(free, declared=_propagated(free, others))


def covariance_by(
    fit: WindowFit, influence: Array, residuals: Array | None = None, unknowns: int | None = None
) -> Array:
    """Type A covariance (..., m, m) of values of this influence (..., m, windows), as that of the inertia of a fit.

    By sensor noise, and by the scatter of the residuals (of the fit, if not given) beyond it. unknowns: which these
    residuals (..., windows) have used, if not those of the fit.
    """
    used_residuals = fit.fit.residuals if residuals is None else residuals
    used = len(fit.unknowns) if unknowns is None else unknowns
    covariance = LinearFit(np.zeros(used), used_residuals, influence, 1.0).covariance(LAG)
    scattered = covariance.diagonal(0, -2, -1)
    sensor, seen = sensor_variance(fit.rows, influence, fit.coefficients, fit.noise)
    variances = with_excess(sensor, seen, scattered, max(len(fit.rows) - used, 1))
    scale = np.sqrt(variances / np.maximum(scattered, 1e-300))
    covariance *= scale[..., :, None] * scale[..., None, :]
    at = np.arange(influence.shape[-2])
    covariance[..., at, at] = variances
    return covariance


def residuals_beside(fit: WindowFit, more: Array) -> Array:
    """Residuals of a fit with these columns (rows, m) added, without a prior."""
    return fit.beside(more).alone().residuals
