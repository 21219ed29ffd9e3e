"""Equation (I) pointwise: every term on an even grid, all through one zero-phase filter, then decimated.

    a11 L q1'' + b L sin q1 + L F(q1') = −a12 L q2''    (reaction wheel; direct drive: L τ; free decay: −b L sin q1)

All terms pass the same filter L (parallel filtering), so a row is exact for every cut-off. The direction of Coulomb
friction is that of the swings (`Motion.directions`), not the sign of a noisy speed. A filtered row is the balance on
the impulse response of the filter, so it is a `Rows` like any other, with windows of one period of the cut-off.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from swingid.balance.friction_laws import TERMS, Law, stribeck_slope
from swingid.balance.perturbations import Slope, slopes_by
from swingid.balance.reversals import IMPULSES
from swingid.balance.rows import Rows, Signals, Windows, smooth_columns
from swingid.methods.equation_error.cutoff import SETTLING, Cutoff
from swingid.methods.equation_error.grid import STENCIL, Grid, as_held, curvature, even_grid, slope
from swingid.model.equation import Equation, shifted
from swingid.numerics.arrays import Array, Bools
from swingid.numerics.lowpass import ZeroPhase
from swingid.preparation.motion import Motion
from swingid.preparation.noise import Noise

ROWS_PER_PERIOD = 5.0
"""Rows kept per period of the cut-off."""

DECAYED = 12.0
"""Periods of the cut-off after which nothing of an impulse is left within the accuracy of the arithmetic."""

SMEARED = 0.5
"""Periods of the cut-off around a rest or a gap in which rows are not used: 98 % of the response's power is there."""

GRID_PHASES = 8

