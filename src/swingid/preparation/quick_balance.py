"""Residuals of equation (I) on short modulating functions all over a log, in a few tenths of a millisecond.

    a11 q1'' + b sin q1 + F(q1') = −a12 q2'' (reaction wheel), = τ (direct drive)

The rows are averaged in bins, the balance is evaluated with φ, φ' and φ'' as weights of bins, and fitted robustly.
Beside inertia, gravity and friction the fit has columns for errors that repeat with the motion: the angle's zero,
latency, and the encoders' nonlinearity. So it finds what happens once, and is no estimator of the inertia.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from swingid.errors import UnanswerableError
from swingid.model.equation import Equation
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array, Bools
from swingid.numerics.test_functions import CURVATURE_POWER
from swingid.preparation.motion import sixth_differences
from swingid.preparation.scale import equation_of
from swingid.preparation.speed import typical_step
from swingid.recording.recording import Recording

BINS = 4
"""Bins in half a window."""

SHORT, LONG = 0.5, 1.5
"""Half-length of the windows, of the time in which the motion turns (1/ω of a sine): with little noise, and at most."""

QUIET = 0.003
"""Noise of a window, of the largest acceleration, up to which it need not be longer."""

FEWEST_WINDOWS = 60

TURNED = 0.2
"""Second difference over the first, both over the same time, from which on a motion has turned enough for its pace."""

STEADY = 0.7
"""Of the frequency over half the time: from which on it is the motion's, and not that of noise."""

PLACES = 1000
"""Places all over the log at which its noise and its pace are estimated."""

PASSES = 5
"""Reweightings of the fit: first towards least absolute residuals, then without outliers."""

FAR = 6.0
"""Robust standard deviations beyond which a window is an outlier."""

RESTS = 0.03
"""Of the largest speed: an axis that is slower over three bins rests, and friction is then any torque that holds it."""

GRAINS = 10.0
"""Steps of the encoder that the angle passes in half a window, at least: else rounding errors repeat."""

SLOW = 0.15
"""Of the largest speed: below it, near a reversal, friction may deviate from its law."""

Whole = slice(BINS, -BINS)


@dataclass(frozen=True)
class QuickBalance:
    """Residuals of the balance, one value per window; every bin has one.

    times: middles (s). half: half-length (s). torque: external, averaged with φ (N m or N). scatter: its robust
    standard deviation; noise: that by the sensors' noise. largest: quantile 0.99 of drive or gravity over the windows.
    friction: quantile 0.9 of its torque. usable: no gap in the window; rests, slow: the axis
    comes to rest in it or hardly moves, or passes it slowly. turn: 1/ω of the motion (s).
    """

    times: Array
    half: float
    torque: Array
    scatter: float
    noise: float
    largest: float
    friction: float
    usable: Bools
    rests: Bools
    slow: Bools
    turn: float


def quick_balance(log: Recording, rig: Rig) -> QuickBalance | None:
    """The balance of a driven log on short windows; None without a drive, without motion and where it is too short."""
    try:
        equation = equation_of(rig)
    except UnanswerableError:  # without a scale reference; a method raises it
        return None
    wheel = "wheel" in equation.coefficients
    drive = log.wheel_angle if wheel else log.torque if "torque" in equation.coefficients else None
    if drive is None or len(log) < FEWEST_WINDOWS:
        return None
    step = typical_step(log.time)
    angle_noise = _noise(log.angle, rig.sensors.of("angle").resolution)
    turn, acceleration = pace(log.time, log.angle, step, angle_noise)
    if not 0.0 < turn * acceleration < np.inf:
        return None
    half = SHORT * turn
    while half < LONG * turn and _of_window(angle_noise, step, half) > QUIET * acceleration:
        half *= 1.25
    rows = max(round(half / (BINS * step)), 1)
    half = rows * step * BINS
    averaged = _averaged(log.time, step, rows, np.stack([log.angle, drive]))
    if averaged is None:
        return None
    middles, (q1, driven), full = averaged
    columns, target, speed = _columns(q1, driven, half / BINS, equation)
    usable = ~_within(~full)
    quickest = level(np.abs(speed[full]), 0.95)
    rests = _within(_resting(q1, RESTS * quickest * half / BINS))
    rests |= half * columns[1 + FRICTION.index("viscous_even")] < GRAINS * np.sqrt(12) * angle_noise
    fitted = _robust(columns[:, usable & ~rests][:, ::BINS], target[usable & ~rests][::BINS])
    if fitted is None:
        return None
    values, scatter = fitted
    gravity = (
        0.0 if equation.seeks("gravity_torque") else equation.value("gravity_torque") * level(np.abs(np.sin(q1)), 0.99)
    )
    wheel_noise = _noise(drive, rig.sensors.of("wheel").resolution) if wheel else 0.0
    noise = np.hypot(values[0] * angle_noise, equation.value("wheel") * wheel_noise)
    friction = values[1 : len(FRICTION) + 1] @ columns[1 : len(FRICTION) + 1]
    return QuickBalance(
        times=middles[Whole],
        half=half,
        torque=values @ columns - target,
        scatter=scatter,
        noise=_of_window(float(noise), step, half),
        largest=max(level(np.abs(target[usable]), 0.99), gravity),
        friction=level(np.abs(friction[usable]), 0.9),
        usable=usable,
        rests=rests,
        slow=np.abs(speed[Whole]) < SLOW * quickest,
        turn=turn,
    )


