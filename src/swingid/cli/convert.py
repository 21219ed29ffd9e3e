"""``swingid convert``: a log from one file format to another."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def convert(
    source: Annotated[str, typer.Argument(metavar="IN", help="Log: any format that swingid reads.")],
    target: Annotated[
        str, typer.Argument(metavar="OUT", help="File to write: .parquet, .csv, .mat, .h5, .mcap or .jsonl.")
    ],
) -> None:
    """Write the table in IN to OUT in the format of its ending; numbers bit for bit, nothing resampled or repaired."""
    from swingid.cli.output import check_target, check_targets, tell
    from swingid.recording.convert import convert as run

    check_targets({"OUT": target}, {source: "IN"})
    check_target(Path(target))
    rows, columns, dropped = run(source, target)
    line = f"wrote {target}: {rows} rows of {', '.join(columns)}"
    tell(line + (f"; left out, no numbers: {', '.join(dropped)}" if dropped else ""))
