"""The process that runs the cases with one tree: ``python -m compare_with.worker RESULTS --role old ...``.

The tree is the one that PYTHONPATH names. Cases run in this process one after the other, since starting Python and
compiling kernels takes longer than most cases; each is guarded, and its outcome written down whatever happens.

A kernel that was compiled in this process differs in the last digits from the same kernel loaded from the cache. Some
results show that in their sixth digit. So where anything had to be compiled the worker ends with `AGAIN`, and is
started once more with all kernels in the cache.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import signal
import sys
import time
import traceback
import warnings
from pathlib import Path
from typing import Any

from compare_with import cases_commands, cases_files, cases_real, cases_told, cases_twin
from compare_with.case import Case
from compare_with.logs import recipes
from compare_with.recipe import write_log

LIMIT = 120
"""Seconds of this process's work after which a case counts as crashed; of the clock, `PATIENCE` times as many."""

PATIENCE = 10

READY = "logs/.written"

AGAIN = 75
"""Exit code (EX_TEMPFAIL of sysexits.h) that asks for another pass, since kernels were compiled in this one."""


class Overdue(BaseException):
    """A case takes longer than `LIMIT`; no Exception, for which the command line has an exit code."""


def chosen(level: str, part: str) -> list[Case]:
    """The cases of a level whose names contain `part`; those that need no logs first."""
    found = [*cases_commands.cases(), *cases_twin.cases(), *cases_told.cases(), *cases_files.cases()]
    if Path("data").exists():
        found += cases_real.cases()
    names = [case.name for case in found]
    assert len(set(names)) == len(names), "two cases have one name"
    found = [case for case in found if (case.quick or level == "full") and part in case.name]
    return sorted(found, key=lambda case: case.needs_logs)


def run_case(case: Case) -> dict[str, Any]:
    """The outcome of a case, or what broke in it, with the time it took."""
    folder = Path("out") / re.sub(r"[^\w.-]", "_", case.name)
    folder.mkdir(parents=True, exist_ok=True)
    begin = time.perf_counter()
    signal.setitimer(signal.ITIMER_PROF, LIMIT)
    signal.alarm(PATIENCE * LIMIT)
    try:
        found = {"outcome": case.run(folder)}
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        found = {"crash": f"{type(error).__name__}: {error}", "where": traceback.format_exc()}
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.alarm(0)
    return found | {"seconds": time.perf_counter() - begin}


def _overdue(*_: object) -> None:
    raise Overdue(f"more than {LIMIT} s")


def write_logs(part: str, level: str) -> None:
    """All logs that the cases may need, by the twin of this tree."""
    import swingid as sw

    Path("logs").mkdir(exist_ok=True)
    for recipe in recipes():
        if recipe.quick or level == "full" or part:
            write_log(sw, recipe, Path())
    cases_files.write(Path("logs"))
    Path(READY).touch()


def compilations() -> list[Any]:
    """A list that grows with each kernel that is compiled, and not loaded from the cache: what numba tells of it."""
    from numba.core import event

    found: list[Any] = []

    class Count(event.Listener):  # type: ignore[misc]
        """Counts ends of compilations."""

        def on_start(self, event: object) -> None:
            pass

        def on_end(self, event: Any) -> None:
            found.append(event.data)

    event.register("numba:compile", Count())
    return found


def main() -> int:
    """Run the cases and write their outcomes to the file that is named first."""
    parser = argparse.ArgumentParser()
    parser.add_argument("results", type=Path)
    parser.add_argument("--source", type=Path, required=True, help="the tree's src, to check that it is the one run")
    parser.add_argument("--writes-logs", action="store_true")
    parser.add_argument("--level", default="full")
    parser.add_argument("--cases", default="")
    parser.add_argument("--last", action="store_true", help="no other pass after this one")
    given = parser.parse_args()
    import swingid as sw

    if not Path(str(sw.__file__)).resolve().is_relative_to(given.source.resolve()):
        sys.exit(f"{sw.__file__} is not the tree in {given.source}")
    warnings.simplefilter("ignore")
    for number in (signal.SIGALRM, signal.SIGPROF):
        signal.signal(number, _overdue)
    compiled = compilations()
    if given.writes_logs and not Path(READY).exists():
        write_logs(given.cases, given.level)
    outcomes = {}
    cases = chosen(given.level, given.cases)
    for k, case in enumerate(cases):
        while case.needs_logs and not Path(READY).exists():
            if os.getppid() == 1:
                return 1
            time.sleep(0.2)
        outcomes[case.name] = run_case(case)
        if k % 50 == 49:
            print(f"{given.results.stem}: {k + 1} of {len(cases)} cases", file=sys.stderr, flush=True)
    given.results.write_text(json.dumps(outcomes), encoding="utf-8")
    count = sum(one["args"] in one["dispatcher"].overloads for one in compiled)  # the others could not be compiled
    if count:
        print(f"{given.results.stem}: {count} kernels compiled", file=sys.stderr, flush=True)
    return AGAIN if count and not given.last else 0


if __name__ == "__main__":
    sys.exit(main())
