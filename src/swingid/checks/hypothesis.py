"""A hypothesis of what is not as the rig file states, by the balance of a log, and how it changes the inertia.

Each has the same life. It applies or not; a statistic of the momentum balance decides whether it is significant; a
change of the inertia by more than its standard uncertainty is a warning. `checks.table` has all of them, in order.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

from swingid.balance.choice import Choice
from swingid.balance.fits import WindowFit
from swingid.balance.parts import Comparison, Prediction, compared, divisible, predicted
from swingid.balance.rows import Signals
from swingid.balance.slow import SlowEffect, change_over_time, slow_effects
from swingid.balance.systematics import PlaceFit, place_fits
from swingid.numerics.once import once
from swingid.preparation.prepared import Part
from swingid.recording.findings import Kind
from swingid.result.data import Changing
from swingid.uncertainty.significance import MATTERS

LEAST = 1e-4
"""Share of a11 below which a change is not worth a warning: without noise, rounding is significant."""

FIRST_ORDER = 0.1
"""Share of a11 up to which a change is one of first order, as budgets take all: the square is a tenth of it."""


@dataclass(frozen=True)
class Evidence:
    """The momentum balance of a log, whatever a method computes of the same log; what is derived is computed once.

    memory: as `balance.choice.MEMORY`.
    """

    choice: Choice
    part: Part
    memory: str = "auto"

    @property
    def law(self) -> WindowFit:
        """The fit of least uncertainty."""
        return self.choice.law

    @property
    def signals(self) -> Signals:
        """The signals of the fit."""
        return self.choice.signals

    @cached_property
    def tried(self) -> list[WindowFit]:
        """The fits on windows of all lengths."""
        return list(self.choice.tried.values())

    @cached_property
    def place(self) -> list[PlaceFit]:
        """Fits with torques that depend on the angle and are not in the rig file."""
        return place_fits(self.law, self.signals, self.tried)

    @cached_property
    def slow(self) -> list[tuple[SlowEffect, Changing]]:
        """Slow changes that were found: their effects on the inertia, and each over time."""
        effects = slow_effects(self.law, self.signals, self.choice.slow)
        return [(effect, change_over_time(self.law, self.signals, effect.kind)) for effect in effects]

    @cached_property
    def _divided(self) -> WindowFit:
        return divisible(self.law, self.tried)

    @cached_property
    def parts(self) -> list[Comparison]:
        """Comparisons of parts of the log."""
        return compared(self._divided, self.signals)

    @cached_property
    def prediction(self) -> Prediction | None:
        """The prediction of the second half by the first."""
        return predicted(self._divided)


@dataclass(frozen=True)
class Judged:
    """The inertia (kg m² or kg) that is judged, with standard uncertainties that changes are compared with.

    limits: by name; what a hypothesis would itself add to the interval is left out of its own; "whole" has all. own:
    whether the inertia is that of the balance (momentum), which has slow changes as unknowns.
    """

    value: float
    a11: float
    limits: Mapping[str, float]
    own: bool = False

    def matters(self, change: float, limit: str) -> bool:
        """Return whether a change of the inertia is beyond its standard uncertainty."""
        return matters(change, self.limits[limit], self.a11)

    def contains(self, change: float) -> bool:
        """Return whether the interval, with what hypotheses add, contains a change, which must be of first order."""
        return not self.matters(change, "whole") and abs(change) <= FIRST_ORDER * abs(self.a11)


def matters(change: float, u: float, a11: float) -> bool:
    """Return whether a change of the inertia is worth a warning; u: its standard uncertainty."""
    return bool(abs(change) > max(MATTERS * u, LEAST * abs(a11)))


class Finding(NamedTuple):
    """A hypothesis that is significant: the change of the inertia by it, and a sentence.

    contained: whether the interval contains all that it does to the inertia, so that it is a note.
    """

    change: float
    text: str
    contained: bool = False


Test = Callable[[Evidence, Judged], Sequence[Finding] | None]
"""The findings of a hypothesis; None where it does not apply."""


def of_log(test: Callable[[Evidence], Sequence[Finding] | None]) -> Test:
    """The test of what does not depend on the inertia that is judged: once for a log, whatever methods ask."""
    tested = once(test)
    return lambda evidence, judged: tested(evidence)


@dataclass(frozen=True)
class Hypothesis:
    """One line of the table.

    check: its name among the consistency checks of a result, empty for none; words: what that checks. code, kind: of
    its message. test: see `Test`. limit: name of the standard uncertainty in
    `Judged.limits` beyond which a finding is a warning; empty where it never is one. note: whether another finding is a
    note. unless: codes of findings before, each of which would explain this one. own: whether it is tested only for an
    inertia that is that of the balance. contradicts: whether it is a contradiction of log and rig file. entries:
    standard uncertainties of the inertia by source, of an estimate with the given type A; see `table.entries`.

    Limits: "alone" is without what the sources of `table.NAMED` add, "whole" has all; "place", "angle", "gravity",
    "timing" are those of one question; "balance" is only there with own=True.
    """

    check: str
    code: str
    test: Test
    words: str = ""
    limit: str = ""
    note: bool = False
    unless: tuple[str, ...] = ()
    own: bool = False
    contradicts: bool = False
    kind: Kind | None = None
    entries: Callable[[Evidence, float, bool], dict[str, float]] = field(default=lambda evidence, u, of_balance: {})
