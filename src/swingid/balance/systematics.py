"""Uncertainty of the inertia that the scatter of the rows does not contain.

Errors that are equal at every swing: grid phase of the encoder, late turning points. And lack of fit of the friction
terms: it biases windows of different length and place differently, so estimates of one inertia on such windows are
compared, and what their uncertainties do not explain is dark uncertainty.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from swingid.balance.fits import (
    WindowFit,
    fit_rows,
    residuals_beside,
    with_fitted,
    with_gravity_free,
)
from swingid.balance.perturbations import Perturbation, RowError
from swingid.balance.rows import Signals, Windows
from swingid.model.equation import GRAVITY
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.numerics.once import once
from swingid.numerics.test_functions import project_stacked, superpose, superposed
from swingid.preparation.noise import Noise
from swingid.uncertainty.dark import dark_uncertainty
from swingid.uncertainty.significance import CERTAIN, INDICATED

SHIFTS = (np.arange(8) / 8 + 0.5) % 1 - 0.5
"""Of the grid in `Signals.grid_errors`, in steps."""

COMPARABLE = 2.0
"""Ratio of uncertainties up to which two estimates know a quantity about equally well."""

ROUNDS = 6
"""Of the weight of that prior, see `with_fitted`: the residuals may fall by orders of magnitude."""

PLACE_SHARE = 0.05
"""Prior standard deviation of each torque that depends on the angle, as a share of gravity or of the torque of the
inertia: larger ones are seen by eye."""

SLIPS = 0.1, 0.5
"""Ways after a reversal, as shares of the motion's reach, at which two parts of a cable with hysteresis slip."""

SHORTEST, COMPARED_LENGTHS = 0.49, 4.0
"""Shortest windows that are compared, in lengths of the chosen ones, for attenuation is theirs alone; and the ratio of
relative uncertainties up to which, for a poorer estimate adds less than its own uncertainty."""

COMPARED = 0.1
"""Share of the inertia above which the uncertainty of a kind of windows is too large for a consistency check."""


def timing_spread(fit: WindowFit, impulse: float) -> float:
    """Standard uncertainty of a11 by an impulse of unknown sign at every reversal, where none is fitted.

    A turning point that is found δ too late is one, of δ times the jump of friction.
    """
    if "memory" in fit.unknowns:
        return 0.0
    return abs(float(fit.fit.influence[0] @ fit.rows["memory"])) * impulse


Weights = tuple[Array, Array]
"""Change of an unknown per radian and second of error of the angle, and of the wheel's angle, at the nodes."""


@once
def angle_weights(fit: WindowFit, signals: Signals, unknown: str = "inertia") -> Weights:
    """The weights of an unknown of a fit: through φ'', and that of the axis through the gravity b sin q1 as well."""
    return _weights_of([fit], signals, unknown)[0]


def _weights_of(fits: Sequence[WindowFit], signals: Signals, unknown: str = "inertia") -> list[Weights]:
    """The weights of fits on the same windows, at once."""
    windows, held = fits[0].rows.windows, [term.name for term in fits[0].equation.conservative]
    factors = np.array([fit.fit.influence[fit.unknowns.index(unknown)] for fit in fits])
    pulled = any(fit.value(name) for fit in fits for name in held)
    bent, *plain = superposed(signals.nodes, windows.centres, windows.half, factors, (2, 0) if pulled else (2,))
    axes = [row * fit.a11 for row, fit in zip(bent, fits, strict=True)]
    for axis, row, fit in zip(axes, plain[0], fits, strict=True) if pulled else ():
        axis += signals.stiffness(fit.value).ravel() * row
    return [(axis, row * fit.value("wheel")) for axis, row, fit in zip(axes, bent, fits, strict=True)]


@once
def grid_spread(fit: WindowFit, signals: Signals, unknown: str = "inertia") -> float:
    """Standard uncertainty of an unknown by the grid phase of the encoder beyond what counts as white noise.

    An encoder has the same error wherever the same angle comes again, so its error does not average out over the swings
    as white noise does. The smoothed angle is rounded on a grid that is shifted by eighths of a step, and with it the
    zero of the angle, which is known no better than the step.
    """
    return _grid_spread(signals, fit.noise, angle_weights(fit, signals, unknown)[0])


def _grid_spread(signals: Signals, noise: Noise, weights: Array) -> float:
    """The same of a value with these weights of the angle."""
    steps, resolution = signals.nodes.flat[1], noise.resolution
    if resolution == 0.0:
        return 0.0
    # without BLAS, which would wake other processors for products of this length
    effects = np.einsum("ij,j->i", signals.grid_errors(resolution), weights)
    effects += resolution * SHIFTS * float(np.einsum("i,i->", steps, weights))
    white = resolution**2 / 12 * noise.step * float(np.einsum("i,i,i->", steps, weights, weights))
    return float(np.sqrt(max(float(effects @ effects) / len(effects) - white, 0.0)))


