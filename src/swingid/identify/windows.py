"""Fits of the balance on test functions, and the choice of their length.

Three kinds of windows answer the same question with different assumptions:

law     windows all over the motion; friction is a small basis fitted beside the inertia
swing   as law, but each window inside one swing, away from the turning points
even    windows centred on the turning points; friction odd in speed vanishes there without any law

The length of "law" windows minimises the standard uncertainty of the inertia: short windows amplify sensor noise,
long ones let through what the friction basis does not describe, and both show in the scatter of the rows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swingid.errors import UnanswerableError
from swingid.identify.balance import Rows, Signals, Windows, rows_of
from swingid.identify.scale import Scale
from swingid.numerics.regression import LinearFit, fit_linear
from swingid.numerics.spline import spline_at, spline_slopes
from swingid.numerics.test_functions import curvature_overlap, superpose

Array = NDArray[np.float64]

BASIS = ("coulomb", "viscous", "quadratic", "offset", "viscous_even")
"""Odd friction c0 sgn v + c1 v + c2 v|v|, and even friction (what depends on the direction) 1 and |v|.

The even terms live on even harmonics of the motion, where the inertia is not, so they cost nothing. A richer odd
basis would be nearly collinear.
"""

LAG = 4
"""Neighbouring rows that share data (windows of length 2L, one every L/2), and so are correlated."""

DETECTED = 4.0
"""Standard uncertainties beyond which a friction memory counts as seen."""


FLAT = 1.25
"""Of windows whose uncertainties are equal within this factor the longest is taken."""


@dataclass(frozen=True)
class Noise:
    """Standard deviations of one sample of the angle and of the wheel angle, the sample step in s, the angle's grid."""

    angle: float
    wheel: float
    step: float
    resolution: float = 0.0


@dataclass(frozen=True)
class WindowFit:
    """A fit of the balance on windows of one kind.

    unknowns names the columns ("inertia" first); a11 and its standard uncertainty are for the whole axis.
    """

    rows: Rows
    unknowns: tuple[str, ...]
    fit: LinearFit
    covariance: Array
    half: float

    def value(self, name: str) -> float:
        """Fitted value of an unknown, 0 where it was not fitted."""
        return float(self.fit.values[self.unknowns.index(name)]) if name in self.unknowns else 0.0

    def uncertainty(self, name: str) -> float:
        """Type A standard uncertainty of an unknown."""
        k = self.unknowns.index(name)
        return float(np.sqrt(self.covariance[k, k]))

    @property
    def a11(self) -> float:
        """Inertia of the whole axis, a11 = J1 + J2 + Jr."""
        return float(self.fit.values[0])

    @property
    def u(self) -> float:
        """Type A standard uncertainty of a11."""
        return float(np.sqrt(self.covariance[0, 0]))


def known_side(rows: Rows, scale: Scale) -> Array:
    """What the balance knows of each row: −a12 ∫φ'' q2 + ∫φ τ − b ∫φ sin q1."""
    return -scale.a12 * rows.wheel + rows.torque - (scale.b or 0.0) * rows.gravity


def columns_of(rows: Rows, scale: Scale, friction: tuple[str, ...]) -> tuple[tuple[str, ...], Array]:
    """Names and columns of the unknowns."""
    named = {"inertia": rows.inertia}
    if scale.b is None:
        named["gravity_torque"] = rows.gravity
    named |= {name: rows.friction[name] for name in friction}
    return tuple(named), np.column_stack(list(named.values()))


def fit_rows(rows: Rows, scale: Scale, noise: Noise, friction: tuple[str, ...]) -> WindowFit | None:
    """Fit the balance; None where there are too few rows for the unknowns."""
    unknowns, columns = columns_of(rows, scale, friction)
    if len(rows.windows) < 2 * LAG or len(rows.windows) / (LAG / 2) <= len(unknowns):
        return None
    fit = fit_linear(columns, known_side(rows, scale))
    covariance = fit.covariance(LAG)
    sensor = _sensor_variance(rows.windows, fit, scale, noise)
    covariance = covariance * max(1.0, sensor / covariance[0, 0] if covariance[0, 0] > 0 else 1.0)
    covariance[0, 0] += _attenuation(rows.windows, fit, noise) ** 2
    return WindowFit(rows, unknowns, fit, covariance, float(np.median(rows.windows.half)))


