"""The momentum method for many logs at once: one length of windows for all, chosen once as for a single log.

The rows, the basis of friction, the fit and its uncertainty are those of the "law" windows of `momentum`. What a single
log gets beside it is left out: the search for a length per log, other windows as judges, effects of declared
imperfections, checks. So `u` is the scatter of the rows and the sensors alone. For campaigns; a log that matters goes
to `identify`.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from swingid.errors import UnanswerableError
from swingid.identify.batch.plan import UNKNOWNS, Batch, Plan, require_batch
from swingid.identify.batch.projections import (
    COLUMNS,
    COULOMB,
    EVEN,
    GRAVITY,
    INERTIA,
    OFFSET,
    QUADRATIC,
    VISCOUS,
    WHEEL,
    project_runs,
    window_weights,
)  # fmt: skip
from swingid.identify.momentum.fits import LAG
from swingid.identify.scale import Scale
from swingid.model.rig import Rig
from swingid.numerics.test_functions import CURVATURE_POWER, curvature_overlap

Array = NDArray[np.float64]

PLACES = (INERTIA, COULOMB, VISCOUS, QUADRATIC, OFFSET, EVEN)
BLUR = 0.01
"""s: half the time over which the speed of the friction columns is taken."""


def momentum_batch(
    angle: Array, wheel_angle: Array | None, rate: float, rig: Rig, plan: Plan, *, threads: int | None = None
) -> Batch:
    """Inertia and friction from angles (n, rows) (rad) and wheel angles, logged at `rate` (1/s) by one rig.

    Raises InputError for a direct drive or an unknown gravity torque, which this cannot do, and UnanswerableError where
    the part used holds too few windows.
    """
    scale = Scale.of(rig)
    require_batch(rig, scale)
    rows, step = angle.shape[1], 1.0 / rate
    reach = 2 * max(2, round(0.5 * plan.half * rate))
    first, last = round(plan.start * rate), min(rows - 1, round(plan.stop * rate))
    windows = (last - first - 2 * reach) // (reach // 2) + 1
    if windows < 2 * LAG or windows <= LAG / 2 * len(UNKNOWNS):
        raise UnanswerableError(f"only {windows} windows fit into the logs; record longer ones.", code="too-short")
    columns = np.empty((len(angle), windows, COLUMNS))
    weights = window_weights(reach, step)
    wheel = np.empty((0, rows)) if wheel_angle is None else wheel_angle
    blur = max(1, round(BLUR * rate))

    def part(begin: int, end: int) -> None:
        own = wheel[begin:end] if len(wheel) else wheel
        project_runs(angle[begin:end], own, step, blur, first, reach // 2, weights, columns[begin:end])

    workers = threads or len(os.sched_getaffinity(0))
    edges = np.linspace(0, len(angle), workers + 1).astype(int)
    with ThreadPoolExecutor(workers) as pool:
        list(pool.map(part, edges[:-1], edges[1:]))
    return _fitted(columns, scale, plan, reach * step, step)


def _fitted(columns: Array, scale: Scale, plan: Plan, half: float, step: float) -> Batch:
    """Least squares of all logs, with the covariance of `fit_rows`: Newey and West, no less than the sensors'."""
    matrix = columns[:, :, PLACES]
    known = -scale.a12 * columns[:, :, WHEEL] - (scale.b or 0.0) * columns[:, :, GRAVITY]
    size = np.linalg.norm(matrix, axis=1, keepdims=True)
    size[size == 0.0] = 1.0
    scaled = matrix / size
    inverse = np.linalg.pinv(scaled.transpose(0, 2, 1) @ scaled, rcond=1e-14, hermitian=True)
    influence = (inverse @ scaled.transpose(0, 2, 1)) / size.transpose(0, 2, 1)
    values = (influence @ known[:, :, None])[:, :, 0]
    scores = influence * (known - (matrix @ values[:, :, None])[:, :, 0])[:, None, :]
    covariance = scores @ scores.transpose(0, 2, 1)
    for k in range(1, LAG + 1):
        cross = scores[:, :, k:] @ scores[:, :, :-k].transpose(0, 2, 1)
        covariance += (1 - k / (LAG + 1)) * (cross + cross.transpose(0, 2, 1))
    independent = matrix.shape[1] / (LAG / 2)
    covariance *= independent / max(independent - len(UNKNOWNS), 1.0)
    sensor = _sensor_variance(influence[:, 0], values[:, 0], scale, plan, half, step)
    covariance *= np.maximum(1.0, sensor / np.maximum(covariance[:, 0, 0], 1e-300))[:, None, None]
    power = plan.noise**2 * step * CURVATURE_POWER * matrix.shape[1] / half**3
    bias = values[:, :1] * power * (influence @ influence[:, 0, :, None])[:, :, 0]
    covariance += bias[:, :, None] * bias[:, None, :]
    return Batch(values[:, 0] - scale.carried, np.sqrt(covariance[:, 0, 0]), values, covariance)


def _sensor_variance(weights: Array, a11: Array, scale: Scale, plan: Plan, half: float, step: float) -> Array:
    """Variance of a11 (n,) from white noise of both angles, through phi''; weights (n, windows): influence of a11."""
    variance = np.zeros(len(weights))
    for lag in range(4):
        overlap = float(curvature_overlap(np.array([0.5 * lag]))[0])
        pairs = (weights[:, lag:] * weights[:, : weights.shape[1] - lag]).sum(axis=1)
        variance += (1.0 if lag == 0 else 2.0) * overlap * pairs
    power = (a11 * plan.noise) ** 2 + (scale.a12 * plan.wheel_noise) ** 2
    result: Array = np.maximum(variance, 0.0) / half**3 * power * step
    return result
