"""The claims of the paper's conclusion, each with a test on the twin, the criterion that judges it, and a verdict.

A verdict follows from the numbers by the criterion that stands beside it; no verdict is written by hand.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from swingid.study.reproduce.estimates import Answer

BAR = 1.4
"""Per cent: where a sentence speaks of an inertia or a friction parameter that is found, and names no accuracy, what
the paper reaches in its own ideal simulation is asked."""

HOLDS, PARTLY, FAILS = "holds", "holds in part", "does not hold"


@dataclass(frozen=True)
class Claim:
    """A claim in the paper's words, what was done, what was measured, the criterion and the verdict.

    measured: (words, value, unit), "±%" for the size of an error; words before a colon are what several have in common.
    """

    claim: str
    test: str
    measured: tuple[tuple[str, float | None, str], ...]
    criterion: str
    verdict: str

    def to_dict(self) -> Answer:
        """Plain data."""
        measured = [{"what": what, "value": value, "unit": unit} for what, value, unit in self.measured]
        return vars(self) | {"measured": measured}


def judged(whole: bool, part: bool = False) -> str:
    """The verdict: the criterion is met, only the part of it that is named, or neither."""
    return HOLDS if whole else PARTLY if part else FAILS


def claim_rows(seed: int, progress: Callable[[str], None]) -> list[Answer]:
    """All claims, tested."""
    from swingid.study.reproduce import claims_accuracy, claims_control

    rows = []
    for test in (*claims_accuracy.TESTS, *claims_control.TESTS):
        progress(f"claim: {test.__name__.replace('_', ' ')}")
        rows.append(test(seed).to_dict())
    return rows