def level(values: Array, share: float) -> float:
    """The value that this share of the values does not exceed; quicker than a quantile."""
    place = min(int(share * len(values)), len(values) - 1)
    return float(np.partition(values, place)[place])


def _noise(values: Array, resolution: float) -> float:
    """Standard deviation of one sample, declared or estimated at some thousand places."""
    every = max(1, len(values) // PLACES)
    sixth = sixth_differences([values[k : len(values) - 6 + k : every] for k in range(7)])
    return max(level(np.abs(sixth), 0.5) / (0.6745 * float(np.sqrt(924))), resolution / float(np.sqrt(12)))


def _of_window(noise: float, step: float, half: float) -> float:
    """Standard deviation, by white noise of an angle, of its second derivative averaged with φ."""
    return float(noise * np.sqrt(CURVATURE_POWER * step / half**3) / (32 / 35 * half))


def pace(time: Array, angle: Array, step: float, noise: float) -> tuple[float, float]:
    """Time in which the motion turns (s; 1/ω of a sine), and about its largest acceleration.

    From first and second differences over a time that is lengthened until the second ones are large enough; both are
    quantiles 0.75 of the moving part, so that a short irregular part has no influence.
    """
    if np.ptp(np.diff(time[:: max(1, len(time) // 500)])) > 0.1 * step:
        even = np.arange(time[0], time[-1], step)
        angle = np.interp(even, time, angle)
    rows = len(angle)
    lag, frequency, seen = 1, 0.0, False
    while True:
        every = max(1, (rows - 2 * lag) // PLACES)
        behind, middle, ahead = angle[: -2 * lag : every], angle[lag:-lag:every], angle[2 * lag :: every]
        changes, bends = np.abs(ahead - behind), np.abs(ahead - 2 * middle + behind)
        moving = changes >= RESTS * level(changes, 0.95)
        first, second = level(changes[moving], 0.75) / 2, level(bends[moving], 0.75)
        if first == 0.0:
            return 0.0, 0.0
        before, frequency = frequency, 2 * np.arcsin(min(1.0, second / first / 2)) / (lag * step)
        # the second difference of noise falls with the square of the time
        if (seen and frequency > STEADY * before) or 12 * lag > rows:
            return 1 / max(frequency, 1e-300), first / (lag * step) * frequency
        seen = second > TURNED * first and second > 6 * noise
        lag *= 2


def _averaged(time: Array, step: float, rows: int, signals: Array) -> tuple[Array, Array, Bools] | None:
    """Middles of bins of so many rows, the means of the signals there, and which bins have most of their rows."""
    width = rows * step
    count = int((time[-1] - time[0] + step) / width)
    if count < FEWEST_WINDOWS + 2 * BINS:
        return None
    edges = time[0] - step / 2 + width * np.arange(count + 1)
    first = np.searchsorted(time, edges)
    counts = np.diff(first)
    begins = np.minimum(first[:-1], first[-1] - 1)
    divisor = np.maximum(counts, 1)
    middles = (edges[1:] + edges[:-1]) / 2
    off = middles - np.add.reduceat(time[: first[-1]], begins) / divisor
    means: Array = np.add.reduceat(signals[:, : first[-1]], begins, axis=1) / divisor
    # rows that are missing leave the mean beside the middle of the bin
    means += off * np.gradient(means, width, axis=1)
    return middles, means, counts > rows / 2


FRICTION = ("coulomb", "viscous", "quadratic", "cubic", "offset", "viscous_even")


def _columns(q1: Array, driven: Array, width: float, equation: Equation) -> tuple[Array, Array, Array]:
    """Columns (unknowns, windows) with the inertia's first and friction's next, the known side, the speed in the bins.

    driven: means of the wheel's angle, or of the torque.
    """
    speed = np.convolve(q1, np.array([2.0, 1.0, 0.0, -1.0, -2.0]) / (10 * width), "same")
    speed[:2], speed[-2:] = speed[2], speed[-3]
    size = np.abs(speed)
    with np.errstate(divide="ignore", invalid="ignore"):
        sign = np.nan_to_num(np.clip(2 * speed / np.abs(np.gradient(speed)), -1.0, 1.0))
    averaged = [sign, speed * size, speed * size * size, np.ones_like(q1), size]
    # terms of the angle only repeat with the motion: they are fitted whatever the rig states of them
    averaged += [term.regressor(q1, speed, sign) for term in equation.slots]
    curved, gravity = [q1], len(averaged)
    if not equation.linear:
        sine, cosine = np.sin(q1), np.cos(q1)
        averaged += [sine, cosine]
        curved += [sine, cosine]
    # the drive comes last: the wheel's angle with its nonlinearity, or the torque
    wheel = "wheel" in equation.coefficients
    if wheel:
        curved += [np.sin(driven), np.cos(driven), driven]
    else:
        averaged.append(driven)
    mean, slope, bend = _kernels()
    plain = _filtered(np.stack(averaged), mean)
    bent = _filtered(np.stack(curved), bend / width**2)
    viscous = _filtered(q1[None], slope / width)
    if wheel:
        drive, bent = -equation.value("wheel") * bent[-1], bent[:-1]
    else:
        drive, plain = plain[-1], plain[:-1]
    rate = np.gradient(drive)
    stated = 0.0 if equation.linear else equation.value("gravity_torque")
    target = drive - stated * plain[gravity] if stated else drive
    return np.vstack([bent[:1], plain[:1], viscous, plain[1:], bent[1:], rate[None]]), target, speed


@cache
def _kernels() -> Array:
    """Weights of 2 BINS + 1 bins of width 1 that give the mean with φ of a signal, of its first and second derivative.

    Exact for parabolas and cubics, whatever the bins do to φ.
    """
    k = np.arange(-BINS, BINS + 1.0)
    s = k / BINS
    p = 1 - s * s
    mean, slope, bend = p**3, s * p * p, -p * (p - 4 * s * s)
    bend = bend - np.mean(bend)
    return np.stack([mean / mean.sum(), slope / (slope @ k), bend / (bend @ (k * k)) * 2])


def _filtered(signals: Array, kernel: Array) -> Array:
    """Weighted sums over every run of bins as long as the kernel; (signals, windows)."""
    windows = signals.shape[1] - 2 * BINS
    result: Array = kernel[0] * signals[:, :windows]
    for k in range(1, len(kernel)):
        result += kernel[k] * signals[:, k : k + windows]
    return result


def _within(bins: Bools) -> Bools:
    """Return whether any of these bins lies in each window."""
    before = np.concatenate([[0], np.cumsum(bins)])
    result: Bools = before[2 * BINS + 1 :] > before[: -2 * BINS - 1]
    return result


def _resting(q1: Array, threshold: float) -> Bools:
    """Bins from which the angle changes less than this to both neighbours."""
    still = np.abs(np.diff(q1)) < threshold
    result = np.zeros(len(q1), dtype=bool)
    result[1:-1] = still[1:] & still[:-1]
    return result


def _robust(columns: Array, target: Array) -> tuple[Array, float] | None:
    """Robust estimate of the unknowns, and the robust standard deviation of the residuals."""
    if len(target) < 2 * len(columns) or not np.any(target):
        return None
    sizes = np.sqrt(np.mean(columns * columns, axis=1))
    sizes[sizes == 0.0] = 1.0  # a regressor of zeros
    columns = columns / sizes[:, None]
    weights = np.ones(len(target))
    tiny = 1e-10 * np.eye(len(columns))
    for k in range(PASSES):
        weighted = columns * weights
        matrix = weighted @ columns.T
        matrix += matrix.trace() * tiny
        values = np.asarray(np.linalg.solve(matrix, weighted @ target), dtype=np.float64)
        size = np.abs(target - values @ columns)
        scatter = 1.4826 * level(size, 0.5)
        weights = scatter / np.maximum(size, max(scatter, 1e-300))
        if k > 1:
            weights[size > FAR * scatter] = 0.0
    return values / sizes, scatter
