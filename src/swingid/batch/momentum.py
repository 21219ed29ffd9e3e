"""The momentum method for many logs at once: one length of windows for all, chosen once as for a single log.

The rows, the basis of friction, the fit and its uncertainty are those of the "law" windows of `momentum`. Without the
search for a length per log, other windows, declared imperfections and checks: `u` contains the scatter of the rows and
the noise of the sensors alone. For campaigns; for a single log use `identify`.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from swingid.balance.covariance import LAG, covariance_of
from swingid.balance.fits import BASIS
from swingid.balance.rows import Rows, Windows
from swingid.batch import kernels
from swingid.batch.plan import Batch, Plan, at_stamps, channels_of, require_batch
from swingid.errors import UnanswerableError
from swingid.model.equation import Equation
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.numerics.regression import fit_linear
from swingid.preparation.noise import Noise
from swingid.preparation.scale import equation_of
from swingid.preparation.speed import SHARE
from swingid.processes import cores

UNKNOWNS = ("inertia", *BASIS)
"""a11 of the whole axis, then the terms of friction: the first columns, in this order."""

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
    if windows < 2 * LAG or windows <= LAG / 2 * len(UNKNOWNS):
        text = f"only {max(windows, 0)} windows fit into the logs; record longer ones."
        raise UnanswerableError(text, code="too-short")
    columns = np.empty((len(angle), windows, kernels.COLUMNS))
    weights = kernels.window_weights(reach, step)
    wheel = np.empty((0, rows)) if wheel_angle is None else wheel_angle

    def part(begin: int, end: int) -> None:
        on_time = at_stamps(wheel[begin:end], rate, late) if len(wheel) else wheel
        kernels.project_runs(angle[begin:end], on_time, (speed, kink), first, reach // 2, weights, columns[begin:end])

    workers = threads or cores()
    edges = np.linspace(0, len(angle), workers + 1).astype(int)
    with ThreadPoolExecutor(workers) as pool:
        list(pool.map(part, edges[:-1], edges[1:]))
    stiffness = np.cos(angle[:, first : last + 1 : reach // 4 or 1]).mean(axis=1)
    centres = step * (first + reach + reach // 2 * np.arange(windows))
    supports = Windows(centres, np.full(windows, reach * step))
    return _fitted(columns, stiffness, equation, plan, supports, step)


def _fitted(columns: Array, stiffness: Array, equation: Equation, plan: Plan, windows: Windows, step: float) -> Batch:
    """Least squares of all logs at once, with the covariance of a single one; stiffness (n,): mean cos q1."""
    known = (
        -equation.value("wheel") * columns[:, :, kernels.WHEEL]
        - equation.value("gravity_torque") * columns[:, :, kernels.GRAVITY]
    )
    fit = fit_linear(columns[:, :, : len(UNKNOWNS)], known)
    rows = Rows(windows, {}, {"gravity_torque": stiffness})
    alone = replace(fit, influence=fit.influence[:, :1])  # of the inertia
    variance = covariance_of(alone, rows, UNKNOWNS, equation, Noise(plan.noise, plan.wheel_noise, step))[0][:, 0, 0]
    late = (fit.influence[:, 0] * columns[:, :, kernels.LATE]).sum(axis=1)
    variance = variance + (fit.values[:, UNKNOWNS.index("coulomb")] * late) ** 2
    return Batch(fit.values[:, 0] - equation.carried, np.sqrt(variance))
