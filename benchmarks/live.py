"""The host of a live rig in real time: round trip, lateness beside a plain time.sleep loop, CPU, bytes, loss at a kill.

The rig is `swingid emulate` in a process of its own: the firmware's process where there is a C compiler, else the
machine in Python. Figures of a shared machine are upper bounds, no specification.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np

from swingid.control.compensator import Compensator
from swingid.control.references.parse import parse_reference
from swingid.errors import SwingidError
from swingid.live.devices.table import open_device
from swingid.live.experiment import Done, Order
from swingid.live.frames import Decoder, encode
from swingid.live.pace import PERIOD
from swingid.live.processes import ProcessConductor
from swingid.live.progress import Progress
from swingid.model.rig import Rig
from swingid.recording.recording import Recording

RIG = Rig.load("paper")
MOTION = parse_reference("sine 0.8 rad 8.5 rad/s")
SECONDS = 10.0


def emulator() -> tuple[subprocess.Popen[str], str]:
    """The process of the emulator and its address."""
    command = [sys.executable, "-m", "swingid", "emulate", "--rig", "paper", "--tcp", "0"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    assert process.stdout is not None
    return process, process.stdout.readline().split()[0].rstrip(":")


def round_trips(address: str, count: int = 300) -> np.ndarray:
    """Seconds from Who to Hello."""
    stream, decoder, found = open_device(address), Decoder(), []
    for _ in range(count):
        begin = time.perf_counter()
        stream.write(encode("Who"))
        while not any(frame.name == "Hello" for frame in decoder.feed(stream.read(0.1))):
            pass
        found.append(time.perf_counter() - begin)
    stream.close()
    return np.array(found)


def plain_loop(seconds: float, over: threading.Event) -> np.ndarray:
    """Lateness (s) of time.sleep to absolute deadlines in an ordinary process, as the link's turns are spaced."""
    due, late = time.perf_counter(), []
    end = due + seconds
    while due < end and not over.is_set():
        time.sleep(max(due - time.perf_counter(), 0.0))
        late.append(time.perf_counter() - due)
        due = max(due + PERIOD, time.perf_counter() - PERIOD)
    return np.array(late)


def cpu(pid: int) -> float:
    """Processor time (s) of a process so far; nan where the system does not say."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return float("nan")
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class Watcher:
    """Processor time of the run's processes between 2 s and 8 s, and a kill of one of them at 5 s."""

    def __init__(self, conductor: ProcessConductor, kill: str = "") -> None:
        self.conductor, self.kill = conductor, kill
        self.first: dict[str, float] = {}
        self.share: dict[str, float] = {}
        self.at = 0.0
        self.killed = 0.0

    def __call__(self, progress: Progress) -> None:
        pids = {**self.conductor.pids, "view": os.getpid()}
        if progress.time > 2.0 and not self.first:
            self.first, self.at = {name: cpu(pid) for name, pid in pids.items()}, time.perf_counter()
        elif progress.time > 8.0 and not self.share:
            passed = time.perf_counter() - self.at
            self.share = {name: (cpu(pid) - self.first[name]) / passed for name, pid in pids.items()}
        if self.kill and progress.time > 5.0 and not self.killed:
            self.killed = progress.time
            os.kill(pids[self.kill], signal.SIGKILL)


def run(address: str, out: Path, kill: str = "") -> tuple[Watcher, list[str], Done | None]:
    """One run, with what it said."""
    said: list[str] = []
    conductor = ProcessConductor(RIG, address, say=said.append)
    watcher = Watcher(conductor, kill)
    conductor._show = watcher
    order = Order(MOTION, Compensator.paper(RIG), SECONDS, clear=True)
    try:
        return watcher, said, conductor.run(order, out)
    except SwingidError as error:
        said.append(error.message)
        return watcher, said, None


def percentiles(late: np.ndarray) -> str:
    return ", ".join(f"{100 * p:g} % {1e3 * np.quantile(late, p):.2g} ms" for p in (0.5, 0.99, 0.999))


def whole(folder: Path) -> None:
    """A whole run, beside a plain loop."""
    process, address = emulator()
    try:
        print(f"round trip Who, Hello: {percentiles(round_trips(address))}")
        beside = subprocess.Popen([sys.executable, __file__, "plain"], stdout=subprocess.PIPE, text=True)
        out = folder / "run.mcap"
        watcher, said, done = run(address, out)
        beside.terminate()
        print(beside.communicate()[0].strip())
        print("\n".join(line for line in said if "host's loop" in line or done is None))
        if done is not None:
            rows = len(Recording.load(out, RIG))
            shares = ", ".join(f"{name} {100 * share:.0f} %" for name, share in watcher.share.items())
            print(f"processor at 1 kHz: {shares} of a core (view: with estimates)")
            print(f"journal: {out.stat().st_size / rows:.0f} bytes per row, {rows} rows, {done.lost} lost")
    finally:
        process.send_signal(signal.SIGINT)
        process.wait()


def killed(folder: Path, name: str) -> None:
    """A run in which a process is killed."""
    process, address = emulator()
    try:
        out = folder / f"{name}.mcap"
        watcher, _, _ = run(address, out, name)
        log = Recording.load(out, RIG)
        lost = 1e3 * max(watcher.killed - float(log.time[-1]), 0.0)
        print(f"kill -9 of the {name}: the log ends {lost:.0f} ms before what the view had shown")
    finally:
        process.send_signal(signal.SIGINT)
        process.wait()


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        whole(Path(folder))
        for name in ("link", "recorder"):
            killed(Path(folder), name)


def plain() -> None:
    """The plain loop until it is ended, in a process of its own."""
    over = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: over.set())
    late = plain_loop(120.0, over)
    print(f"plain time.sleep loop beside it: {len(late)} turns, late by at most: {percentiles(late)}")


if __name__ == "__main__":
    plain() if sys.argv[1:] == ["plain"] else main()