def variance_of_difference(signals: Signals, first: WindowFit, second: WindowFit) -> float:
    """Variance of the difference of two fits' a11 by white noise of the same samples."""
    return _white_variance(signals, first.noise, angle_weights(first, signals), angle_weights(second, signals))


def _white_variance(signals: Signals, noise: Noise, first: Weights, second: Weights) -> float:
    """The same of two values with these weights."""
    weights = signals.nodes.flat[1]
    axis, wheel = (mine - theirs for mine, theirs in zip(first, second, strict=True))
    squares = (float(np.einsum("i,i,i->", weights, rows, rows)) for rows in (axis, wheel))
    power = sum(sigma**2 * square for sigma, square in zip((noise.of_angle, noise.of_wheel), squares, strict=True))
    for rate, rows in ((noise.rate, axis), (noise.wheel_rate, wheel)):
        if rate:  # an error of the rate is one of all angles after it
            power += rate**2 * float(weights @ np.cumsum((rows * weights)[::-1])[::-1] ** 2)
    return noise.step * power


def drift_with_length(
    law: WindowFit,
    tried: Mapping[float, WindowFit],
    signals: Signals | None,
    variance_between: Callable[[WindowFit, WindowFit], float] | None = None,
) -> float:
    """Standard uncertainty of a11 from its drift with the length of the windows: half that of `law` to the longest.

    All lengths use the same samples, so the variance of a difference is the difference of the variances (Hausman 1978),
    or what white noise of the samples gives it, whichever is larger. Friction that the basis does not describe acts
    near the reversals, and its bias grows with the length L about as its root (on a ball screw: from 7 ms to 0.3 s). A
    difference d from windows of length L then bounds the bias at the length L0 by d / (√(L/L0) − 1), beyond 4 L0 less
    than d. variance_between: of the difference of two fits by white noise of the samples, where there are no `signals`.
    """
    worst, limit = 0.0, COMPARED_LENGTHS * law.relative(law.total)
    for half, fit in tried.items():
        ratio = half / law.half
        if fit is law or ratio < SHORTEST or not fit.relative(fit.total) < limit:
            continue
        share = 1.0 if ratio <= 4.0 else 1.0 / (ratio**0.5 - 1.0)
        variance = abs(fit.u**2 - law.u**2)
        if share * _unexplained(law, fit, variance) > worst:  # more variance explains no less, and takes a while
            if signals is not None:
                white = variance_of_difference(signals, law, fit)
            else:
                white = 0.0 if variance_between is None else variance_between(law, fit)
            variance = max(variance, white)
            worst = max(worst, share * _unexplained(law, fit, variance))
    return worst


def gravity_conflict(law: WindowFit, rig: Rig, signals: Signals, u: float = math.inf) -> float:
    """Standard uncertainty of a11 where the stated gravity torque contradicts the log (a conflict of prior and data).

    Either the stated gravity torque is wrong, or the scale of the drive is, and with it a11 and the fitted gravity
    torque in one proportion. The dark uncertainty holds the estimates of both cases. A fitted gravity torque that is
    negative leaves the first: another stated torque of the angle is too large. u: of the estimate it is added to, if
    that is smaller than that of `law`.
    """
    stated, u = law.equation.value("gravity_torque"), min(u, law.u)
    if law.equation.seeks("gravity_torque") or not law.equation.driven or signals.linear:
        return 0.0
    free = with_gravity_free(law, rig, signals)
    if free is None or free.a11 <= 0 or (stated and leaves_no_inertia(free)):
        return 0.0
    mine = {effect.item.source: float(effect.shifts[0]) for effect in law.declared}
    variance = abs(free.u**2 - law.u**2) + mine.pop(GRAVITY, 0.0) ** 2
    variance += sum((float(other.shifts[0]) - mine.get(other.item.source, 0.0)) ** 2 for other in free.declared)
    by_drive = dark_uncertainty(free.a11 - law.a11, variance, u)
    if not stated or free.value("gravity_torque") <= 0:  # of which no scale of the drive makes the one stated
        return by_drive
    gravity = rig.axis.gravity_torque
    ratio = free.total_of("gravity_torque") ** 2 + (0.0 if isinstance(gravity, str) else (gravity.std or 0.0) ** 2)
    # a11 is in proportion to the gravity torque, to first order
    by_gravity = free.a11 - law.a11 - law.a11 * (free.value("gravity_torque") / stated - 1.0)
    variance += ratio * (law.a11 / stated) ** 2
    return max(by_drive, dark_uncertainty(by_gravity, variance, u))


def leaves_no_inertia(free: WindowFit) -> bool:
    """Return whether gravity is fitted negative because noise of the regressors attenuates the inertia to nothing.

    So it is at one frequency and a small angle, where the two have one regressor.
    """
    return free.value("gravity_torque") <= 0 and free.a11 <= CERTAIN * free.u


