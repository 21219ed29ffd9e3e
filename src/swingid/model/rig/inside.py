"""The rig file inside the journal of a live run."""

from __future__ import annotations

from pathlib import Path

from swingid.errors import InputError

ENDING = ".mcap"
NAME = "rig.toml"
"""Name of the attachment."""


def has_rig(path: str | Path) -> bool:
    """Return whether a file is a journal with a rig file inside; False also where it can't be read."""
    if Path(path).suffix.lower() != ENDING:
        return False
    try:
        return _text(path) is not None
    except InputError:
        return False


def rig_inside(path: str | Path) -> str:
    """The text of the rig file inside a journal; InputError where there is none, or the file can't be read."""
    text = _text(path)
    if text is None:
        message = f"{path} has no rig file inside, so it is no journal of swingid run; give --rig RIG.toml"
        raise InputError(message, code="no-rig-inside")
    return text


def _text(path: str | Path) -> str | None:
    """The first attachment of that name; records are read from the beginning, so the end of the file may be missing."""
    try:
        from mcap.records import Attachment, Chunk
        from mcap.stream_reader import StreamReader
    except ImportError:
        raise InputError(
            f"{path} is read with the package mcap; run: pip install mcap", code="missing-package"
        ) from None
    try:
        with Path(path).open("rb") as stream:
            for record in StreamReader(stream, emit_chunks=True).records:
                if isinstance(record, Attachment) and record.name == NAME:
                    return str(record.data.decode())
                if isinstance(record, Chunk):
                    return None  # a journal has it before its first message
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror or error}", code="cannot-read") from None
    except Exception:  # the other package may fail anywhere in a damaged file
        return None
    return None
