"""The messages of a chunk of MCAP, many at once: found by the chunk's index, which is checked, else record by record.

Layout: https://mcap.dev/spec. A record is its opcode, its length in 8 bytes and its content, numbers little end first.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from swingid.numerics.arrays import Bools, Ints

    Bytes = NDArray[np.uint8]

MESSAGE, INDEX = 5, 7
"""Opcodes of a message and of the index of a channel's messages in the chunk before."""

RECORD = 9
"""Bytes of a record before its content."""

HEAD = 22
"""Bytes before the data of a message: channel 2, sequence 4, log time 8, publish time 8."""


def indexed(stream: BinaryIO, places: Mapping[int, int]) -> Ints:
    """Return where the messages of a chunk begin, rising, by its index; none where that is damaged.

    places: in the file, of the index of each channel.
    """
    offsets = [np.empty(0, np.int64)]
    for place in places.values():
        stream.seek(place)
        head = stream.read(RECORD + 6)
        if len(head) < RECORD + 6 or head[0] != INDEX:
            return offsets[0]
        (size,) = struct.unpack_from("<I", head, RECORD + 2)
        content = stream.read(size)
        if len(content) < size or size % 16:
            return offsets[0]
        offsets.append(np.frombuffer(content, "<i8").reshape(-1, 2)[:, 1])
    return np.sort(np.concatenate(offsets))


def split(data: Bytes, wanted: Bools, begins: Ints) -> tuple[bytes, Ints, Ints]:
    """Data of the wanted messages, a newline before each; their times in the log (ns), and where each ends.

    data: records of a chunk, not compressed. wanted: by the number of a channel. begins: see `indexed`; where these are
    not all messages the records are read one by one. Raises ValueError where a record exceeds the chunk.
    """
    lengths = _lengths(data, begins)
    if lengths is None:
        begins = np.array([at for at, opcode, _ in _records(data, 0, data.size) if opcode == MESSAGE], np.int64)
        lengths = _lengths(data, begins)
        if lengths is None:
            raise ValueError("a message is shorter than its head")
    if not begins.size:
        return b"", begins, begins
    heads = data[begins[:, None] + np.arange(RECORD + HEAD)]
    of_channel = wanted[heads[:, RECORD : RECORD + 2].copy().view("<u2")[:, 0]]
    heads, begins, lengths = heads[of_channel], begins[of_channel], lengths[of_channel]
    stamps = heads[:, RECORD + 6 : RECORD + 14].copy().view("<i8")[:, 0].astype(np.int64)
    sizes = lengths - HEAD + 1  # with the byte before the data, in whose place the newline comes
    edges = np.zeros(data.size + 1, np.int8)
    edges[begins + RECORD + HEAD - 1] = 1
    edges[begins + RECORD + lengths] -= 1
    lines, ends = data[np.cumsum(edges[:-1], dtype=np.int8).view(np.bool_)], np.cumsum(sizes)
    lines[ends - sizes] = ord("\n")
    return lines.tobytes(), stamps, ends


def _lengths(data: Bytes, begins: Ints) -> Ints | None:
    """Lengths of the messages that begin there; None where these are no messages, or not all."""
    if begins.size and not (begins[0] >= 0 and begins[-1] <= data.size - RECORD - HEAD):
        return None
    lengths: Ints = data[begins[:, None] + np.arange(1, RECORD)].view("<i8").reshape(begins.size).astype(np.int64)
    ends = np.minimum(lengths, data.size) + begins + RECORD
    after, before = np.append(begins, data.size), np.append(0, ends)
    if not ((data[begins] == MESSAGE).all() and (lengths >= HEAD).all() and (after >= before).all()):
        return None
    for k in np.flatnonzero(after > before):
        if any(opcode == MESSAGE for _, opcode, _ in _records(data, int(before[k]), int(after[k]))):
            return None
    return lengths


def _records(data: Bytes, begin: int, end: int) -> Iterator[tuple[int, int, int]]:
    """Place, opcode and length of each record between two places; ValueError where one goes beyond the end."""
    at, content = begin, data.data
    while at + RECORD <= end:
        opcode, length = content[at], int(struct.unpack_from("<Q", content, at + 1)[0])
        if length > end - at - RECORD:
            raise ValueError("a record is longer than its chunk")
        yield at, opcode, length
        at += RECORD + length
