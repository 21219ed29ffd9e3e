"""The momentum method for many logs at once: one length of windows for all, chosen once as for a single log.

The rows, the basis of friction, the fit and its uncertainty are those of the "law" windows of `momentum`. Without the
search for a length per log, other windows, declared imperfections and checks: `u` contains the scatter of the rows and
the noise of the sensors alone. For campaigns; for a single log use `identify`.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np

from swingid.balance.fits import LAG, with_excess
from swingid.batch import kernels
from swingid.batch.plan import Batch, Plan, at_stamps, channels_of, require_batch
from swingid.errors import UnanswerableError
from swingid.model.equation import Equation
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.numerics.test_functions import CURVATURE_POWER, overlap_terms
from swingid.preparation.scale import equation_of
from swingid.preparation.speed import SHARE
from swingid.system import cores

PLACES = (kernels.INERTIA, kernels.COULOMB, kernels.VISCOUS, kernels.QUADRATIC, kernels.OFFSET, kernels.EVEN)
"""Columns of the unknowns: a11 of the whole axis first, then the terms of friction."""

REVERSAL = 0.5 / SHARE
"""Half-width of the cubics for reversals, in that of the plan: half of that for speeds, as for a single log."""

NARROWEST = 2.5
"""Half-width in sample steps, at least: five samples."""


def momentum_batch(
    angle: Array, wheel_angle: Array | None, rate: float, rig: Rig, plan: Plan, *, threads: int | None = None
) -> Batch:
    """Inertias from angles (n, rows) (rad) and wheel angles, logged at `rate` (1/s) by one rig.

    Raises InputError for a direct drive or an unknown gravity torque, which this cannot do, and for a channel that is
    missing or of another shape; UnanswerableError where the part used holds too few windows.
    """
    equation = equation_of(rig)
    require_batch(rig, equation)
    angle, (wheel_angle,) = channels_of(equation, angle, wheel_angle=wheel_angle)
    encoders = plan.encoders(rig)
    late = encoders.wheel.latency.value - encoders.angle.latency.value
    rows, step = angle.shape[1], 1.0 / rate
    reach = 2 * max(2, round(0.5 * plan.half * rate))
    width = max(plan.width, NARROWEST * step)
    speed, kink = kernels.smoothing(width, step)[1], kernels.kinked(REVERSAL * width, step)
    ends = len(speed) - 1  # samples at both ends without a speed
    first, last = max(ends, round(plan.start * rate)), min(rows - 1 - ends, round(plan.stop * rate))
    windows = (last - first - 2 * reach) // (reach // 2) + 1
    if windows < 2 * LAG or windows <= LAG / 2 * len(PLACES):
        text = f"only {max(windows, 0)} windows fit into the logs; record longer ones."
        raise UnanswerableError(text, code="too-short")
    columns = np.empty((len(angle), windows, kernels.COLUMNS))
    weights = kernels.window_weights(reach, step)
    wheel = np.empty((0, rows)) if wheel_angle is None else wheel_angle

    def part(begin: int, end: int) -> None:
        own = at_stamps(wheel[begin:end], rate, late) if len(wheel) else wheel
        kernels.project_runs(angle[begin:end], own, (speed, kink), first, reach // 2, weights, columns[begin:end])

    workers = threads or cores()
    edges = np.linspace(0, len(angle), workers + 1).astype(int)
    with ThreadPoolExecutor(workers) as pool:
        list(pool.map(part, edges[:-1], edges[1:]))
    stiffness = np.cos(angle[:, first : last + 1 : reach // 4 or 1]).mean(axis=1)
    return _fitted(columns, stiffness, equation, plan, reach * step, step)


def _fitted(columns: Array, stiffness: Array, equation: Equation, plan: Plan, half: float, step: float) -> Batch:
    """Least squares of all logs, with the variance of a11 of `covariance_of`: sensor noise and excess scatter."""
    matrix = columns[:, :, PLACES]
    known = (
        -equation.value("wheel") * columns[:, :, kernels.WHEEL]
        - equation.value("gravity_torque") * columns[:, :, kernels.GRAVITY]
    )
    values, weights, scores = kernels.least_squares(matrix, known, 1e-14)
    a11, coulomb = values[:, 0], values[:, PLACES.index(kernels.COULOMB)]
    variance = (scores * scores).sum(axis=1)
    for k in range(1, LAG + 1):
        variance += 2.0 * (1 - k / (LAG + 1)) * (scores[:, k:] * scores[:, :-k]).sum(axis=1)
    independent = matrix.shape[1] / (LAG / 2)
    variance *= independent / max(independent - len(PLACES), 1.0)
    gravity = equation.value("gravity_torque") * stiffness * half**2 / a11
    sensor, seen = _sensor_variance(weights, a11, gravity, equation, plan, half, step)
    variance = with_excess(sensor, seen, variance, matrix.shape[1] - len(PLACES))
    power = plan.noise**2 * step * CURVATURE_POWER * matrix.shape[1] / half**3
    variance += (a11 * power * (weights * weights).sum(axis=1)) ** 2  # noise in the regressor of the inertia
    variance += (coulomb * (weights * columns[:, :, kernels.LATE]).sum(axis=1)) ** 2
    return Batch(a11 - equation.carried, np.sqrt(variance))


def _sensor_variance(
    weights: Array, a11: Array, gravity: Array, equation: Equation, plan: Plan, half: float, step: float
) -> tuple[Array, Array]:
    """Variance of a11 (n,) by white noise of both angles, and Newey and West's sum for that noise.

    weights (n, windows): influence of the windows on a11; gravity (n,): as in `curvature_overlap`.
    """
    powers = [(a11 * plan.noise) ** 2, (equation.value("wheel") * plan.wheel_noise) ** 2]
    true, seen = np.zeros(len(weights)), np.zeros(len(weights))
    for lag, curved, crossed, plain in zip(range(4), *overlap_terms(np.arange(0.0, 2.0, 0.5)), strict=True):
        pairs = (weights[:, lag:] * weights[:, : weights.shape[1] - lag]).sum(axis=1) * (2.0 if lag else 1.0)
        both = pairs * (powers[0] * (curved + gravity * (2 * crossed + gravity * plain)) + powers[1] * curved)
        true += both
        seen += (1 - lag / (LAG + 1)) * both
    unit = step / half**3
    return np.maximum(true, 0.0) * unit, np.maximum(seen, 0.0) * unit
