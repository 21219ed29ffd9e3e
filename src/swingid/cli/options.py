"""Options that several commands share."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer


class Method(StrEnum):
    """How the inertia is found."""

    MOMENTUM = "momentum"
    ENERGY = "energy"
    OUTPUT_ERROR = "output-error"
    EQUATION_ERROR = "equation-error"
    BACKSTEPPING = "backstepping"


RigFile = Annotated[str, typer.Option(metavar="RIG", help="Path ending in .toml, or a built-in name such as paper.")]
Logs = Annotated[
    list[str], typer.Argument(metavar="LOG...", help="Logs of one body on the rig, in any format that swingid reads.")
]
Methods = Annotated[list[Method] | None, typer.Option(help="Only this method; may be repeated. Default: all of them.")]
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
Report = Annotated[str | None, typer.Option(metavar="FILE", help="Write a report as one HTML file.")]
