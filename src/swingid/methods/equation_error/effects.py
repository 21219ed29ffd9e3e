"""What rig.toml declares as uncertain, as perturbations of the filtered rows; constants as in the momentum method."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from swingid.balance.imperfections import Imperfection, constants
from swingid.balance.rows import Rows
from swingid.methods.equation_error.grid import curvature, slope
from swingid.methods.equation_error.rows import RowFilter
from swingid.model.rig import Rig
from swingid.model.terms import rig_terms, stated_stiffness


def effects(rig: Rig, row_filter: RowFilter, rows: Rows, a11: float, b: float) -> list[Imperfection]:
    """All uncertainties that the rig declares and these rows feel; a11, b: as known or as identified."""
    found = [*constants(rig, rows), *_encoders(rig, row_filter, a11, b), *_latencies(rig, row_filter)]
    return [item for item in found if item.std > 0]


def _encoders(rig: Rig, row_filter: RowFilter, a11: float, b: float) -> Iterator[Imperfection]:
    """Once-per-turn nonlinearity, measured = q + α cos q + β sin q, on each encoder."""
    grid = row_filter.grid
    sensor = grid.encoders.angle
    if sensor.nonlinearity and rig.axis.kind == "rotary":
        q = grid.angle
        for name, error in (("cosine", np.cos(q)), ("sine", np.sin(q))):
            pull = b * np.cos(q) + stated_stiffness(rig_terms(rig), q)
            (effect,) = row_filter(-(a11 * curvature(error, grid.step) + pull * error))
            source, shared = f"angle encoder nonlinearity ({name})", f"sensors.nonlinearity.{name}"
            yield Imperfection(source, sensor.parts[name].std or 0.0, effect, 0.0, shared)
    sensor = grid.encoders.wheel
    if sensor.nonlinearity and grid.wheel is not None:
        for name, error in (("cosine", np.cos(grid.wheel)), ("sine", np.sin(grid.wheel))):
            (effect,) = row_filter(-rig.drive.a12 * curvature(error, grid.step))
            source, shared = f"wheel encoder nonlinearity ({name})", f"sensors.wheel.nonlinearity.{name}"
            yield Imperfection(source, sensor.parts[name].std or 0.0, effect, 0.0, shared)


def _latencies(rig: Rig, row_filter: RowFilter) -> Iterator[Imperfection]:
    """A channel read δ later than its stamp shows q + q' δ; an angle that is late is a drive that is early."""
    grid = row_filter.grid
    std = grid.encoders.angle.latency.std or 0.0
    wheel = grid.encoders.wheel.latency.std or 0.0
    if grid.wheel is not None and (std > 0 or wheel > 0):
        (effect,) = row_filter(rig.drive.a12 * slope(curvature(grid.wheel, grid.step), grid.step))
        yield Imperfection("angle latency", std, effect, 0.0, "sensors.latency")
        yield Imperfection("wheel latency", wheel, -effect, 0.0, "sensors.wheel.latency")
    elif grid.torque is not None and std > 0:
        (effect,) = row_filter(-slope(grid.torque, grid.step))
        yield Imperfection("angle latency", std, effect, 0.0, "sensors.latency")
