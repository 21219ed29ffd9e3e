"""The unit of an angle by its steps: an encoder makes a whole number of counts of a turn, most often a power of two."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from swingid.recording.inspect.grid import is_decimal

if TYPE_CHECKING:
    from swingid.recording.inspect.columns import Column

TURN = {"rad": 2 * np.pi, "deg": 360.0, "turns": 1.0}
"""One turn in each unit of an angle."""

FEWEST, MOST, MOST_ROUND = 64, 2**26, 40_000
"""Counts per turn of the coarsest encoder, of the finest, and of the finest whose counts are no power of two."""

CLOSE = 3e-4
"""How exactly (share) a step is known."""


def steps_seen(column: Column) -> bool:
    """Whether the values lie on the grid of an encoder, and not on that of the digits that were written."""
    return column.step > 0 and (column.kind == "whole numbers" or not is_decimal(column.step))


def unit_of_steps(column: Column) -> tuple[str, int]:
    """The one unit in which the steps are those of an encoder, and its counts per turn; ("", 0) where none or several.

    Counts are a power of two, or else a multiple of 100.
    """
    if column.kind == "whole numbers" or not steps_seen(column):
        return "", 0
    counts = {unit: turn / column.step for unit, turn in TURN.items()}
    counts = {unit: count for unit, count in counts.items() if FEWEST < count <= MOST}
    for fits in (_is_power_of_two, _is_round):
        found = [(unit, round(count)) for unit, count in counts.items() if fits(count)]
        if len(found) == 1:
            return found[0]
    return "", 0


def _is_power_of_two(count: float) -> bool:
    return bool(abs(count / 2.0 ** np.round(np.log2(count)) - 1) < CLOSE)


def _is_round(count: float) -> bool:
    return 100 < count < MOST_ROUND and abs(count / (100 * round(count / 100)) - 1) < CLOSE / 10
