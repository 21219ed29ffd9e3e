"""One result of an inspection (`Check`), and the checks of a log's clock: rate, jitter, gaps, repeated rows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Literal

import numpy as np

from swingid.recording.rows import NEARLY_ALL, few

if TYPE_CHECKING:
    from swingid.numerics.arrays import Array
    from swingid.recording.inspect.columns import Column


Level = Literal["ok", "note", "unknown", "advice", "repair", "fault"]


@dataclass(frozen=True, slots=True)
class Check:
    """A finding of an inspection: a `code` for scripts, a `title` and a sentence of `evidence` with numbers for people.

    level: "ok" nothing is wrong; "note" worth knowing; "unknown" not determined here; "advice" it serves, and would
    serve better after `remedy`; "repair" it serves once `remedy` is stated in the rig file; "fault" it does not serve.
    values: the numbers of the sentence, in SI units. own: what swingid repaired on reading.
    """

    code: str
    title: str
    level: Level
    evidence: str
    remedy: str = ""
    values: Mapping[str, object] = field(default_factory=dict)
    own: str | None = None

    def to_dict(self) -> dict[str, object]:
        """Return plain data for JSON."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        repair = values.pop("own")
        return values | {"values": dict(self.values), "own_repair": repair}


GAP = 1.5
COUNTED = 1e12  # rows that a gap is reported to miss, at most
"""Median steps beyond which a step is a gap."""

EVEN = 0.01
UNEVEN = 0.2
"""Robust standard deviations of the steps, in steps: rows are even below the first, very uneven above the second."""


FEW_TURNS = 0.5
"""Share of rows at which a count turns, below which it follows a motion; a bit that toggles turns at all of them."""


@dataclass(frozen=True, eq=False)
class Clock:
    """The time column in s. step: mean of the usual rising steps. jitter: robust standard deviation of the steps, s.

    gaps: number of steps beyond 1.5 usual ones; longest: the longest step; lost: rows that would fill the gaps.
    edges: whether a column counts by one from row to row: a row per edge of an encoder, where a long step
    is a slow motion and no row is lost. repeated: rows with the time of the row before, copies of them alike in every
    column; backwards: steps back.
    stamps (n,): time of each row, s.
    """

    stamps: Array
    step: float
    jitter: float
    gaps: int
    longest: float
    lost: int
    repeated: int
    copies: int
    backwards: int
    edges: bool = False

    @property
    def rate(self) -> float:
        """Rows per second."""
        return 1.0 / self.step if self.step > 0 else float("nan")

    @property
    def duration(self) -> float:
        """Time from the first row to the last, s."""
        finite = self.stamps[np.isfinite(self.stamps)]
        return float(finite.max() - finite.min()) if finite.size else 0.0


def read_clock(stamps: Array, columns: list[Column]) -> Clock:
    """The clock of `stamps` (s, one per row, NaN where missing); columns: of the file, to find copies of rows."""
    steps = np.diff(stamps)
    steps = steps[np.isfinite(steps)]
    rising = steps[steps > 0]
    usual = float(np.median(rising)) if rising.size else 0.0
    gaps = rising[rising > GAP * usual]
    regular = rising[rising <= GAP * usual]
    repeated = np.flatnonzero(np.diff(stamps) == 0)
    copies = np.ones(repeated.size, dtype=bool)
    for column in columns if repeated.size else ():
        if len(column.values) == len(stamps):
            before, after = column.values[repeated], column.values[repeated + 1]
            copies &= (before == after) | (np.isnan(before) & np.isnan(after))
    edges = any(len(column.values) == len(stamps) and _counts_edges(column) for column in columns)
    lost = int(np.sum(np.floor(np.minimum(gaps / usual, COUNTED) + 0.3) - 1)) if gaps.size and not edges else 0
    return Clock(
        stamps=stamps,
        step=float(np.mean(regular)) if regular.size else 0.0,  # the median of rounded stamps is rounded, too
        jitter=1.4826 * float(np.median(np.abs(regular - usual))) if regular.size else 0.0,
        gaps=int(gaps.size),
        longest=float(rising.max(initial=0.0)),
        lost=lost,
        repeated=int(repeated.size),
        copies=int(np.count_nonzero(copies)),
        backwards=int(np.count_nonzero(steps < 0)),
        edges=edges,
    )


def _counts_edges(column: Column) -> bool:
    """Return whether whole numbers go up and down by one from row to row, and stay only where the direction changes."""
    if column.kind != "whole numbers":
        return False
    steps = np.diff(column.values)
    return bool(
        NEARLY_ALL * steps.size < np.count_nonzero(np.abs(steps) == 1) and (steps > 0).any() and (steps < 0).any()
    ) and bool(np.mean(np.diff(np.sign(steps)) != 0) < FEW_TURNS)


def check_clock(clock: Clock, name: str) -> list[Check]:
    """What the clock shows, in sentences; name: of the time column."""
    rows = len(clock.stamps)
    values: dict[str, object] = {"rows": rows, "rate": clock.rate, "duration": clock.duration, "jitter": clock.jitter}
    if clock.backwards > NEARLY_ALL * (rows - 1):
        text = f"the time in {name} runs backwards, from {clock.stamps[0]:.6g} to {clock.stamps[-1]:.6g} s"
        remedy = "if the rows are stored newest first, turn their order around, else correct the clock"
        return [Check("backwards", "order of rows", "fault", text, remedy, {"backwards": clock.backwards})]
    if clock.step <= 0:
        text = f"{name} does not rise, so the instants of the rows are unknown"
        return [Check("rate", "rate", "fault", f"{text}.", "log the time, or set [log] rate", values)]
    share = clock.jitter / clock.step
    steps = "evenly spaced" if share < EVEN else f"steps scatter by {share:.0%} ({clock.jitter * 1e3:.3g} ms)"
    findings = [
        Check(
            "rate",
            "rate",
            "note" if share > UNEVEN else "ok",
            f"{rows} rows over {clock.duration:.5g} s, {clock.rate:.6g} per second, {steps}.",
            "",
            values,
        )
    ]
    if clock.gaps:
        text = f"{clock.gaps} {'step is' if clock.gaps == 1 else 'steps are'} longer than {GAP:g} usual ones"
        text += f", the longest {clock.longest:.4g} s"
        share = clock.lost / (rows + clock.lost)
        none = "a row per edge of the encoder, none is lost." if clock.edges else "no rows seem lost."
        text += f"; {clock.lost} rows ({share:.2%}) seem lost." if clock.lost else f"; {none}"
        findings.append(Check("gaps", "gaps", "note", text, "", {"gaps": clock.gaps, "lost": clock.lost}))
    if clock.repeated:
        text = f"{clock.repeated} rows have the time of the row before, {clock.copies} of them are copies of it"
        other = clock.repeated - clock.copies
        slips = few(other, rows)
        remedy = "" if slips else "log the time with more digits"
        text += "; these are left out." if slips else "; the others contradict it."
        values = {"repeated": clock.repeated, "copies": clock.copies}
        findings.append(Check("repeated-rows", "repeated rows", "note" if slips else "advice", text, remedy, values))
    if clock.backwards:
        text = f"the time runs backwards after {clock.backwards} of {rows} rows."
        slips = few(clock.backwards, rows)
        remedy = "" if slips else "give one run per file"
        level: Level = "note" if slips else "fault"
        findings.append(Check("backwards", "order of rows", level, text, remedy, {"backwards": clock.backwards}))
    return findings
