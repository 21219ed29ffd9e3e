"""``swingid record``: a log of a device that only prints columns."""

from __future__ import annotations

from typing import Annotated

import typer

from swingid.cli import output
from swingid.errors import UsageError


def record(
    device: Annotated[
        str, typer.Option(metavar="DEV", help="csv:///dev/ttyACM0?baud=115200, or csv://FILE that a program writes.")
    ],
    out: Annotated[str, typer.Option(metavar="FILE.csv", help="Log to write.")],
    duration: Annotated[float | None, typer.Option(metavar="S", min=0.001, help="End after this time.")] = None,
    idle: Annotated[
        float | None, typer.Option(metavar="S", min=0.001, help="End after so long without a byte.")
    ] = None,
    columns: Annotated[
        str | None, typer.Option(metavar="NAMES", help='Names of the columns, as "t,q1,q2,u", where none are printed.')
    ] = None,
    rate: Annotated[
        float | None, typer.Option(metavar="HZ", min=1e-3, help="Lines per second, where no time is printed.")
    ] = None,
) -> None:
    """Record the columns that a device prints, until Ctrl-C; nothing is sent to it."""
    from swingid.live.devices.columns import open_columns
    from swingid.live.record import record as run

    if not out.lower().endswith(".csv"):
        raise UsageError(f"--out {out} must end in .csv", code="bad-target")
    if not device.lower().startswith("csv://"):
        text = f"--device {device} does not only print; record takes csv://PORT or csv://FILE, swingid run the others"
        raise UsageError(text, code="bad-address")
    names = [name.strip() for name in columns.split(",")] if columns else []
    if not all(names):
        raise UsageError(f"--columns {columns!r}: a name is empty", code="bad-columns")
    stream = open_columns(device)
    output.check_files({stream.path: "what is recorded"} if stream.path else {}, out=out)
    try:
        recorded = run(stream, out, seconds=duration, idle=idle, names=names, rate=rate, cut=stream.path is None)
    finally:
        stream.close()
    bad = f", {recorded.bad} lines were no row" if recorded.bad else ""
    output.tell(f"wrote {out}: {recorded.rows} rows of {', '.join(recorded.columns)}{bad}; ended: {recorded.end}")
    if not recorded.named:
        output.say("nothing names the columns: give --columns, or name them in [log] of rig.toml")
