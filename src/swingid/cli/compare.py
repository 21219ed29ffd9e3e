"""``swingid compare``: all methods on the same logs."""

from __future__ import annotations

from typing import Annotated

import typer

from swingid.cli.identify import Method


def compare(
    logs: Annotated[list[str], typer.Argument(metavar="LOG...", help="Logs of the rig: .csv, .parquet or .mat.")],
    rig: Annotated[str, typer.Option(metavar="RIG", help="Path ending in .toml, or a built-in name such as paper.")],
    method: Annotated[
        list[Method] | None, typer.Option(help="Only this method; may be repeated. Default: all of them.")
    ] = None,
    json: Annotated[
        str | None, typer.Option(metavar="FILE", help='Write the results as JSON; "-": standard output.')
    ] = None,
    report: Annotated[str | None, typer.Option(metavar="FILE", help="Write the comparison as one HTML file.")] = None,
) -> None:
    """Put every method on the same LOGs: inertia, friction, time, what each rests on, and whether they agree."""
    from swingid.cli.output import check_once, check_targets, check_writable, say, tell, write_json

    check_targets({"--json": json, "--report": report}, {rig: "the rig file"} | dict.fromkeys(logs, "a log"))
    check_writable(json, report)
    check_once(logs)
    from swingid.cli.kernels import announce_compilation
    from swingid.model.rig import Rig
    from swingid.recording.recording import Recording
    from swingid.study.compare import compare as run

    plant = Rig.load(rig)
    recordings = [Recording.load(log, plant) for log in logs]
    announce_compilation("identify")
    comparison = run(recordings, plant, [m.value for m in method] if method else None)
    if report is not None:
        from swingid.report.pages import write_comparison

        write_comparison(comparison, plant, report)
    if json is not None:
        write_json(comparison.to_json(), json)
    tell(comparison.summary(), to_error=json == "-")
    if report is not None:
        say(f"wrote {report}")
