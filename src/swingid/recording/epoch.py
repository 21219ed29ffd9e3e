"""A clock that counts from an epoch (1970, ns of a ROS stamp): its times are taken from the first row."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from swingid.recording.conventions import Conventions, Scale
from swingid.recording.recording import Finding

if TYPE_CHECKING:
    from swingid.recording.formats.table import Table

EPOCH = 1e8
"""Three years in s: no clock that was started with the rig has run so long."""

LAST = 1e11
"""No clock in s: one that counts ms, us or ns."""


def from_first_row(table: Table, conventions: Conventions) -> tuple[Conventions, list[Finding]]:
    """The conventions with times (s) from the first row of `table` where they count from an epoch, and a note of it."""
    column = None if conventions.rate is not None else table.find(conventions.columns["time"])
    if column is None:
        return conventions, []
    stamps, _ = table.numbers(column)
    scale = conventions.scales.get("time", Scale())
    stamps = stamps[np.isfinite(stamps)][:1]
    begin = float(stamps[0]) * scale.factor if stamps.size else 0.0
    if not EPOCH < abs(begin) < LAST:
        return conventions, []
    text = f"the times in column {column!r} count from an epoch; here they count from the first row, at {begin:.3f} s."
    moved = Scale(scale.factor, -begin)
    return replace(conventions, scales=conventions.scales | {"time": moved}), [Finding("from-epoch", text, "note")]
