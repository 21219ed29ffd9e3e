"""From a log to the chosen fit of filtered rows and the fits that it is compared with."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from swingid.balance.choice import FLAT, impulse_left, impulse_possible
from swingid.balance.delays import dry_levels, impulse_of, late_reversals
from swingid.balance.friction_laws import EXACT, Law
from swingid.balance.rows import Rows, Signals
from swingid.checks.consistency import DISAGREES
from swingid.checks.rig_file import CONFLICT
from swingid.errors import UnanswerableError
from swingid.methods.equation_error.cutoff import AT_LEAST, SETTLING, Cutoff
from swingid.methods.equation_error.fit import ROWS_PER_UNKNOWN, best_lag, fit_rows
from swingid.methods.equation_error.grid import Grid, even_grid
from swingid.methods.equation_error.laws import Laws, LawTable
from swingid.methods.equation_error.regressors import Regressors
from swingid.methods.equation_error.rows import RowFilter
from swingid.methods.equation_error.scatter import Fitted
from swingid.model.equation import Equation
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.preparation.motion import Motion
from swingid.preparation.noise import Noise
from swingid.preparation.prepared import Part
from swingid.uncertainty.budget import Source, systematic
from swingid.uncertainty.significance import DETECTED, INDICATED

EARLIER = 0.75
"""Least lag of the instruments in half periods, within which a controller has responded to the noise."""

LAGS = 1.0
"""Range, in periods of the motion, in which the lag of the instruments is sought."""

RICHEST = 8
"""Unknowns of the richest model: inertia, gravity torque, the terms of a law, an impulse at each reversal."""

LOWEST = 2.0
"""Lowest cut-off with which the chosen one is compared, in frequencies of the swings: the first harmonic passes."""

PASSES = 4
"""Most iterations between friction law and turning points."""

SETTLED = 0.1
"""Relative change of the delay of the turning points that ends the iteration."""


@dataclass(frozen=True)
class OnGrid:
    """The used part of the log on its grid, its motion and regressors, and intervals whose rows are excluded."""

    grid: Grid
    regressors: Regressors
    closed: Array
    noise: Noise

    @classmethod
    def of(cls, part: Part, rig: Rig, equation: Equation) -> OnGrid:
        """The grid of a part; rests of the axis and gaps between rows are excluded."""
        time, motion = part.log.time, part.motion
        late = np.nonzero(np.diff(time) > part.longest_gap)[0]
        gaps = np.column_stack([time[late], time[late + 1]])
        grid = even_grid(part.log, rig, part.encoders)
        return cls(grid, Regressors(grid, motion, equation), np.vstack([motion.rests, gaps]), part.noise)

    @property
    def motion(self) -> Motion:
        """The motion, with its turning points."""
        return self.regressors.motion

    def earlier(self, late: Array) -> OnGrid:
        """The same with every turning point `late` seconds earlier (one value each)."""
        return replace(self, regressors=self.regressors.earlier(late))

    def reach(self, row_step: float, rows: int) -> int:
        """Rows up to which correlation is taken into account: two periods."""
        return min(int(4 * self.motion.half_period / row_step), rows // 4)


@dataclass(frozen=True)
class Selection:
    """The chosen fit with its law, and the fits that it is compared with.

    laws: fits with the other possible laws, and their probabilities. cutoffs: by name. impulse: standard uncertainty
    (N m s or N s) of the impulse at each reversal that the correction of the turning points leaves. memory: column of
    such an impulse in the rows. from_momentum: dark uncertainty of the inertia by the difference to modulating
    functions. conflict: that of the stated gravity torque with the log.
    """

    chosen: Fitted
    law: Law
    laws: tuple[tuple[Law, Fitted, float], ...]
    cutoffs: dict[str, Fitted]
    impulse: float
    memory: Array
    motion: Motion
    from_momentum: float = 0.0
    conflict: float = 0.0

    @property
    def between_laws(self) -> float:
        """Standard deviation of the inertia over the possible laws about the chosen one, by their probabilities."""
        own = self.chosen.fit.a11
        return float(np.sqrt(sum(weight * (other.fit.a11 - own) ** 2 for _, other, weight in self.laws)))

    @property
    def common(self) -> list[tuple[Source, str, float]]:
        """Type A errors that the scatter does not contain: common to all rows, or shown by other fits."""
        found = self.chosen.common()
        found["choice of the friction law"] = self.between_laws
        if "memory" not in self.chosen.fit.unknowns:
            effect = float(self.chosen.fit.fit.influence[0] @ self.memory)
            found["timing of the turning points"] = abs(effect) * self.impulse
        # the cut-offs have the same noise and lack of fit, so their differences are one error
        apart = [self.chosen.contradicted(other) for other in self.cutoffs.values()]
        found |= {"drift with the cut-off": max(apart, default=0.0), DISAGREES: self.from_momentum}
        found[CONFLICT] = self.conflict
        entries = [(systematic(source), "inertia", spread) for source, spread in found.items()]
        for name in (own.name for own in self.chosen.equation.further if own.value is None):
            own = self.chosen.common(name)
            entries += [(systematic(source), name, spread) for source, spread in own.items()]
        return entries


def estimate(
    part: OnGrid, signals: Signals, equation: Equation, cutoff: Cutoff, given: str | None, instruments: bool
) -> tuple[Selection, Laws]:
    """The chosen fit with those it is compared with, and the possible laws. given: name of a law, None to choose one.

    Raises UnanswerableError for too short a log.
    """
    if cutoff.given or instruments:  # which have no attenuation
        row_filter = RowFilter.of(part.grid, cutoff, part.closed)
    else:
        row_filter = choose_lower(part, equation, cutoff)
    law, laws, late = _law(part, signals, equation, row_filter, given)
    part = part.earlier(late)
    others = [(other, weight) for other, weight in laws.likely if other.name != law.name]
    plain = _fit(part, equation, row_filter, law, (), instruments)
    memory = _fit(part, equation, row_filter, law, ("memory",), instruments, plain.lag)
    # dynamic friction is part of the model where its impulse at each reversal is significant
    spread, size = memory.spread("memory"), abs(memory.fit.value("memory"))
    levels = dry_levels(signals, plain.fit)
    dry = abs(float(law.torque(np.array([1e-9]))[0] - law.torque(np.array([-1e-9]))[0])) / 2
    dry += float(np.abs(np.mean(levels)))
    seen = size > DETECTED * spread and impulse_possible(equation, part.motion, size, dry)
    impulse, _ = impulse_left(impulse_of(late, law.torque, levels), size, spread)
    chosen, more = (memory, ("memory",)) if seen else (plain, ())
    fits = [(other, _fit(part, equation, row_filter, other, more, instruments, plain.lag), w) for other, w in others]
    cutoff = row_filter.cutoff
    others_of = {*cutoff.beside(1 / part.grid.step), *cutoff.down_to(LOWEST / (2 * part.motion.half_period))[1:]}
    cutoffs = {}
    for other in sorted(others_of, key=lambda one: -one.frequency):
        with suppress(UnanswerableError):  # too low for so short a log
            filtered = RowFilter.of(part.grid, other, part.closed)
            cutoffs[f"cut-off {other.frequency:.3g} Hz"] = _fit(part, equation, filtered, law, more, instruments)
    column = memory.rows["memory"]
    return Selection(chosen, law, tuple(fits), cutoffs, impulse, column, part.motion), laws


def choose_lower(part: OnGrid, equation: Equation, rule: Cutoff) -> RowFilter:
    """The filter of the highest cut-off, from the rule downwards, with about the least relative uncertainty of a11.

    Raises UnanswerableError where the log is too short for every one.
    """
    tried: list[tuple[float, RowFilter]] = []
    for cutoff in rule.down_to(AT_LEAST / (2 * part.motion.half_period)):
        row_filter = RowFilter.of(part.grid, cutoff, part.closed)
        if tried and row_filter.usable.sum() < ROWS_PER_UNKNOWN * RICHEST:
            break
        tried.append((_plain(part, equation, row_filter).relative(), row_filter))
    least = min(relative for relative, _ in tried)
    row_filter = next(one for relative, one in tried if relative <= FLAT * least)
    if row_filter.cutoff.frequency == rule.frequency:
        return row_filter
    reason = f"least relative uncertainty of the inertia below the {rule.frequency:.3g} Hz of the rule"
    return replace(row_filter, cutoff=Cutoff(row_filter.cutoff.frequency, reason))


def _plain(part: OnGrid, equation: Equation, row_filter: RowFilter) -> Fitted:
    """The fit with Coulomb and viscous friction."""
    terms = ("coulomb", "viscous")
    rows = part.regressors.rows(row_filter, terms)
    reach = part.reach(row_filter.row_step, len(rows.windows))
    fit = fit_rows(rows, equation, terms, row_filter.usable, reach, 0)
    b = fit.value("gravity_torque") if equation.seeks("gravity_torque") else equation.value("gravity_torque")
    return Fitted(fit, row_filter, part.regressors, rows, 0, reach, 0.0 if equation.linear else b, equation, part.noise)


def _law(
    part: OnGrid, signals: Signals, equation: Equation, row_filter: RowFilter, given: str | None
) -> tuple[Law, Laws, Array]:
    """The law, all possible ones, and the delay of the turning points with it.

    Friction delays them, and its regressors depend on them: both are found by iteration.
    """
    table = LawTable(row_filter, part.regressors, part.noise.angle)
    late = np.zeros(len(part.motion.turning_times))
    for _ in range(PASSES):
        moved = part.earlier(late) if np.any(late) else part
        rows = moved.regressors.rows(row_filter, EXACT)
        reach = part.reach(row_filter.row_step, len(rows.windows))
        first = fit_rows(rows, equation, ("coulomb", "viscous"), row_filter.usable, reach, 0)
        choice = table.choice(rows, first.weights, equation)
        laws = Laws.of(choice).where(partial(_peaked, moved, equation, row_filter))
        law = laws.best if given is None else choice.only(given).best.law
        before, late = late, late_reversals(signals, law.torque, abs(first.a11), part.noise, dry_levels(signals, first))
        if np.max(np.abs(late - before)) <= SETTLED * np.max(np.abs(late)):
            break
    return law, laws, late


def _peaked(part: OnGrid, equation: Equation, row_filter: RowFilter, law: Law) -> bool:
    """Whether Stribeck's peak is significant beside noise and the encoder's grid, whose errors repeat."""
    fit = _fit(part, equation, row_filter, law, (), instruments=False)
    return abs(fit.fit.value("stribeck")) > INDICATED * fit.spread("stribeck")


def _fit(
    part: OnGrid,
    equation: Equation,
    row_filter: RowFilter,
    law: Law,
    more: tuple[str, ...],
    instruments: bool,
    lag: int | None = None,
) -> Fitted:
    """The fit of the rows of one filter with one law, and `more` terms; lag: of the instruments, None to choose it."""
    terms = (*law.unknowns, *more)
    rows = part.regressors.rows(row_filter, terms, law.stribeck_speed, law.peak)
    if lag is None:
        lag = _lag(part, equation, row_filter, rows, terms) if instruments else 0
    reach = part.reach(row_filter.row_step, len(rows.windows))
    fit = fit_rows(rows, equation, terms, row_filter.usable, reach, lag)
    b = fit.value("gravity_torque") if equation.seeks("gravity_torque") else equation.value("gravity_torque")
    return Fitted(
        fit, row_filter, part.regressors, rows, lag, reach, 0.0 if equation.linear else b, equation, part.noise
    )


def _lag(part: OnGrid, equation: Equation, row_filter: RowFilter, rows: Rows, terms: tuple[str, ...]) -> int:
    least = max(SETTLING / row_filter.cutoff.frequency, EARLIER * part.motion.half_period)
    shortest = int(np.ceil(least / row_filter.row_step))
    period = 2 * part.motion.half_period / row_filter.row_step
    return best_lag(rows, equation, terms, row_filter.usable, shortest, shortest + int(LAGS * period))
