"""``swingid campaign``: many runs of the twin with something varied, and what the methods make of them."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swingid.cli.compile import compile_first
from swingid.cli.failure import keeps
from swingid.cli.options import Json
from swingid.cli.output import check_writable, overwrite, tell, time_left, write_json
from swingid.cli.progress import bar
from swingid.errors import UsageError

if TYPE_CHECKING:
    from swingid.study.campaign.plan import Plan

LINES = 20
"""Lines of progress where standard error is no terminal."""


def campaign(
    plan: Annotated[
        str | None, typer.Argument(metavar="PLAN", help="Path ending in .toml, or the name of a ready plan.")
    ] = None,
    out: Annotated[
        str | None, typer.Option(metavar="DIR", help="Folder of the results; default: campaign-NAME.")
    ] = None,
    workers: Annotated[int | None, typer.Option(help="Processes on this machine; default: one per core.")] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Of a Dask scheduler, such as tcp://host:8786.")
    ] = None,
    runs: Annotated[int | None, typer.Option(help="At most so many runs, spread over the points.")] = None,
    json: Json = None,
    listed: Annotated[bool, typer.Option("--list", help="Name the ready plans and what they take, and end.")] = False,
) -> None:
    """Run a campaign: an experiment on the twin many times, something varied, every log identified by some methods.

    Killed and started again it goes on where it was. DIR gets results.parquet, summary.json and report.html.
    """
    check_writable(json)
    if listed:
        from swingid.study.campaign.loading import described
        from swingid.table import aligned

        tell("\n".join(aligned([(name, takes, about) for name, about, takes in described()])))
        return
    if plan is None:
        raise UsageError(
            "give a plan, a .toml file or the name of a ready one ('swingid campaign --list')", code="no-plan"
        )
    if workers is not None and scheduler is not None:
        raise UsageError(
            "--workers is for this machine, --scheduler for a cluster; give one of them", code="two-workers"
        )
    from swingid.report.html import write_campaign
    from swingid.study.campaign import load_plan, run_campaign, summarise
    from swingid.study.campaign.run import kernels_of

    chosen = load_plan(plan).with_runs(runs)
    folder = Path(out or f"campaign-{chosen.name}")
    if scheduler is None and not (folder / "results.parquet").is_file():
        compile_first(*kernels_of(chosen))
    with keeps(lambda: _kept(chosen, folder)):
        run_campaign(chosen, folder, workers=workers, scheduler=scheduler, progress=_progress())
    summary = summarise(chosen, folder)
    text = summary.to_json()
    write_json(text, str(folder / "summary.json"))
    write_campaign(summary, folder / "report.html")
    if json is not None:
        write_json(text, json)
    tell(summary.text() + f"\nwrote {folder}: results.parquet, summary.json, report.html", to_error=json == "-")


def _kept(plan: Plan, folder: Path) -> str:
    """What a campaign that is interrupted keeps, and how it goes on."""
    from swingid.study.campaign.store import Store

    done = sum(len(plan.block(block)) for block in Store(plan, folder).done())
    return f"{done} of {plan.trials} runs are kept in {folder}; the same command goes on from there"


def _progress() -> Callable[[int, int, int], None]:
    """Runs done and time left on standard error: a line that overwrites itself, or some lines in a file."""
    start = time.monotonic()
    shown = -1

    def show(done: int, trials: int, already: int) -> None:
        nonlocal shown
        line = progress_line(done, trials, already, time.monotonic() - start)
        if not overwrite(f"{bar(done, trials)} {line}", last=done == trials) and LINES * done // trials > shown:
            shown = LINES * done // trials
            tell(f"swingid: {line}", to_error=True)

    return show


def progress_line(done: int, trials: int, already: int, seconds: float) -> str:
    """How far it is, and the time left as the runs of this process took it."""
    line = f"{done} of {trials} runs"
    if done == trials:
        return f"{line}, {time_left(seconds)}"
    if done == already:
        return f"{line} were there already" if already else line
    return f"{line}, {time_left(seconds * (trials - done) / (done - already))} left"
