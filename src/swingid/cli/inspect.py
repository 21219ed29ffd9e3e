"""``swingid inspect``: what a log holds, what it is worth, whether it fits the rig."""

from __future__ import annotations

from typing import Annotated

import typer


def inspect(
    log: Annotated[str, typer.Argument(metavar="LOG", help="A log in any format that swingid reads.")],
    rig: Annotated[
        str | None,
        typer.Option(metavar="RIG", help="Path ending in .toml, or a built-in name; without it the file alone."),
    ] = None,
    json: Annotated[str | None, typer.Option(metavar="FILE", help='Write JSON; "-": standard output.')] = None,
    report: Annotated[str | None, typer.Option(metavar="FILE", help="Write one page as one HTML file.")] = None,
) -> None:
    """Say what LOG holds: columns, clock, encoders, motion, and with a rig signs, latencies and encoder errors.

    A verdict says whether it is ready for identify. Exit code 0 whenever the file could be read, whatever the verdict.
    """
    from swingid.cli.output import check_targets, check_writable, say, tell, write_json

    inputs = {log: "the log"} | ({rig: "the rig file"} if rig is not None else {})
    check_targets({"--json": json, "--report": report}, inputs)
    check_writable(json, report)
    from swingid.cli.kernels import announce_compilation
    from swingid.model.rig import Rig
    from swingid.study.inspect import inspect_log

    plant = None if rig is None else Rig.load(rig)
    announce_compilation("identify")
    found = inspect_log(log, plant)
    if report is not None:
        from swingid.report.pages import write_inspection

        write_inspection(found, report)
    if json is not None:
        write_json(found.to_json(), json)
    tell(found.summary(), to_error=json == "-")
    if report is not None:
        say(f"wrote {report}")
