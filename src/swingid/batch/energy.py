"""The energy method ("better") for many logs at once: one smoothing and one part of the log for all, chosen once.

Blocks of mirrored nodes, basis of friction, fit and covariance are those of `energy`; nodes stand on samples. What a
single log gets beside it is left out, as in `batch.momentum`; `u` is the scatter of the blocks alone.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from swingid.batch import passes
from swingid.batch.passes import energy_runs
from swingid.batch.plan import Batch, Plan, require_batch
from swingid.batch.speeds import smoothing
from swingid.errors import InputError, UnanswerableError
from swingid.methods.energy.method import FEWEST_BLOCKS, LEVELS
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array, Ints
from swingid.preparation.scale import Scale

TOGETHER = 32
"""Logs whose nodes are in memory at once, per thread."""


def energy_batch(
    angle: Array,
    wheel_angle: Array | None,
    voltage: Array | None,
    rate: float,
    rig: Rig,
    plan: Plan,
    *,
    threads: int | None = None,
) -> Batch:
    """Inertias from angles, wheel angles (rad) and voltages (V), each (n, rows), logged at `rate` (1/s).

    The rig's motor constants are used, and the voltage is held from row to row. A log with fewer than three turning
    points has NaN. Raises InputError for a direct drive, an unknown gravity torque or a missing channel.
    """
    scale = Scale.of(rig)
    require_batch(rig, scale)
    if scale.drive == "reaction-wheel" and (wheel_angle is None or voltage is None):
        raise InputError(
            "the energy method needs the wheel angle and the voltage; record them.", code="missing-voltage"
        )
    step = 1.0 / rate
    weights = (smoothing(plan.width, step), smoothing(plan.wheel_width, step))
    span = (round(plan.start * rate), min(angle.shape[1] - 1, round(plan.stop * rate)))
    constants = _constants(rig, scale)
    nothing = np.empty((0, angle.shape[1]))
    wheel = nothing if wheel_angle is None or scale.drive == "none" else wheel_angle
    volts = nothing if voltage is None else voltage
    blocks = plan.turns + plan.turns // 4 + 2

    def part(begin: int) -> tuple[Array, Array]:
        own = slice(begin, begin + TOGETHER)
        columns = np.empty((len(angle[own]), blocks, 2 * len(LEVELS) + 1, passes.COLUMNS))
        counts = energy_runs(angle[own], wheel[own], volts[own], step, span, LEVELS, weights, constants, columns)
        return _fitted(columns, counts)

    with ThreadPoolExecutor(threads or len(os.sched_getaffinity(0))) as pool:
        fits = list(pool.map(part, range(0, len(angle), TOGETHER)))
    a11, variance = np.concatenate([v for v, _ in fits]), np.concatenate([c for _, c in fits])
    if np.isnan(a11).all():
        raise UnanswerableError("no log holds three turning points with their passes; record longer.", code="too-short")
    return Batch(a11 - scale.carried, np.sqrt(variance))


def _constants(rig: Rig, scale: Scale) -> Array:
    """Constants of the balance as `passes` names them."""
    found = np.zeros(passes.CONSTANTS)
    found[passes.GRAVITY] = scale.b or 0.0
    motor = rig.drive.motor
    if scale.drive == "reaction-wheel" and motor is not None:
        found[passes.ETA], found[passes.C1] = motor.efficiency.value, motor.torque_per_volt.value
        found[passes.C2], found[passes.GEAR] = motor.back_emf.value, motor.gear_ratio.value
        found[passes.LOW], found[passes.HIGH] = motor.dead_zone
        found[passes.F2], found[passes.F3] = motor.viscous.value, motor.coulomb.value
        found[passes.A12], found[passes.A22] = rig.drive.a12, rig.drive.a22
    return found


def _fitted(columns: Array, counts: Ints) -> tuple[Array, Array]:
    """a11 (n,) and its variance as of `fit_nodes`, for columns (n, blocks, nodes, COLUMNS)."""
    n, blocks = columns.shape[:2]
    within = (columns - columns.mean(axis=2, keepdims=True)).reshape(n, -1, passes.COLUMNS)
    matrix, known = within[:, :, : passes.KNOWN], within[:, :, passes.KNOWN]
    size = np.linalg.norm(matrix, axis=1, keepdims=True)
    size[size == 0.0] = 1.0
    scaled = matrix / size
    inverse = np.linalg.pinv(scaled.transpose(0, 2, 1) @ scaled, rcond=1e-12, hermitian=True)
    values = inverse @ (scaled.transpose(0, 2, 1) @ known[:, :, None])
    weights = (scaled @ inverse[:, :, :1])[:, :, 0] / size[:, :, 0]  # influence of the nodes on a11
    scores = (weights * (known - (scaled @ values)[:, :, 0])).reshape(n, blocks, -1).sum(axis=2)
    variance = (scores * scores).sum(axis=1) + (scores[:, 1:] * scores[:, :-1]).sum(axis=1)
    variance *= counts / np.maximum(counts - passes.KNOWN, 1)
    a11 = values[:, 0, 0] / size[:, 0, 0]
    a11[counts < FEWEST_BLOCKS], variance[counts < FEWEST_BLOCKS] = np.nan, np.nan
    return a11, variance
