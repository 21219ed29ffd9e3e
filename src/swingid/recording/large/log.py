"""`LargeLog`: a log in a file that is read in parts, in constant memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import takewhile
from pathlib import Path
from typing import TYPE_CHECKING

from swingid.errors import InputError, SwingidError, UnanswerableError
from swingid.recording.conventions import Conventions, Reading, gather
from swingid.recording.findings import Source
from swingid.recording.formats import csv, hdf5, mcap, mcap_parts, parquet
from swingid.recording.formats.table import PartFile, Table, stacked
from swingid.recording.large.parts import parts, within
from swingid.recording.live import ARRIVAL, is_live, with_own_time, zero_at_rest
from swingid.recording.load import reading_of
from swingid.recording.recording import Recording
from swingid.system import sha256_of

if TYPE_CHECKING:
    from swingid.model.rig import Rig

LARGE = 1_000_000
"""Rows beyond which a log is read in parts."""

PIECE = 250_000
"""Rows that are read at once."""

FIRST = 1000
"""Rows read to see whether the clock counts from an epoch."""

UNUSED = ("reference", "adaptive_gain")
"""Channels that only pictures show."""


def is_large(path: str | Path) -> bool:
    """Return whether a file is a log of more than `LARGE` rows that can be read in parts (Parquet, text, MCAP,
    HDF5).
    """
    file = _file(path)
    return file is not None and file.rows > LARGE


def _file(path: str | Path) -> PartFile | None:
    """The file, where it is one that can be read in pieces and is large enough to look into it."""
    where = Path(path)
    try:
        if not where.is_file() or where.stat().st_size < LARGE:
            return None
        with where.open("rb") as stream:
            start = stream.read(1024)
    except (OSError, ValueError):
        return None
    kinds: dict[bytes, type[PartFile]] = {
        parquet.MAGIC: parquet.File,
        mcap.MAGIC: mcap_parts.File,
        hdf5.MAGIC: hdf5.File,  # also behind the header of MATLAB v7.3
    }
    known = [kind for magic, kind in kinds.items() if start.startswith(magic) or start[512:].startswith(magic)]
    return (known or [csv.File])[0].open(str(path))


def first_rows(path: str | Path, rows: int = LARGE // 2) -> Table:
    """The first rows of a log for which `is_large`, all columns; raises InputError as `LargeLog.parts`."""
    file = opened(path)
    header, names = file.header(), file.together()
    tables: list[Table] = []
    for table in file.pieces(min(rows, PIECE), names):
        tables.append(table)
        if sum(len(next(iter(piece.columns.values()))) for piece in tables) >= rows:
            break
    if not tables:
        raise InputError(f"{path} has no rows of numbers; log a motion.", code="empty-file")
    columns = {name: values[:rows] for name, values in stacked([piece.columns for piece in tables]).items()}
    return Table(columns, header.metadata, sum(piece.unreadable_rows for piece in tables), header.units)


def opened(path: str | Path) -> PartFile:
    """The file of a log for which `is_large`; InputError where it cannot be read in parts."""
    file = _file(path)
    if file is None:
        raise InputError(f"{path} cannot be read in parts; read it whole.", code="not-in-parts")
    return file


@dataclass(frozen=True)
class LargeLog:
    """A log of a rig that is too large to be read whole.

    Parameters
    ----------
    repairs
        Switches as of `Recording.load`.
    span : (start, stop), s
        The part of the log to use, None for all.
    progress : function of two numbers
        Called after each part with the rows read so far and the rows of the log (`rows`, of text about so many).
    workers : int
        Processes that identify parts, up to 4. None: one per core where they need no main module (Linux, up to Python
        3.13), else 1; more need ``if __name__ == "__main__":`` around a program's work. The result is the same.
    digest : function
        Gives the SHA-256 of the file where it is being computed already.
    """

    path: str
    rig: Rig
    repairs: Mapping[str, bool] = field(default_factory=dict)
    span: tuple[float, float] | None = None
    progress: Callable[[int, int], None] | None = None
    workers: int | None = None
    digest: Callable[[], str] | None = None

    @cached_property
    def _open(self) -> PartFile:
        for key in ("point", "skip_rows", "comment"):
            if getattr(self.rig.log, key):
                text = f"{self.path} has more than {LARGE} rows and is read in parts, which [log] {key} does not allow"
                raise InputError(f"{text}; give --part FROM:TO of a shorter log.", code="not-in-parts")
        return opened(self.path)

    @property
    def rows(self) -> int:
        """Rows of the file, about so many of a text file."""
        return self._open.rows

    def parts(self, stopped: Callable[[], bool] = lambda: False) -> Iterator[tuple[int, Recording | SwingidError]]:
        """The parts of the log in their order, or why one cannot be used; with the rows of the file read so far.

        No more is read once `stopped` gives true.

        Rows are averaged as far as the motion allows, see `parts`; each recording states how many (`averaged`). Raises
        InputError where the file cannot be read.
        """
        header, reading = self._read_header()
        if self.rig.log.angle_speed is not None:
            message = (
                f"{self.path} has too many rows to be read whole, and log.angle_speed is a rate, whose integral must"
            )
            raise InputError(f"{message} not be cut; use a part of it, --part FROM:TO.", code="rate-in-parts")
        columns = _columns(header, reading.conventions)
        wanted = [column for channel, column in columns.items() if channel not in UNUSED]
        yield from parts(takewhile(lambda _: not stopped(), self._open.pieces(PIECE, wanted)), reading)

    def small(self) -> Recording | None:
        """The part `span` as an ordinary recording, of which nothing is averaged; None where it is large, too.

        Raises as `Recording.load` and `Recording.segment`.
        """
        if self.span is None:
            return None
        header, reading = self._read_header()
        before, rows, tables = 0, 0, []
        for table in self._open.pieces(PIECE, list(_columns(header, reading.conventions).values())):
            inside = within(table, reading, before)
            before += inside.size
            rows += int(inside.sum())
            if rows > LARGE:
                return None
            if inside.any():
                tables.append({name: values[inside] for name, values in table.columns.items()})
        if not tables:
            text = f"{self.path} has no rows between {self.span[0]:g} s and {self.span[1]:g} s; choose another part."
            raise UnanswerableError(text, code="empty-segment")
        table = Table(stacked(tables), header.metadata, 0, header.units)
        source = Source(self.path, self.sha256())
        log = Recording.from_table(table, self.rig, source, repairs=self.repairs)
        return (
            log if reading.conventions.scales["time"].offset else log.segment(*self.span)
        )  # else from the part's first row

    def _read_header(self) -> tuple[Table, Reading]:
        """The header, and how the log is to be read, with times from the first row of the file."""
        header = self._open.header()
        stamps = header.find(self.rig.log.time) if self.rig.log.rate is None else None
        first = None if stamps is None else next(self._open.pieces(FIRST, [stamps]), None)
        reading = replace(reading_of(header, first, self.rig, self.path, self.repairs), span=self.span)
        if is_live(header):
            reading = self._as_live(header, reading)
        gather(header, reading)  # raises for a column that is missing
        return header, reading

    def _as_live(self, header: Table, reading: Reading) -> Reading:
        """How the journal of a live run is to be read: its zero, and its times by the computer's clock."""
        zero_at_rest(header, reading)
        time = reading.conventions.columns["time"]
        if not {time, ARRIVAL} <= header.columns.keys():
            return reading
        whole = stacked([piece.columns for piece in self._open.pieces(PIECE, [time, ARRIVAL])])
        return with_own_time(Table(whole, header.metadata), time, reading)

    def sha256(self) -> str:
        """SHA-256 of the file; InputError where it cannot be read."""
        return sha256_of(self.path) if self.digest is None else self.digest()


def _columns(header: Table, conventions: Conventions) -> dict[str, str]:
    """The column of each channel that the file has."""
    wanted = (*(("time",) if conventions.rate is None else ()), *conventions.channels)
    names = {channel: header.find(conventions.columns[channel]) for channel in wanted}
    return {channel: column for channel, column in names.items() if column is not None}
