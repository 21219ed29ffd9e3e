"""Equation (I) pointwise: every term on an even grid, all through one zero-phase filter, then decimated.

    a11 L q1'' + b L sin q1 + L F(q1') = −a12 L q2''    (reaction wheel; direct drive: L τ; free decay: −b L sin q1)

All terms pass the same filter L (parallel filtering), so a row is exact for every cut-off. The direction of Coulomb
friction is that of the swings (`Motion.directions`), not the sign of a noisy speed. A filtered row is the balance on
the impulse response of the filter, so it is a `Rows` like any other, with windows of one period of the cut-off.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from swingid.balance.friction_laws import TERMS, stribeck_slope
from swingid.balance.rows import Rows, Windows, smooth_columns
from swingid.methods.equation_error.grid import Grid, as_held, curvature, slope
from swingid.methods.equation_error.rows import RowFilter
from swingid.model.equation import Equation, shifted
from swingid.numerics.arrays import Array
from swingid.preparation.motion import Motion


class Key(NamedTuple):
    """A column: its name, numbers that it depends on, and of a further term of the rig the name of that."""

    name: str
    numbers: tuple[float, ...] = ()
    further: str = ""


Kept = dict[tuple[Key, float], Array]
"""Columns of the grid (cut-off 0) and rows by their cut-off (Hz)."""

OF_DIRECTION = ("coulomb", "stribeck", "memory", "dry")
"""Columns that depend on the turning points."""

GRID_PHASES = 8


class Regressors:
    """The columns of equation (I) on the grid, and their filtered rows; each is computed once.

    The direction jumps where the axis turns around, between two rows or not. The viscous term is the slope of the angle
    itself. "memory" is an impulse at each reversal, by dynamic friction or backlash; "stribeck_speed" the derivative of
    a peak of some height by its speed.
    """

    def __init__(self, grid: Grid, motion: Motion, equation: Equation, steady: Kept | None = None) -> None:
        self.grid, self.motion, self.equation = grid, motion, equation
        self._steady: Kept = {} if steady is None else steady
        self._turning: Kept = {}

    def earlier(self, late: Array) -> Regressors:
        """The same with every turning point `late` seconds earlier (one value each)."""
        return Regressors(self.grid, self.motion.earlier(late), self.equation, self._steady)

    @property
    def smooth(self) -> Array:
        """Smoothed speed (n,)."""
        return self._column(Key("smooth"))

    @property
    def cosine(self) -> Array:
        """Cos q1 (n,)."""
        return self._column(Key("cosine"))

    def rows(
        self, row_filter: RowFilter, terms: tuple[str, ...], stribeck_speed: float = 1.0, peak: float = 0.0
    ) -> Rows:
        """The filtered rows, usable or not, with these terms of friction and the further terms of the rig.

        peak: height of Stribeck's peak.
        """
        numbers: dict[str, tuple[float, ...]] = {
            "stribeck": (stribeck_speed,),
            "stribeck_speed": (stribeck_speed, peak),
        }
        friction: dict[str, Key] = {term: Key(term, numbers.get(term, ())) for term in terms}
        further: dict[str, Key] = {}
        for own in self.equation.further:
            if own.term.is_dry:
                further[own.name] = Key("dry", further=own.name)
            else:
                names = (own.name, shifted(own.name)) if own.shift.std else (own.name,)
                further |= {name: Key("further", further=name) for name in names}
        body = {name: Key(name) for name in ("inertia", "gravity_torque", "wheel", "torque")}
        keys = body | friction | further
        found = self._filtered(row_filter, list(keys.values()))
        windows = Windows(row_filter.instants, np.full(len(row_filter.instants), 1 / row_filter.cutoff.frequency))
        pulls = {own.name: float(np.mean(own.stiffness(self.grid.angle))) for own in self.equation.further}
        pulls["gravity_torque"] = 0.0 if self.equation.linear else float(np.mean(self.cosine))
        return Rows(windows, {name: found[key] for name, key in keys.items()}, pulls)

    def grid_columns(self, resolution: float) -> Array:
        """Errors (8, n) of the acceleration by an encoder's grid of this step, shifted by its eighths, in steps."""
        key = Key("grid columns", (resolution,)), 0.0
        if key not in self._steady:
            columns = [self._column(Key("grid error", (resolution, k / GRID_PHASES))) for k in range(GRID_PHASES)]
            self._steady[key] = np.array(columns)
        return self._steady[key]

    def grid_errors(self, row_filter: RowFilter, resolution: float) -> Array:
        """Filtered errors (8, rows) of the acceleration by an encoder's grid of this step, shifted by its eighths."""
        key = Key("grid errors", (resolution,)), row_filter.cutoff.frequency
        if key not in self._steady:
            self._steady[key] = row_filter(*self.grid_columns(resolution)) * resolution
        return self._steady[key]

    def _filtered(self, row_filter: RowFilter, keys: list[Key]) -> dict[Key, Array]:
        """Filtered rows of columns; those that are missing go through the filter together."""
        cutoff, zero = row_filter.cutoff.frequency, np.zeros(len(row_filter.instants))
        seen = [key for key in dict.fromkeys(keys) if not self._absent(key)]
        missing = [key for key in seen if (key, cutoff) not in self._kept(key)]
        if missing:
            columns = row_filter(*(self._column(key) for key in missing))
            for key, column in zip(missing, columns, strict=True):
                self._kept(key)[key, cutoff] = column
        return dict.fromkeys(keys, zero) | {key: self._kept(key)[key, cutoff] for key in seen}

    def _kept(self, key: Key) -> Kept:
        return self._turning if key.name in OF_DIRECTION else self._steady

    def _absent(self, key: Key) -> bool:
        """Whether the drive or the axis has no such column."""
        have = {"gravity_torque": not self.equation.linear, "wheel": self.grid.wheel is not None}
        have["torque"] = self.grid.torque is not None
        return not have.get(key.name, True)

    def _column(self, key: Key) -> Array:
        """A column of the grid before the filter."""
        kept = self._kept(key)
        if (key, 0.0) not in kept:
            kept[key, 0.0] = self._computed(key)
        return kept[key, 0.0]

    def _computed(self, key: Key) -> Array:
        grid, speed, numbers = self.grid, self.motion.speed, key.numbers
        of_name: dict[str, Callable[[], Array]] = {
            "inertia": lambda: curvature(grid.angle, grid.step),
            "gravity_torque": lambda: np.sin(grid.angle),
            "wheel": lambda: np.zeros(0) if grid.wheel is None else curvature(grid.wheel, grid.step),
            "torque": lambda: np.zeros(0) if grid.torque is None else grid.torque,
            "cosine": lambda: np.cos(grid.angle),
            "grid error": lambda: self._grid_error(*numbers),
            "smooth angle": lambda: speed.angle_at(np.clip(grid.time, speed.grid[0], speed.grid[-1])),
            "smooth": lambda: speed.at(np.clip(grid.time, speed.grid[0], speed.grid[-1])),
            "coulomb": lambda: as_held(*self.motion.directions(float(grid.time[0]), float(grid.time[-1])), grid.time),
            "viscous": lambda: slope(grid.angle, grid.step),
            "stribeck": lambda: self._column(Key("coulomb")) * np.exp(-((self.smooth / numbers[0]) ** 2)),
            "stribeck_speed": lambda: numbers[1] * stribeck_slope(self.smooth, numbers[0]),
            "memory": self._impulses,
            "dry": lambda: self._further(key.further),
            "further": lambda: self._further(key.further),
        }
        return of_name[key.name]() if key.name in of_name else TERMS[key.name](self.smooth)

    def _grid_error(self, resolution: float, phase: float) -> Array:
        """Second derivative of the error by a grid of this step that is shifted by a share of it, in steps / s²."""
        shifted = self._column(Key("smooth angle")) / resolution + phase
        return curvature(np.rint(shifted) - shifted, self.grid.step)

    def _further(self, name: str) -> Array:
        """The regressor of a further term of the rig, or its derivative by its shift."""
        angle, smooth = self.grid.angle, self.smooth
        own = next(term for term in self.equation.further if name in (term.name, shifted(term.name)))
        if own.term.is_dry:
            return own.regressor(angle, smooth, self._column(Key("coulomb")))
        return smooth_columns(own, angle, smooth)[name]

    def _impulses(self) -> Array:
        """An impulse at each reversal in the new direction, shared by the two rows of the grid beside it (1/s)."""
        grid, motion = self.grid, self.motion
        place = (motion.turning_times - grid.time[0]) / grid.step
        first = np.clip(place.astype(np.int64), 0, len(grid.time) - 2)
        share = place - first
        density = np.zeros(len(grid.time))
        np.add.at(density, first, -motion.sides * (1 - share) / grid.step)
        np.add.at(density, first + 1, -motion.sides * share / grid.step)
        return density
