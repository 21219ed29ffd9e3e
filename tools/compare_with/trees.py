"""The two trees: a worktree of the old revision that is gone at the end, and a worker process in each."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from compare_with.worker import AGAIN

PROJECT = Path(__file__).resolve().parents[2]
TOOLS = PROJECT / "tools"

PASSES = 2
"""Most passes over the cases: in the second, kernels come from the cache."""

FIXED = {
    "PYTHONDONTWRITEBYTECODE": "1",
    "PYTHONHASHSEED": "0",  # the order of sets
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "NUMBA_NUM_THREADS": "1",
    "MPLBACKEND": "Agg",
    "COLUMNS": "120",
    "NO_COLOR": "1",
}
"""Variables that are the same for both workers, so that nothing depends on the machine's mood."""


def commit_of(revision: str) -> str:
    """The commit that a revision names; ends the program with git's words where it names none."""
    ran = subprocess.run(
        ["git", "-C", str(PROJECT), "rev-parse", "--verify", "--quiet", f"{revision}^{{commit}}"],
        capture_output=True,
        text=True,
        check=False,
    )
    if ran.returncode:
        sys.exit(f"compare-with: {revision} is no revision of this repository")
    return ran.stdout.strip()


@contextmanager
def worktree(commit: str) -> Iterator[Path]:
    """A temporary working tree of a commit, removed at the end, also after Ctrl-C or a signal to end."""
    folder = Path(tempfile.mkdtemp(prefix="swingid-compare-"))
    tree = folder / "tree"
    git = ["git", "-C", str(PROJECT), "worktree"]
    try:
        subprocess.run([*git, "add", "--quiet", "--detach", str(tree), commit], check=True)
        yield tree
    finally:
        subprocess.run([*git, "remove", "--force", str(tree)], check=False, capture_output=True)
        shutil.rmtree(folder, ignore_errors=True)
        subprocess.run([*git, "prune"], check=False)


def end_on_signals() -> None:
    """Turn a signal to end into SystemExit, so that worktrees are removed."""

    def end(number: int, frame: FrameType | None) -> None:
        raise SystemExit(128 + number)

    signal.signal(signal.SIGTERM, end)
    signal.signal(signal.SIGHUP, end)


def prepare(folder: Path, shared: Path, data: Path | None) -> None:
    """A worker's folder, in which logs, rigs and data have the same relative paths for both trees."""
    if folder.exists():
        shutil.rmtree(folder)
    folder.mkdir(parents=True)
    for name in ("logs", "rigs"):
        (shared / name).mkdir(exist_ok=True)
        (folder / name).symlink_to((shared / name).resolve())
    if data is not None:
        (folder / "data").symlink_to(data.resolve())


def first_pass(results: Path) -> Path:
    """Where the outcomes of the first of several passes are kept, those of kernels just compiled."""
    return results.with_suffix(".first.json")


class Worker:
    """The worker process of a tree, started again where kernels had to be compiled.

    With `cache`, compiled kernels go to that folder and not to the user's.
    """

    def __init__(self, tree: Path, folder: Path, results: Path, options: Sequence[str], cache: Path | None) -> None:
        self.folder, self.results, self.passes = folder, results, 0
        self.environment = os.environ | FIXED
        self.environment["PYTHONPATH"] = os.pathsep.join([str(tree / "src"), str(TOOLS)])
        if cache is not None:
            self.environment["NUMBA_CACHE_DIR"] = str(cache)
        named = [str(results.resolve()), "--source", str(tree / "src"), *options]
        self.command = [sys.executable, "-m", "compare_with.worker", *named]
        self._start()

    def _start(self) -> None:
        self.passes += 1
        if self.passes == 2:
            self.results.replace(first_pass(self.results))
        last = ["--last"] if self.passes == PASSES else []
        shutil.rmtree(self.folder / "out", ignore_errors=True)
        self.process = subprocess.Popen([*self.command, *last], cwd=self.folder, env=self.environment)

    def code(self) -> int | None:
        """The exit code once the last pass is done; None while it runs."""
        code = self.process.poll()
        if code == AGAIN:
            self._start()
            return None
        return code

    def end(self) -> None:
        """Stop it if it runs."""
        if self.process.poll() is None:
            self.process.terminate()
            self.process.wait()


def wait(workers: Sequence[Worker]) -> bool:
    """Whether all workers ended well; where one does not, or this process is stopped, all are ended."""
    try:
        while True:
            codes = [worker.code() for worker in workers]
            if any(codes):
                return False
            if None not in codes:
                return True
            time.sleep(0.2)
    finally:
        for worker in workers:
            worker.end()
