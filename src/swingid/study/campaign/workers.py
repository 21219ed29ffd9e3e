"""Who does the blocks of a campaign: this process, processes of this machine, or a Dask cluster.

Blocks are pure, so a lost worker costs time only: what it had not handed over is done again by another.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from swingid.errors import InputError, UsageError
from swingid.study.campaign.store import made_by
from swingid.study.campaign.trial import Row, run_block

if TYPE_CHECKING:
    from swingid.study.campaign.plan import Plan

Done = tuple[int, list[Row]]

IDLE = 20
"""s after which a process without work ends, as it does when the one that started it was killed."""

MOST_LOST = 3
"""Times that processes may be lost before it is given up."""


def blocks_done(plan: Plan, blocks: Sequence[int], workers: int | None, scheduler: str | None) -> Iterator[Done]:
    """Number and rows of each block as it is done, in any order.

    workers: processes, None for one per core; scheduler: address of a Dask scheduler, which then counts instead.
    Raises UsageError where a package is missing, InputError where workers are lost again and again or the cluster
    cannot be reached.
    """
    if scheduler is not None:
        yield from _by_dask(plan, blocks, scheduler)
        return
    count = min(workers or len(os.sched_getaffinity(0)), len(blocks))
    if count <= 1:
        for block in blocks:
            yield _one(plan, block)
        return
    yield from _by_processes(plan, blocks, count)


def _one(plan: Plan, block: int) -> Done:
    return block, run_block(plan, block)


def _one_for(parent: int, plan: Plan, block: int) -> Done:
    """A block for the process that started this one; where that was killed nobody wants it, and this one ends."""
    if os.getppid() != parent:
        os._exit(1)
    return _one(plan, block)


def _by_processes(plan: Plan, blocks: Sequence[int], count: int) -> Iterator[Done]:
    try:
        from joblib import Parallel, delayed, parallel_config
        from joblib.externals.loky.process_executor import TerminatedWorkerError
    except ImportError:
        raise UsageError(
            "several workers need joblib: pip install 'swingid[campaign]', or take --workers 1", code="no-joblib"
        ) from None
    left = dict.fromkeys(blocks)
    for _ in range(MOST_LOST):
        try:
            with parallel_config(backend="loky", inner_max_num_threads=1, idle_worker_timeout=IDLE):
                pool = Parallel(n_jobs=count, return_as="generator_unordered", batch_size=1, pre_dispatch="2*n_jobs")
                for block, rows in pool(delayed(_one_for)(os.getpid(), plan, block) for block in list(left)):
                    del left[block]
                    yield block, rows
            return
        except TerminatedWorkerError:
            continue
    raise InputError(
        f"worker processes died {MOST_LOST} times, perhaps for want of memory; start again with fewer --workers, "
        "what is done is kept",
        code="lost-workers",
    )


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
        found = client.run(made_by)
    except Exception as error:
        raise InputError(
            f"a worker of the cluster cannot import swingid ({type(error).__name__}); install it there",
            code="no-swingid",
        ) from None
    for address, there in found.items():
        if there != made_by():
            raise InputError(
                f"worker {address} has another version of swingid ({there.get('swingid')}, code {there.get('code')}); "
                "install the same everywhere",
                code="other-version",
            )
