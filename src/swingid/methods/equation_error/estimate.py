"""From a log to the chosen fit of filtered rows and the fits that it is compared with.

The friction law is that of least BIC. All laws are compared on the Gram matrix of the filtered rows
(`balance/law_choice.py`). The spread of the inertia over them, weighted by their criterion, is an uncertainty (Bayesian
model averaging; Hoeting, Madigan, Raftery and Volinsky 1999).
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from swingid.balance.choice import FLAT, PASSES, SETTLED
from swingid.balance.delays import dry_friction, dry_levels, late_reversals
from swingid.balance.fits import columns_of
from swingid.balance.friction_laws import EXACT, KNOTS, Law, speed_knots
from swingid.balance.law_choice import LawChoice, slowest_peak
from swingid.balance.reversals import TIMING, impulse_found, impulses_expected
from swingid.checks.stated import CONFLICT
from swingid.errors import UnanswerableError
from swingid.methods.equation_error.cutoff import AT_LEAST, Cutoff
from swingid.methods.equation_error.filtered import OnGrid, RowFilter
from swingid.methods.equation_error.fit import ROWS_PER_UNKNOWN, RowFit, fit_rows, noise_share
from swingid.numerics.arrays import Array
from swingid.preparation.motion import Motion
from swingid.uncertainty.budget import Source, systematic
from swingid.uncertainty.significance import INDICATED

RICHEST = 8
"""Unknowns of the richest model: inertia, gravity torque, the terms of a law, an impulse at each reversal."""

LOWEST = 2.0
"""Lowest cut-off with which the chosen one is compared, in frequencies of the swings: the first harmonic passes."""

PLAIN = ("coulomb", "viscous")
"""Friction of the fits by which the cut-off is chosen and the choice of the law begins."""

POSSIBLE = 1e-3
"""Probability below which a law is not fitted: its distance counts by the root of it, 3 %, in `between_laws`."""

Weighted = tuple[tuple[Law, float], ...]
"""Laws with their probabilities."""


@dataclass(frozen=True)
class Selection:
    """The chosen fit with its law, and the fits that it is compared with.

    likely: the possible laws, most probable first; laws: fits with those that were not chosen, and their probabilities.
    cutoff: the chosen one; cutoffs: fits with others, by name. impulse: standard uncertainty (N m s or N s) of the
    impulse at each reversal that the correction of the turning points leaves. memory: column of such an impulse in the
    rows. conflict: standard uncertainty of the inertia by that of the stated gravity torque with the log.
    """

    chosen: RowFit
    law: Law
    likely: Weighted
    laws: tuple[tuple[Law, RowFit, float], ...]
    cutoff: Cutoff
    cutoffs: dict[str, RowFit]
    impulse: float
    memory: Array
    conflict: float = 0.0

    @property
    def motion(self) -> Motion:
        """The motion, with its turning points."""
        return self.chosen.part.motion

    @property
    def between_laws(self) -> float:
        """Standard deviation of the inertia over the possible laws about the chosen one, by their probabilities."""
        a11 = self.chosen.a11
        return float(np.sqrt(sum(weight * (other.a11 - a11) ** 2 for _, other, weight in self.laws)))

    @property
    def common(self) -> list[tuple[Source, str, float]]:
        """Type A errors that the scatter does not contain: common to all rows, or shown by other fits."""
        of_inertia = self.chosen.common()
        of_inertia["choice of the friction law"] = self.between_laws
        if "memory" not in self.chosen.unknowns:
            effect = float(self.chosen.fit.influence[0] @ self.memory)
            of_inertia[TIMING] = abs(effect) * self.impulse
        # the cut-offs have the same noise and lack of fit, so their differences are one error
        apart = [self.chosen.contradicted(other) for other in self.cutoffs.values()]
        of_inertia |= {"drift with the cut-off": max(apart, default=0.0), CONFLICT: self.conflict}
        each = {"inertia": of_inertia}
        each |= {name: self.chosen.common(name) for name in self.chosen.equation.sought[1:]}
        return [(systematic(source), name, u) for name, errors in each.items() for source, u in errors.items()]


def estimate(part: OnGrid, cutoff: Cutoff, given: str | None, *, instruments: bool) -> Selection:
    """The chosen fit with those it is compared with. given: name of a law, None to choose lower.

    Raises UnanswerableError for too short a log.
    """
    if not (cutoff.given or instruments):  # which have no attenuation
        cutoff = choose_lower(part, cutoff)
    row_filter, lag = part.filter(cutoff), None if instruments else 0
    law, likely, late = _law(part, row_filter, given)
    part = part.earlier(late)
    plain = fit_rows(part, row_filter, law.unknowns, law, lag)
    memory = fit_rows(part, row_filter, (*law.unknowns, "memory"), law, plain.lag)
    levels = dry_levels(part.signals, plain.value)
    measured = memory.value("memory"), memory.of("memory").spread
    expected = impulses_expected(part.motion, late, law.torque, levels)
    more, impulse = impulse_found(part.equation, part.motion, measured, expected, dry_friction(law.torque, levels))
    chosen = fit_rows(part, row_filter, (*law.unknowns, *more), law, plain.lag) if more else plain
    others = [(other, weight) for other, weight in likely if other.name != law.name]
    laws = [
        (candidate, fit_rows(part, row_filter, (*candidate.unknowns, *more), candidate, plain.lag), weight)
        for candidate, weight in others
    ]
    others_of = {*cutoff.beside(1 / part.grid.step), *cutoff.down_to(LOWEST / (2 * part.motion.half_period))[1:]}
    cutoffs = {}
    for other in sorted(others_of, key=lambda lower: -lower.frequency):
        with suppress(UnanswerableError):  # too low for so short a log
            fit = fit_rows(part, part.filter(other), (*law.unknowns, *more), law, lag)
            cutoffs[f"cut-off {other.frequency:.3g} Hz"] = fit
    if chosen.lag == 0 and cutoffs:
        share = noise_share(chosen, next(iter(cutoffs.values())))
        chosen = chosen.without_bias(*share)
        laws = [(candidate, fit.without_bias(*share), weight) for candidate, fit, weight in laws]
        cutoffs = {name: fit.without_bias(*share) for name, fit in cutoffs.items()}
    return Selection(chosen, law, likely, tuple(laws), cutoff, cutoffs, impulse, memory.rows["memory"])


def choose_lower(part: OnGrid, rule: Cutoff) -> Cutoff:
    """The highest cut-off, from the rule downwards, with about the least relative uncertainty of a11.

    Raises UnanswerableError where the log is too short for every one.
    """
    tried: list[tuple[float, Cutoff]] = []
    for cutoff in rule.down_to(AT_LEAST / (2 * part.motion.half_period)):
        row_filter = part.filter(cutoff)
        if tried and row_filter.usable.sum() < ROWS_PER_UNKNOWN * RICHEST:
            break
        tried.append((fit_rows(part, row_filter, PLAIN).relative_with_bias(), cutoff))
    least = min(relative for relative, _ in tried)
    cutoff = next(candidate for relative, candidate in tried if relative <= FLAT * least)
    if cutoff.frequency == rule.frequency:
        return cutoff
    reason = f"least relative uncertainty of the inertia below the {rule.frequency:.3g} Hz of the rule"
    return replace(cutoff, reason=reason)


def _law(part: OnGrid, row_filter: RowFilter, given: str | None) -> tuple[Law, Weighted, Array]:
    """The law, all possible ones, and the delay of the turning points with it.

    Friction delays them, and its regressors depend on them: both are found by iteration.
    """
    late = np.zeros(len(part.motion.turning_times))
    smooth = part.column("smooth")
    knots = speed_knots(float(np.quantile(np.abs(smooth), 0.999)), KNOTS)
    hats = _filtered_hats(row_filter, smooth, knots)
    for _ in range(PASSES):
        moved = part.earlier(late) if np.any(late) else part
        exact = moved.rows(row_filter, EXACT)
        first = fit_rows(moved, row_filter, PLAIN)
        used, root = first.weights > 0, np.sqrt(first.weights[first.weights > 0])
        friction = np.column_stack([*(exact[name] for name in EXACT), *hats])[used] * root[:, None]
        _, body = columns_of(first.rows, part.equation, ())
        slowest = slowest_peak(moved.motion, part.noise.angle)
        choice = LawChoice.of(body[used] * root[:, None], friction, first.known[used] * root, knots, slowest)
        likely = _possible(moved, row_filter, choice)
        law = likely[0][0] if given is None else choice.only(given).best.law
        levels = dry_levels(part.signals, first.value)
        before, late = late, late_reversals(part.signals, law.torque, abs(first.a11), part.noise, levels)
        if np.max(np.abs(late - before)) <= SETTLED * np.max(np.abs(late)):
            break
    return law, likely, late


def _possible(part: OnGrid, row_filter: RowFilter, choice: LawChoice) -> Weighted:
    """The laws of more than negligible probability, the most probable first; a peak of Stribeck's must be significant.

    Beside noise and the encoder's grid, whose errors repeat.
    """
    tried = [(choice.trials[name].law, weight) for name, weight in choice.weights().items()]
    worth = {law.name for law, _ in _likely(tried)}
    kept = []
    for law, weight in tried:
        if "stribeck" in law.terms:
            if law.name not in worth or not law.peak:
                continue
            fit = fit_rows(part, row_filter, law.unknowns, law)
            if not abs(fit.value("stribeck")) > INDICATED * fit.of("stribeck").spread:
                continue
        kept.append((law, weight))
    return _likely(kept)


def _likely(tried: Iterable[tuple[Law, float]]) -> Weighted:
    """The laws of more than negligible probability, with that, the most probable first."""
    ranked = sorted(tried, key=lambda trial: -trial[1])
    total = sum(weight for _, weight in ranked)
    return tuple((law, weight / total) for law, weight in ranked if weight > POSSIBLE * total)


def _filtered_hats(row_filter: RowFilter, speeds: Array, knots: Array) -> Array:
    """Hat functions on rising `knots` at `speeds` (n,), constant beyond them, filtered: (knots, rows)."""
    below = np.clip(np.searchsorted(knots, speeds, side="right") - 1, 0, len(knots) - 2)
    share = np.clip((speeds - knots[below]) / np.diff(knots)[below], 0.0, 1.0)
    columns = np.zeros((len(knots), len(speeds)))
    at = below * len(speeds) + np.arange(len(speeds))
    columns.ravel()[at], columns.ravel()[at + len(speeds)] = 1 - share, share
    return row_filter(*columns)
