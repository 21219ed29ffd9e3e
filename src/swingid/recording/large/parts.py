"""From pieces of a file to parts of a log: rows in order, angles continuous, averaged, then repaired as any log.

Means are over blocks of rows, as many as the motion allows: what a slower logger with a better encoder would write. The
mean over a block is a convolution, so in the terms that are linear in the angles (φ'' q1, φ'' q2) it is the same as
modulating functions smoothed by the block: exact. In the others, sin q1 and friction, the mean of the term is not the
term of the mean, but for a relative (q1' w)²/24, w the width of a block: 4e-6 with 300 blocks in a swing. White noise
falls by the root of the number of rows. A block has an odd number of rows, so that its middle is a row.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from swingid.errors import InputError, SwingidError
from swingid.numerics.arrays import median, quantile
from swingid.numerics.reversals import reversals
from swingid.recording.conventions import Reading, gather
from swingid.recording.findings import Finding, Source
from swingid.recording.formats.table import stacked
from swingid.recording.load import check_motion, unreadable_rows
from swingid.recording.recording import Recording
from swingid.recording.repair import ANGLES, FAULTS_OF_MEANS, limited, made_continuous, without_spikes
from swingid.recording.rows import LARGEST, few, rows_in_order, take

if TYPE_CHECKING:
    from swingid.numerics.arrays import Array, Bools
    from swingid.recording.conventions import Channels, Conventions
    from swingid.recording.formats.table import Table


ENOUGH = 60_000
"""Rows, averaged ones, that make a part."""

HELD = ("voltage", "torque")


@dataclass
class _Part:
    """A part as it grows: its averaged rows, raw rows that wait, how many are averaged, what was found."""

    block: int
    rows: int = 0
    kept: list[Channels] = field(default_factory=list)
    waiting: Channels = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)

    def add(self, channels: Channels, held: tuple[str, ...]) -> None:
        """Take raw rows."""
        self.rows += channels["time"].size
        if self.block == 1:
            self.kept.append(channels)
            return
        means, self.waiting = averaged(channels, self.block, held, self.waiting)
        self.kept.append(means)

    @property
    def size(self) -> int:
        """Averaged rows so far."""
        return sum(channels["time"].size for channels in self.kept)


def parts(pieces: Iterable[Table], reading: Reading) -> Iterator[tuple[int, Recording | SwingidError]]:
    """The parts of a log, or why one cannot be used, each with the number of rows read so far.

    Raises InputError as `Recording.load`, where the rows of a piece cannot be used.
    """
    held = HELD if reading.held else ()
    part: _Part | None = None
    done = 0
    for channels, findings in _pieces(pieces, reading):
        averages = "wheel_speed" not in channels
        block = block_length(channels["angle"]) if averages and channels["time"].size else 1
        if part is not None and (part.size >= ENOUGH or not part.block <= block <= 3 * part.block):
            done += part.rows
            yield done, _recording(part, reading)
            part = None
        part = part or _Part(block)
        part.findings += findings
        part.add(channels, held)
    if part is not None:
        yield done + part.rows, _recording(part, reading)


def _pieces(pieces: Iterable[Table], reading: Reading) -> Iterator[tuple[Channels, list[Finding]]]:
    """Channels of each piece in logged units, in order of time and continuous also from piece to piece."""
    last: Channels = {}
    wrapped: set[str] = set()
    before = 0
    for table in pieces:
        row, before = before, before + max(map(len, table.columns.values()))
        piece = replace(reading, findings=[], before=row, texts={})
        unreadable = unreadable_rows(table, piece)
        with _naming_rows(reading.name, row, before):
            channels = gather(table, piece)
            if reading.conventions.rate is not None:
                channels["time"] = channels["time"] + row / reading.conventions.rate
            if reading.span is not None:
                channels = take(channels, within(table, reading, row))
            if channels["time"].size < 2:
                continue
            if not _is_plain(channels, last, reading.conventions):
                channels = made_continuous(_after(rows_in_order(channels, piece), last, piece), piece)
                channels = without_spikes(channels, piece, passes=0)
        piece.findings += unreadable
        if any(finding.code == "unwrapped" for finding in piece.findings):
            wrapped |= {name for name in ANGLES if reading.conventions.scales.get(name) is not None}
        channels = limited(_continued(channels, last, reading.conventions, wrapped), piece)
        last = {name: values[-1:] for name, values in channels.items()}
        yield channels, piece.findings


@contextmanager
def _naming_rows(name: str, before: int, after: int) -> Iterator[None]:
    """An error about a piece of the file `name` after the first, with the rows that the piece has of it."""
    try:
        yield
    except InputError as error:
        if before == 0:  # what is wrong from the begin on may be so in all rows
            raise
        message = error.message.replace(name, f"{name} (rows {before + 1} to {after})", 1)
        raise InputError(message, code=error.code) from None


def _is_plain(channels: Channels, last: Channels, conventions: Conventions) -> bool:
    """Return whether the rows need no repair: a time that rises, possible numbers only, no angle that leaps half a
    turn.
    """
    time, most = channels["time"], LARGEST["time"]
    begin = last["time"][0] if last else -np.inf
    if not (max(begin, -most) < time[0] and time[-1] <= most and (time[1:] > time[:-1]).all()):
        return False
    for name, values in channels.items():
        scale = conventions.scale(name)
        limit = LARGEST[name] / abs(scale.factor) if name in LARGEST else np.finfo(np.float64).max
        if name != "time" and not (-limit <= values.min() and values.max() <= limit):  # not so for a NaN
            return False
        if name in ANGLES and scale.turn is not None:
            steps = np.diff(values)
            if not max(-steps.min(), steps.max()) <= 0.5 * scale.turn:
                return False
    return True


def within(table: Table, reading: Reading, before: int) -> Bools:
    """Which rows (n,) of a piece lie in the span of time; before: rows of the pieces before."""
    conventions, (start, stop) = reading.conventions, reading.span or (-np.inf, np.inf)
    if conventions.rate is not None:
        time = (before + np.arange(max(map(len, table.columns.values())))) / conventions.rate
    else:
        column = table.find(conventions.columns["time"])
        time, _ = table.numbers(column or conventions.columns["time"])
    time = conventions.scale("time").to_model(time)
    inside: Bools = (time >= start) & (time <= stop)
    return inside


def _after(channels: Channels, last: Channels, reading: Reading) -> Channels:
    """The rows after the piece before; InputError where more than a few go back."""
    if not last:
        return channels
    late = channels["time"] <= last["time"][0]
    count = int(late.sum())
    if count == 0:
        return channels
    where = f"{reading.name}: {reading.column('time')} runs backwards after row {reading.before}"
    if not few(count, late.size):
        message = f"{where}; a log of this size is not sorted, so give one run per file, or choose a part of it."
        raise InputError(message, code="unsorted")
    reading.found("unsorted", f"{where}; {count} rows were left out.", "warning", "sort")
    return take(channels, ~late)


def _continued(channels: Channels, last: Channels, conventions: Conventions, wrapped: set[str]) -> Channels:
    """Angles that are logged within one turn, on the turn on which the piece before ends."""
    for name in ANGLES:
        turn = conventions.scale(name).turn
        if name in channels and name in last and turn is not None and name in wrapped:
            turns = np.round((last[name][0] - channels[name][0]) / turn)
            channels = {**channels, name: channels[name] + turn * turns}
    return channels


def _recording(part: _Part, reading: Reading) -> Recording | SwingidError:
    """A part as a Recording: the rest of the repairs, the model's units, checked; the error where it cannot be one."""
    channels = stacked([piece for piece in part.kept if piece])
    reading = replace(reading, findings=[*reading.findings, *part.findings], averaged=part.block)
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # absurd numbers are spikes or refused
            for fault in FAULTS_OF_MEANS:
                channels = fault(channels, reading)
            model = reading.conventions.to_model(channels)
            check_motion(model, reading)
        return Recording(
            **model,
            drive_held=reading.held and part.block == 1,
            findings=tuple(dict.fromkeys(reading.findings)),  # spikes that are left are found twice
            source=Source(reading.name, None),
            averaged=part.block,
            metadata={},
            selected=False,
            repairs_off=reading.off,
            done=frozenset(),
        )
    except SwingidError as error:
        return error


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
    few = angle[::stride]
    low, high = quantile(few, 0.01), quantile(few, 0.99)
    extremes = reversals(few, BACK * (high - low))[1:]  # the first may be where the rows begin
    if len(extremes) >= 3:
        lengths = np.sort(np.diff(extremes))
        swing = float(lengths[int(SHORTER * (len(lengths) - 1))]) * stride
    else:  # a slow motion, or none
        swing = angle.size / 3 if extremes.size else 0.0
    rows = int(swing / BLOCKS_PER_SWING)
    return max(1, rows if rows % 2 else rows - 1)


