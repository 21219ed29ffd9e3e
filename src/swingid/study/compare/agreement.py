"""Whether the methods agree on a log, and what those that stand apart have in common."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from swingid.pooling.shares import Identity, estimate_of, sum_of
from swingid.result.result import Result

if TYPE_CHECKING:
    from swingid.study.compare.comparison import Trial

LIMIT = 2.0
"""Difference, in its own standard uncertainties, beyond which two methods disagree."""

MATTERS = 0.5
"""Difference, in the smaller of the two methods' own uncertainties, below which it changes nothing.

Methods that lean alike on the same constants differ by far less than either is uncertain.
"""


@dataclass(frozen=True)
class Verdict:
    """For one log: the method that the others are held against, who disagrees with it, and a sentence on why."""

    log: str
    reference: str | None
    apart: tuple[str, ...]
    message: str


def verdict(log: str, trials: Sequence[Trial]) -> Verdict:
    """Hold every method against the one that rests on least (the first that answers)."""
    answered = [t for t in trials if "inertia" in t.result.parameters]
    if len(answered) < 2:
        return Verdict(
            log, answered[0].method if answered else None, (), "one method alone answers; nothing to compare."
        )
    reference, others = answered[0], answered[1:]
    deviations = {t.method: deviation(t.result, reference.result) for t in others}
    apart = tuple(
        t.method
        for t in others
        if (far := deviations[t.method]) is not None and abs(far) > LIMIT and _matters(t.result, reference.result)
    )
    if not apart:
        doubts = ", ".join(dict.fromkeys(w.code for w in reference.result.warnings))
        doubt = f", but {doubts} of {reference.method} may concern them all" if doubts else ""
        return Verdict(
            log, reference.method, (), f"all methods agree with {reference.method} within their intervals{doubt}."
        )
    named = ", ".join(f"{name} ({deviations[name]:+.1f} standard uncertainties)" for name in apart)
    verb = "stands" if len(apart) == 1 else "stand"
    return Verdict(
        log, reference.method, apart, f"{named} {verb} apart from {reference.method}: {_why(answered, apart)}"
    )


def deviation(a: Result, b: Result) -> float | None:
    """(a − b) over the standard uncertainty of the difference; constants that both share partly cancel in it.

    Scatter counts as independent although both saw the same noise, which errs on the side of agreement. None where an
    uncertainty is unknown.
    """
    if a.inertia.standard_uncertainty is None or b.inertia.standard_uncertainty is None:
        return None
    gap = sum_of((estimate_of(a, "inertia", _source("a")), estimate_of(b, "inertia", _source("b"))), (1.0, -1.0))
    return gap.value / gap.u if gap.u > 0 else None


def _matters(a: Result, b: Result) -> bool:
    """Whether the difference is a good part of what either is uncertain by anyway."""
    own = min(a.inertia.standard_uncertainty or 0.0, b.inertia.standard_uncertainty or 0.0)
    return abs(a.inertia.value - b.inertia.value) > MATTERS * own


def _source(run: str) -> Identity:
    """A constant is the same in both results, anything else is not."""
    return lambda entry: entry.shared_id or f"{run}: {entry.source}"


def _why(answered: Sequence[Trial], apart: tuple[str, ...]) -> str:
    """The assumption that sets those apart from those that agree, in words with what to do."""
    odd = [t for t in answered if t.method in apart]
    even = [t for t in answered if t.method not in apart]
    if all(t.assumptions.motor for t in odd) and not all(t.assumptions.motor for t in even):
        rests = "they rest" if len(odd) > 1 else "it rests"
        return f"{rests} on the motor's constants; calibrate the motor (swingid calibrate) or trust the others."
    if all(t.assumptions.friction != "any" for t in odd):
        return (
            f"{'they assume' if len(odd) > 1 else 'it assumes'} a friction law; try another law, or trust the method "
            "that needs none."
        )
    return "no assumption tells them apart; look at the residuals in their reports."
