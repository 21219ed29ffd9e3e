"""A log of what a passive device prints: lines of numbers in columns, into a CSV file that `identify` reads.

A line counts where it has as many numbers as the others; a header, or labels as the Arduino plotter takes them
(``angle:0.1,wheel:3``), name the columns. What was recorded is on the disk within a second.
"""

from __future__ import annotations

import math
import os
import re
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from swingid.errors import DeviceError, InputError, UsageError
from swingid.live.journal import new_file

if TYPE_CHECKING:
    from swingid.live.devices.stream import Stream

FLUSH, SYNC, TURN = 0.25, 1.0, 0.05
"""Seconds between two flushes, two synchronisations with the disk, and of waiting for bytes."""

TRIED, MOST_NOISE, LONGEST = 5, 4096, 4096
"""Lines after which the number of columns is clear; bytes without a row of numbers; bytes of a line."""

_LABEL = re.compile(r"\s*([^\d\s:.+-][^:]*):\s*(.+)")


def fields_of(line: str) -> list[str]:
    """The fields of a line, parted by semicolons (then with decimal commas), commas, tabs or spaces."""
    line = line.strip()
    if ";" in line:
        fields = [field.strip().replace(",", ".") for field in line.split(";")]
    elif "," in line or "\t" in line:
        fields = [field.strip() for field in re.split(r"[,\t]", line)]
    else:
        fields = line.split()
    return fields[:-1] if len(fields) > 1 and not fields[-1] else fields


def _is_number(text: str) -> bool:
    try:
        return "_" not in text and text.isascii() and math.isfinite(float(text))
    except ValueError:
        return False


class Lines:
    """Rows of numbers, as text, out of bytes that come in any pieces.

    cut: whether the first line may lack its begin, so that its numbers may be wrong. A line of names is kept: a board
    prints it as it starts.

    names: of the columns as printed, empty where nothing names them; bad: lines that were no row.
    """

    def __init__(self, *, cut: bool) -> None:
        self.names: list[str] = []
        self.bad = 0
        self._rest, self._first = b"", cut
        self._waiting: list[list[str]] = []
        self._headers: list[list[str]] = []
        self._width: int | None = None

    def feed(self, data: bytes) -> list[list[str]]:
        """The rows that are complete with these bytes."""
        *ended, self._rest = re.split(rb"\r\n|\n|\r(?!\Z)", self._rest + data)
        self._rest = self._rest[-LONGEST:]
        rows: list[list[str]] = []
        for line in ended:
            text, first, self._first = line.decode("utf-8", "replace"), self._first, False
            if first and all(map(_is_number, fields_of(text))):
                continue
            rows += self._line(text)
        return rows

    def finish(self) -> list[list[str]]:
        """The rows that still wait for the number of columns to be clear."""
        return self._settle() if self._width is None else []

    def _line(self, line: str) -> list[list[str]]:
        fields = fields_of(line)
        if not fields or not any(fields):
            return []
        labels = [_LABEL.fullmatch(field) for field in fields]
        if all(labels):
            self._headers.append([match[1].strip() for match in labels if match])
            fields = [match[2].strip() for match in labels if match]
        if not all(map(_is_number, fields)):
            if self._width is None and not any(map(_is_number, fields)):
                self._headers.append(fields)
            else:
                self.bad += 1
            return []
        if self._width is not None:
            good = len(fields) == self._width
            self.bad += not good
            return [fields] if good else []
        self._waiting.append(fields)
        return self._settle() if len(self._waiting) >= TRIED else []

    def _settle(self) -> list[list[str]]:
        """Decide the number of columns by the rows so far; those of them that have it."""
        if not self._waiting:
            return []
        self._width = Counter(map(len, self._waiting)).most_common(1)[0][0]
        rows = [row for row in self._waiting if len(row) == self._width]
        self.bad += len(self._waiting) - len(rows)
        named = [names for names in self._headers if len(names) == self._width]
        self.names = named[-1] if named else []
        self._waiting = []
        return rows


