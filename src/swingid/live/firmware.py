"""Images of the firmware that the package ships, and which of them a device states in Hello.

An image states the CRC-32 of its own bytes, which the journal of a run records.
"""

from __future__ import annotations

import zlib
from functools import cache

from swingid.errors import UsageError
from swingid.live.native import sources

IMAGES = ("nucleo",)
"""Boards with an image; see `firmware/README.md`."""


def image(board: str) -> bytes:
    """The image of a board, as it is written to its flash; UsageError where there is none."""
    if board not in IMAGES:
        raise UsageError(f"there is no image for {board!r}; boards: {', '.join(IMAGES)}", code="no-image")
    folder = sources()
    if folder is None:
        raise UsageError("the firmware's files are not installed; install swingid again", code="no-image")
    return (folder / "images" / f"{board}.bin").read_bytes()


@cache
def _known() -> dict[int, str]:
    return {zlib.crc32(image(board)): board for board in IMAGES} if sources() is not None else {}


def named(firmware: int) -> str:
    """The hash of a firmware in words: with its board where it is an image of this version."""
    board = _known().get(firmware)
    return f"{firmware:08x}" + (f" (the image {board} of this version)" if board else "")
