"""A small plot of dots for a terminal: Braille letters, two by four dots each."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from swingid.format import number

if TYPE_CHECKING:
    from swingid.numerics.arrays import Array
    from swingid.study.inspect.inspection import Inspection

COLUMNS, LINES = 96, 10
"""Letters of the plot: it fits beside its labels into 118 columns."""

EMPTY = 0x2800
DOTS = np.array(((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80)))
"""The first letter of the block, and what each dot adds to it."""


def dots(x: Array, y: Array) -> list[str]:
    """Lines of a plot of points (n,), from the lowest to the highest of both."""
    seen = np.isfinite(x) & np.isfinite(y)
    letters = np.full((LINES, COLUMNS), EMPTY)
    if seen.any():
        across, down = _places(x[seen], 2 * COLUMNS), 4 * LINES - 1 - _places(y[seen], 4 * LINES)
        np.bitwise_or.at(letters, (down // 4, across // 2), DOTS[down % 4, across % 2])
    return ["".join(map(chr, line)) for line in letters]


def _places(values: Array, count: int) -> np.ndarray:
    """The place of each value among `count` equal ones from the lowest to the highest."""
    low, span = float(values.min()), float(np.ptp(values))
    return np.minimum((values - low) / (span or 1.0) * count, count - 1).astype(int)


def plot_of(inspection: Inspection) -> str:
    """The angle over the time of an inspected log; a sentence where it could not be read."""
    log = inspection.log
    if log is None:
        return "no plot: the log could not be read."
    unit = "m" if inspection.linear else "rad"
    high, low = (number(float(end), unit, 3) for end in (log.angle.max(), log.angle.min()))
    begin, end = (f"{instant:.4g} s" for instant in (log.time[0], log.time[-1]))
    what = f"{'position' if inspection.linear else 'angle'} from {low} to {high}"
    return "\n".join([what, *dots(log.time, log.angle), f"{begin}{end:>{COLUMNS - len(begin)}}"])