@dataclass(frozen=True)
class Recorded:
    """What was recorded: columns of the log, rows, lines that were no row, how it ended in a sentence."""

    columns: tuple[str, ...]
    rows: int
    bad: int
    end: str
    named: bool


class _Log:
    """The CSV file: header with the first rows, flushed and synchronised now and then."""

    def __init__(self, path: Path, names: Sequence[str], rate: float | None) -> None:
        self._file = new_file(path, "w", encoding="utf-8", newline="\n")
        self.path, self.columns, self.rows = path, tuple(names), 0
        self._rate = rate
        self._flushed = self._synced = time.monotonic()

    def write(self, rows: list[list[str]], printed: list[str]) -> None:
        """Rows, after the header where they are the first; InputError where the disk takes none."""
        try:
            if rows and not self.rows:
                self._head(len(rows[0]), printed)
            for row in rows:
                begin = [f"{self.rows / self._rate:.9g}"] if self._rate is not None else []
                self._file.write(",".join([*begin, *row]) + "\n")
                self.rows += 1
            now = time.monotonic()
            if now - self._flushed >= FLUSH:
                self._file.flush()
                self._flushed = now
            if now - self._synced >= SYNC:
                os.fsync(self._file.fileno())
                self._synced = now
        except OSError as error:
            raise InputError(f"cannot write {self.path}: {error.strerror or error}", code="cannot-write") from None

    def _head(self, width: int, printed: list[str]) -> None:
        names = list(self.columns) or printed or [f"c{k}" for k in range(1, width + 1)]
        if len(names) != width:
            text = f"the device prints {width} columns and {len(names)} names were given ({', '.join(names)}); "
            raise UsageError(text + "give one name per column", code="bad-columns")
        begin = ["t"] if self._rate is not None else []
        self.columns = (*begin, *(re.sub(r'[",\r\n]', " ", name) for name in names))
        if len(set(self.columns)) < len(self.columns):
            text = f"two columns have one name: {', '.join(self.columns)}; give others by --columns"
            raise UsageError(text, code="bad-columns")
        self._file.write(",".join(self.columns) + "\n")

    def close(self) -> None:
        """Write out what is left."""
        self._file.close()


def record(
    stream: Stream,
    out: str | Path,
    *,
    seconds: float | None = None,
    idle: float | None = None,
    names: Sequence[str] = (),
    rate: float | None = None,
    cut: bool = True,
    progress: Callable[[int], None] = lambda _: None,
) -> Recorded:
    """Record the columns that a passive device prints into a CSV file, until it ends.

    It ends after `seconds`, after `idle` seconds without a byte, by KeyboardInterrupt, or where the device goes. names:
    of the columns, where the device prints none. rate: rows per second, for a device that prints no time: a column t.
    Raises DeviceError where nothing that comes is a row of numbers, UsageError for names that do not fit, InputError
    where the file can't be written.
    """
    lines, log, came = Lines(cut=cut), _Log(Path(out), names, rate), 0
    begin = last = time.monotonic()
    end = "stopped"
    try:
        while True:
            now = time.monotonic()
            if seconds is not None and now - begin >= seconds:
                end = f"after {seconds:g} s"
                break
            if idle is not None and now - last >= idle:
                end = f"after {idle:g} s without a byte"
                break
            data = stream.read(TURN)
            came, last = came + len(data), time.monotonic() if data else last
            log.write(lines.feed(data), lines.names)
            progress(log.rows)
            if came > MOST_NOISE and not log.rows and not lines.names:
                break
    except KeyboardInterrupt:
        pass
    except DeviceError as error:
        if not log.rows:
            raise
        end = error.message
    finally:
        log.write(lines.finish(), lines.names)
        log.close()
    if not log.rows:
        text = f"{stream.address}: no line is a row of numbers in columns ({came} bytes came); check baud and sketch"
        raise DeviceError(text, code="no-columns")
    return Recorded(log.columns, log.rows, lines.bad, end, bool(names) or bool(lines.names))
