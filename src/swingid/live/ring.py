"""Records from one process to others through a file in memory: the writer never waits, a slow reader loses the oldest.

The file is a header and a ring of bytes. The writer puts a record (kind, time, length, bytes) behind the last one and
then moves the head; a reader that is behind by more than the ring goes on at the head and counts what it lost.
"""

from __future__ import annotations

import mmap
import os
import struct
import tempfile
import time
from contextlib import suppress
from enum import IntEnum
from pathlib import Path
from typing import NamedTuple

ROOM = 1 << 24
"""Bytes of the ring: some seven minutes at 1 kHz."""

_WORD = struct.Struct("<Q")
_BEAT = struct.Struct("<d")
_RECORD = struct.Struct("<BdI")
HEAD, BEAT, STOP, OVER, START = 0, 8, 16, 17, 64


class Kind(IntEnum):
    """What a record holds."""

    HOST = 0
    DEVICE = 1
    PLAN = 2
    EVENT = 3
    SAY = 4
    DONE = 5
    FAILED = 6


class Record(NamedTuple):
    """One record: its kind, the time of the link (s), its bytes."""

    kind: Kind
    time: float
    data: bytes


class Ring:
    """The file of a ring, made or opened. path: of the file."""

    def __init__(self, path: str | Path | None = None) -> None:
        if path is None:
            memory = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None
            number, name = tempfile.mkstemp(prefix="swingid-ring-", dir=memory)
            os.ftruncate(number, START + ROOM)
        else:
            name = str(path)
            number = os.open(name, os.O_RDWR | getattr(os, "O_BINARY", 0))
        self.path = Path(name)
        try:
            self._map = mmap.mmap(number, START + ROOM)
        finally:
            os.close(number)

    def forget(self) -> None:
        """Remove the file's name, where the system lets that be done while it is in use."""
        with suppress(OSError):
            self.path.unlink()

    def close(self) -> None:
        """Give it up, and its name."""
        with suppress(BufferError, ValueError):
            self._map.close()
        self.forget()

    @property
    def head(self) -> int:
        """Bytes written since the beginning."""
        return int(_WORD.unpack_from(self._map, HEAD)[0])

    def beat(self) -> None:
        """The writer lives."""
        _BEAT.pack_into(self._map, BEAT, time.monotonic())

    def rest(self) -> None:
        """The writer gives no signs of life for a while: it does something that takes its time."""
        _BEAT.pack_into(self._map, BEAT, 0.0)

    @property
    def over(self) -> bool:
        """Whether the view knows that the writer's process has ended."""
        return bool(self._map[OVER])

    @over.setter
    def over(self, known: bool) -> None:
        self._map[OVER] = known

    @property
    def silence(self) -> float:
        """Seconds since the writer's last sign of life; 0 while none are due."""
        then = float(_BEAT.unpack_from(self._map, BEAT)[0])
        return 0.0 if then == 0.0 else time.monotonic() - then

    @property
    def stop(self) -> int:
        """What a view has asked for: 0 nothing, 1 a soft stop, 2 a hard one, 3 a soft one at the wanted uncertainty."""
        return self._map[STOP]

    @stop.setter
    def stop(self, what: int) -> None:
        self._map[STOP] = what

    def write(self, kind: Kind, now: float, data: bytes) -> None:
        """A record for all readers; only one process may write."""
        head = self.head
        whole = _RECORD.pack(kind, now, len(data)) + data
        if len(whole) > ROOM // 2:
            raise ValueError("a record is too large for the ring")
        place = START + head % ROOM
        first = min(len(whole), START + ROOM - place)
        self._map[place : place + first] = whole[:first]
        self._map[START : START + len(whole) - first] = whole[first:]
        _WORD.pack_into(self._map, HEAD, head + len(whole))
        self.beat()


class Reader:
    """Reads a ring from its beginning. lost: bytes that were overwritten before they were read."""

    def __init__(self, ring: Ring) -> None:
        self._ring, self._tail, self.lost = ring, 0, 0

    def read(self) -> list[Record]:
        """All records since the last call."""
        head = self._ring.head
        if head - self._tail > ROOM - ROOM // 8:
            self.lost += head - self._tail
            self._tail = head
            return []
        records = []
        while self._tail < head:
            kind, now, length = _RECORD.unpack(self._bytes(self._tail, _RECORD.size))
            data = self._bytes(self._tail + _RECORD.size, length)
            self._tail += _RECORD.size + length
            records.append(Record(Kind(kind), now, data))
        return records

    def _bytes(self, start: int, length: int) -> bytes:
        place = START + start % ROOM
        first = min(length, START + ROOM - place)
        memory = self._ring._map
        return bytes(memory[place : place + first]) + bytes(memory[START : START + length - first])
