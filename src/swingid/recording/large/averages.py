"""Means over blocks of rows, as many as the motion allows: what a slower logger with a better encoder would write.

The mean over a block is a convolution, so in the terms that are linear in the angles (φ'' q1, φ'' q2) it is the same as
test functions smoothed by the block: exact. In the others, sin q1 and friction, the mean of the term is not the term of
the mean, but for a relative (q1' w)²/24, w the width of a block: 4e-6 with 300 blocks in a swing. White noise falls by
the root of the number of rows. A block has an odd number of rows, so that its middle is a row.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from swingid.numerics.arrays import Array
    from swingid.recording.conventions import Channels


BLOCKS_PER_SWING = 300
"""Blocks that the shorter swings have at least."""

SHORTER = 0.1
"""Share of the swings that may be shorter."""

BACK = 0.1
"""Share of the range by which the angle must come back for its extreme to be one."""

LOOKED_AT = 5_000
"""Rows that are looked at, spread over all."""

WIDE = 1.5
"""Median widths of a block beyond which it lies across a gap, and is left out."""


def block_length(angle: Array) -> int:
    """Rows (odd) that may be averaged into one, from the swings of the angle (n,); 1 where there is no motion."""
    stride = max(1, angle.size // LOOKED_AT)
    extremes = _extremes(angle[::stride])
    if len(extremes) >= 3:
        swing = float(np.quantile(np.diff(extremes), SHORTER, method="lower")) * stride
    else:  # a slow motion, or none
        swing = angle.size / 3 if extremes else 0.0
    rows = int(swing / BLOCKS_PER_SWING)
    return max(1, rows if rows % 2 else rows - 1)


def _extremes(values: Array) -> list[int]:
    """Places of the alternating extremes of `values`, without the first, which may be where they begin."""
    low, high = np.quantile(values, (0.01, 0.99))
    back = BACK * float(high - low)
    found: list[int] = []
    lowest = highest = 0
    direction = 0
    path = values.tolist()
    for k, value in enumerate(path):
        if value > path[highest]:
            highest = k
        if value < path[lowest]:
            lowest = k
        if direction >= 0 and path[highest] - value > back:
            found.append(highest)
            direction, lowest, highest = -1, k, k
        elif direction <= 0 and value - path[lowest] > back:
            found.append(lowest)
            direction, lowest, highest = 1, k, k
    return found[1:]


def averaged(channels: Channels, rows: int, held: tuple[str, ...]) -> tuple[Channels, Channels]:
    """Means over blocks of `rows` (odd) successive rows, and the last rows, which the next blocks begin with.

    channels: with "time" (s), rising; no more is asked of it. held: channels whose values act from their row to the
    next one (a voltage as commanded); their means are over the same time as those of the angles, and so are
    measurements, held no more. Blocks across a gap are left out.
    """
    time = channels["time"]
    blocks = time.size // rows - 1  # the last needs the middle of the next
    if blocks < 1:
        return {name: values[:0] for name, values in channels.items()}, channels
    middles = _means(time, blocks + 1, rows)
    used, found = blocks * rows, {"time": middles[:-1]}
    for name, values in channels.items():
        if name in held:
            found[name] = _held_means(time, values, middles)
        elif name != "time":
            found[name] = _means(values, blocks, rows)
    widths = time[rows - 1 : used : rows] - time[0:used:rows]
    whole = widths < WIDE * np.median(widths)
    if not whole.all():
        found = {name: values[whole] for name, values in found.items()}
    return found, {name: values[used:] for name, values in channels.items()}


def _means(values: Array, blocks: int, rows: int) -> Array:
    result: Array = values[: blocks * rows].reshape(blocks, rows).mean(axis=1)
    return result


def _held_means(time: Array, values: Array, middles: Array) -> Array:
    """Mean of a held signal about each middle but the last, half-way to its neighbours."""
    last = min(int(np.searchsorted(time, middles[-1])) + 1, time.size)
    before = time[0] - (time[1] - time[0])  # the block reaches half a step beyond its first row
    stamps = np.concatenate(([before], time[:last]))
    running = np.concatenate(([0.0], np.cumsum(np.concatenate((values[:1], values[: last - 1])) * np.diff(stamps))))
    between = (middles[1:] + middles[:-1]) / 2
    edges = np.concatenate(([2 * middles[0] - between[0]], between))
    result: Array = np.diff(np.interp(edges, stamps, running)) / np.diff(edges)
    return result
