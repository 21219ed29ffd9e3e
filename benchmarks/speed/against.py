"""First use and warm start beside an earlier tree, old and new by turns: into docs/benchmarks.md.

    python benchmarks/speed/against.py [--against 72b55b8] [--cold 2] [--warm 9] [--print]

Each tree runs as `python -m swingid` from its sources, in this environment, with a cache of kernels of its own: empty
for the first `simulate`, then the first `identify` and the first `compare`; full for the warm starts. The default is
the tree before the work on speed. Elapsed and processor time (all processes); the ratio is the median of paired ratios.
"""

from __future__ import annotations

import argparse
import io
import os
import re
import shutil
import statistics
import subprocess
import sys
import tarfile
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from start import SIMULATE, processor

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "benchmarks.md"
COLD = {
    "first `simulate`": (*SIMULATE, "run.parquet"),
    "then the first `identify`": ("identify", "run.parquet", "--rig", "paper"),
    "then the first `compare`": ("compare", "run.parquet", "--rig", "paper"),
}
WARM = {
    "`swingid identify`, new process": ("-m", "swingid", "identify", "run.parquet", "--rig", "paper"),
    "`swingid simulate`, new process": ("-m", "swingid", *SIMULATE, "run.parquet"),
    "`swingid --help`": ("-m", "swingid", "--help"),
    "`import swingid`": ("-c", "import swingid"),
}
Times = tuple[float, float]
"""Elapsed and processor time, s."""


class Tree:
    """The sources of a revision, a folder to run in and a cache of kernels."""

    def __init__(self, sources: Path, folder: Path) -> None:
        self.folder, self.cache = folder, folder / "kernels"
        folder.mkdir(parents=True, exist_ok=True)
        self.environment = os.environ | {"PYTHONPATH": str(sources), "NUMBA_CACHE_DIR": str(self.cache)}
        self.environment.pop("PYTHONDONTWRITEBYTECODE", None)
        subprocess.run(
            [sys.executable, "-m", "compileall", "-q", sources], env=self.environment, check=True
        )  # as pip does

    def run(self, arguments: Sequence[str]) -> Times:
        """Run Python with these arguments."""
        before, start = processor(), time.perf_counter()
        subprocess.run(
            [sys.executable, *arguments], cwd=self.folder, env=self.environment, check=True, capture_output=True
        )
        return time.perf_counter() - start, processor() - before


def sources_of(revision: str, folder: Path) -> Path:
    """The `src` of a revision, taken out of the repository."""
    archive = subprocess.run(["git", "archive", revision, "src"], cwd=ROOT, check=True, capture_output=True).stdout
    with tarfile.open(fileobj=io.BytesIO(archive)) as files:
        files.extractall(folder, filter="data")
    return folder / "src"


def measured(trees: tuple[Tree, Tree], cold: int, warm: int) -> dict[str, list[tuple[Times, Times]]]:
    """Pairs (old, new) of every command."""
    found: dict[str, list[tuple[Times, Times]]] = {name: [] for name in (*COLD, *WARM)}
    for _ in range(cold):
        for tree in trees:
            shutil.rmtree(tree.cache, ignore_errors=True)
        for name, command in COLD.items():
            old, new = (tree.run(("-m", "swingid", *command)) for tree in trees)
            found[name].append((old, new))
    for _ in range(warm):
        for name, arguments in WARM.items():
            old, new = (tree.run(arguments) for tree in trees)
            found[name].append((old, new))
    return found


def table(found: dict[str, list[tuple[Times, Times]]]) -> str:
    """Rows for the page."""
    lines = [
        "| | before, s | now, s | ratio | processor time: before, s | now, s | ratio |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, pairs in found.items():
        cells = []
        for which in (0, 1):
            old, new = (statistics.median(pair[tree][which] for pair in pairs) for tree in (0, 1))
            ratio = statistics.median(pair[1][which] / pair[0][which] for pair in pairs)
            cells += [f"{old:.2g}", f"{new:.2g}", f"{ratio:.2f}"]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(lines)


def main() -> None:
    """Measure and write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--against", default="72b55b8", help="the earlier revision")
    parser.add_argument("--cold", type=int, default=2)
    parser.add_argument("--warm", type=int, default=9)
    parser.add_argument("--print", action="store_true", help="only print")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        old = Tree(sources_of(given.against, folder / "sources"), folder / "old")
        rows = table(measured((old, Tree(ROOT / "src", folder / "new")), given.cold, given.warm))
    print(f"load {os.getloadavg()[0]:.1f}, {os.cpu_count()} processors\n{rows}")
    if not given.print:
        text = PAGE.read_text(encoding="utf-8")
        pattern = re.compile(r"(<!-- speed: start -->\n\n).*?(\n\n<!-- end -->)", re.DOTALL)
        PAGE.write_text(pattern.sub(lambda match: match[1] + rows + match[2], text), encoding="utf-8")


if __name__ == "__main__":
    main()