@dataclass(frozen=True)
class PlaceFit:
    """The windows fitted with a torque of one kind that depends on the angle, and without it.

    variance: of the difference of a11 by noise, by the prior, by the grid phase of the encoder and by attenuation.
    """

    kind: str
    more: WindowFit
    plain: WindowFit
    variance: float

    @property
    def difference(self) -> float:
        """Change of a11 by the torque."""
        return self.more.a11 - self.plain.a11


def _with_place(fit: WindowFit, signals: Signals, kinds: Mapping[str, Array]) -> list[PlaceFit]:
    """The fits with each kind of torque, by its columns (rows, n), that the residuals do not reject."""
    declared = [effect.item for effect in fit.declared if effect.item.of.fitted]
    passed = [effect.item for effect in fit.declared if not effect.item.of.fitted]
    bare = fit_rows(fit.rows, fit.equation, fit.noise, fit.friction) if declared or fit.wandering else fit
    assert bare is not None  # there are rows enough for `fit`
    plain = with_fitted(bare, [declared], ROUNDS)[0] if declared else replace(bare, declared=())
    std = PLACE_SHARE * (
        abs(plain.value("gravity_torque")) or float(np.max(np.abs(plain.a11 * fit.rows["inertia"]))) / float(fit.half)
    )
    if std == 0.0:
        return []
    place = Perturbation("place", std, None, fitted=True)
    several = [[*declared, *(RowError(place, column) for column in columns.T)] for columns in kinds.values()]
    fits = zip(kinds, with_fitted(bare, several, ROUNDS), strict=True)
    count = len(declared)
    # a torque so large that it would be known is none: then the residuals have another cause, as a camera
    significant = {
        k: more for k, more in fits if all(abs(effect.value) <= INDICATED for effect in more.declared[count:])
    }
    weights, *of_more = _weights_of([plain, *significant.values()], signals)
    grid = _grid_spread(signals, plain.noise, weights[0])
    placed = []
    for (kind, more), other in zip(significant.items(), of_more, strict=True):
        # windows that are not the best for both fits do not make the difference of the variances that of the difference
        variance = max(abs(more.u**2 - plain.u**2), _white_variance(signals, plain.noise, other, weights))
        variance += grid**2 + _grid_spread(signals, plain.noise, other[0]) ** 2
        placed.append(PlaceFit(kind, more, plain, variance + _variance_declared(plain, more, count, passed)))
    return placed


def _variance_declared(plain: WindowFit, more: WindowFit, count: int, passed: Sequence[RowError]) -> float:
    """Return the variance of the change of a11 by a torque, by its prior, by attenuation and by what is declared.

    count: of what is declared and fitted, in both; passed: what is not fitted.
    """
    variance = sum(float(effect.shifts[0]) ** 2 for effect in more.declared[count:])
    variance += (attenuation(more) - attenuation(plain)) ** 2
    change = more.fit.influence[0] - plain.fit.influence[0]
    return float(variance + sum((float(change @ item.rows) * item.std) ** 2 for item in passed))


def attenuation(fit: WindowFit) -> float:
    """Return how much a11 is lower than by the reverse regression, in which all residuals are errors of its column.

    A torque that is nearly gravity leaves little of that column to a free decay: no inertia, and a spring that cancels
    gravity, fit any log, and errors draw the fit there.
    """
    influence = fit.fit.influence[0]
    return fit.lost * float(influence @ influence) / max(abs(fit.a11), 1e-300)


def _shapes(signals: Signals) -> dict[str, list[Array]]:
    """Evaluate at the nodes the torques of each kind that depends on the angle; of a linear axis the powers of its
    place.
    """
    angle = signals.angle
    reach = float(np.max(np.abs(angle - np.mean(angle)))) or 1.0
    lagging = [signals.stopped(share * reach) / (share * reach) for share in SLIPS]
    if signals.linear:
        place = (angle - np.mean(angle)) / reach
        return {"spring": [place], "square": [place**2], "cubic": [place**3], "hysteresis": lagging}
    waves = {f"order {n}": [np.sin(n * angle), np.cos(n * angle)] for n in (2, 3)}
    return {"spring": [angle], "cubic": [angle**3], **waves, "hysteresis": lagging}


