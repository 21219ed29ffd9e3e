"""Many closed loops of 25 s at 1 kHz: the ensemble's kernel beside scalar C programs of the same loop.

    python benchmarks/ensemble/ensemble.py        (make bench-ensemble)

Two C programs, gcc -O3 -march=native, one run after another on one core: `scalar_loop.c`, lean, with the classical
Runge-Kutta step and nothing located; `../closed_loop.c`, which does all that the twin does. Ours: `simulate_ensemble`
as users call it, packing and Python included, on one thread and on all. Everything is measured in turns, the least of
`REPEATS` counts. Runs are compared with `simulate`. The last line is our time per run on one thread over that of the
lean program, without recording.
"""

from __future__ import annotations

import os
import re
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numba
import numpy as np

from swingid.control.compensator import Compensator
from swingid.model.parameters import rig_vector
from swingid.model.rig import Rig
from swingid.numerics.vectors import widest
from swingid.simulation import simulate
from swingid.simulation.ensemble import simulate_ensemble
from swingid.simulation.ensemble.lanes import BLOCK
from swingid.simulation.ensemble.motion import move_all

DURATION, RATE, RUNS, REPEATS = 25.0, 1000.0, 128, 5
ROWS = round(DURATION * RATE) + 1
AGREEMENT = 1e-9
LAWS = {
    "viscous": {},
    "quadratic": {"quadratic": 1e-4},
    "coulomb": {"coulomb": 3e-3},
    "stribeck": {"coulomb": 3e-3, "static": 5e-3, "stribeck_speed": 0.05},
}
HERE = Path(__file__).parent


def reference(times: np.ndarray) -> np.ndarray:
    return 0.8 * np.sin(8.5 * times)


@numba.njit(error_model="numpy", fastmath={"contract", "nsz"})
def step_of_block(block: np.ndarray) -> int:
    widest()
    return move_all(block[0]["rows"], None, None)


def vector_width() -> str:
    """Bits of the processor's vector registers by its flags, and what of them the compiled kernel uses."""
    flags = set(re.findall(r"\S+", re.search(r"^flags.*$", Path("/proc/cpuinfo").read_text(), re.M)[0]))
    bits = 512 if "avx512f" in flags else 256 if "avx2" in flags else 128
    step_of_block(np.zeros(1, BLOCK))  # compiled afresh: numba shows no code that comes from its cache
    code = "\n".join(step_of_block.inspect_asm().values())
    used = {name: len(re.findall(rf"^\s+v\w+pd\s.*%{name}", code, re.M)) for name in ("zmm", "ymm")}
    return (
        f"processor: {bits} bit vectors, {bits // 64} numbers of 64 bits; "
        f"numba's code of a step: {used['zmm']} instructions on 512 bits, {used['ymm']} on 256"
    )


def program(name: str, source: Path, folder: Path) -> Path:
    subprocess.run(["gcc", "-O3", "-march=native", "-o", folder / name, source, "-lm"], check=True)
    return folder / name


def scalar(binary: Path, folder: Path, *channels: str) -> Callable[[], float]:
    """Seconds of one run of a C program, as it says itself."""
    return lambda: float(
        subprocess.run([binary, folder / "in", folder / "out", "2", *channels], check=True, capture_output=True).stdout
    )


def ensemble(rig: Rig, record: str, threads: int) -> Callable[[], float]:
    """Seconds of one run out of an ensemble of `RUNS`: of this thread alone, or of the clock where there are more."""
    clock = time.thread_time if threads == 1 else time.perf_counter
    inertias = 302.2e-5 * np.linspace(0.7, 1.5, RUNS)
    pages = simulate_ensemble(rig, reference, duration=DURATION, record=record, values={"axis.inertia": inertias})
    del pages

    def timed() -> float:
        start = clock()
        simulate_ensemble(
            rig, reference, duration=DURATION, record=record, values={"axis.inertia": inertias}, threads=threads
        )
        return (clock() - start) / RUNS

    return timed


def difference(rig: Rig) -> float:
    """Largest difference of three runs from `simulate`, in rad and V."""
    inertias, worst = 302.2e-5 * np.linspace(0.7, 1.5, 40), 0.0
    runs = simulate_ensemble(rig, reference, duration=DURATION, values={"axis.inertia": inertias})
    for k in (0, 20, 39):
        own, alone = (
            runs.recording(k),
            simulate(rig.changed({"axis.inertia": inertias[k]}), reference, duration=DURATION),
        )
        pairs = ((own.angle, alone.angle), (own.wheel_angle, alone.wheel_angle), (own.voltage, alone.voltage))
        worst = max(worst, *(float(np.abs(a - b).max()) for a, b in pairs))
    if worst > AGREEMENT:
        raise SystemExit(f"the ensemble differs from simulate by {worst:g}")
    return worst


def input_file(rig: Rig, folder: Path) -> None:
    head = [ROWS, RATE, rig.drive.motor.voltage_limit, rig.sensors.of("angle").resolution]
    gains = Compensator.paper(rig).parameters(1.0 / RATE)
    np.concatenate([head, rig_vector(rig), gains, reference(np.arange(ROWS) / RATE)]).tofile(folder / "in")


def main() -> None:
    cores = len(os.sched_getaffinity(0))
    print(f"{RUNS} closed loops of {DURATION:g} s at {RATE:g} Hz, 14-bit encoders; ns per step, least of {REPEATS}")
    ratios: dict[str, tuple[float, float]] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        lean, full = (
            program("lean", HERE / "scalar_loop.c", folder),
            program("full", HERE.parent / "closed_loop.c", folder),
        )
        heads = ["C lean", "C lean+log", "C full", "ours", "ours+log", f"ours {cores} thr.", "ratio", "ratio+log"]
        print(f"{'friction':10}" + "".join(f"{head:>13}" for head in heads) + f"{'from simulate':>15}")
        for law, friction in LAWS.items():
            rig = Rig.builtin("paper").changed({f"axis.friction.{key}": value for key, value in friction.items()})
            input_file(rig, folder)
            worst = difference(rig)
            timers = [scalar(lean, folder, "0"), scalar(lean, folder, "3"), scalar(full, folder)]
            timers += [ensemble(rig, "nothing", 1), ensemble(rig, "measured", 1), ensemble(rig, "nothing", cores)]
            least = np.min([[timer() for timer in timers] for _ in range(REPEATS)], axis=0)
            ratios[law] = float(least[3] / least[0]), float(least[4] / least[1])
            cells = "".join(f"{1e9 * seconds / ROWS:13.1f}" for seconds in least)
            print(f"{law:10}{cells}{ratios[law][0]:13.3f}{ratios[law][1]:13.3f}{worst:15.1e}")
    print("C lean locates nothing; C full and ours locate every stop and release")
    print(vector_width())
    worst = [max(ratio[k] for ratio in ratios.values()) for k in range(2)]
    print(f"worst of these laws: ratio {worst[0]:.3f}, with recording {worst[1]:.3f}")
    print(f"ratio with recording {ratios['viscous'][1]:.3f}")
    print(f"ratio {ratios['viscous'][0]:.3f}")


if __name__ == "__main__":
    main()
