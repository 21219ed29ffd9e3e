"""``python -m compare_with REV``: run a revision and the working tree over the corpus, and compare.

Logs and outcomes of the old tree are kept in out/compare-with by commit and corpus, so that it runs once.

Exit code 0: all equal or intended; 1: something differs or crashed; 2: a worker could not run.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import shutil
import sys
import time
from importlib.metadata import version
from pathlib import Path
from typing import Any

from compare_with.trees import PROJECT, Worker, commit_of, end_on_signals, first_pass, prepare, wait, worktree
from compare_with.verdict import read_intended, rounding, text_of, verdict

INTENDED = Path(__file__).with_name("intended.toml")


def arguments() -> argparse.Namespace:
    """What the command line asks for."""
    parser = argparse.ArgumentParser(prog="compare-with", description="Compare a revision with the working tree.")
    parser.add_argument("revision", help="of the old tree")
    parser.add_argument("--quick", action="store_true", help="the cases for use while refactoring")
    parser.add_argument("--cases", default="", metavar="TEXT", help="only cases whose names contain TEXT")
    parser.add_argument("--words", action="store_true", help="count texts that were reworded")
    parser.add_argument("--strict", action="store_true", help="fail also for what rounding explains")
    parser.add_argument("--all", action="store_true", help="show every differing path")
    parser.add_argument("--fresh", action="store_true", help="run the old tree also where its outcomes are kept")
    parser.add_argument("--out", type=Path, default=PROJECT / "out" / "compare-with", help="folder of logs and results")
    return parser.parse_args()


def data_folder() -> Path | None:
    """The folder of real measurements: $SWINGID_DATA, else ../shared/data beside the project; None without it."""
    stated = os.environ.get("SWINGID_DATA")
    folder = Path(stated) if stated else PROJECT.parent / "shared" / "data"
    return folder if folder.is_dir() else None


def key_of(commit: str, level: str, data: Path | None) -> str:
    """The name under which outcomes of an old tree are kept: the commit, and all else that they depend on."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.glob("*.py")):
        if path.name not in ("__main__.py", "comparing.py", "verdict.py"):
            digest.update(path.read_bytes())
    for path in sorted(data.rglob("*")) if data else ():
        digest.update(f"{path.relative_to(data)} {path.stat().st_size}".encode() if data else b"")
    for name in ("numpy", "scipy", "numba", "pyarrow"):
        digest.update(version(name).encode())
    return f"{commit[:12]}-{level}-{digest.hexdigest()[:8]}"


def kept(given: argparse.Namespace, commit: str, data: Path | None) -> tuple[Path, bool]:
    """The folder of the old tree's logs and outcomes, and whether they are there; a full run serves all others."""
    full, quick = (given.out / key_of(commit, level, data) for level in ("full", "quick"))
    if not given.fresh:
        for folder in (full, *([quick] if given.quick else [])):
            if (folder / "old.json").exists():
                return folder, True
    if given.cases:
        return given.out / "some", False
    return (quick if given.quick else full), False


def run_trees(given: argparse.Namespace, commit: str, store: Path, known: bool, data: Path | None) -> bool:
    """Run both trees side by side, or the new one alone; whether both came to their end."""
    options = ["--level", "quick" if given.quick else "full", "--cases", given.cases]
    prepare(store / "new", store, data)
    if known:
        return wait([Worker(PROJECT, store / "new", store / "new.json", options, None)])
    with worktree(commit) as tree:
        for path in (tree / "examples" / "rigs").glob("*.toml"):
            shutil.copy(path, store / "rigs")
        prepare(store / "old", store, data)
        partial, cache = store / "old.part.json", tree.parent / "kernels"
        old = Worker(tree, store / "old", partial, [*options, "--writes-logs"], cache)
        if not wait([old, Worker(PROJECT, store / "new", store / "new.json", options, None)]):
            return False
    if first_pass(partial).exists():
        first_pass(partial).replace(first_pass(store / "old.json"))
    partial.replace(store / "old.json")
    return True


def read(path: Path, names: set[str] | None = None) -> dict[str, Any]:
    """The outcomes of a tree, all or those of the named cases."""
    outcomes: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return outcomes if names is None else {name: one for name, one in outcomes.items() if name in names}


def main() -> int:
    """Run, compare, print."""
    given = arguments()
    end_on_signals()
    begin, data, commit = time.perf_counter(), data_folder(), commit_of(given.revision)
    if data is None:
        print("compare-with: no real measurements; set SWINGID_DATA to their folder", file=sys.stderr)
    store, known = kept(given, commit, data)
    if not known:
        shutil.rmtree(store, ignore_errors=True)
        store.mkdir(parents=True)
    if not run_trees(given, commit, store, known, data):
        print("compare-with: a worker ended before its cases were run", file=sys.stderr)
        return 2
    new = read(store / "new.json")
    old, first = read(store / "old.json", set(new) if known else None), first_pass(store / "old.json")
    noise = {} if given.strict or not first.exists() else rounding(old, read(first, set(old)))
    found = verdict(old, new, read_intended(INTENDED), noise)
    print(text_of(found, words=given.words, everything=given.all))
    what = f"{given.revision} ({'kept outcomes' if known else 'run now'}) against the working tree"
    print(f"{what} in {time.perf_counter() - begin:.0f} s; outcomes in {os.path.relpath(store)}")
    return int(found.failed)


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(130)
