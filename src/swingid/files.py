"""Files that appear whole or not at all."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from swingid.errors import InputError


def write_whole(target: Path, content: bytes) -> None:
    """Write a file that appears whole or not at all (a device or a pipe as it is, a link where it leads).

    Raises InputError that names the file and the reason, BrokenPipeError where a pipe's reader went away.
    """
    partial = None
    try:
        place = Path(os.path.realpath(target))
        if place.exists() and not place.is_file():
            place.write_bytes(content)
            return
        partial = place.with_name(f".{place.name[:200]}.{os.getpid()}.part")
        partial.write_bytes(content)
        partial.replace(place)
    except BrokenPipeError:
        raise
    except OSError as error:
        if partial is not None:
            with suppress(OSError):
                partial.unlink(missing_ok=True)
        raise InputError(f"cannot write {target}: {error.strerror or error}.", code="cannot-write") from None
