"""Which rows of a filtered log are kept, and which of them may be used."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from swingid.methods.equation_error.cutoff import SETTLING, Cutoff
from swingid.methods.equation_error.grid import STENCIL, Grid, curvature
from swingid.methods.equation_error.lowpass import ZeroPhase
from swingid.numerics.arrays import Array, Bools

ROWS_PER_PERIOD = 5.0
"""Rows kept per period of the cut-off."""

DECAYED = 12.0
"""Periods of the cut-off after which nothing of an impulse is left within the accuracy of the arithmetic."""

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

    def weights(self, of_rows: Array) -> Array:
        """Weight of each row of the grid in Σ of_rows · row, exactly, ends of the log included."""
        return self.lowpass.transposed(of_rows, len(self.grid.time))

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


def autocorrelation(values: Array, most: int | None = None) -> Array:
    """Sums of products of values (..., n) that are 0 to `most` apart, by default to n − 1."""
    length = values.shape[-1]
    count = length if most is None else min(most + 1, length)
    size = 1 << (length + count - 1).bit_length()
    spectrum = np.fft.rfft(values, size)
    return np.asarray(np.fft.irfft(spectrum.real**2 + spectrum.imag**2, size)[..., :count])
