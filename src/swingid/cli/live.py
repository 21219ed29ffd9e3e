"""``swingid recover``: whole journals of broken ones."""

from __future__ import annotations

from typing import Annotated

import typer

from swingid.cli import output


def recover(
    file: Annotated[str, typer.Argument(metavar="FILE.mcap", help="Journal that was cut off or is damaged.")],
    out: Annotated[
        str | None, typer.Option(metavar="FILE", help="File to write; default: FILE.recovered.mcap beside it.")
    ] = None,
) -> None:
    """Write a whole journal of what a broken one holds: every block whose checksum is right.

    A journal that is cut off can be identified as it is; other programs (Foxglove) want a whole file.
    """
    if out is not None:
        output.check_targets({"--out": out}, {file: "the broken file"})
        output.check_writable(out)
    from swingid.live.recover import recover as run

    found, path = run(file, out)
    counts = ", ".join(f"{count} of {topic}" for topic, count in found.messages.items())
    if path is None:
        output.tell(f"{file} is whole ({counts}); nothing to recover")
        return
    lost = f"; {found.damaged} damaged blocks left out" if found.damaged else ""
    output.tell(f"wrote {path}: {counts}{lost}")
