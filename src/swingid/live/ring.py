"""Records from one process to others through memory: the writer never waits, a slow reader loses the oldest.

The memory is a header and a ring of bytes. The writer puts a record (kind, time, length, bytes) behind the last one and
then moves the head; a reader that is behind by more than the ring goes on at the head and counts what it lost. Only how
a run ended (DONE, FAILED) reaches every reader: where that record begins stands in the header. On POSIX the memory is a
file without a name, whose descriptor the processes inherit, so nothing is left however they die; on Windows the last
one removes the file, else the next run. All of it is reserved when it is made.
"""

from __future__ import annotations

import errno
import mmap
import os
import pickle
import struct
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from enum import IntEnum
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from swingid.errors import InputError
from swingid.live.codes import StopMode

ROOM = 1 << 24
"""Bytes of the ring: some seven minutes at 1 kHz."""

FOLDER = "SWINGID_MEMORY"
"""Variable of the environment that names the folder of the ring."""

PREFIX = "swingid-ring-"

_WORD = struct.Struct("<Q")
_BEAT = struct.Struct("<d")
_PID = struct.Struct("<I")
_RECORD = struct.Struct("<BdI")
HEAD, BEAT, STOP, OVER, PID, WHY, LAST, START = 0, 8, 16, 17, 20, 24, 256, 264


class Role(IntEnum):
    """A process of a run."""

    VIEW = 0
    LINK = 1
    RECORDER = 2


class Kind(IntEnum):
    """What a record holds."""

    HOST = 0
    DEVICE = 1
    PLAN = 2
    EVENT = 3
    SAY = 4
    DONE = 5
    FAILED = 6
    JOB = 7
    SHOWN = 8


class Record(NamedTuple):
    """One record: its kind, the time of the link (s), its bytes."""

    kind: Kind
    time: float
    data: bytes


class Ring:
    """A ring, made or, by the handle of one, opened. handle: for another process, which inherits `descriptors`.

    Raises InputError where there is no room for it.
    """

    def __init__(self, handle: str | None = None) -> None:
        self._path: Path | None = None
        if handle is None:
            self._file = self._made()
        elif handle.isdecimal():
            self._file = os.dup(int(handle))
        else:
            self._path = Path(handle)
            self._file = os.open(handle, os.O_RDWR | getattr(os, "O_BINARY", 0))
        self._map = mmap.mmap(self._file, START + ROOM)

    def _made(self) -> int:
        """A new file with its room reserved; without a name where the system lets that be."""
        folder = memory()
        try:
            _sweep(folder)
            number, name = tempfile.mkstemp(prefix=PREFIX, dir=folder)
            self._path = Path(name)
            if os.name == "posix":
                self._path.unlink()
                self._path = None
            try:
                _reserve(number, START + ROOM)
            except OSError:
                os.close(number)
                if self._path is not None:
                    self._path.unlink()
                raise
        except OSError as error:
            raise _no_room(folder, error) from None
        return number

    @property
    def handle(self) -> str:
        """What another process opens the ring by."""
        return str(self._file if self._path is None else self._path)

    @property
    def descriptors(self) -> tuple[int, ...]:
        """What another process must inherit."""
        return (self._file,) if self._path is None else ()

    def close(self) -> None:
        """Give it up; a second call does nothing."""
        if self._file < 0:
            return
        with suppress(BufferError, ValueError):
            self._map.close()
        os.close(self._file)
        self._file = -1
        if self._path is not None:
            with suppress(OSError):  # others have it open: the last one removes it
                self._path.unlink()

    def hold(self, role: Role) -> None:
        """Let the others know, by a lock that ends with this process, that it lives."""
        if role is Role.LINK:
            _PID.pack_into(self._map, PID, os.getpid())
        with suppress(OSError):
            _lock(self._file, START + ROOM + role, hold=True)

    def held(self, role: Role) -> bool:
        """Return whether another process lives that has this role."""
        try:
            _lock(self._file, START + ROOM + role, hold=False)
        except OSError:
            return True
        return False

    @property
    def pid(self) -> int:
        """Number of the process of the link, 0 before it has begun."""
        return int(_PID.unpack_from(self._map, PID)[0])

    @property
    def head(self) -> int:
        """Bytes written since the beginning."""
        return int(_WORD.unpack_from(self._map, HEAD)[0])

    @property
    def last(self) -> int:
        """The place of the record that says how the run ended, in bytes since the beginning; 0 before that."""
        return int(_WORD.unpack_from(self._map, LAST)[0])

    def beat(self) -> None:
        """The writer lives."""
        _BEAT.pack_into(self._map, BEAT, time.monotonic())

    def rest(self) -> None:
        """The writer gives no signs of life for a while: it does something that takes its time."""
        _BEAT.pack_into(self._map, BEAT, 0.0)

    @property
    def over(self) -> bool:
        """Return whether the view knows that the writer's process has ended."""
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
        """What a view has asked for: 0 nothing, 1 a soft stop, 2 a hard one."""
        return self._map[STOP]

    def ask(self, mode: StopMode, why: str) -> None:
        """Ask for a stop; a hard one replaces a soft one. For the view alone."""
        wanted = 2 if mode is StopMode.HARD else 1
        if wanted <= self.stop:
            return
        words = why.encode()[: LAST - WHY - 1].decode(errors="ignore").encode()
        self._map[WHY : WHY + 1 + len(words)] = bytes([len(words)]) + words
        self._map[STOP] = wanted

    @property
    def asked(self) -> tuple[StopMode, str] | None:
        """The stop that a view has asked for, and why."""
        wanted = self.stop
        if not wanted:
            return None
        words = bytes(self._map[WHY + 1 : WHY + 1 + self._map[WHY]]).decode(errors="replace")
        return (StopMode.HARD if wanted == 2 else StopMode.SOFT), words

    def write(self, kind: Kind, now: float, data: bytes) -> None:
        """A record for all readers; only one process may write: who made the ring, until the link begins."""
        head = self.head
        whole = _RECORD.pack(kind, now, len(data)) + data
        if len(whole) > ROOM // 2:
            raise ValueError("a record is too large for the ring")
        place = START + head % ROOM
        first = min(len(whole), START + ROOM - place)
        self._map[place : place + first] = whole[:first]
        self._map[START : START + len(whole) - first] = whole[first:]
        if kind in (Kind.DONE, Kind.FAILED):
            _WORD.pack_into(self._map, LAST, head)
        _WORD.pack_into(self._map, HEAD, head + len(whole))
        self.beat()