def _sensor_variance(windows: Windows, fit: LinearFit, scale: Scale, noise: Noise) -> float:
    """Variance of a11 from white noise of both angles, through φ''."""
    weights = fit.influence[0] / windows.half**1.5
    variance = 0.0
    for lag in range(min(2 * LAG, len(weights))):
        distance = (windows.centres[lag:] - windows.centres[: len(weights) - lag]) / windows.half[lag:]
        pairs = weights[lag:] * weights[: len(weights) - lag] * curvature_overlap(distance)
        variance += (1.0 if lag == 0 else 2.0) * float(pairs.sum())
    power = (fit.values[0] * noise.angle) ** 2 + (scale.a12 * noise.wheel) ** 2
    return max(variance, 0.0) * power * noise.step


def _attenuation(windows: Windows, fit: LinearFit, noise: Noise) -> float:
    """Bias of a11 by noise in its own column ∫φ'' q1 (errors in variables), to first order."""
    column_variance = noise.angle**2 * noise.step * float(np.sum(curvature_overlap(np.zeros(1)) / windows.half**3))
    return float(fit.values[0] * column_variance * (fit.influence[0] @ fit.influence[0]))


def law_windows(signals: Signals, half: float) -> Windows:
    """Windows of half-length `half` every half/2, none across a rest or a gap of the log."""
    time = signals.nodes.time
    centres = np.arange(time[0] + half, time[-1] - half, half / 2)
    windows = Windows(centres, np.full(len(centres), half))
    return windows.select(_clear(signals, windows))


def swing_windows(signals: Signals) -> Windows:
    """Three windows inside each swing, of 0.8 of its duration, away from both turning points."""
    begins, ends = signals.motion.turning_times[:-1], signals.motion.turning_times[1:]
    duration = ends - begins
    middles = (begins + ends) / 2
    shifts = np.array([-0.06, 0.0, 0.06])
    centres = (middles[:, None] + duration[:, None] * shifts).ravel()
    windows = Windows(centres, np.repeat(0.4 * duration, len(shifts)))
    return windows.select(_clear(signals, windows))


def even_windows(signals: Signals, half: float) -> Windows:
    """Windows centred on the turning points, cut to reach no farther than the next ones and the ends of the log."""
    time, turning = signals.nodes.time, signals.motion.turning_times
    edges = np.concatenate([[time[0]], turning, [time[-1]]])
    reach = np.minimum(np.minimum(turning - edges[:-2], edges[2:] - turning), half)
    windows = Windows(turning, reach)
    return windows.select((reach > 0.6 * half) & _clear(signals, windows))


def _clear(signals: Signals, windows: Windows) -> NDArray[np.bool_]:
    """Whether each window holds enough samples, no rest of the axis and no gap longer than a quarter of it."""
    time = signals.nodes.time
    first = np.searchsorted(time, windows.centres - windows.half)
    last = np.searchsorted(time, windows.centres + windows.half)
    clear: NDArray[np.bool_] = (last - first) >= 6
    gaps = np.diff(time)
    for k in np.nonzero(gaps > 0.25 * windows.half.min(initial=np.inf))[0]:
        covered = (windows.centres - windows.half < time[k + 1]) & (windows.centres + windows.half > time[k])
        clear &= ~(covered & (gaps[k] > 0.25 * windows.half))
    for begin, end in signals.motion.rests:
        clear &= (windows.centres + windows.half <= begin) | (windows.centres - windows.half >= end)
    return clear


