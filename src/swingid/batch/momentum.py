"""The momentum method for many logs at once: one length of windows for all, chosen once as for a single log.

The rows, the basis of friction, the fit and its uncertainty are those of the "law" windows of `momentum`. What a single
log gets beside it is left out: the search for a length per log, the consistency check on other windows, effects of
declared imperfections, checks. So `u` is the scatter of the rows and the sensors alone. For campaigns; a log that
matters goes to `identify`.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np

from swingid.balance.fits import LAG, with_excess
from swingid.batch.kernels import (
    COLUMNS,
    COULOMB,
    EVEN,
    GRAVITY,
    INERTIA,
    LATE,
    OFFSET,
    QUADRATIC,
    VISCOUS,
    WHEEL,
    kinked,
    njit_sums_threads,
    project_run,
    signs,
    slopes,
    smoothing,
    window_weights,
)
from swingid.batch.plan import Batch, Plan, at_stamps, require_batch
from swingid.errors import UnanswerableError
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.numerics.test_functions import CURVATURE_POWER, overlap_terms
from swingid.preparation.encoders import Encoders
from swingid.preparation.scale import Scale
from swingid.preparation.speed import SHARE
from swingid.system import cores

PLACES = (INERTIA, COULOMB, VISCOUS, QUADRATIC, OFFSET, EVEN)
"""Columns of the unknowns: a11 of the whole axis first, then the terms of friction that free it of friction."""

REVERSAL = 0.5 / SHARE
"""Half-width of the cubics that show reversals, in that of the plan: of a speed's it is half, as for a single log."""

NARROWEST = 2.5
"""Sample steps that a half-width has at least: five samples."""


