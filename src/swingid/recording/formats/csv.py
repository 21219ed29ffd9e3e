"""Text tables of any dialect: tab, semicolon, comma, bar or blanks between the cells, decimal comma, quoted cells.

swingid's own files open with one comment line, ``# swingid: {json}``. Other comments and titles above the header are
left out, a line of units below it is kept; columns without a header are called column1, column2 and so on. Large files
are read some lines at a time (`File`), these in UTF-8 only (a degree sign from an old logger apart).
"""

from __future__ import annotations

import csv as quoting
import io
import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from swingid.errors import InputError
from swingid.recording.formats.arrow import parse_metadata, table_from_arrow
from swingid.recording.formats.dialect import Layout, find_layout, is_number, split_cells
from swingid.recording.formats.table import METADATA_KEY, PartFile, Table, header_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from swingid.numerics.arrays import Array


ENDINGS = (".csv", ".txt", ".tsv", ".dat")
MAGIC = b""

#: First bytes of files that people hand over by mistake.
_OTHER_KINDS = {
    b"\x89PNG": "a PNG image",
    b"\xff\xd8\xff": "a JPEG image",
    b"GIF8": "a GIF image",
    b"%PDF": "a PDF",
    b"PK\x03\x04": "a zip archive",
    b"\xd0\xcf\x11\xe0": "an old Excel or Word file",
    b"\x1f\x8b": "a gzip archive",
    b"TDSm": "a LabVIEW TDMS file",
    b"MDF ": "an MDF measurement file",
    b"#ROSBAG": "a bag of ROS 1",
    b"SQLite format 3": "an SQLite data base (a bag of ROS 2)",
    b"\x93NUMPY": "an array of NumPy",
    b"ARROW1": "an Arrow (Feather) file",
    b"<": "HTML or XML",
}
_COMMENTS = (b"#", b"%", b"//")
TABLE_NEEDS = "a log needs a header line with column names and rows of numbers"
LABVIEW = b"LabVIEW Measurement"
"""First bytes of a text that `labview` reads."""


def read(content: bytes, name: str) -> Table:
    """The table in the bytes of a text file called `name`.

    The layout is found in the first lines; rows with too few or too many cells are left out and counted. Raises
    InputError, naming the file, for other kinds of file, no rows, or lines without columns.
    """
    content = as_text(content, name)
    raw_metadata, body = split_comments(content)
    layout = layout_of(body, name)
    return read_rows(body[layout.rows :], layout, name, raw_metadata)


def layout_of(body: bytes, name: str) -> Layout:
    """How the text below the comments is laid out; InputError where it is no table."""
    layout = find_layout(body)
    if layout is None:
        raise InputError(f"{name} is empty; {TABLE_NEEDS}.", code="empty-file")
    if layout.header_width != layout.width:
        message = f"{name} is not a table: its header names {layout.header_width} columns, but its rows have"
        raise InputError(f"{message} {layout.width} cells.", code="not-a-table")
    return layout


def column_names(layout: Layout) -> list[str]:
    """Names of the columns: those of the header, or column1, column2 and so on."""
    return [name.strip() for name in layout.names] or [f"column{k}" for k in range(1, layout.width + 1)]


