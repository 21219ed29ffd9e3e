"""``swingid firmware``: the image of a board, to be flashed."""

from __future__ import annotations

import zlib
from pathlib import Path
from typing import Annotated

import typer

from swingid.cli import output
from swingid.system import write_whole


def firmware(
    board: Annotated[str, typer.Argument(metavar="BOARD", help="nucleo: the reference board, Nucleo-F446RE.")],
    out: Annotated[
        str,
        typer.Option(metavar="FILE.bin", help="File on this computer; copy it onto the board's drive."),
    ],
) -> None:
    """Write the firmware of a board, which the package ships; no compiler is needed."""
    from swingid.live.firmware import image

    output.check_writable(out)
    content = image(board)
    write_whole(Path(out), content)
    output.tell(f"wrote {out}: {len(content)} bytes, which state firmware {zlib.crc32(content):08x}")
    output.tell("copy it onto the drive that the board is on USB (NODE_F446RE), and wait until its LED stands still")
