"""One file per format: each reads bytes into a Table of named columns, some write one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from swingid.errors import InputError
from swingid.recording.formats import archive, csv, hdf5, json_rows, labview, matlab, mcap, parquet, workbook
from swingid.recording.formats.sheets import units_of_gyroscope

if TYPE_CHECKING:
    from types import ModuleType

    from swingid.recording.formats.table import Table

READERS: tuple[ModuleType, ...] = (parquet, matlab, hdf5, mcap, labview, workbook, archive, json_rows, csv)

ZIP = b"PK\x03\x04"
"""First bytes of archives, among them the newer workbooks."""
WRITERS: tuple[ModuleType, ...] = (parquet, csv, matlab, hdf5, mcap, json_rows)


def read_table(content: bytes, name: str) -> Table:
    """The table in a file's bytes: by its first bytes, else by the ending of `name`, else as CSV.

    Raises InputError, as the format's own `read`, where the bytes are no such table.
    """
    by_magic = [f for f in READERS if f.MAGIC and content.startswith(f.MAGIC)]
    by_ending = [f for f in READERS if Path(name).suffix.lower() in f.ENDINGS]
    by_text = [json_rows] if content[:64].lstrip(b"\xef\xbb\xbf \t\r\n").startswith((b"{", b"[{")) else []
    zipped = [_of_zip(content)] if content.startswith(ZIP) else []
    reader = (zipped + by_magic + by_text + by_ending + [csv])[0]
    table: Table = reader.read(content, name)
    return replace(table, units=units_of_gyroscope(Path(name).stem, table)) if reader is csv else table


def _of_zip(content: bytes) -> ModuleType:
    """The reader of an archive: of workbooks where it is one, whose parts it names."""
    parts = (b"xl/workbook", b"mimetypeapplication/vnd.oasis.opendocument.spreadsheet")
    return workbook if any(part in content for part in parts) else archive


def writer_for(path: Path) -> ModuleType:
    """The format module that writes files with this ending; InputError for any other."""
    for module in WRITERS:
        if path.suffix.lower() in module.ENDINGS:
            return module
    *first, last = (module.ENDINGS[0] for module in WRITERS)
    endings = f"{', '.join(first)} or {last}"
    raise InputError(f"cannot write {path}: a recording is written as {endings}.", code="unknown-ending")