def averaged(
    channels: Channels, rows: int, held: tuple[str, ...], waiting: Channels | None = None
) -> tuple[Channels, Channels]:
    """Means over blocks of `rows` (odd) successive rows, and the last rows, which the next blocks begin with.

    channels: with "time" (s), rising, not necessarily even. held: channels whose values act from their row to the
    next one (a voltage as commanded); their means are over the same time as those of the angles, and so are
    measurements, held no more. waiting: the last rows of the piece before. Blocks across a gap are left out.
    """
    first = waiting if waiting else {name: values[:0] for name, values in channels.items()}
    total = first["time"].size + channels["time"].size
    blocks = total // rows - 1  # the last needs the middle of the next
    if blocks < 1:
        joined = stacked([first, channels])
        return {name: values[:0] for name, values in joined.items()}, joined
    used = blocks * rows
    blocked = {name: _blocks(first[name], values, blocks + 1, rows) for name, values in channels.items()}
    middles = np.concatenate([_means(part) for part in blocked["time"]])
    means = {"time": middles[:-1]}
    for name, values in channels.items():
        if name in held:
            time = np.concatenate((first["time"], channels["time"]))
            means[name] = _held_means(time, np.concatenate((first[name], values)), middles)
        elif name != "time":
            means[name] = np.concatenate([_means(part) for part in blocked[name]])[:-1]
    widths = np.concatenate([part[:, -1] - part[:, 0] for part in blocked["time"]])[:-1]
    whole = widths < WIDE * median(widths)
    if not whole.all():
        means = take(means, whole)
    remaining = total - used
    if remaining <= channels["time"].size:
        return means, {name: values[values.size - remaining :] for name, values in channels.items()}
    return means, {name: np.concatenate((first[name], values))[used:] for name, values in channels.items()}


def _blocks(first: Array, values: Array, blocks: int, rows: int) -> tuple[Array, Array]:
    """The rows of `first` and `values` in blocks (blocks, rows); those that `first` has a part in come apart."""
    begun = min(-(-first.size // rows), blocks)
    cut = begun * rows - first.size
    if cut < 0:  # `first` alone is longer
        return first[: begun * rows].reshape(begun, rows), values[:0].reshape(0, rows)
    head = np.concatenate((first, values[:cut]))
    return head.reshape(begun, rows), values[cut : cut + (blocks - begun) * rows].reshape(blocks - begun, rows)


def _means(blocks: Array) -> Array:
    """Row by row; `mean` takes five times as long for rows of some ten values."""
    result: Array = np.einsum("ij->i", blocks)
    result /= blocks.shape[1]
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
