"""One closed loop of 25 s at 1 kHz: the twin's compiled kernel beside a scalar C program of the same loop.

    python benchmarks/closed_loop.py

The C program (closed_loop.c) is compiled with gcc -O3 and fed the same constants, gains and reference. Both logs must
agree. The last line is the ratio of the best times.
"""

from __future__ import annotations

import math
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np

from swingid.control.compensator import Compensator
from swingid.model.parameters import rig_vector
from swingid.model.rig import Rig
from swingid.simulation import simulate_run, twin

DURATION, RATE, REPEATS = 25.0, 1000.0, 20
LAWS = {
    "viscous": {},
    "stribeck": {"coulomb": 3e-3, "static": 5e-3, "stribeck_speed": 0.05},
    "lugre": {"coulomb": 3e-3, "lugre": {"bristle_stiffness": 30.0, "bristle_damping": 0.01}},
}
AGREEMENT = 1e-9


def reference(times: np.ndarray) -> np.ndarray:
    return 0.8 * np.sin(8.5 * times)


def kernel(rig: Rig) -> tuple[float, np.ndarray]:
    """Best time (s) of the compiled loop alone, and its log (rows, 4)."""
    best, inner = math.inf, twin.closed_loop

    def timed(*arguments: object) -> object:
        nonlocal best
        start = time.perf_counter()
        counts = inner(*arguments)
        best = min(best, time.perf_counter() - start)
        return counts

    twin.closed_loop = timed
    try:
        for _ in range(REPEATS + 1):
            run = simulate_run(rig, reference, duration=DURATION, rate=RATE)
    finally:
        twin.closed_loop = inner
    log = run.recording
    return best, np.column_stack([log.angle, log.wheel_angle, log.voltage, log.adaptive_gain])


def program(rig: Rig, folder: Path) -> tuple[float, np.ndarray]:
    """Best time (s) and log (rows, 4) of the C program."""
    rows = round(DURATION * RATE) + 1
    head = [rows, RATE, rig.drive.motor.voltage_limit, rig.sensors.of("angle").resolution]
    gains = Compensator.paper(rig).parameters(1.0 / RATE)
    grid = reference(np.arange(rows) / RATE)
    np.concatenate([head, rig_vector(rig), gains, grid]).tofile(folder / "in")
    command = [folder / "closed_loop", folder / "in", folder / "out", str(REPEATS)]
    seconds = float(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    return seconds, np.fromfile(folder / "out").reshape(rows, 4)


def main() -> None:
    source = Path(__file__).with_suffix(".c")
    ratios = []
    print(
        f"one closed loop, {DURATION:g} s at {RATE:g} Hz, gains of the experiment, 14-bit encoders; best of {REPEATS}"
    )
    print(f"{'friction':10} {'kernel ms':>10} {'C -O3 ms':>10} {'ratio':>7} {'largest difference of the logs':>32}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        subprocess.run(["gcc", "-O3", "-o", folder / "closed_loop", source, "-lm"], check=True)
        for law, friction in LAWS.items():
            rig = Rig.builtin("paper").changed({f"axis.friction.{key}": value for key, value in friction.items()})
            ours, log = kernel(rig)
            theirs, other = program(rig, folder)
            difference = float(np.abs(log - other).max())
            if difference > AGREEMENT:
                raise SystemExit(f"{law}: the logs differ by {difference:g}")
            ratios.append(ours / theirs)
            print(f"{law:10} {1e3 * ours:10.2f} {1e3 * theirs:10.2f} {ratios[-1]:7.2f} {difference:32.1e}")
    print(f"ratio {max(ratios):.2f}")


if __name__ == "__main__":
    main()
