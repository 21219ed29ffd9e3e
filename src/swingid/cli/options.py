"""Options that several commands share."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from swingid.errors import InputError
from swingid.methods.table import METHODS


def method_name(text: str) -> str:
    """The name of a method; typer's error for any other."""
    if text not in METHODS:
        raise typer.BadParameter(f"{text!r} is not one of {', '.join(map(repr, METHODS))}")
    return text


def rig_of(rig: str | None, logs: Sequence[str]) -> str:
    """The rig file: as it was given, else that inside the first of the logs that is the journal of a live run.

    Raises typer's error where there is neither, InputError for a journal that is not there.
    """
    if rig is not None:
        return rig
    from swingid.model.rig.inside import ENDING, has_rig

    journal = next((log for log in logs if has_rig(log)), None)
    if journal is None:
        for log in logs:
            if log.lower().endswith(ENDING) and not Path(log).exists():
                raise InputError(f"{log} does not exist; give the path of a log", code="missing-file")
        raise typer.BadParameter("give a rig file; only the journal of a live run has one inside", param_hint="'--rig'")
    return journal


NAMES = "|".join(METHODS)

RigFile = Annotated[str, typer.Option(metavar="RIG", help="Path ending in .toml, or a built-in name such as paper.")]
LogRigFile = Annotated[
    str | None,
    typer.Option(metavar="RIG", help="Path ending in .toml, or a built-in name; default: the file inside a journal."),
]
Logs = Annotated[
    list[str], typer.Argument(metavar="LOG...", help="Logs of one body on the rig, in any format that swingid reads.")
]
Method = Annotated[str, typer.Option(parser=method_name, metavar=f"[{NAMES}]", help="How the inertia is found.")]
Methods = Annotated[
    list[str] | None,
    typer.Option(
        parser=method_name, metavar=f"[{NAMES}]", help="Only this method; may be repeated. Default: all of them."
    ),
]
Parts = Annotated[
    list[str] | None,
    typer.Option("--part", metavar="FROM:TO", help="Use all of this part of each LOG, s, such as 0:4.5; repeatable."),
]
Motion = Annotated[
    str | None,
    typer.Option(metavar="MOTION", help='Motion to follow, such as "sine 0.8 rad 8.5 rad/s"; none: no command.'),
]
Rate = Annotated[float, typer.Option(help="Rows and controller steps per second.")]
Angle = Annotated[str, typer.Option(metavar="ANGLE", help='Angle at the start, rad (m), or with a unit: "30 deg".')]
Json = Annotated[str | None, typer.Option(metavar="FILE", help='Write JSON; "-": standard output.')]
JsonOrRefusal = Annotated[
    str | None, typer.Option(metavar="FILE", help='Write the result as JSON, also a refusal; "-": standard output.')
]
Report = Annotated[
    str | None, typer.Option(metavar="FILE", help="Write a report: one HTML file, or a PDF if the name ends in .pdf.")
]
Verbose = Annotated[
    bool, typer.Option("--verbose", "-v", help="Print all: whole budget, friction laws, notes, correlations.")
]
Certificate = Annotated[
    str | None,
    typer.Option(metavar="LAB.toml", help="Laboratory, customer and item for the report; see docs/report.md."),
]
