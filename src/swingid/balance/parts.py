"""Estimates of the inertia from parts of a log, which must agree: halves in time, amplitudes, directions of motion.

The rows of one fit are divided, and both parts are fitted with all its unknowns; or all rows are fitted with an inertia
that changes with the size, speed or place of the swings (`trends`). The difference of the two estimates is linear in
the rows, so its variance is that of one value (`fits.covariance_by`): rows that share data, at the border of the parts,
are counted as correlated. What is declared of the rig is the same in both and enters by the difference of its effects.
A missing term, a friction that changes, a sensor that drifts, a late channel bias the parts differently.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from swingid.balance.covariance import LAG, column_noise
from swingid.balance.fits import WindowFit, covariance_by
from swingid.balance.rows import Signals
from swingid.balance.systematics import COMPARABLE
from swingid.numerics.arrays import Array, Bools, median
from swingid.numerics.regression import LinearFit, fit_linear
from swingid.uncertainty.dark import dark_uncertainty
from swingid.uncertainty.significance import normal_of_ratio

THIRDS = 1 / 6, 5 / 6
"""Quantiles that are the middle of the smallest and of the largest third of the swings."""

VARIES = 0.1
"""Least difference between the thirds: of the logarithm of a size or speed, of places in swings; scatter below it."""

SAME = 0.9
"""Correlation from which on two quantities are one: in a free decay the larger swings are the faster ones."""

MIRRORED = ("direction", "rise")
"""Divisions whose parts are mirror images: an error that is odd under the mirror, as a latency or a lens, makes them
differ, and is not in the whole."""

CLEAR = 0.3
"""Mean direction of motion within a window, as a share of a window within one swing, from which on it counts."""


@dataclass(frozen=True)
class Comparison:
    """Inertias of two parts of a log, of the whole axis, with their standard uncertainties of type A.

    name: "time", "direction" or "rise", or of a trend "amplitude", "speed" or "place". variance: of their difference
    where the model holds. off, u: by how much the whole may be off, and the standard uncertainty of that where the
    model holds.
    """

    name: str
    first: tuple[float, float]
    second: tuple[float, float]
    variance: float
    off: float
    u: float

    @property
    def difference(self) -> float:
        """First less second."""
        return self.first[0] - self.second[0]

    @property
    def deviation(self) -> float:
        """The difference in its standard uncertainties."""
        return self.difference / float(max(self.variance, 1e-300) ** 0.5)


def divisible(law: WindowFit, tried: Iterable[WindowFit]) -> WindowFit:
    """The fit whose rows are divided: `law`, or where these are too few the best one whose rows suffice.

    If that knows the inertia about as well (COMPARABLE); shorter windows are more.
    """
    least = 2 * fewest(law)
    enough = [fit for fit in tried if len(fit.rows) >= least and len(fit.unknowns) == len(law.unknowns)]
    limit = COMPARABLE * law.relative(law.total)
    within = [fit for fit in enough if fit.relative(fit.total) < limit]
    if len(law.rows) >= least or not within:
        return law
    return min(within, key=lambda fit: fit.relative(fit.total))


def fewest(law: WindowFit) -> int:
    """Rows that each part needs: twice as many independent ones as unknowns."""
    return max(2 * LAG, LAG * len(law.unknowns))


def unexplained(comparisons: Sequence[Comparison], u: float) -> float:
    """Standard uncertainty of a11 by the disagreement of parts."""
    return max(
        (dark_uncertainty(comparison.off, comparison.u**2, u, len(comparisons)) for comparison in comparisons),
        default=0.0,
    )


def compared(law: WindowFit, signals: Signals) -> list[Comparison]:
    """The comparisons that this log allows."""
    if law.is_exact:
        return []
    least = fewest(law)
    divided = [
        division
        for division in divisions(law, signals)
        if min(np.count_nonzero(part) for part in division[1:]) >= least
    ]
    return [
        *trends(law, signals),
        *_comparisons(law, [name for name, *_ in divided], np.array([sides for _, *sides in divided])),
    ]


def divisions(law: WindowFit, signals: Signals) -> Iterator[tuple[str, Bools, Bools]]:
    """Names and the rows (windows,) of both parts."""
    centres = law.rows.windows.centres
    early = centres < median(centres)
    yield "time", early, ~early
    mean = law.rows["coulomb"] / law.rows["offset"]
    yield "direction", mean > CLEAR, mean < -CLEAR
    if law.value("gravity_torque") and not signals.linear:  # elsewhere no angle is the middle
        outward = np.interp(centres, signals.nodes.stamps, signals.angle_values) * signals.motion.speed.at(centres)
        yield "rise", outward > 0, outward < 0


def covariates(law: WindowFit, signals: Signals) -> dict[str, Array]:
    """What the inertia per swing may depend on, at the windows: size and speed (logarithms), place (in swings).

    Each where it varies, and is not one of those before.
    """
    motion, by_name = signals.motion, dict[str, Array]()
    if len(motion.turning_times) < 4:
        return {}
    times, angles = motion.turning_times, motion.turning_angles
    middles, places = (times[1:] + times[:-1]) / 2, (angles[2:] + 2 * angles[1:-1] + angles[:-2]) / 4
    each = {
        "amplitude": (middles, np.log(motion.swing_sizes)),
        "speed": (middles, np.log(motion.swing_sizes / np.diff(times))),
        "place": (times[1:-1], places / median(motion.swing_sizes)),
    }
    for name, (instants, values) in each.items():
        at_windows = np.interp(law.rows.windows.centres, instants, values)
        least, most = np.quantile(at_windows, THIRDS)
        if most - least > VARIES and all(
            abs(np.corrcoef(at_windows, other)[0, 1]) < SAME for other in by_name.values()
        ):
            by_name[name] = at_windows
    return by_name


def trends(law: WindowFit, signals: Signals) -> list[Comparison]:
    """The inertia of the largest third of the swings less that of the smallest, by their size, speed and place x.

    Σ J (1 + s (x − x̄)) with s beside the unknowns of the fit; x̄ is the mean that a11 has, so that s leaves it. What is
    true may be at either end, as without the torque or the friction that changes the period: half of the difference.
    """
    return [_trend(law, name, values) for name, values in covariates(law, signals).items()]


def _trend(law: WindowFit, name: str, values: Array) -> Comparison:
    """Compute the trend of one quantity (windows,)."""
    column = law.rows["inertia"]
    apart = values - float((law.fit.influence[0] * column) @ values)
    fit = law.beside((column * apart)[:, None]).alone()
    small, large = np.quantile(apart, THIRDS)
    estimates = np.array([law.fit.influence[0] + end * fit.influence[0] for end in (large, small)])
    variances = _variances(law, estimates, [[1, -1]], fit.residuals, len(column), len(law.unknowns) + 1)
    changes = [float(end * fit.values[0]) for end in (large, small)]
    first, second = ((law.a11 + change, u**0.5) for change, u in zip(changes, variances.tolist(), strict=False))
    difference, variance = changes[0] - changes[1], float(variances[2])
    return Comparison(name, first, second, variance, difference / 2, variance**0.5 / 2)


def _fits_of(law: WindowFit, parts: Bools) -> LinearFit:
    """The residuals fitted with all unknowns on each of these parts of the rows (parts, windows) alone."""
    return fit_linear(parts[..., None] * law.columns, parts * law.fit.residuals)


def _comparisons(law: WindowFit, names: Sequence[str], parts: Bools) -> list[Comparison]:
    """The comparisons of two parts each (comparisons, 2, windows).

    By how much the whole may be off: of parts that mirror one another by how much their mean differs from it. Of others
    half the difference, as it is where both determine the inertia alike: each then has √2 times the uncertainty of the
    whole. Parts that distinguish the unknowns worse amplify what the model lacks as they amplify noise, so the share of
    the difference is less by what its uncertainty is more.
    """
    if not names:
        return []
    fits, whole = _fits_of(law, parts.reshape(-1, parts.shape[-1])), law.fit.influence[0]
    first, second = fits.influence[:, 0].reshape(parts.shape).swapaxes(0, 1)
    rests = fits.residuals.reshape(parts.shape).sum(axis=1)
    estimates = np.stack([first, second, np.broadcast_to(whole, first.shape)], axis=1)
    rows, used = parts.any(axis=1).sum(axis=1), 2 * len(law.unknowns)
    variances = _variances(law, estimates, [[1, -1, 0], [0.5, 0.5, -1]], rests, rows, used)
    changes = fits.values[:, 0].reshape(-1, 2)
    return [_comparison(law, *each) for each in zip(names, changes.tolist(), variances.tolist(), strict=True)]


def _variances(
    law: WindowFit, estimates: Array, combined: Sequence[Sequence[float]], rests: Array, rows: Any, used: int
) -> Array:
    """Variances (..., 2 + combinations) of the first two of some estimates of a11, and of combinations of all.

    estimates: their influences (..., estimates, windows), of fits of so many `rows` that leave `rests` (..., windows)
    and have `used` so many unknowns. The bias by noise in the regressor is that of each, to first order.
    """
    weights = np.array([*np.eye(2, estimates.shape[-2]), *combined])
    influence = weights @ estimates
    variances = covariance_by(law, influence, rests, used).diagonal(0, -2, -1)
    variances = variances + np.sum((influence @ declared_effects(law)) ** 2, axis=-1)
    bent = law.a11 * column_noise(law.rows.windows, law.noise) * np.sum(estimates**2, axis=-1)
    variances[..., 2:] += (bent @ weights[2:].T) ** 2
    spare = rows / (LAG / 2) - used
    variances *= np.where(spare > 4, spare / np.maximum(spare - 2, 1), 2.0)[..., None]  # of Student's t
    result: Array = variances
    return result


def _comparison(law: WindowFit, name: str, changes: list[float], variances: list[float]) -> Comparison:
    """changes: of a11 by each part. variances: of both, of their difference, and of their mean less the whole."""
    first, second = ((law.a11 + change, u**0.5) for change, u in zip(changes, variances, strict=False))
    if name in MIRRORED:
        mean = max(2 * (variances[0] + variances[1]) - variances[2], 1e-300) ** 0.5 / 2  # of both estimates
        share = min(1.0, law.u / mean)
        off, u = share * (changes[0] + changes[1]) / 2, share * variances[3] ** 0.5
    else:
        share = min(0.5, law.u / max(variances[2], 1e-300) ** 0.5)
        off, u = share * (changes[0] - changes[1]), share * variances[2] ** 0.5
    return Comparison(name, first, second, variances[2], off, u)


@dataclass(frozen=True)
class Prediction:
    """The second half of a log as the fit of the first half predicts it.

    ratio: of the residuals (root mean square) to those that are expected. significance: of their excess, in standard
    deviations of a normal quantity.
    """

    ratio: float
    significance: float


def predicted(law: WindowFit) -> Prediction | None:
    """How well the first half predicts the second one; None for too few rows.

    The residuals of the prediction exceed those of a fit to the second half by Q = dᵀ XᵀX d, d the difference of both
    halves' unknowns, of covariance V, and X the columns there: Q is distributed as Σ λ_i χ²_1 with λ_i the eigenvalues
    of XᵀX V, nearly as a multiple of χ² of the same mean and variance (Satterthwaite).
    """
    count, columns = len(law.unknowns), law.columns
    early = law.rows.windows.centres < median(law.rows.windows.centres)
    if min(int(early.sum()), int((~early).sum())) < fewest(law):
        return None
    fits = _fits_of(law, np.array([early, ~early]))
    influence, rests = fits.influence[0] - fits.influence[1], fits.residuals.sum(axis=0)
    effects = influence @ declared_effects(law)
    spread = covariance_by(law, influence, rests, 2 * count) + effects @ effects.T
    spread = spread @ (columns[~early].T @ columns[~early])
    difference, last = columns[~early] @ (fits.values[0] - fits.values[1]), fits.residuals[1]
    excess, rest = float(difference @ difference), float(last @ last)
    mean, power = float(np.trace(spread)), float(np.trace(spread @ spread))
    freedom = law.independent - 2 * count
    if not (mean > 0 and power > 0) or freedom < count:
        return None
    significance = normal_of_ratio(excess / mean, mean**2 / power, freedom)
    return Prediction(((rest + excess) / (rest + mean)) ** 0.5, significance)


def declared_effects(law: WindowFit) -> Array:
    """What the rig declares as columns (windows, n): errors of the rows, independent and of unit variance.

    Those that were fitted count by their posterior.
    """
    if not law.declared:
        return np.zeros((len(law.rows), 1))
    effects = np.column_stack([effect.item.rows * effect.item.std for effect in law.declared])
    fitted = [effect.item.of.fitted for effect in law.declared]
    alone = law.beside(effects[:, fitted]).rest
    error = max(LAG / 2 * float(np.mean(law.fit.residuals**2)), 1e-300)
    posterior = np.linalg.inv(np.eye(sum(fitted)) + alone.T @ alone / error)
    effects[:, fitted] = effects[:, fitted] @ np.linalg.cholesky(posterior)
    return effects
