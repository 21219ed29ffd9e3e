"""``swingid reproduce``: the paper's section 5 on the twin, as a page with figures and numbers."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def reproduce(
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder to write to; made if need be.")] = Path("paper"),
    seed: Annotated[int, typer.Option(min=0, help="Of the encoders' grids and of what is drawn.")] = 0,
    quick: Annotated[
        bool, typer.Option("--quick", help="Without the table of imperfections and the paper's claims.")
    ] = False,
) -> None:
    """Run the experiment and the simulations of the paper on the twin, and set its numbers beside these.

    Writes index.html, fig2 to fig8 as .svg and .png, and results.json to DIR; the same seed gives the same files.
    """
    from swingid.cli.kernels import announce_compilation
    from swingid.cli.output import cannot_write, check_target, say, tell, write_file
    from swingid.study.reproduce import reproduce as run

    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise cannot_write(out, error.strerror or str(error)) from None
    names = [f"fig{k}.{ending}" for k in range(2, 9) for ending in ("svg", "png")]
    for name in (*names, "results.json", "index.html"):
        check_target(out / name)
    announce_compilation("simulate")
    reproduction = run(seed=seed, quick=quick, progress=say)
    from swingid.report.paper import drawn_figures, write_paper

    say("drawing figures 2 to 8")
    figures = drawn_figures(reproduction)
    for figure in figures:
        for name, content in figure.files().items():
            write_file(out / name, content)
    write_file(out / "results.json", reproduction.to_json().encode("utf-8"))
    page = write_paper(reproduction.results, figures, out / "index.html")
    tell(f"wrote {page}, figures 2 to 8 and results.json to {out}")
