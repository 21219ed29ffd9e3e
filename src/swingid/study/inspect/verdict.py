"""What all checks of a log say together: whether it is usable, and what would serve better."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

from swingid.recording.inspect import Check

MOST = 4
"""Remedies of one kind that the line names."""


@dataclass(frozen=True)
class Verdict:
    """status for scripts, the line for people, and what would serve better ("" for nothing).

    "ready": the log serves as it is, or as swingid repairs it on reading; "repairs": once the rig file states what the
    line names; "unusable": it does not.
    """

    status: Literal["ready", "repairs", "unusable"]
    line: str
    advice: str = ""


def verdict_of(checks: Sequence[Check], *, with_rig: bool) -> Verdict:
    """Make the verdict of all checks; without a rig the file alone was checked, and the line states it."""
    advice = _listed(check.remedy for check in checks if check.level == "advice")
    faults = [check for check in checks if check.level == "fault"]
    if faults:
        return Verdict("unusable", f"not usable: {_sentences(faults)}", advice)
    made = _listed(check.own for check in checks if check.own is not None)
    remedies = _listed(check.remedy for check in checks if check.level == "repair")
    by_itself = f"swingid itself repairs {made}" if made else ""
    if remedies:
        return Verdict("repairs", f"ready after these repairs: {remedies}{'; ' + by_itself if made else ''}.", advice)
    line = f"ready; {by_itself}." if made else "ready."
    if not with_rig:
        line = f"ready as a file{'; ' + by_itself if made else ''}; signs, zero and scale are checked with --rig."
    return Verdict("ready", line, advice)


def _listed(texts: Iterable[str]) -> str:
    """Each once, the first few of them."""
    several = list(dict.fromkeys(text for text in texts if text))
    return "; ".join(several[:MOST]) + (f"; and {len(several) - MOST} more" if len(several) > MOST else "")


def _sentences(checks: list[Check]) -> str:
    """The first two with what is to be done."""
    texts = [
        check.evidence.rstrip(".")
        + (f"; {check.remedy}" if check.remedy and check.remedy not in check.evidence else "")
        for check in checks[:2]
    ]
    return ". ".join(text[0].upper() + text[1:] if k else text for k, text in enumerate(texts)) + "."
