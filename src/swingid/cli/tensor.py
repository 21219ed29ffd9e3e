"""``swingid tensor``: the inertia tensor of a body from results about several axes."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Annotated

import typer

from swingid.cli import output
from swingid.cli.options import JsonOrRefusal
from swingid.errors import UsageError
from swingid.system import write_whole


def tensor(
    files: Annotated[
        list[str],
        typer.Argument(metavar="AXES.toml | RESULT.json...", help="The file of the axes, or results with --axes."),
    ],
    axes: Annotated[
        str | None,
        typer.Option(metavar="AXES.toml", help="Directions and levers of the axes of the results, in their order."),
    ] = None,
    about: Annotated[
        list[str] | None,
        typer.Option(metavar="'X Y Z [at D]'", help="Predict the inertia about this axis; may be repeated."),
    ] = None,
    compare: Annotated[
        str | None, typer.Option(metavar="FILE", help="A URDF, an MJCF or a mesh to compare with, in the body frame.")
    ] = None,
    link: Annotated[str | None, typer.Option(metavar="NAME", help="Which link or body of that file.")] = None,
    density: Annotated[
        str | None, typer.Option(metavar="RHO", help='Of a mesh, "2700 kg/m^3"; else the weighed mass.')
    ] = None,
    mesh_unit: Annotated[str, typer.Option(metavar="UNIT", help="Length of the mesh's coordinates.")] = "m",
    json: JsonOrRefusal = None,
    plot: Annotated[
        str | None, typer.Option(metavar="FILE", help="Draw elements and axes as .png, .svg or .pdf.")
    ] = None,
) -> None:
    """Determine the inertia tensor about the centre of mass from results about six axes or more."""
    results, listed = (files, axes) if axes is not None else ([], files[0])
    inputs = {listed: "the file of the axes"} | dict.fromkeys(results, "a result")
    output.check_targets({"--json": json, "--plot": plot}, inputs | ({compare: "the CAD file"} if compare else {}))
    with output.refusals_to(json, "tensor", {"axes": listed}):
        output.check_writable(json, plot)
        if axes is None and len(files) > 1:
            raise UsageError("give one file of axes, or results with --axes AXES.toml", code="no-axes")
        if plot is not None and Path(plot).suffix.lower() not in (".png", ".svg", ".pdf"):
            raise UsageError(f"--plot {plot} must end in .png, .svg or .pdf", code="bad-target")
        if compare is None and (link or density or mesh_unit != "m"):
            raise UsageError("--link, --density and --mesh-unit belong to --compare FILE", code="contradiction")
        from swingid.body.cad import load_cad
        from swingid.body.tables import load_axes
        from swingid.body.tensor import tensor as solve

        stated = load_axes(listed, len(results))
        cad = None
        if compare is not None:
            cad = load_cad(compare, link=link, mass=stated.body.mass, density=density, mesh_unit=mesh_unit)
        answer = solve(stated, results, compare_with=cad, about=[_axis(text) for text in about or ()])
        if plot is not None:
            drawn = io.BytesIO()
            answer.plot().savefig(drawn, dpi=150, format=Path(plot).suffix[1:].lower() or "png")
            write_whole(Path(plot), drawn.getvalue())
    output.hand_over(answer, json, plot)


def _axis(text: str) -> tuple[list[float], str]:
    """Direction and distance of "0 0 1 at 12 mm"."""
    words, _, distance = text.partition(" at ")
    try:
        direction = [float(word) for word in words.replace(",", " ").split()]
    except ValueError:
        direction = []
    if len(direction) != 3:
        raise UsageError(f'--about {text[:60]!r} must be three numbers, such as "1 1 0 at 12 mm"', code="bad-direction")
    return direction, distance.strip() or "0 m"