def choose_law(signals: Signals, scale: Scale, noise: Noise) -> tuple[WindowFit, dict[float, WindowFit]]:
    """The "law" fit of least uncertainty, and the fits of all lengths tried (by half-length in s).

    If friction has a memory, an impulse at each reversal (the old direction lives on for a moment: LuGre's
    bristles, backlash, a short stick) is fitted too, where it is seen beyond noise and encoder grid. Raises
    UnanswerableError for a log too short for any window.
    """
    tried = _search(signals, scale, noise, BASIS)
    remembered = {
        half: fit
        for half, plain in tried.items()
        # over a whole swing and more, an impulse at each reversal looks like inertia
        if half < 0.55 * signals.motion.half_period
        and (fit := fit_rows(plain.rows, scale, noise, (*BASIS, "memory"))) is not None
    }
    if remembered:
        sharpest = min(remembered.values(), key=lambda fit: fit.uncertainty("memory"))
        spread = np.hypot(sharpest.uncertainty("memory"), grid_spread(signals, sharpest, noise, "memory"))
        if abs(sharpest.value("memory")) > DETECTED * spread:
            tried = remembered
    least = min(fit.u for fit in tried.values())
    return max((fit for fit in tried.values() if fit.u <= FLAT * least), key=lambda fit: fit.half), tried


def timing_spread(signals: Signals, fit: WindowFit) -> float:
    """What late turning points do to a11: friction turns around at the wrong instant, alike at every swing."""
    if "memory" in fit.unknowns:
        return 0.0
    jump = 2 * abs(fit.value("coulomb")) / abs(fit.a11)
    impulse = jump * abs(fit.a11) * signals.motion.lateness(jump)
    return abs(float(fit.fit.influence[0] @ fit.rows.friction["memory"])) * impulse


def grid_spread(signals: Signals, fit: WindowFit, noise: Noise, unknown: str) -> float:
    """What the place of the encoder's grid does to an unknown: its standard deviation over shifts of the grid.

    A coarse encoder errs alike at every turning point, so its error does not average out over the swings as white
    noise does. The smoothed angle is rounded on a grid that is shifted by eighths of a step.
    """
    if noise.resolution == 0.0:
        return 0.0
    speed, time = signals.motion.speed, signals.nodes.time
    smooth = spline_at(speed.grid, speed.angle, spline_slopes(speed.grid, speed.angle), time, 0)
    windows, row = fit.rows.windows, fit.fit.influence[fit.unknowns.index(unknown)]
    weights = superpose(time, windows.centres, windows.half, row, 2) * np.gradient(time) * fit.a11
    shifted = smooth / noise.resolution + np.arange(8)[:, None] / 8
    effects = ((np.round(shifted) - shifted) @ weights) * noise.resolution
    return float(np.sqrt(np.mean(effects**2)))


def _search(signals: Signals, scale: Scale, noise: Noise, friction: tuple[str, ...]) -> dict[float, WindowFit]:
    """Fits by half-length: octaves downwards while they get better, then the half octaves beside the best."""
    time = signals.nodes.time
    longest = min(0.75 * signals.motion.half_period, (time[-1] - time[0]) / 5)
    shortest = 4 * noise.step
    tried: dict[float, WindowFit] = {}

    def attempt(half: float) -> WindowFit | None:
        fit = fit_rows(rows_of(signals, law_windows(signals, half)), scale, noise, friction)
        if fit is not None and np.isfinite(fit.u):
            tried[half] = fit
        return tried.get(half)

    half = longest
    while half > shortest:
        fit = attempt(half)
        if fit is not None and fit.u > 2.5 * min(other.u for other in tried.values()):
            break
        half /= 2
    if not tried:
        raise UnanswerableError(
            f"the log holds {time[-1] - time[0]:.3g} s of usable motion, too little to fit inertia and friction; "
            "record at least five swings.",
            code="too-short",
        )
    best = min(tried, key=lambda length: tried[length].u)
    for neighbour in (best / np.sqrt(2), best * np.sqrt(2)):
        if shortest < neighbour < longest:
            attempt(neighbour)
    return tried