def read_rows(
    rows: bytes, layout: Layout, name: str, raw_metadata: str = "{}", columns: list[str] | None = None
) -> Table:
    """The table in lines of this layout, without a header, all columns or some; InputError where they are none.

    By one thread: those of Arrow hold the Python source a little longer than the call, and a process that ends
    meanwhile, as after a refusal, is aborted (1 in 20 on a busy computer).
    """
    import pyarrow as pa
    import pyarrow.csv as pc

    if not rows.strip():
        raise InputError(f"{name} has a header but no rows of numbers; log a motion.", code="empty-file")
    rows, names = _parted(rows, layout), column_names(layout)
    some = columns if len(set(names)) == len(names) else None  # else two columns have one name, which is refused below
    lost: list[int | None] = []

    def leave_out(row: Any) -> Literal["skip"]:
        lost.append(row.number)
        return "skip"

    try:
        table = pc.read_csv(
            pa.BufferReader(rows),
            read_options=pc.ReadOptions(
                column_names=names,
                block_size=min(max(len(rows) + 1, 1 << 16), 1 << 30),  # types from all rows
                use_threads=False,
            ),
            parse_options=pc.ParseOptions(delimiter=layout.delimiter.decode(), invalid_row_handler=leave_out),
            convert_options=pc.ConvertOptions(
                decimal_point=layout.decimal, strings_can_be_null=True, include_columns=some
            ),
        )
    except pa.ArrowException:
        message = f"{name} is not a table: its lines do not split into the columns that its header names."
        raise InputError(message, code="not-a-table") from None
    _require_closed_quotes(rows, table.num_rows + len(lost), name)
    return table_from_arrow(table, name, raw_metadata, len(lost), () if some else layout.units, layout.decimal)


MOST_IN_A_CELL = 10
"""Lines that a quoted cell may hold, as a remark does."""


def _require_closed_quotes(rows: bytes, read: int, name: str) -> None:
    """Raise InputError where a quote that is never closed has made one cell of many of the rows."""
    if rows.count(b'"') % 2 == 0 or rows.count(b"\n") - read <= MOST_IN_A_CELL:
        return
    begin = rows.rfind(b"\n", 0, rows.rfind(b'"')) + 1
    shown = rows[begin:].split(b"\n", 1)[0][:40].decode("utf-8", "replace").strip()
    message = f'{name}: a quote (") is opened and not closed, perhaps in the row {shown} …'
    raise InputError(f"{message}, so the rows below it would be lost; remove it.", code="open-quote")


def _parted(rows: bytes, layout: Layout) -> bytes:
    """The lines with one blank between the cells, where blanks part them."""
    if layout.delimiter != b" ":
        return rows
    return re.sub(rb"[ \t]+", b" ", re.sub(rb"(?m)^[ \t]+|[ \t\r]+$", b"", rows))


def write(columns: Mapping[str, Array], metadata: Mapping[str, object]) -> bytes:
    """The bytes of a CSV file: metadata comment (JSON), header, rows; columns of equal length (n,) by name.

    Numbers read back bit for bit.
    """
    import pyarrow as pa
    import pyarrow.csv as pc

    header = io.StringIO()
    quoting.writer(header, lineterminator="\n").writerow(columns)
    sink = pa.BufferOutputStream()
    sink.write(f"# {METADATA_KEY}: {json.dumps(metadata)}\n{header.getvalue()}".encode())
    pc.write_csv(pa.table(dict(columns)), sink, pc.WriteOptions(include_header=False))
    return bytes(sink.getvalue())


def without_lines(content: bytes, skip_rows: int, comment: str | None, name: str) -> bytes:
    """A text without its first lines, and without those that begin with a mark; InputError where it is no text.

    Files of other formats, and those that swingid wrote, are as they are.
    """
    wide = content.startswith((b"\xff\xfe", b"\xfe\xff"))
    written = content.startswith((f"# {METADATA_KEY}:".encode(), b"PK\x03\x04")) or (
        b"\0" in content[:1024] and not wide
    )
    if written or (not skip_rows and not comment):
        return content
    lines = as_text(content, name).splitlines(keepends=True)[skip_rows:]
    mark = comment.encode() if comment else None
    return b"".join(line for line in lines if mark is None or not line.lstrip().startswith(mark))


