"""Row (I) pointwise: every term at every instant of an even grid, all through one zero-phase filter, then decimated.

    a11 L q1'' + b L sin q1 + L F(q1') = −a12 L q2''    (reaction wheel; direct drive: L τ; free decay: −b L sin q1)

All terms pass the same filter L (parallel filtering), so the row holds exactly for every cut-off: what the filter
takes from the acceleration it takes from gravity and friction too. The direction of Coulomb friction is that of the
swings (`Motion.directions`), not the sign of a noisy speed. A filtered row is the balance on the filter's impulse
response, so it is a `Rows` like any other, with windows of one period of the cut-off.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swingid.balance.friction_laws import TERMS, stribeck_slope
from swingid.balance.rows import Rows, Windows, smooth_columns
from swingid.methods.equation_error.cutoff import SETTLING, Cutoff, lowpass
from swingid.methods.equation_error.grid import STENCIL, Grid, as_held, curvature, slope
from swingid.model.terms import RigTerm
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
        """The filter of a grid; closed (k, 2): begin and end (s) of intervals in which rows tell nothing."""
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
        """What each row of the grid contributes to Σ weights · row (the filter is symmetric in time)."""
        spread = np.zeros(len(self.grid.time))
        spread[self.keep] = weights
        result: Array = lowpass(spread[None], self.grid.step, self.cutoff)[0]
        return result


def friction_columns(
    motion: Motion, grid: Grid, terms: tuple[str, ...], stribeck_speed: float = 1.0, peak: float = 0.0
) -> dict[str, Array]:
    """The terms of friction on the grid; the direction jumps where the axis turns around, between two rows or not.

    "memory" is an impulse at each reversal: the old direction lives on for a moment (bristles, backlash).
    "stribeck_speed" is the derivative of a peak of height `peak` by its speed.
    """
    edges, directions = motion.directions(float(grid.time[0]), float(grid.time[-1]))
    direction = as_held(edges, directions, grid.time)
    smooth = motion.speed.at(np.clip(grid.time, motion.speed.grid[0], motion.speed.grid[-1]))
    columns = {}
    for term in terms:
        if term == "coulomb":
            columns[term] = direction
        elif term == "stribeck":
            columns[term] = direction * np.exp(-((smooth / stribeck_speed) ** 2))
        elif term == "stribeck_speed":
            columns[term] = peak * stribeck_slope(smooth, stribeck_speed)
        elif term == "memory":
            columns[term] = _impulses(grid, motion)
        else:
            columns[term] = TERMS[term](smooth)
    return columns


def _impulses(grid: Grid, motion: Motion) -> Array:
    """An impulse at each reversal in the new direction, shared by the two rows of the grid beside it (1/s)."""
    place = (motion.turning_times - grid.time[0]) / grid.step
    first = np.clip(place.astype(np.int64), 0, len(grid.time) - 2)
    share = place - first
    density = np.zeros(len(grid.time))
    np.add.at(density, first, -motion.sides * (1 - share) / grid.step)
    np.add.at(density, first + 1, -motion.sides * share / grid.step)
    return density


def further_columns(motion: Motion, grid: Grid, terms: tuple[RigTerm, ...]) -> dict[str, Array]:
    """The further terms on the grid, and their derivatives by an uncertain shift."""
    edges, directions = motion.directions(float(grid.time[0]), float(grid.time[-1]))
    direction = as_held(edges, directions, grid.time)
    smooth = motion.speed.at(np.clip(grid.time, motion.speed.grid[0], motion.speed.grid[-1]))
    columns: dict[str, Array] = {}
    for term in terms:
        dry = {term.name: term.regressor(grid.angle, smooth, direction)}
        columns |= dry if term.term.is_dry else smooth_columns(term, grid.angle, smooth)
    return columns


def filtered_rows(row_filter: RowFilter, motion: Motion, friction: dict[str, Array], scale: Scale) -> Rows:
    """The filtered rows: all that are kept, usable or not. The viscous term is the slope of the angle itself."""
    grid = row_filter.grid
    step, zero = grid.step, np.zeros(len(grid.time))
    named = dict(friction)
    if "viscous" in named:
        named["viscous"] = slope(grid.angle, step)
    wheel = zero if grid.wheel is None else curvature(grid.wheel, step)
    torque = zero if grid.torque is None else grid.torque
    gravity = zero if scale.linear else np.sin(grid.angle)
    further = further_columns(motion, grid, scale.further) if scale.further else {}
    inertia, gravity, wheel, torque, *terms = row_filter(
        curvature(grid.angle, step), gravity, wheel, torque, *named.values(), *further.values()
    )
    half = np.full(len(inertia), 1 / row_filter.cutoff.frequency)
    windows = Windows(row_filter.instants, half)
    count = len(named)
    slopes = {term.name: float(np.mean(term.stiffness(grid.angle))) for term in scale.further}
    return Rows(
        windows,
        inertia,
        gravity,
        wheel,
        torque,
        dict(zip(named, terms[:count], strict=True)),
        further=dict(zip(further, terms[count:], strict=True)),
        slopes=slopes,
    )