Key = tuple[str, tuple[float, ...]]
"""A column: its name, and numbers that it depends on."""


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
        settled, reach = SETTLING / cutoff.frequency, SMEARED / cutoff.frequency
        usable = (instants > grid.time[0] + settled) & (instants < grid.time[-1] - settled)
        for begin, end in closed:
            usable &= (instants < begin - reach) | (instants > end + reach)
        return cls(grid, cutoff, every, usable)

    @cached_property
    def instants(self) -> Array:
        """Times of the rows in s."""
        return self.grid.time[STENCIL : -STENCIL : self.every]

    @property
    def row_step(self) -> float:
        """Time between rows in s."""
        return self.grid.step * self.every

    @cached_property
    def lowpass(self) -> ZeroPhase:
        """The low-pass, of which the rows are kept."""
        return ZeroPhase(self.cutoff.frequency, self.grid.step, self.every, STENCIL)

    def __call__(self, *columns: Array) -> Array:
        """Columns (n,) of the grid filtered and decimated, shape (columns, rows)."""
        return self.lowpass.rows(columns, len(self.instants))

    def adjoint(self, weights: Array) -> Array:
        """Contribution of each row of the grid to Σ weights · row (the filter is symmetric in time).

        weights (rows,): 0 of rows that are not usable.
        """
        result: Array = self.lowpass.spread(weights[None], len(self.grid.time))[0]
        return result

    @cached_property
    def response(self) -> tuple[Array, Array]:
        """Weights of one row on the samples of an angle around it, and on those of its second derivative."""
        period = 1 / (self.cutoff.frequency * self.grid.step)
        # the same in the middle of any log that is long enough
        length = min(len(self.grid.time), int(2 * DECAYED * period))
        weights = np.zeros(len(range(STENCIL, length - STENCIL, self.every)))
        weights[len(weights) // 2] = 1.0
        spread = self.lowpass.spread(weights[None], length)[0]
        curved = curvature(spread, self.grid.step)
        middle = STENCIL + len(weights) // 2 * self.every
        reach = int(2 * SETTLING * period)
        near = slice(max(middle - reach, 0), middle + reach)
        return spread[near].copy(), curved[near].copy()

    @cached_property
    def correlations(self) -> tuple[Array, Array, Array]:
        """Sums of products of `response` of rows 0, 1, … apart: of its second part, its first, and of both."""
        spread, curved = self.response
        of_curved, of_spread, of_sum = autocorrelation(np.array([curved, spread, curved + spread]))[:, :: self.every]
        return of_curved, of_spread, (of_sum - of_curved - of_spread) / 2


@dataclass(frozen=True)
class OnGrid:
    """The used part of a log on its grid, with the terms of equation (I) there; closed: as of `RowFilter.of`.

    The direction of motion jumps where the axis turns around, between two rows or not. The viscous term is the slope of
    the angle itself. IMPULSES are those at each reversal, weighted as by `Motion.reversals`; "stribeck_speed" is the
    derivative of a peak of some height by its speed. kept: columns and, by the cut-off (Hz), rows, each computed once.
    """

    signals: Signals
    equation: Equation
    noise: Noise
    grid: Grid
    closed: Array
    kept: dict[tuple[Key, float], Array]
    filters: dict[float, RowFilter]

    @classmethod
    def of(cls, signals: Signals, equation: Equation, noise: Noise, longest_gap: float) -> OnGrid:
        """The grid of a part; rests of the axis and gaps between rows that are longer than that are excluded."""
        closed = np.vstack([signals.motion.rests, signals.gaps(longest_gap)])
        return cls(signals, equation, noise, even_grid(signals), closed, {}, {})

    @property
    def motion(self) -> Motion:
        """The motion, with its turning points."""
        return self.signals.motion

    def earlier(self, late: Array) -> OnGrid:
        """The same with every turning point `late` seconds earlier (one value each)."""
        dry = {name for name, term in self.equation.terms.items() if term.term.is_dry}
        turning = {"coulomb", "stribeck", *IMPULSES} | dry
        steady = {key: column for key, column in self.kept.items() if key[0][0] not in turning}
        return replace(self, signals=self.signals.earlier(late), kept=steady)

    def filter(self, cutoff: Cutoff) -> RowFilter:
        """The filter of this cut-off."""
        if cutoff.frequency not in self.filters:
            self.filters[cutoff.frequency] = RowFilter.of(self.grid, cutoff, self.closed)
        return self.filters[cutoff.frequency]

    def rows(self, row_filter: RowFilter, terms: tuple[str, ...], law: Law | None = None) -> Rows:
        """The filtered rows of the equation, usable or not, with these terms; law: of Stribeck's peak among them."""
        cutoff = row_filter.cutoff.frequency
        peak = {"stribeck": (law.stribeck_speed,), "stribeck_speed": (law.stribeck_speed, law.peak)} if law else {}
        keys: dict[str, Key] = {name: (name, peak.get(name, ())) for name in (*self.equation.coefficients, *terms)}
        missing = [key for key in keys.values() if (key, cutoff) not in self.kept]
        if missing:
            columns = row_filter(*(self.column(name, *numbers) for name, numbers in missing))
            self.kept.update(zip([(key, cutoff) for key in missing], columns, strict=True))
        windows = Windows(row_filter.instants, np.full(len(row_filter.instants), 1 / cutoff))
        return Rows(windows, {name: self.kept[key, cutoff] for name, key in keys.items()}, self.signals.pulls)

    def grid_errors(self, row_filter: RowFilter) -> Array:
        """Filtered errors (8, rows) of the acceleration by the encoder's grid, shifted by eighths of its step."""
        key: tuple[Key, float] = ("grid errors", ()), row_filter.cutoff.frequency
        if key not in self.kept:
            errors = self._once("grid errors", self._grid_errors)
            self.kept[key] = row_filter(*errors) * self.noise.resolution
        return self.kept[key]

    def _grid_errors(self) -> Array:
        """The same before the filter, in steps / s²."""
        angle = self.column("smooth angle") / self.noise.resolution
        shifted = [angle + k / GRID_PHASES for k in range(GRID_PHASES)]
        return np.array([curvature(np.rint(place) - place, self.grid.step) for place in shifted])

    def acting(self, channel: str, error: Array, values: Mapping[str, float]) -> Array:
        """Σ c ∂f/∂channel s of an error s of a channel at every row of the grid, with these coefficients (n,).

        Away from the ends it is symmetric: so it also is the effect of every sample on a sum with the weights s.
        """
        effect = np.zeros_like(error)
        for name, order, by_angle in slopes_by(channel, self.equation.terms):
            if value := values.get(name, 0.0):
                change = curvature(error, self.grid.step) if order else self._pull(name, by_angle) * error
                effect = effect + value * change
        return effect

    def stiffness(self, values: Mapping[str, float]) -> float:
        """Mean of Σ c ∂f/∂q1 over the grid, with these coefficients."""
        pulls = {name: by_angle for name, order, by_angle in slopes_by("angle", self.equation.terms) if order == 0}
        known = {name: values[name] for name in pulls if values.get(name)}
        return sum(value * float(np.mean(self._pull(name, pulls[name]))) for name, value in known.items())

    def _pull(self, name: str, by_angle: Slope) -> Array:
        """∂f/∂q1 of a term at every row of the grid."""
        return self._once(f"slope of {name}", partial(by_angle, self.grid.angle))

    def channel(self, name: str) -> Array:
        """Angle, wheel or torque at every row of the grid; the drive must have it."""
        values = {"angle": self.grid.angle, "wheel": self.grid.wheel, "torque": self.grid.torque}[name]
        assert values is not None
        return values

    def column(self, name: str, *numbers: float) -> Array:
        """A column of the grid before the filter."""
        return self._once(name, lambda: self._computed(name, *numbers), numbers)

    def _once(self, name: str, make: Callable[[], Array | float], numbers: tuple[float, ...] = ()) -> Array:
        key = (name, numbers), 0.0
        if key not in self.kept:
            self.kept[key] = np.asarray(make())
        return self.kept[key]

    def _computed(self, name: str, *numbers: float) -> Array:
        grid, speed = self.grid, self.motion.speed
        of_name: dict[str, Callable[[], Array]] = {
            "inertia": lambda: curvature(grid.angle, grid.step),
            "wheel": lambda: curvature(self.channel("wheel"), grid.step),
            "torque": lambda: self.channel("torque"),
            "smooth angle": lambda: speed.angle_at(np.clip(grid.time, speed.grid[0], speed.grid[-1])),
            "smooth": lambda: speed.at(np.clip(grid.time, speed.grid[0], speed.grid[-1])),
            "coulomb": lambda: as_held(self.signals.edges, self.signals.directions, grid.time),
            "viscous": lambda: slope(grid.angle, grid.step),
            "stribeck": lambda: self.column("coulomb") * np.exp(-((self.column("smooth") / numbers[0]) ** 2)),
            "stribeck_speed": lambda: numbers[1] * stribeck_slope(self.column("smooth"), numbers[0]),
            "memory": lambda: self._impulses(self.motion.reversals[2]),
            "memory_equal": lambda: self._impulses(1.0 - self.motion.reversals[2]),
        }
        if name in of_name:
            return of_name[name]()
        return TERMS[name](self.column("smooth")) if name in TERMS else self._of_registry(name)

    def _of_registry(self, name: str) -> Array:
        """The regressor of a term of the registry, or its derivative by its shift."""
        angle, smooth = self.grid.angle, self.column("smooth")
        slot = next(term for term in self.equation.terms.values() if name in (term.name, shifted(term.name)))
        if slot.term.is_dry:
            return slot.regressor(angle, smooth, self.column("coulomb"))
        return smooth_columns(slot, angle, smooth)[name]

    def _impulses(self, weights: Array) -> Array:
        """Impulses at the reversals in the new direction, each shared by the two rows of the grid beside it (1/s)."""
        grid, (instants, directions, _) = self.grid, self.motion.reversals
        place = (instants - grid.time[0]) / grid.step
        first = np.clip(place.astype(np.int64), 0, len(grid.time) - 2)
        share, size = place - first, directions * weights / grid.step
        density = np.zeros(len(grid.time))
        np.add.at(density, first, size * (1 - share))
        np.add.at(density, first + 1, size * share)
        return density


def autocorrelation(values: Array, most: int | None = None) -> Array:
    """Sums of products of values (..., n) that are 0 to `most` apart, by default to n − 1."""
    length = values.shape[-1]
    count = length if most is None else min(most + 1, length)
    size = 1 << (length + count - 1).bit_length()
    spectrum = np.fft.rfft(values, size)
    return np.asarray(np.fft.irfft(spectrum.real**2 + spectrum.imag**2, size)[..., :count])
