"""Text tables in pieces: some lines at a time. UTF-8 only (a degree sign from an old logger apart)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from swingid.errors import InputError
from swingid.recording.formats import labview
from swingid.recording.formats.arrow import parse_metadata
from swingid.recording.formats.csv import as_text, column_names, layout_of, read_rows, split_comments
from swingid.recording.formats.dialect import Layout
from swingid.recording.formats.table import Table

HEAD = 1 << 20
"""Bytes from which the layout is found."""


@dataclass(frozen=True)
class File:
    """A text file: its path, about how many rows it has, its layout, and lines before the first row."""

    path: str
    rows: int
    layout: Layout
    metadata: str
    lines_above: int
    bytes_per_row: float

    @classmethod
    def open(cls, path: str) -> File | None:
        """Look at the first lines; None where they are no text table that can be read in pieces."""
        try:
            with Path(path).open("rb") as stream:
                head = stream.read(HEAD)
            size = Path(path).stat().st_size
            whole = head[: head.rindex(b"\n") + 1]
            if whole.startswith((b"\xff\xfe", b"\xfe\xff", labview.MAGIC)):
                return None
            text = as_text(whole, path)
            metadata, body = split_comments(text)
            layout = layout_of(body, path)
        except (OSError, ValueError, InputError):
            return None
        rows = body[layout.rows :]
        if not rows.strip():
            return None
        per_row = len(rows) / max(rows.count(b"\n"), 1)
        above = text.count(b"\n") - rows.count(b"\n")
        return cls(path, int(size / per_row), layout, metadata, above, per_row)

    def header(self) -> Table:
        """The columns, each with a row of zeros in the place of its own."""
        names = [name.strip() for name in column_names(self.layout)]
        units = {name: unit for name, unit in zip(names, self.layout.units, strict=False) if unit}
        return Table({name: np.zeros(1) for name in names}, parse_metadata(self.metadata), 0, units)

    def pieces(self, rows: int, columns: list[str]) -> Iterator[Table]:
        """The table in pieces of about `rows` rows; InputError where the file cannot be read or is no table."""
        try:
            with Path(self.path).open("rb") as stream:
                for _ in range(self.lines_above):
                    stream.readline()
                rest = b""
                while block := stream.read(int(rows * self.bytes_per_row) + 1):
                    block = rest + block
                    end = block.rfind(b"\n") + 1
                    rest = block[end:]
                    if block[:end].strip():
                        yield self._table(block[:end], columns)
                if rest.strip():
                    yield self._table(rest, columns)
        except OSError as error:
            raise InputError(f"{self.path} cannot be read: {error.strerror}.", code="unreadable-file") from None

    def _table(self, lines: bytes, columns: list[str]) -> Table:
        try:
            lines.decode("utf-8")
        except UnicodeDecodeError:
            lines = lines.decode("latin-1").encode()
        table = read_rows(lines, self.layout, self.path)
        return Table({name: table.columns[name] for name in columns}, {}, table.unreadable_rows, table.units)
