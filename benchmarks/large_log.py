"""A log of an hour at 10 kHz: rows a second, peak memory, error and interval.

    python benchmarks/large_log.py [--rows 36000000] [--method momentum] [--format parquet|csv|h5|mcap]

The log is a periodic motion in closed form, read by 14-bit encoders with noise; it is written to a file first.
`swingid identify` then runs as a user runs it; reading alone is timed in another process.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

from large_logs import GIVEN, INERTIA, write_large_log

HERE = Path(__file__).resolve()


def main() -> None:
    """Write the log, read it, identify it, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", type=int, default=36_000_000)
    parser.add_argument("--method", default="momentum")
    parser.add_argument("--format", choices=("parquet", "csv", "h5", "mcap"), default="parquet")
    parser.add_argument("--read", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.read:
        _read(given.read)
        return
    with tempfile.TemporaryDirectory() as folder:
        short, path = (
            write_large_log(Path(folder) / f"{rows}.{given.format}", rows) for rows in (1_200_000, given.rows)
        )
        _command(short, given.method)  # compiles what is to be compiled
        reading = _timed([sys.executable, HERE, "--read", path])
        found = _command(path, given.method)
    _print(given, found, reading)


def _print(given: argparse.Namespace, found: dict, reading: dict) -> None:
    rows, seconds, result = given.rows, found["seconds"], found["result"]
    inertia, parts = result["parameters"]["inertia"], result["provenance"]["parts"]
    low, high = inertia["interval95"]
    lines = (
        f"{rows / 1e6:.1f} million rows, {given.method}, {given.format}; {os.cpu_count()} processors, load "
        f"{os.getloadavg()[0]:.1f}; read in {len(parts)} parts, {parts[0]['averaged']} rows averaged into one",
        f"  reading alone            {_rate(rows, reading['seconds'])}",
        f"  read and identified      {_rate(rows, seconds)}",
        f"  its processor time       {_rate(rows, found['processor'])}",
        f"  peak memory              {found['memory']:7.2f} GB",
        f"  error of the inertia     {100 * (inertia['value'] / INERTIA - 1):+.5f} %",
        f"  95 % interval            ±{100 * (high - low) / 2 / INERTIA:.5f} %",
        f"  warnings                 {', '.join(w['code'] for w in result['warnings']) or 'none'}",
    )
    print("\n".join(lines))


def _rate(rows: int, seconds: float) -> str:
    return f"{seconds:7.2f} s   {rows / max(seconds, 1e-9) / 1e6:6.2f} million rows/s"


def _command(path: Path, method: str) -> dict[str, object]:
    """``swingid identify``, as a user runs it: seconds, processor time, peak memory (GB), the result."""
    rig, result = path.with_name("rig.toml"), path.with_name("result.json")
    rig.write_text(GIVEN.text)
    command = [sys.executable, "-m", "swingid", "identify", path, "--rig", rig, "--method", method, "--json", result]
    return _timed(command) | {"result": json.loads(result.read_text())}


# Runs in a Python process that holds nothing else. Linux takes the resident set of the program that calls exec as the
# first peak of the new one (`ru_maxrss`), so measured from here a command would have this process's memory: a gigabyte
# and more in a run of all tests. Through this one it has some 10 MB. Memory is that of the command and the processes
# that it starts, a page that several share counted once (the sum of their proportional set sizes), looked at ten times
# a second; where the system does not state that, the peak of the largest process.
MEASURE = """
import json, os, subprocess, sys, time
begin = time.perf_counter()
process = subprocess.Popen(sys.argv[2:], stdout=subprocess.DEVNULL)
most = 0

def tree(pid):
    yield pid
    for task in os.listdir(f"/proc/{pid}/task"):
        with open(f"/proc/{pid}/task/{task}/children") as file:
            for child in file.read().split():
                yield from tree(child)

def held(pid):
    try:
        with open(f"/proc/{pid}/smaps_rollup") as file:
            return sum(int(line.split()[1]) for line in file if line.startswith("Pss:"))
    except OSError:
        return 0  # it has ended, and its result is not yet taken

found = 0, 0, None
while not found[0]:
    try:
        most = max(most, sum(held(pid) for pid in tree(process.pid)))
    except (OSError, ValueError):
        pass  # a process ended meanwhile
    for _ in range(10):
        found = os.wait4(process.pid, os.WNOHANG)
        if found[0]:
            break
        time.sleep(0.01)
seconds, (_, status, used) = time.perf_counter() - begin, found
answer = {"seconds": seconds, "processor": used.ru_utime + used.ru_stime, "status": status}
with open(sys.argv[1], "w") as file:
    json.dump(answer | {"memory": max(most, used.ru_maxrss) / 1e6}, file)
"""


def _timed(command: list[object]) -> dict[str, object]:
    """Seconds, processor time and peak memory (GB) of a command with all its processes."""
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "measured.json"
        words = [str(word) for word in command]
        subprocess.run([sys.executable, "-I", "-S", "-c", MEASURE, str(target), *words], check=True)
        found: dict[str, object] = json.loads(target.read_text())
    if found.pop("status"):
        raise SystemExit(f"{command} failed")
    return found


def _read(path: str) -> None:
    from swingid.recording.large.log import PIECE, _file

    for _ in _file(path).pieces(PIECE, ["t", "q1", "q2", "u"]):
        pass


if __name__ == "__main__":
    main()
