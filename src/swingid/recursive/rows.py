"""Rows of a stream as plain numbers, and the pieces cut from them: from one turning point to the one after the next.

Rows come from tuples or Recordings; unusable ones are excluded and counted. Turning points are found row by row with
hysteresis: the angle must return by a share of the last swing. They are where the stream is cut; in each piece the
turning points are found again, by smoothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from math import isfinite

import numpy as np

from swingid.errors import InputError
from swingid.numerics.arrays import Array
from swingid.recording.recording import Finding, Recording

Row = tuple[float, float, float, float]
"""Time (s), angle, wheel angle, voltage or torque; 0 for a channel that the method does not use."""

TOO_MANY_BAD = 1000
"""Successive unusable rows after which the stream is refused."""

NAMES = ("time", "angle", "wheel_angle", "voltage or torque")


BACK = 0.08
"""Share of the last swing by which the angle must return for its extreme to be a turning point."""

MARGIN = 0.15
"""Share of a swing before the first and after the last turning point that a piece contains too."""

LONGEST = 200_000
"""Rows in the buffer, at most; longer swings are given up."""


@dataclass
class Reader:
    """Reads the rows of a stream and counts those excluded.

    needed: which of time, angle, wheel angle, drive are required; the others are ignored. Rows with NaN or infinity in
    one of them, and rows whose time does not increase, are excluded; anything that is no row, also one with more
    numbers, raises InputError. held, findings, repairs_off: of the Recording that the last rows came from.
    """

    needed: tuple[bool, bool, bool, bool]
    skipped: int = 0
    held: bool = True
    findings: tuple[Finding, ...] = ()
    repairs_off: frozenset[str] = frozenset()

    def rows(self, samples: Iterable[object] | Recording) -> Iterator[Row]:
        """The usable rows of `samples`: tuples (t, angle, wheel_angle, voltage or torque), or Recordings, or one."""
        last, bad, number = -float("inf"), 0, 0
        for plain in self._plain(samples):
            number += 1
            row = self._row(plain, number)
            if row is not None and row[0] > last:
                last, bad = row[0], 0
                yield row
                continue
            self.skipped += 1
            bad += 1
            if bad > TOO_MANY_BAD:
                why = "NaN or infinity" if row is None else f"a time that does not rise above {last:g} s"
                raise InputError(
                    f"row {number} of the stream: the {bad}th in succession with {why}; repair the source.",
                    code="bad-stream",
                )

    def _plain(self, samples: Iterable[object] | Recording) -> Iterator[object]:
        try:
            stream = iter((samples,) if isinstance(samples, Recording) else samples)
        except TypeError:
            text = f"samples are rows (time, angle, wheel_angle, voltage or torque) or Recordings, not {samples!r:.60}."
            raise InputError(text, code="bad-stream") from None
        for sample in stream:
            if not isinstance(sample, Recording):
                yield sample
                continue
            self.held, self.findings, self.repairs_off = sample.drive_held, sample.findings, sample.repairs_off
            drive = sample.torque if sample.voltage is None else sample.voltage
            channels = [sample.time, sample.angle, sample.wheel_angle, drive]
            yield from zip(*([None] * len(sample) if c is None else c.tolist() for c in channels), strict=True)

    def _row(self, sample: object, number: int) -> Row | None:
        """The row as four numbers, None where a needed one is not finite."""
        try:
            given: tuple[float, ...] = tuple(sample)  # type: ignore[arg-type]
            if len(given) > len(NAMES):
                raise ValueError
            values = [float(given[k]) if needed else 0.0 for k, needed in enumerate(self.needed)]
        except (TypeError, ValueError, IndexError):
            wanted = [name for name, needed in zip(NAMES, self.needed, strict=True) if needed]
            raise InputError(
                f"row {number} of the stream is {sample!r:.60}; write (time, angle, wheel_angle, voltage or torque), "
                f"numbers for {', '.join(wanted)}, and None for a channel that the rig does not have.",
                code="bad-row",
            ) from None
        return (values[0], values[1], values[2], values[3]) if all(map(isfinite, values)) else None


@dataclass
class SwingBuffer:
    """Rows of the last two swings and a little more.

    least: swings smaller than this (rad or m) are noise. lost: pieces that were given up, for gaps or for their length.
    _farthest: rows of the highest (1) and of the lowest angle (−1) since the axis turned around.
    """

    least: float
    rows: list[Row] = field(default_factory=list)
    extremes: list[int] = field(default_factory=list)
    lost: int = 0
    _direction: int = 0
    _farthest: dict[int, int] = field(default_factory=lambda: {1: 0, -1: 0})

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
        self._direction, self._farthest = 0, {1: 0, -1: 0}

    @property
    def _threshold(self) -> float:
        """Return by how much the angle must come back, from the swings known so far."""
        angles = [self.rows[k][1] for k in self.extremes[-2:]]
        size = abs(angles[1] - angles[0]) if len(angles) == 2 else 0.0
        return max(BACK * size, self.least)

    def _turned(self) -> bool:
        """Return whether the last row shows that an extreme was a turning point."""
        last, threshold = len(self.rows) - 1, self._threshold
        value = self.rows[last][1]
        for side, far in self._farthest.items():
            if side * value > side * self.rows[far][1]:
                self._farthest[side] = last
        for side, far in self._farthest.items():
            if side * self._direction >= 0 and side * (self.rows[far][1] - value) > threshold:
                self.extremes.append(far)
                self._direction, self._farthest = -side, {1: last, -1: last}
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
        self._farthest = {side: far - keep for side, far in self._farthest.items()}
        return piece
