"""The messages of a chunk of MCAP, taken apart by a kernel: a loop in Python takes longer than parsing their JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from swingid.numerics.compiled import njit_nogil

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from swingid.numerics.arrays import Bools, Ints

MESSAGE, HEAD = 5, 22
"""The opcode of a message, and the bytes before its data: channel 2, sequence 4, log time 8, publish time 8
(https://mcap.dev/spec)."""


@njit_nogil
def _number(data: NDArray[np.uint8], at: int, size: int) -> int:
    """The unsigned integer, little end first, at a place."""
    value = 0
    for k in range(size - 1, -1, -1):
        value = (value << 8) | int(data[at + k])
    return value


@njit_nogil
def split(data: NDArray[np.uint8], wanted: Bools, lines: NDArray[np.uint8], stamps: Ints, ends: Ints) -> int:
    """Data of the wanted messages, a newline after each; returns how many, -1 where a record exceeds the chunk.

    data: records of a chunk, not compressed. wanted: by the number of a channel. lines: takes the data, bytes as many
    as in `data`. stamps, ends: take the log times (ns), and where each line ends.
    """
    at, count, used = 0, 0, 0
    while at + 9 <= data.size:
        length = _number(data, at + 1, 8)
        if length < 0 or length > data.size - at - 9:
            return -1
        if data[at] == MESSAGE and length >= HEAD and wanted[_number(data, at + 9, 2)]:
            stamps[count] = _number(data, at + 15, 8)
            for k in range(at + 9 + HEAD, at + 9 + length):
                lines[used] = data[k]
                used += 1
            lines[used] = 10
            used += 1
            ends[count] = used
            count += 1
        at += 9 + length
    return count
