"""Running a campaign: what is not there yet is done, what is there stays, and at the end it is sorted."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from swingid.errors import UsageError
from swingid.study.campaign.plan import Plan
from swingid.study.campaign.store import Store, is_finished
from swingid.study.campaign.workers import blocks_done

Progress = Callable[[int, int, int], None]


def run_campaign(
    plan: Plan,
    folder: str | Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Progress | None = None,
) -> Path:
    """Do all trials of `plan` that are not in `folder` yet; returns the Parquet file of all results, sorted.

    The same plan gives the same bytes for any number of workers, and killed and started again, on processors of one
    kind. workers: processes, one per core by default; scheduler: address of a Dask scheduler, "tcp://host:8786".
    progress(trials done, trials, of which were there already) is called at the start and after each block.

    Raises InputError where the folder holds another plan's results or cannot be written, UsageError for fewer than one
    worker or a missing package.
    """
    if workers is not None and workers < 1:
        raise UsageError(f"--workers is {workers}; give a positive number of processes", code="bad-workers")
    store = Store(plan, Path(folder))
    with store.alone():
        there = store.done()
        done = already = sum(len(plan.block(block)) for block in there)
        if progress is not None:
            progress(done, plan.trials, already)
        missing = [block for block in range(plan.blocks) if block not in there]
        if missing or not is_finished(store.folder):
            store.check_code()
            for block, rows in blocks_done(plan, missing, workers, scheduler):
                store.write(block, rows)
                done += len(plan.block(block))
                if progress is not None:
                    progress(done, plan.trials, already)
            store.finish()
    return store.folder / "results.parquet"
