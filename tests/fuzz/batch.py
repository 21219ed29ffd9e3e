"""Many cases in a process of their own, watched: a hang, a crash and what is printed are failures, too.

    python tests/fuzz/batch.py TARGET FIRST COUNT [--memory GB]

runs the cases one after the other and prints a JSON line for each failure; `watched` does so from outside.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HANG, COMPILING = 60.0, 300.0
"""Seconds of processor time that a case may take, and ten times as many on the clock; and the time before the first.

A case may compare two methods, and a fit by output-error of a drawn rig whose friction changes within 1 mrad/s takes
some 200 simulations of 50 ms: 15 s were seen on a slow processor. A loop without an end takes any limit.
"""

LIMIT = 6 << 30
"""Bytes of address space of the process, so that a runaway does not take the machine along."""


def watched(target: str, first: int, count: int) -> list[tuple[int, str]]:
    """Number and failure of every case that fails; the process is started anew after one that kills or hangs it."""
    failures: list[tuple[int, str]] = []
    last = first + count
    with tempfile.TemporaryDirectory() as folder:
        state, output = Path(folder) / "state", Path(folder) / "output"
        while first < last:
            state.write_text("")
            with output.open("wb") as stream:
                process = _started(target, first, last - first, state, stream)
                end = _wait(process, state)
            lines = output.read_text("utf-8", "replace").splitlines()
            failures += [(one["seed"], one["failure"]) for line in lines if (one := _parsed(line))]
            at = int(state.read_text() or first)
            if end == "done":
                break
            other = [line for line in lines if not _parsed(line)]
            failures.append((at, f"{end}: {' | '.join(other[-3:])}"))
            first = at + 1
    return failures


def _parsed(line: str) -> dict | None:
    return json.loads(line[9:]) if line.startswith("FAILURE: ") else None


def _started(target: str, first: int, count: int, state: Path, stream: object) -> subprocess.Popen:
    command = [sys.executable, str(Path(__file__)), target, str(first), str(count), str(state)]
    threads = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "ARROW_NUM_THREADS": "1"}
    return subprocess.Popen(command, stdout=stream, stderr=subprocess.STDOUT, env=os.environ | threads)


def _wait(process: subprocess.Popen, state: Path) -> str:
    """How the process ended: "done", "crash (signal …)", "hang"."""
    at, began, used = "", time.monotonic(), 0.0
    while process.poll() is None:
        time.sleep(0.05)
        now = state.read_text()
        if now != at:
            at, began, used = now, time.monotonic(), _processor(process.pid)
        elif _processor(process.pid) - used > (limit := HANG if now else COMPILING) or (
            time.monotonic() - began > 10 * limit
        ):
            process.kill()
            process.wait()
            return "hang"
    return "done" if process.returncode == 0 else f"crash (exit code {process.returncode})"


def _processor(pid: int) -> float:
    """Seconds of processor time of a process so far; 0 where nothing tells."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def main(target: str, first: int, count: int, state: str) -> None:
    """Run the cases of one batch; what a case prints is a failure of it."""
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
    resource.setrlimit(resource.RLIMIT_AS, (LIMIT, LIMIT))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    from fuzz.cases import failure_of, warm_up

    warm_up(target)
    report = os.fdopen(os.dup(1), "w", encoding="utf-8")
    with tempfile.TemporaryFile() as printed, Path(state).open("r+b", buffering=0) as at:
        os.dup2(printed.fileno(), 1)
        os.dup2(printed.fileno(), 2)
        for seed in range(first, first + count):
            at.seek(0)
            at.write(b"%12d" % seed)
            failure = failure_of(target, seed)
            sys.stdout.flush()
            sys.stderr.flush()
            size = os.lseek(printed.fileno(), 0, os.SEEK_CUR)
            if size:
                os.lseek(printed.fileno(), 0, os.SEEK_SET)
                text = os.read(printed.fileno(), 2000).decode("utf-8", "replace")
                failure = failure or f"printed: {text}"
                os.ftruncate(printed.fileno(), 0)
                os.lseek(printed.fileno(), 0, os.SEEK_SET)
            if failure:
                report.write("FAILURE: " + json.dumps({"seed": seed, "failure": failure}) + "\n")
                report.flush()


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), sys.argv[4])