def place_fits(law: WindowFit, signals: Signals, tried: Iterable[WindowFit] = ()) -> list[PlaceFit]:
    """One fit for each kind of torque that depends on the angle: spring, cubic spring, order 2 and 3, hysteresis.

    Inertia and gravity are even under q' → −q' as any torque T(q) is, so no symmetry removes it. Each kind alone, for
    together they replace the gravity torque, which is the scale of a free decay; and under a prior. Each on the windows
    of `law` and on those that seem to distinguish it best: where such a torque acts and is not fitted short ones have
    the least uncertainty, and may determine it 60 times worse (a spring in a free decay).
    """
    best: dict[str, tuple[float, WindowFit, Array]] = {}
    fits: list[PlaceFit] = []
    for fit in (law, *(fit for fit in tried if fit is not law)):
        if fit.half < SHORTEST * law.half or fit.is_exact:
            continue
        kinds = shape_columns(fit, signals)
        columns = np.concatenate(list(kinds.values()), axis=1)
        alone = np.linalg.norm(fit.beside(columns).rest, axis=0)
        change = np.abs(fit.fit.influence[0] @ columns) / np.maximum(alone, 1e-300)
        change *= float(np.sqrt(fit.lost / len(columns))) / max(abs(fit.a11), 1e-300)
        edges = np.cumsum([of_kind.shape[1] for of_kind in kinds.values()])[:-1]
        for (kind, of_kind), uncertain in zip(kinds.items(), map(np.sum, np.split(change, edges)), strict=True):
            if kind not in best or uncertain < best[kind][0]:
                best[kind] = float(uncertain), fit, of_kind
        if fit is law:
            fits += _with_place(fit, signals, kinds)
    for other in {id(fit): fit for _, fit, _ in best.values() if fit is not law}.values():
        fits += _with_place(other, signals, {kind: of_kind for kind, (_, fit, of_kind) in best.items() if fit is other})
    return fits


@once
def _stacked(signals: Signals) -> tuple[dict[str, int], Array]:
    """The kinds of torques with their numbers of shapes, and all shapes (n, nodes)."""
    shapes = _shapes(signals)
    return {kind: len(each) for kind, each in shapes.items()}, np.stack([x.ravel() for x in chain(*shapes.values())])


@once
def shape_columns(fit: WindowFit, signals: Signals) -> dict[str, Array]:
    """∫φ T (windows, n) of each kind of torque T that depends on the angle, on the windows of a fit."""
    (counts, stacked), windows = _stacked(signals), fit.rows.windows
    plain = np.zeros(len(stacked), dtype=np.int64)
    columns = project_stacked(signals.nodes, stacked, plain, windows.centres, windows.half)
    return dict(zip(counts, np.split(columns, np.cumsum(list(counts.values()))[:-1], axis=1), strict=True))


def left_by_place(law: WindowFit, signals: Signals, beside: Array) -> float:
    """Least mean square of the residuals with a torque of one kind that depends on the angle, without a prior.

    beside: columns (rows, n) that are fitted as well.
    """
    kinds = shape_columns(law, signals).values()
    return min(float(np.mean(residuals_beside(law, np.column_stack([beside, columns])) ** 2)) for columns in kinds)


def place_torque(fits: Sequence[PlaceFit], u: float) -> float:
    """Standard uncertainty of a11 by torques that depend on the angle and are not in the model."""
    return max((dark_uncertainty(fit.difference, fit.variance, u, len(fits)) for fit in fits), default=0.0)


def disagreement(chosen: WindowFit, other: WindowFit | None) -> float:
    """Standard uncertainty of a11 from the difference of another kind of windows beyond both uncertainties.

    And beyond attenuation, of which short windows have more: jumps of a tracker are no white noise of known size.
    """
    if other is None or other.total > COMPARED * abs(chosen.a11):
        return 0.0
    attenuated = attenuation(other) - attenuation(chosen)
    return _unexplained(chosen, other, other.u**2 + chosen.u**2 + attenuated**2)


def _unexplained(chosen: WindowFit, other: WindowFit, variance: float) -> float:
    """Dark uncertainty of two estimates whose difference has this variance by their type A.

    A declared imperfection is the same in both, so it explains the difference of its two effects.
    """
    pairs = zip(chosen.declared, other.declared, strict=True)
    variance += sum(float(mine.shifts[0] - theirs.shifts[0]) ** 2 for mine, theirs in pairs)
    return dark_uncertainty(other.a11 - chosen.a11, variance, chosen.u)


def common_instants(windows: Sequence[Windows]) -> Array:
    """Even instants over all windows, 16 in the shortest of them, for `noise_weights` (instants,)."""
    first = min(float(np.min(kind.centres - kind.half)) for kind in windows)
    last = max(float(np.max(kind.centres + kind.half)) for kind in windows)
    step = min(float(np.min(kind.half)) for kind in windows) / 8
    return np.arange(first, last + step, step)


def noise_weights(windows: Windows, influence: Array, instants: Array) -> Array:
    """Change of values whose rows have this `influence` (p, windows) per radian of error of an angle at each instant.

    (p, instants), but for a factor that all values share: through φ'', beside which gravity is negligible.
    """
    return superpose(instants, windows.centres, windows.half, influence, 2)
