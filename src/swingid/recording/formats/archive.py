"""Zip archives of text tables, as phyphox and Sensor Logger export one for each sensor."""

from __future__ import annotations

import io
import zipfile
import zlib
from pathlib import PurePosixPath
from typing import TYPE_CHECKING

from swingid.errors import InputError
from swingid.recording.formats import csv
from swingid.recording.formats.sheets import joined
from swingid.recording.formats.table import most_unpacked

if TYPE_CHECKING:
    from swingid.recording.formats.table import Table

ENDINGS = (".zip",)
MAGIC = b""

MOST_FILES = 200
"""More are no export of a phone."""


def read(content: bytes, name: str) -> Table:
    """The tables of an archive, see `sheets.joined`; folders such as phyphox's ``meta`` are left out.

    Raises InputError for a damaged archive, one that unpacks to more than it can hold, and one without tables.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = [member for member in archive.infolist() if _is_table(member)]
            if len(members) > MOST_FILES or sum(member.file_size for member in members) > most_unpacked(len(content)):
                message = f"{name} unpacks to {len(members)} tables or more bytes than an export has; give one log."
                raise InputError(message, code="not-a-table")
            texts = {PurePosixPath(member.filename).stem: archive.read(member) for member in members}
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, ValueError, OSError):
        message = f"{name} is not a whole zip archive or Excel workbook, or is encrypted; export it again."
        raise InputError(message, code="not-a-table") from None
    if not texts:
        message = f"{name} is a zip archive without a .csv or .txt file at its top"
        raise InputError(f"{message}; give the log, or an export of a phone's sensors.", code="not-a-table")
    tables = {}
    for title, text in texts.items():
        try:
            tables[title] = csv.read(text, f"{name}: {title}")
        except InputError:
            if len(texts) == 1:
                raise
    return joined(tables, name, "file")


def _is_table(member: zipfile.ZipInfo) -> bool:
    path = PurePosixPath(member.filename)
    inner = path.parts[-2] if len(path.parts) > 1 else ""
    return path.suffix.lower() in csv.ENDINGS and inner not in ("meta", "__MACOSX") and not path.name.startswith(".")
