"""The last swings of a stream, and the pieces cut from it: one per turning point, from the one before to the one after.

Turning points are found row by row with hysteresis: the angle must come back by a share of the last swing. That tells
where to cut; the piece finds its turning points anew, by smoothing.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from swingid.numerics.arrays import Array
from swingid.recursive.samples import Row

BACK = 0.08
"""Share of the last swing by which the angle must come back for its extreme to be a turning point."""

MARGIN = 0.15
"""Share of a swing before the first and after the last turning point that a piece holds too."""

LONGEST = 200_000
"""Rows that the buffer holds at most; a swing that is longer is no swing."""


@dataclass
class SwingBuffer:
    """Rows of the last two swings and a little more.

    least: swings smaller than this (rad or m) are noise. lost: pieces that were given up, for gaps or for their length.
    """

    least: float
    rows: list[Row] = field(default_factory=list)
    extremes: list[int] = field(default_factory=list)
    lost: int = 0
    _direction: int = 0
    _high: int = 0
    _low: int = 0

    def push(self, row: Row) -> tuple[Array, float] | None:
        """Take one row; the piece (rows, 4) around the turning point before the last, and its time, once known."""
        self.rows.append(row)
        if len(self.rows) > LONGEST:
            self.restart()
            return None
        if self._turned():
            return self._piece()
        return None

    def restart(self) -> None:
        """Forget everything but the last row."""
        self.lost += 1
        del self.rows[:-1]
        self.extremes.clear()
        self._direction = self._high = self._low = 0

    @property
    def _threshold(self) -> float:
        """By how much the angle must come back, from the swings known so far."""
        angles = [self.rows[k][1] for k in self.extremes[-2:]]
        size = abs(angles[1] - angles[0]) if len(angles) == 2 else 0.0
        return max(BACK * size, self.least)

    def _turned(self) -> bool:
        """Whether the last row shows that an extreme was a turning point."""
        last = len(self.rows) - 1
        value = self.rows[last][1]
        if value > self.rows[self._high][1]:
            self._high = last
        if value < self.rows[self._low][1]:
            self._low = last
        threshold = self._threshold
        if self._direction >= 0 and self.rows[self._high][1] - value > threshold:
            self.extremes.append(self._high)
            self._direction, self._low, self._high = -1, last, last
            return True
        if self._direction <= 0 and value - self.rows[self._low][1] > threshold:
            self.extremes.append(self._low)
            self._direction, self._high, self._low = 1, last, last
            return True
        return False

    def _piece(self) -> tuple[Array, float] | None:
        """Rows around the last but one extreme; rows that no later piece needs are dropped."""
        if len(self.extremes) < 3:
            return None
        first, middle, _ = self.extremes[-3:]
        start = max(first - int(MARGIN * (middle - first)) - 1, 0)
        piece = np.array(self.rows[start:]), self.rows[middle][0]
        keep = max(middle - int(2 * MARGIN * (middle - first)) - 2, 0)
        del self.rows[:keep]
        self.extremes = [k - keep for k in self.extremes[-2:]]
        self._high -= keep
        self._low -= keep
        return piece
