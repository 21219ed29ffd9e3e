"""Running a campaign: the blocks that are missing are done by this process, by several, or by a Dask cluster.

Blocks are pure, so a lost worker costs time only: what it had not handed over is done again by another. Their bytes do
not depend on which process compiled a kernel, since no kernel calls another by its name (`numerics.helper`).
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing, suppress
from functools import cache
from pathlib import Path
from typing import Any

from swingid.errors import InputError, UsageError
from swingid.numerics.ahead import compile_ahead, tasks
from swingid.numerics.cache import CACHE
from swingid.processes import cores, interruption_waits, worker_pool
from swingid.study.campaign.plan import Plan
from swingid.study.campaign.store import Store, is_finished, made_by
from swingid.study.campaign.trial import batch_rows, run_trial
from swingid.study.trials import Row
from swingid.system import locked

Progress = Callable[[int, int, int], None]

Done = tuple[int, list[Row]]

MOST_LOST = 3
"""Times that processes may be lost before it is given up."""


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
            with closing(blocks_done(plan, missing, workers, scheduler)) as blocks:
                for block, rows in blocks:
                    store.write(block, rows)
                    done += len(plan.block(block))
                    if progress is not None:
                        progress(done, plan.trials, already)
            store.finish()
    return store.folder / "results.parquet"


def blocks_done(plan: Plan, blocks: Sequence[int], workers: int | None, scheduler: str | None) -> Generator[Done]:
    """Number and rows of each block as it is done, in any order.

    workers: processes, None for one per core; scheduler: address of a Dask scheduler, which then counts instead.
    Raises UsageError where a package is missing, InputError where workers are lost again and again or the cluster
    cannot be reached.
    """
    if scheduler is not None:
        yield from _by_dask(plan, blocks, scheduler)
        return
    count = min(workers or cores(), len(blocks))
    if count <= 1:
        yield from (_one(plan, block) for block in blocks)
        return
    yield from _by_processes(plan, blocks, count)


def _one(plan: Plan, block: int) -> Done:
    ensure_compiled(kernels_of(plan))
    trials = plan.block(block)
    return block, batch_rows(plan, trials) if plan.batched else [row for k in trials for row in run_trial(plan, k)]


def _by_processes(plan: Plan, blocks: Sequence[int], count: int) -> Iterator[Done]:
    from concurrent.futures import as_completed  # which takes long to import

    remaining = dict.fromkeys(blocks)
    for attempt in range(MOST_LOST):
        try:
            with worker_pool(count) as pool:
                with interruption_waits():
                    done = as_completed([pool.submit(_one, plan, block) for block in remaining])
                for future in done:
                    block, rows = future.result()
                    del remaining[block]
                    yield block, rows
            return
        except InputError as error:
            if error.code != "lost-workers" or attempt + 1 == MOST_LOST:
                raise


def _by_dask(plan: Plan, blocks: Sequence[int], scheduler: str) -> Iterator[Done]:
    try:
        from distributed import CancelledError, Client, KilledWorker, as_completed
    except ImportError:
        raise UsageError("--scheduler needs Dask: pip install 'swingid[cluster]'", code="no-dask") from None
    try:
        client = Client(scheduler, timeout=20)
    except (OSError, ValueError) as error:
        reason = " ".join(str(error).split())[:120]
        raise InputError(f"no Dask scheduler answers at {scheduler}: {reason}", code="no-scheduler") from None
    with client:
        _check_versions(client)
        shared = client.scatter(plan, broadcast=True, hash=True)
        futures = client.map(_one, [shared] * len(blocks), list(blocks), pure=False, retries=MOST_LOST)
        try:
            for future in as_completed(futures):
                try:
                    block, rows = future.result()
                except (KilledWorker, CancelledError, OSError) as error:
                    raise InputError(
                        f"the cluster lost its workers or its scheduler ({type(error).__name__}); start again, what is "
                        "done is kept",
                        code="lost-workers",
                    ) from None
                future.release()
                yield block, rows
        finally:
            client.cancel([future for future in futures if not future.done()])


def _check_versions(client: Any) -> None:
    """Raise InputError for workers with another swingid, whose numbers could differ."""
    try:
        by_worker = client.run(made_by)
    except Exception as error:
        raise InputError(
            f"a worker of the cluster cannot import swingid ({type(error).__name__}); install it there",
            code="no-swingid",
        ) from None
    for address, there in by_worker.items():
        if there != made_by():
            raise InputError(
                f"worker {address} has another version of swingid ({there.get('swingid')}, code {there.get('code')}); "
                "install the same everywhere",
                code="other-version",
            )


def kernels_of(plan: Plan) -> tuple[str, ...]:
    """Tasks of `numerics.ahead` whose kernels most trials of a plan call; others are compiled when they are called."""
    named = plan.tables.methods
    methods = {str(named[name]["method"]) if name in named else name for name in plan.tables.base.methods}
    wanted = {"simulate", *methods, *(("ensemble",) if plan.batched else ())}
    return tuple(task for task in tasks() if task in wanted)


@cache
def ensure_compiled(wanted: tuple[str, ...]) -> None:
    """Have the kernels of some tasks compiled and cached: one worker of a machine compiles, the others wait."""
    # a cache for reading alone stays as it is
    with suppress(OSError), locked(CACHE / "campaign.lock", wait=True):
        compile_ahead(wanted)
