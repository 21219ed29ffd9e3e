"""``python -m compare_with REV``: run a revision and the working tree over the corpus, and compare.

Exit code 0: all equal or intended; 1: something differs or crashed; 2: a worker could not run.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import sys
import time
from pathlib import Path
from typing import Any

from compare_with.trees import PROJECT, commit_of, end_on_signals, prepare, start, wait, worktree
from compare_with.verdict import read_intended, text_of, verdict

INTENDED = Path(__file__).with_name("intended.toml")


def arguments() -> argparse.Namespace:
    """What the command line asks for."""
    parser = argparse.ArgumentParser(prog="compare-with", description="Compare a revision with the working tree.")
    parser.add_argument("revision", help="of the old tree")
    parser.add_argument("--quick", action="store_true", help="the cases for use while refactoring")
    parser.add_argument("--cases", default="", metavar="TEXT", help="only cases whose names contain TEXT")
    parser.add_argument("--words", action="store_true", help="count texts that were reworded")
    parser.add_argument("--all", action="store_true", help="show every differing path")
    parser.add_argument("--out", type=Path, default=PROJECT / "out" / "compare-with", help="folder of logs and results")
    return parser.parse_args()


def data_folder() -> Path | None:
    """The folder of real measurements: $SWINGID_DATA, else ../shared/data beside the project; None without it."""
    stated = os.environ.get("SWINGID_DATA")
    folder = Path(stated) if stated else PROJECT.parent / "shared" / "data"
    return folder if folder.is_dir() else None


def run_trees(given: argparse.Namespace, out: Path) -> bool:
    """Run both trees side by side; their outcomes are then in old.json and new.json."""
    data = data_folder()
    if data is None:
        print("compare-with: no real measurements; set SWINGID_DATA to their folder", file=sys.stderr)
    options = ["--level", "quick" if given.quick else "full", "--cases", given.cases]
    with worktree(commit_of(given.revision)) as tree:
        for name in ("old", "new"):
            prepare(out / name, out, tree / "examples" / "rigs", data)
        cache = tree.parent / "kernels"
        old = start(tree, out / "old", out / "old.json", [*options, "--writes-logs"], cache)
        new = start(PROJECT, out / "new", out / "new.json", options, None)
        return wait([old, new])


def read(path: Path) -> dict[str, Any]:
    """The outcomes of a tree."""
    outcomes: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return outcomes


def main() -> int:
    """Run, compare, print."""
    given = arguments()
    end_on_signals()
    begin, out = time.perf_counter(), given.out
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    if not run_trees(given, out):
        print("compare-with: a worker ended before its cases were run", file=sys.stderr)
        return 2
    found = verdict(read(out / "old.json"), read(out / "new.json"), read_intended(INTENDED))
    print(text_of(found, words=given.words, everything=given.all))
    print(f"{given.revision} against the working tree in {time.perf_counter() - begin:.0f} s; outcomes in {out}")
    return int(found.failed)


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(130)
