"""One line: ready, ready after these repairs, or not usable and why."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from swingid.recording.inspect import Check

MOST = 4


@dataclass(frozen=True)
class Verdict:
    """status for scripts, and the line for people."""

    status: Literal["ready", "repairs", "unusable"]
    line: str


def judge(checks: list[Check], *, with_rig: bool) -> Verdict:
    """From all checks to the verdict; without a rig only the file was judged, and the line says so."""
    faults = [check for check in checks if check.level == "fault"]
    if faults:
        return Verdict("unusable", f"not usable: {_sentences(faults)}")
    repairs = list(dict.fromkeys(check.remedy for check in checks if check.level == "repair"))
    if repairs:
        shown = "; ".join(repairs[:MOST]) + (f"; and {len(repairs) - MOST} more" if len(repairs) > MOST else "")
        return Verdict("repairs", f"ready after these repairs: {shown}.")
    if with_rig:
        return Verdict("ready", "ready.")
    return Verdict("ready", "ready as a file; signs, zero and scale are told with --rig.")


def _sentences(checks: list[Check]) -> str:
    text = " ".join(check.evidence for check in checks[:2])
    return text if text.endswith(".") else f"{text}."
