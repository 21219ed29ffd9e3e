"""The two trees: a worktree of the old revision that is gone at the end, and a worker process in each."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

PROJECT = Path(__file__).resolve().parents[2]
TOOLS = PROJECT / "tools"


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


def prepare(folder: Path, shared: Path, rigs: Path, data: Path | None) -> None:
    """A worker's folder, in which logs, rigs and data have the same relative paths for both trees."""
    if folder.exists():
        shutil.rmtree(folder)
    folder.mkdir(parents=True)
    (shared / "logs").mkdir(parents=True, exist_ok=True)
    (folder / "logs").symlink_to((shared / "logs").resolve())
    (folder / "rigs").symlink_to(rigs.resolve())
    if data is not None:
        (folder / "data").symlink_to(data.resolve())


def start(
    tree: Path, folder: Path, results: Path, options: Sequence[str], cache: Path | None
) -> subprocess.Popen[bytes]:
    """The worker process of a tree; with `cache`, compiled kernels go there and not to the user's folder."""
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join([str(tree / "src"), str(TOOLS)]),
        "PYTHONDONTWRITEBYTECODE": "1",
        "PYTHONHASHSEED": "0",
        "OPENBLAS_NUM_THREADS": "1",
        "OMP_NUM_THREADS": "1",
        "NUMBA_NUM_THREADS": "1",
        "MPLBACKEND": "Agg",
        "COLUMNS": "120",
        "NO_COLOR": "1",
    }
    if cache is not None:
        environment["NUMBA_CACHE_DIR"] = str(cache)
    command = [sys.executable, "-m", "compare_with.worker", str(results.resolve()), "--source", str(tree / "src")]
    return subprocess.Popen([*command, *options], cwd=folder, env=environment)


def wait(workers: Sequence[subprocess.Popen[bytes]]) -> bool:
    """Whether all workers ended well; where one does not, or this process is stopped, all are ended."""
    try:
        running = list(workers)
        while running:
            for worker in list(running):
                try:
                    code = worker.wait(timeout=0.5)
                except subprocess.TimeoutExpired:
                    continue
                running.remove(worker)
                if code:
                    return False
        return True
    finally:
        for worker in workers:
            if worker.poll() is None:
                worker.terminate()
                worker.wait()
