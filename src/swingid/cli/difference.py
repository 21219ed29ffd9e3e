"""``swingid difference``: the inertia of an added body, and a known body as a second scale."""

from __future__ import annotations

from typing import Annotated

import typer


def difference(
    tare: Annotated[str, typer.Argument(metavar="TARE.json", help="Result of identify without the body.")],
    loaded: Annotated[str, typer.Argument(metavar="LOADED.json", help="Result of identify with the body.")],
    mass: Annotated[
        str | None, typer.Option(metavar="'M ± U'", help='Mass of the body, "68.0 ± 0.1 g": with --distance.')
    ] = None,
    distance: Annotated[
        str | None,
        typer.Option(metavar="'D ± U'", help="Its centre from the axis: gives the inertia about its own centre."),
    ] = None,
    known: Annotated[
        str | None,
        typer.Option(metavar="'J ± U'", help='Its inertia, "961 ± 1 kg*mm^2": calibrates the scale of both runs.'),
    ] = None,
    json: Annotated[
        str | None, typer.Option(metavar="FILE", help='Write the result as JSON, also a refusal; "-": standard output.')
    ] = None,
) -> None:
    """Tell the inertia of a body from two results, with and without it."""
    from swingid.cli.output import check_targets, check_writable, tell, write_json

    check_targets({"--json": json}, {tare: "the tare result", loaded: "the loaded result"})
    try:
        check_writable(json)
        from swingid.pooling import difference as subtract

        result = subtract(tare, loaded, mass=mass, distance=distance, known=known)
    except Exception as error:
        if json is not None:
            from swingid.cli.identify import write_refusal

            write_refusal(json, "difference", error, {"tare": tare, "loaded": loaded})
        raise
    if json is not None:
        write_json(result.to_json(), json)
    tell(result.summary(), to_error=json == "-")
