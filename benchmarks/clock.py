"""A board whose clock is off, in real time: what its comparison with the computer's finds, and what identify answers.

    python benchmarks/clock.py [RUNS] [SECONDS]

The board is the firmware's process; its samples, stamps and Hello follow its own clock, the twin's body moves in
real time. Printed per run: the true deviation, that found, how far apart they are in standard uncertainties, the error
of the inertia in half-widths of its 95 % interval with the clock as it is stated by default (0 ± 100 ppm), and the
same where the device's clock is believed. Figures of a shared machine are upper bounds.
"""

from __future__ import annotations

import signal
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

from swingid.control.compensator import Compensator
from swingid.control.references.parse import parse_reference
from swingid.identification import identify
from swingid.live.emulator import NativeRig, keep_pace
from swingid.live.experiment import Order, require_usable
from swingid.live.native import NativeProcess
from swingid.live.plant import Plant, board_of
from swingid.live.processes import ProcessConductor
from swingid.model.rig import Rig
from swingid.recording.formats import read_table
from swingid.recording.live import compare
from swingid.recording.recording import Recording

RIG = Rig.load("paper")
DEFAULT = RIG.changed({"log.clock": "0 ± 100 ppm"})
DEVIATIONS = (0.0, 5e-5, -2e-4, 5e-4, -0.002, 0.01, -0.01)
RATE, FIRMWARE = 1000.0, 7


class OwnClock(NativeRig):
    """The firmware's process, its device time counted by its own samples."""

    def step(self) -> None:
        """One sample."""
        now = round(self._plant.row * 1e6 / RATE) % 2**32
        self._plant.hold(self._process.exchange(now, self._plant.read()))


def device(deviation: float) -> None:
    """Be the board until it is ended; its samples come more often than they should where its clock is fast."""
    process = NativeProcess(board_of(RIG, rate=RATE, firmware=FIRMWARE), tcp=0)
    rig = OwnClock(Plant(RIG, rate=RATE * (1 + deviation)), process)
    print(rig.address, flush=True)
    over = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: over.set())
    held = keep_pace(rig.step, RATE * (1 + deviation), over=over.is_set, processes=rig.processes)
    print(f"{held.left_out:.4f}", flush=True)
    rig.close()


def error(log: Recording) -> str:
    """Error of the inertia in half-widths of its interval, and the status."""
    result = identify(log, DEFAULT)
    low, high = result.inertia.interval95
    assert RIG.axis.inertia is not None
    return f"{(result.inertia.value - RIG.axis.inertia.value) / ((high - low) / 2):7.2f} {result.status}"


def run(deviation: float, seconds: float, folder: Path) -> None:
    """One run and its line."""
    board = subprocess.Popen([sys.executable, __file__, "device", str(deviation)], stdout=subprocess.PIPE, text=True)
    assert board.stdout is not None
    out = folder / "run.mcap"
    out.unlink(missing_ok=True)
    order = Order(parse_reference("sine 0.8 rad 8.5 rad/s"), Compensator.paper(RIG), seconds, rehearse=False)
    try:
        require_usable(ProcessConductor(RIG, board.stdout.readline().strip()).run(order, out), out)
    finally:
        board.send_signal(signal.SIGTERM)
    left_out = float(board.stdout.readline() or "nan")
    board.wait()
    table = read_table(out.read_bytes(), str(out))
    found = compare(table.numbers("t")[0], table.numbers("host")[0])
    assert found is not None
    apart = (found.deviation - deviation) / found.spread
    corrected = error(Recording.load(out, DEFAULT))
    believed = error(Recording.load(out, DEFAULT, repairs={"device-clock": False}))
    print(
        f"{1e6 * deviation:9.0f} {1e6 * found.deviation:10.1f} ± {1e6 * found.spread:5.1f} ppm {apart:6.2f} u   "
        f"{corrected:>16s}   believed {believed:>16s}   (board late by {left_out:.3f} s)",
        flush=True,
    )


def main() -> None:
    """All deviations, so many times."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 1
    seconds = float(sys.argv[2]) if len(sys.argv) > 2 else 25.0
    print(" true, ppm      found, ppm            apart    error, half-widths, status")
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(runs):
            for deviation in DEVIATIONS:
                run(deviation, seconds, Path(folder))


if __name__ == "__main__":
    device(float(sys.argv[2])) if sys.argv[1:2] == ["device"] else main()