def as_text(content: bytes, name: str) -> bytes:
    """The content as UTF-8 without a byte order mark, with plain signs; InputError when it is no text."""
    start = content[:64].lstrip()
    for magic, kind in _OTHER_KINDS.items():
        if start.startswith(magic):
            instead = "convert it to MCAP" if "bag" in kind else "export the log as CSV or Parquet"
            raise InputError(f"{name} is not a table but {kind}; {instead}.", code="not-a-table")
    try:
        if content.startswith((b"\xff\xfe", b"\xfe\xff")):
            return _plain_minus(content.decode("utf-16").encode())
        if content.startswith(b"\xef\xbb\xbf"):
            content = content[3:]
        if b"\0" in content:
            raise ValueError
        content.decode("utf-8")
    except ValueError:
        letters = np.frombuffer(content, np.uint8)
        plain = (letters >= 32) & (letters < 127) | np.isin(letters, (9, 10, 13))
        if plain.mean() > 0.95 and 0 not in letters:
            return content.decode("latin-1").encode()  # such as a degree sign in a header, from an old logger
        message = f"{name} is not a table but binary data; export the log as CSV or Parquet."
        raise InputError(message, code="not-a-table") from None
    return _plain_minus(content)


def _plain_minus(text: bytes) -> bytes:
    """UTF-8 with a hyphen where a number has the minus sign of typesetting, as spreadsheets of some countries write."""
    return text if text.isascii() else re.sub("\u2212(?=[0-9.,])".encode(), b"-", text)


def _header_in(line: bytes, rest: bytes) -> bytes | None:
    """The header that a comment is of the rows below it, as they are parted; None where it is none.

    As numpy.savetxt and MATLAB users write it. Names may be parted by wider gaps than the rows: "Time (s)   angle".
    """
    below = find_layout(rest)
    if below is None or below.names or below.header_width != below.width:
        return None
    names = line.strip()
    cells = split_cells(names, below.delimiter)
    if len(cells) != below.width:
        wide = re.split(r"\t+| {2,}", names.decode("utf-8", "replace"))
        names = below.delimiter.join(re.sub(r"\s+", "_", cell).encode() for cell in wide)
        cells = split_cells(names, below.delimiter)
    fits = len(cells) == below.width and not any(is_number(cell, below.decimal) for cell in cells)
    return names + b"\n" if fits else None


def split_comments(content: bytes) -> tuple[str, bytes]:
    """The metadata of swingid from the comment lines on top, and what follows them."""
    metadata, mark = "{}", f"# {METADATA_KEY}:".encode()
    while (content := content.lstrip(b"\r\n")).startswith(_COMMENTS):
        line, _, rest = content.partition(b"\n")
        if line.startswith(mark):
            metadata = line[len(mark) :].decode("utf-8", "replace")
        elif line.startswith((b"#", b"%")) and _WORD.search(line):
            rows = rest
            while rows.startswith(_COMMENTS) and not _WORD.search(rows.partition(b"\n")[0]):  # such as a rule of dashes
                rows = rows.partition(b"\n")[2]
            header = None if rows.startswith(_COMMENTS) else _header_in(line[1:], rows)
            if header is not None:
                return metadata, header + rows
        content = rest
    return metadata, content


_WORD = re.compile(rb"[^\W_]")


HEAD = 1 << 20
"""Bytes from which the layout is found."""


@dataclass(frozen=True)
class File(PartFile):
    """A text file: its layout, and lines before the first row."""

    layout: Layout
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
            if whole.startswith((b"\xff\xfe", b"\xfe\xff", LABVIEW)):
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
        names = column_names(layout)
        units = {name: unit for name, unit in zip(names, layout.units, strict=False) if unit}
        header = header_of(names, parse_metadata(metadata), units)
        return cls(path, int(size / per_row), header, layout, above, per_row)

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
                    lines, rest = block[:end], block[end:]
                    if lines and not lines.isspace():
                        yield read_rows(_utf8(lines), self.layout, self.path, columns=columns)
                if rest.strip():
                    yield read_rows(_utf8(rest), self.layout, self.path, columns=columns)
        except OSError as error:
            raise InputError(f"{self.path} cannot be read: {error.strerror}.", code="unreadable-file") from None


def _utf8(lines: bytes) -> bytes:
    """Lines of UTF-8, or of Latin-1, as UTF-8."""
    if lines.isascii():
        return lines
    try:
        lines.decode("utf-8")
    except UnicodeDecodeError:
        return lines.decode("latin-1").encode()
    return _plain_minus(lines)