class Reader:
    """Reads a ring from its beginning. lost: bytes that were overwritten before they were read."""

    def __init__(self, ring: Ring) -> None:
        self._ring, self._tail, self.lost = ring, 0, 0

    def read(self) -> list[Record]:
        """All records since the last call."""
        head = self._ring.head
        if self._behind():
            head = self._skip()
        records = []
        while self._tail < head:
            kind, now, length = _RECORD.unpack(self._bytes(self._tail, _RECORD.size))
            data = self._bytes(self._tail + _RECORD.size, min(length, ROOM))
            if self._behind():  # written over while it was read
                head = self._skip()
                continue
            self._tail += _RECORD.size + length
            records.append(Record(Kind(kind), now, data))
        return records

    def _behind(self) -> bool:
        """Return whether the writer may be at what is read next."""
        return self._ring.head - self._tail > ROOM - ROOM // 8

    def _skip(self) -> int:
        """Go on at the record that says how the run ended, else at the head, which is returned."""
        head, last = self._ring.head, self._ring.last
        to = last if last > self._tail else head
        self.lost += to - self._tail
        self._tail = to
        return head

    def _bytes(self, start: int, length: int) -> bytes:
        place = START + start % ROOM
        first = min(length, START + ROOM - place)
        memory = self._ring._map
        return bytes(memory[place : place + first]) + bytes(memory[START : START + length - first])


def started(ring: Ring, module: str, *words: str, stderr: int | None = None) -> subprocess.Popen[bytes]:
    """A process ``python -m MODULE WORDS HANDLE`` that opens the ring; the terminal's Ctrl-C does not reach it."""
    return subprocess.Popen(
        [sys.executable, "-m", module, *words, ring.handle],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,  # not that of the command, which a pipe's reader may wait for
        stderr=stderr,
        start_new_session=os.name != "nt",
        creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
        pass_fds=ring.descriptors,
    )


def job_in(ring: Ring) -> Any:
    """What the first record of a ring, a JOB, asks a process to do."""
    return pickle.loads(next(record.data for record in Reader(ring).read() if record.kind is Kind.JOB))


def memory() -> str:
    """The folder of rings: that of $SWINGID_MEMORY, else one in memory, else the temporary one."""
    stated = os.environ.get(FOLDER)
    return stated or ("/dev/shm" if os.access("/dev/shm", os.W_OK) else tempfile.gettempdir())


def _reserve(number: int, size: int) -> None:
    """Give a file its room now, so that no write into its memory fails later; OSError where there is none."""
    if hasattr(os, "posix_fallocate"):
        try:
            os.posix_fallocate(number, 0, size)
            return
        except OSError as error:
            if error.errno not in (errno.EOPNOTSUPP, errno.EINVAL):
                raise
    for _ in range(0, size, 1 << 16):
        if os.write(number, bytes(1 << 16)) < 1 << 16:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    os.lseek(number, 0, os.SEEK_SET)


def _sweep(folder: str) -> None:
    """Remove what killed processes have left on Windows, which refuses that for files in use."""
    if os.name != "nt":
        return
    for path in Path(folder).glob(f"{PREFIX}*"):
        with suppress(OSError):
            path.unlink()


def _no_room(folder: str, error: OSError) -> InputError:
    """The error of a folder that does not take a ring."""
    text = f"a run needs {(START + ROOM) / 1e6:.0f} MB in {folder}, which can't be had ({error.strerror or error}); "
    remedies = {errno.EFBIG: "raise the limit of a file's size (ulimit -f), or ", errno.ENOSPC: "make room there, or "}
    text += remedies.get(error.errno or 0, "")
    return InputError(f"{text}name another folder by ${FOLDER}", code="no-room")


def _lock(number: int, place: int, *, hold: bool) -> None:
    """Lock a byte of a file, to hold it or to see whether that is possible; OSError where another process has it."""
    try:
        fcntl = import_module("fcntl")
    except ImportError:
        msvcrt = import_module("msvcrt")
        os.lseek(number, place, os.SEEK_SET)
        msvcrt.locking(number, msvcrt.LK_NBLCK, 1)
        if not hold:
            os.lseek(number, place, os.SEEK_SET)
            msvcrt.locking(number, msvcrt.LK_UNLCK, 1)
        return
    fcntl.lockf(number, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, place)
    if not hold:
        fcntl.lockf(number, fcntl.LOCK_UN, 1, place)
