"""Equation (I) pointwise: every term on an even grid, all through one zero-phase filter, then decimated.

    a11 L q1'' + b L sin q1 + L F(q1') = −a12 L q2''    (reaction wheel; direct drive: L τ; free decay: −b L sin q1)

All terms pass the same filter L (parallel filtering), so a row is exact for every cut-off. The direction of Coulomb
friction is that of the swings (`Motion.directions`), not the sign of a noisy speed. A filtered row is the balance on
the impulse response of the filter, so it is a `Rows` like any other, with windows of one period of the cut-off.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from swingid.balance.friction_laws import TERMS, stribeck_slope
from swingid.balance.rows import Rows, Windows, smooth_columns
from swingid.methods.equation_error.cutoff import SETTLING, Cutoff, lowpass
from swingid.methods.equation_error.grid import STENCIL, Grid, as_held, curvature, slope
from swingid.numerics.arrays import Array, Bools
from swingid.preparation.motion import Motion
from swingid.preparation.scale import Scale

ROWS_PER_PERIOD = 5.0
"""Rows kept per period of the cut-off."""

SMEARED = 0.5
"""Periods of the cut-off around a rest or a gap in which rows are not used."""


@dataclass(frozen=True)
class RowFilter:
    """The low-pass of an even grid, the rows kept after it, and which of them may be used.

    usable (rows,): false within reach of the log's ends, of its gaps and of rests of the axis.
    """

    grid: Grid
    cutoff: Cutoff
    every: int
    usable: Bools

    @classmethod
    def of(cls, grid: Grid, cutoff: Cutoff, closed: Array) -> RowFilter:
        """The filter of a grid; closed (k, 2): begin and end (s) of intervals whose rows are excluded."""
        every = max(1, int(1 / (ROWS_PER_PERIOD * cutoff.frequency * grid.step)))
        instants = grid.time[STENCIL:-STENCIL:every]
        settled = SETTLING / cutoff.frequency
        usable = (instants > grid.time[0] + settled) & (instants < grid.time[-1] - settled)
        reach = SMEARED / cutoff.frequency
        for begin, end in closed:
            usable &= (instants < begin - reach) | (instants > end + reach)
        return cls(grid, cutoff, every, usable)

    @property
    def keep(self) -> slice:
        """The rows of the grid that are kept."""
        return slice(STENCIL, -STENCIL, self.every)

    @property
    def instants(self) -> Array:
        """Times of the rows in s."""
        return self.grid.time[self.keep]

    @property
    def row_step(self) -> float:
        """Time between rows in s."""
        return self.grid.step * self.every

    def __call__(self, *columns: Array) -> Array:
        """Columns (n,) of the grid filtered and decimated, shape (columns, rows)."""
        return lowpass(np.stack(columns), self.grid.step, self.cutoff)[:, self.keep]

    def adjoint(self, weights: Array) -> Array:
        """Contribution of each row of the grid to Σ weights · row (the filter is symmetric in time)."""
        spread = np.zeros(len(self.grid.time))
        spread[self.keep] = weights
        result: Array = lowpass(spread[None], self.grid.step, self.cutoff)[0]
        return result


def _impulses(grid: Grid, motion: Motion) -> Array:
    """An impulse at each reversal in the new direction, shared by the two rows of the grid beside it (1/s)."""
    place = (motion.turning_times - grid.time[0]) / grid.step
    first = np.clip(place.astype(np.int64), 0, len(grid.time) - 2)
    share = place - first
    density = np.zeros(len(grid.time))
    np.add.at(density, first, -motion.sides * (1 - share) / grid.step)
    np.add.at(density, first + 1, -motion.sides * share / grid.step)
    return density


def filtered_rows(
    row_filter: RowFilter,
    motion: Motion,
    terms: tuple[str, ...],
    scale: Scale,
    stribeck_speed: float = 1.0,
    peak: float = 0.0,
) -> Rows:
    """The filtered rows, usable or not, with these terms of friction and the further terms of the rig.

    The direction jumps where the axis turns around, between two rows or not. The viscous term is the slope of the angle
    itself. "memory" is an impulse at each reversal, by dynamic friction or backlash; "stribeck_speed" the derivative of
    a peak of height `peak` by its speed.
    """
    grid = row_filter.grid
    step, zero = grid.step, np.zeros(len(grid.time))
    direction = as_held(*motion.directions(float(grid.time[0]), float(grid.time[-1])), grid.time)
    smooth = motion.speed.at(np.clip(grid.time, motion.speed.grid[0], motion.speed.grid[-1]))
    of_term: dict[str, Callable[[], Array]] = {
        "coulomb": lambda: direction,
        "viscous": lambda: slope(grid.angle, step),
        "stribeck": lambda: direction * np.exp(-((smooth / stribeck_speed) ** 2)),
        "stribeck_speed": lambda: peak * stribeck_slope(smooth, stribeck_speed),
        "memory": lambda: _impulses(grid, motion),
    }
    friction = {term: of_term[term]() if term in of_term else TERMS[term](smooth) for term in terms}
    further: dict[str, Array] = {}
    for own in scale.further:
        dry = {own.name: own.regressor(grid.angle, smooth, direction)}
        further |= dry if own.term.is_dry else smooth_columns(own, grid.angle, smooth)
    inertia, gravity, wheel, torque, *columns = row_filter(
        curvature(grid.angle, step),
        zero if scale.linear else np.sin(grid.angle),
        zero if grid.wheel is None else curvature(grid.wheel, step),
        zero if grid.torque is None else grid.torque,
        *friction.values(),
        *further.values(),
    )
    count = len(friction)
    return Rows(
        Windows(row_filter.instants, np.full(len(inertia), 1 / row_filter.cutoff.frequency)),
        inertia,
        gravity,
        wheel,
        torque,
        dict(zip(friction, columns[:count], strict=True)),
        further=dict(zip(further, columns[count:], strict=True)),
        slopes={own.name: float(np.mean(own.stiffness(grid.angle))) for own in scale.further},
    )
