"""``swingid export`` and ``schema``: results for other programs, and the schemas of our files."""

from __future__ import annotations

from typing import Annotated, Literal

import typer

from swingid.cli import output

Format = Literal["mjcf", "urdf", "python-control", "simulink-m"]
"""Formats of `swingid.exchange.export`."""


def export(
    result: Annotated[str, typer.Argument(metavar="RESULT.json", help="Result of identify --json.")],
    to: Annotated[Format, typer.Option(help="Format of the file.")],
    out: Annotated[str, typer.Option(metavar="FILE", help="File to write: .xml, .urdf, .py or .m.")],
    rig: Annotated[
        str | None, typer.Option(metavar="RIG", help="The rig of the result, if its file is not where it was.")
    ] = None,
) -> None:
    """Write the identified rig as a model for MuJoCo, URDF, python-control or MATLAB."""
    inputs = {result: "the result"} | ({rig: "the rig file"} if rig else {})
    output.check_files(inputs, out=out)
    from swingid.exchange.export import export as run
    from swingid.exchange.model import rig_of
    from swingid.result.file import load_result

    identified = load_result(result)
    output.tell(run(identified, rig_of(identified, rig), to, out).summary())


def schema(name: Annotated[Literal["result", "rig", "plan"], typer.Argument(help="Of which file.")]) -> None:
    """Print the JSON schema of a result, a rig file or a plan, for editors and other programs."""
    from swingid.exchange.schemas import schema as find
    from swingid.study.output import json_text

    output.write_json(json_text(find(name)), "-")