def momentum_batch(
    angle: Array, wheel_angle: Array | None, rate: float, rig: Rig, plan: Plan, *, threads: int | None = None
) -> Batch:
    """Inertias from angles (n, rows) (rad) and wheel angles, logged at `rate` (1/s) by one rig.

    Raises InputError for a direct drive or an unknown gravity torque, which this cannot do, and UnanswerableError where
    the part used holds too few windows.
    """
    scale = Scale.of(rig)
    require_batch(rig, scale)
    encoders = Encoders.of(rig)
    late = encoders.wheel.latency.value - encoders.angle.latency.value
    rows, step = angle.shape[1], 1.0 / rate
    reach = 2 * max(2, round(0.5 * plan.half * rate))
    width = max(plan.width, NARROWEST * step)
    speed, kink = smoothing(width, step)[1], kinked(REVERSAL * width, step)
    ends = len(speed) - 1  # samples at both ends without a speed
    first, last = max(ends, round(plan.start * rate)), min(rows - 1 - ends, round(plan.stop * rate))
    windows = (last - first - 2 * reach) // (reach // 2) + 1
    if windows < 2 * LAG or windows <= LAG / 2 * len(PLACES):
        raise UnanswerableError(f"only {windows} windows fit into the logs; record longer ones.", code="too-short")
    columns = np.empty((len(angle), windows, COLUMNS))
    weights = window_weights(reach, step)
    wheel = np.empty((0, rows)) if wheel_angle is None else wheel_angle

    def part(begin: int, end: int) -> None:
        own = at_stamps(wheel[begin:end], rate, late) if len(wheel) else wheel
        project_runs(angle[begin:end], own, step, (speed, kink), first, reach // 2, weights, columns[begin:end])

    workers = threads or cores()
    edges = np.linspace(0, len(angle), workers + 1).astype(int)
    with ThreadPoolExecutor(workers) as pool:
        list(pool.map(part, edges[:-1], edges[1:]))
    stiffness = np.cos(angle[:, first : last + 1 : reach // 4 or 1]).mean(axis=1)
    return _fitted(columns, stiffness, scale, plan, reach * step, step)


@njit_sums_threads
def project_runs(
    angle: Array,
    wheel: Array,
    step: float,
    speeds: tuple[Array, Array],
    first: int,
    spacing: int,
    weights: Array,
    result: Array,
) -> None:
    """`project_run` for all logs (n, rows), into result (n, windows, COLUMNS). wheel may have no rows: no wheel.

    speeds: weights of the speed and of `kinked`. first, spacing: of the windows (samples); weights: `window_weights`.
    """
    work = np.empty((4, angle.shape[1]))
    still = np.zeros(angle.shape[1])
    for k in range(len(angle)):
        slopes(angle[k], speeds[0], work[1])
        signs(angle[k], work[1], speeds[1], work[2], work[3])
        project_run(angle[k], wheel[k] if len(wheel) > 0 else still, first, spacing, weights, work, result[k])


def _fitted(columns: Array, stiffness: Array, scale: Scale, plan: Plan, half: float, step: float) -> Batch:
    """Least squares of all logs, with the variance of a11 of `covariance_of`: sensor noise and excess scatter."""
    matrix = columns[:, :, PLACES]
    known = -scale.a12 * columns[:, :, WHEEL] - (scale.b or 0.0) * columns[:, :, GRAVITY]
    size = np.linalg.norm(matrix, axis=1, keepdims=True)
    size[size == 0.0] = 1.0
    scaled = matrix / size
    inverse = np.linalg.pinv(scaled.transpose(0, 2, 1) @ scaled, rcond=1e-14, hermitian=True)
    values = (inverse @ (scaled.transpose(0, 2, 1) @ known[:, :, None])) / size.transpose(0, 2, 1)
    a11, coulomb = values[:, 0, 0], values[:, PLACES.index(COULOMB), 0]
    weights = (scaled @ inverse[:, :, :1])[:, :, 0] / size[:, :, 0]  # influence of the windows on a11
    scores = weights * (known - (matrix @ values)[:, :, 0])
    variance = (scores * scores).sum(axis=1)
    for k in range(1, LAG + 1):
        variance += 2.0 * (1 - k / (LAG + 1)) * (scores[:, k:] * scores[:, :-k]).sum(axis=1)
    independent = matrix.shape[1] / (LAG / 2)
    variance *= independent / max(independent - len(PLACES), 1.0)
    gravity = (scale.b or 0.0) * stiffness * half**2 / a11
    sensor, seen = _sensor_variance(weights, a11, gravity, scale, plan, half, step)
    variance = with_excess(sensor, seen, variance, matrix.shape[1] - len(PLACES))
    power = plan.noise**2 * step * CURVATURE_POWER * matrix.shape[1] / half**3
    variance += (a11 * power * (weights * weights).sum(axis=1)) ** 2  # noise in the regressor of the inertia
    variance += (coulomb * (weights * columns[:, :, LATE]).sum(axis=1)) ** 2
    return Batch(a11 - scale.carried, np.sqrt(variance))


def _sensor_variance(
    weights: Array, a11: Array, gravity: Array, scale: Scale, plan: Plan, half: float, step: float
) -> tuple[Array, Array]:
    """Variance of a11 (n,) from white noise of both angles, and what Newey and West's sum sees of it.

    weights (n, windows): influence of the windows on a11; gravity (n,): as in `curvature_overlap`.
    """
    powers = [(a11 * plan.noise) ** 2, (scale.a12 * plan.wheel_noise) ** 2]
    true, seen = np.zeros(len(weights)), np.zeros(len(weights))
    for lag, curved, crossed, plain in zip(range(4), *overlap_terms(np.arange(0.0, 2.0, 0.5)), strict=True):
        pairs = (weights[:, lag:] * weights[:, : weights.shape[1] - lag]).sum(axis=1) * (2.0 if lag else 1.0)
        both = pairs * (powers[0] * (curved + gravity * (2 * crossed + gravity * plain)) + powers[1] * curved)
        true += both
        seen += (1 - lag / (LAG + 1)) * both
    unit = step / half**3
    return np.maximum(true, 0.0) * unit, np.maximum(seen, 0.0) * unit
