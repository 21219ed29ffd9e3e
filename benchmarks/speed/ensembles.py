"""One of 128 closed loops of 25 s at 1 kHz beside a scalar C program of one, and a run simulated and identified.

The C program (gcc -O3 -march=native) locates no stop and no release; see `benchmarks/ensemble`. Nothing is yielded
where there is no gcc.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
from case import Case, Timer, processor_time

from swingid.batch import momentum_batch, plan_batch
from swingid.model.rig import Rig
from swingid.simulation.ensemble import simulate_ensemble

HERE = Path(__file__).resolve().parents[1] / "ensemble"
sys.path.insert(0, str(HERE))
import ensemble as bench  # noqa: E402  (a script beside this folder)

ASKED = {"viscous": 0.12, "stribeck": 0.25}
RUNS = 128


def cases() -> Iterator[Case]:
    """The leanest and the worst friction law without recording, then both steps of an identified run."""
    if shutil.which("gcc") is None:
        return
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        lean = bench.program("lean", HERE / "scalar_loop.c", folder)
        for law, asked in ASKED.items():
            rig = Rig.builtin("paper").changed({f"axis.friction.{k}": v for k, v in bench.LAWS[law].items()})
            bench.input_file(rig, folder)
            reference = bench.scalar(lean, folder, "0")
            yield Case(f"ensemble, {law}", "scalar C, lean", bench.ensemble(rig, "nothing", 1), reference, asked)
        rig = Rig.builtin("paper")
        bench.input_file(rig, folder)
        ours = identified(rig)
        yield Case("ensemble, simulated and identified", "scalar C, lean", ours, bench.scalar(lean, folder, "0"))


def identified(rig: Rig) -> Timer:
    """Processor time (s) of one run, simulated in an ensemble and identified by `momentum_batch`."""
    inertias = 302.2e-5 * np.linspace(0.8, 1.3, RUNS)
    simulated = partial(
        simulate_ensemble, rig, bench.reference, duration=bench.DURATION, values={"axis.inertia": inertias}, threads=1
    )
    whole = simulated()
    plan = plan_batch([whole.recording(k) for k in (0, RUNS // 2, RUNS - 1)], rig)
    del whole

    def work() -> None:
        runs = simulated(record="measured")
        momentum_batch(runs.channel("angle"), runs.channel("wheel_angle"), bench.RATE, rig, plan, threads=1)

    timer = processor_time(work)
    return lambda: timer() / RUNS
