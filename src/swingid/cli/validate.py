"""``swingid validate``: an identified model on logs that it was not fitted to."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer


class Input(StrEnum):
    """What drives the prediction of a reaction wheel."""

    WHEEL = "wheel"
    VOLTAGE = "voltage"


def validate(
    result: Annotated[str, typer.Argument(metavar="RESULT.json", help="Result of identify --json.")],
    logs: Annotated[list[str], typer.Argument(metavar="LOG...", help="Logs to predict, best ones not fitted.")],
    rig: Annotated[str, typer.Option(metavar="RIG", help="Path ending in .toml, or a built-in name such as paper.")],
    input: Annotated[
        Input | None,
        typer.Option(help="The measured wheel (default, needs no motor) or the voltage drives the prediction."),
    ] = None,
    json: Annotated[str | None, typer.Option(metavar="FILE", help='Write JSON; "-": standard output.')] = None,
    report: Annotated[str | None, typer.Option(metavar="FILE", help="Write figures as one HTML file.")] = None,
) -> None:
    """Predict LOGs by the model in RESULT: in a free run and one swing ahead, with the normalised fit in per cent."""
    from swingid.cli.output import check_once, check_targets, check_writable, say, tell, write_json

    inputs = {rig: "the rig file", result: "the result"} | dict.fromkeys(logs, "a log")
    check_targets({"--json": json, "--report": report}, inputs)
    check_writable(json, report)
    check_once(logs)
    from swingid.cli.kernels import announce_compilation
    from swingid.model.rig import Rig
    from swingid.recording.recording import Recording
    from swingid.result.file import load_result
    from swingid.study.validate import validate as run

    plant, found = Rig.load(rig), load_result(result)
    recordings = [Recording.load(log, plant) for log in logs]
    announce_compilation("identify")
    validation = run(found, recordings, plant, input=None if input is None else input.value)
    if report is not None:
        from swingid.report.pages import write_validation

        write_validation(validation, plant, report)
    if json is not None:
        write_json(validation.to_json(), json)
    tell(validation.summary(), to_error=json == "-")
    if report is not None:
        say(f"wrote {report}")
