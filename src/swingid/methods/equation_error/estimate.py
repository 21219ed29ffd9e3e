"""From a log to the chosen fit of filtered rows and the fits that judge it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from swingid.balance.delays import dry_levels, impulse_of, late_reversals
from swingid.balance.friction_laws import EXACT
from swingid.balance.rows import Rows, Signals
from swingid.methods.equation_error.cutoff import SETTLING, Cutoff
from swingid.methods.equation_error.fit import best_lag, fit_rows
from swingid.methods.equation_error.grid import Grid, even_grid
from swingid.methods.equation_error.judges import Judged, remembered, spread_of
from swingid.methods.equation_error.laws import Law, Laws, LawTable
from swingid.methods.equation_error.rows import RowFilter, filtered_rows, friction_columns
from swingid.methods.equation_error.scatter import Fitted
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.preparation.motion import Motion
from swingid.preparation.noise import Noise
from swingid.preparation.prepared import Part
from swingid.preparation.scale import Scale
from swingid.uncertainty.significance import INDICATED

EARLIER = 0.75
"""Least lag of the instruments in half periods, for a controller to have answered the noise."""

LAGS = 1.0
"""Periods of the motion over which the lag of the instruments is sought."""

PASSES = 4
"""Times that law and turning points are found in turns, at most."""

SETTLED = 0.1
"""Change of the delay of the turning points, of itself, that ends it."""


@dataclass(frozen=True)
class OnGrid:
    """The part of the log that is used, on its grid, its motion, and intervals that are closed to rows."""

    grid: Grid
    motion: Motion
    closed: Array
    noise: Noise

    @classmethod
    def of(cls, part: Part, rig: Rig) -> OnGrid:
        """The grid of a part; rests of the axis and gaps between rows are closed."""
        time, motion = part.log.time, part.motion
        late = np.nonzero(np.diff(time) > part.longest_gap)[0]
        gaps = np.column_stack([time[late], time[late + 1]])
        grid = even_grid(part.log, rig, part.encoders)
        return cls(grid, motion, np.vstack([motion.rests, gaps]), part.noise)

    def reach(self, row_step: float, rows: int) -> int:
        """Rows over which correlation is looked for: two periods."""
        return min(int(4 * self.motion.half_period / row_step), rows // 4)


def estimate(
    part: OnGrid, signals: Signals, scale: Scale, cutoff: Cutoff, given: str | None, instruments: bool
) -> tuple[Judged, Laws]:
    """The chosen fit with its judges, and the laws that the log allows. given: name of a law, None to choose one.

    Raises UnanswerableError for too short a log.
    """
    row_filter = RowFilter.of(part.grid, cutoff, part.closed)
    law, laws, late = _law(part, signals, scale, row_filter, given)
    part = replace(part, motion=part.motion.earlier(late))
    others = [(other, weight) for other, weight in laws.likely if other.name != law.name]
    plain = _fit(part, scale, row_filter, law, (), instruments)
    memory = _fit(part, scale, row_filter, law, ("memory",), instruments, plain.lag)
    seen, impulse = remembered(memory, part.motion, impulse_of(late, law.torque, dry_levels(signals, plain.fit)))
    chosen, more = (memory, ("memory",)) if seen else (plain, ())
    fits = [(other, _fit(part, scale, row_filter, other, more, instruments, plain.lag), w) for other, w in others]
    cutoffs = {
        f"cut-off {beside.frequency:.3g} Hz": _fit(
            part, scale, RowFilter.of(part.grid, beside, part.closed), law, more, instruments
        )
        for beside in cutoff.beside(1 / part.grid.step)
    }
    column = memory.rows.friction["memory"]
    return Judged(chosen, law, tuple(fits), cutoffs, impulse, column, part.motion), laws


def _law(
    part: OnGrid, signals: Signals, scale: Scale, row_filter: RowFilter, given: str | None
) -> tuple[Law, Laws, Array]:
    """The law, all that may be, and how late the turning points are found with it.

    Friction delays them, and they decide what is seen of it: both are found in turns.
    """
    table = LawTable(row_filter, part.motion, part.noise.angle)
    late = np.zeros(len(part.motion.turning_times))
    for _ in range(PASSES):
        motion = part.motion.earlier(late)
        rows = filtered_rows(row_filter, motion, friction_columns(motion, part.grid, EXACT), scale)
        reach = part.reach(row_filter.row_step, len(rows.windows))
        first = fit_rows(rows, scale, ("coulomb", "viscous"), row_filter.usable, reach, 0)
        laws = table.choose(rows, first.weights, scale).where(
            partial(_peaked, replace(part, motion=motion), scale, row_filter)
        )
        law = laws.best if given is None else table.fitted(given, rows, first.weights, scale)
        before, late = late, late_reversals(signals, law.torque, abs(first.a11), part.noise, dry_levels(signals, first))
        if np.max(np.abs(late - before)) <= SETTLED * np.max(np.abs(late)):
            break
    return law, laws, late


def _peaked(part: OnGrid, scale: Scale, row_filter: RowFilter, law: Law) -> bool:
    """Whether Stribeck's peak is more than what noise and the encoder's grid, which comes again, make of one."""
    fit = _fit(part, scale, row_filter, law, (), instruments=False)
    return abs(fit.fit.value("stribeck")) > INDICATED * spread_of(fit, "stribeck", part.motion)


def _fit(
    part: OnGrid,
    scale: Scale,
    row_filter: RowFilter,
    law: Law,
    more: tuple[str, ...],
    instruments: bool,
    lag: int | None = None,
) -> Fitted:
    """The fit of the rows of one filter with one law, and `more` terms; lag: of the instruments, None to find one."""
    terms = (*law.unknowns, *more)
    columns = friction_columns(part.motion, part.grid, terms, law.stribeck_speed, law.peak)
    rows = filtered_rows(row_filter, part.motion, columns, scale)
    if lag is None:
        lag = _lag(part, scale, row_filter, rows, terms) if instruments else 0
    reach = part.reach(row_filter.row_step, len(rows.windows))
    fit = fit_rows(rows, scale, terms, row_filter.usable, reach, lag)
    b = fit.value("gravity_torque") if scale.b is None else scale.b
    return Fitted(fit, row_filter, rows, lag, reach, 0.0 if scale.linear else b, scale, part.noise)


def _lag(part: OnGrid, scale: Scale, row_filter: RowFilter, rows: Rows, terms: tuple[str, ...]) -> int:
    least = max(SETTLING / row_filter.cutoff.frequency, EARLIER * part.motion.half_period)
    shortest = int(np.ceil(least / row_filter.row_step))
    period = 2 * part.motion.half_period / row_filter.row_step
    return best_lag(rows, scale, terms, row_filter.usable, shortest, shortest + int(LAGS * period))
