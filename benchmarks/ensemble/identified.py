"""Runs of 25 s at 1 kHz, simulated and identified, per second: ensemble and batched estimators, all cores.

    python benchmarks/ensemble/identified.py

Inertias and friction differ from run to run. What is chosen once for all comes from four of the logs; the time of that
is not counted. "runs/s" is by the clock, "at rest" by processor time, as if all cores were free for this. Beside them
stand the error (mean and root mean square, relative), the root mean square of error over uncertainty and the share of
95 % intervals that hold the truth.
"""

from __future__ import annotations

import os
import time

import numpy as np

from swingid.batch import Batch, energy_batch, momentum_batch, plan_batch
from swingid.model.rig import Rig
from swingid.simulation.ensemble import Ensemble, simulate_ensemble

DURATION, RATE, RUNS, REPEATS = 25.0, 1000.0, 256, 5


def reference(times: np.ndarray) -> np.ndarray:
    return 0.8 * np.sin(8.5 * times)


def main() -> None:
    rig = Rig.builtin("paper")
    values = {
        "axis.inertia": 302.2e-5 * np.linspace(0.8, 1.3, RUNS),
        "axis.friction.viscous": 1.144e-3 * np.random.default_rng(1).uniform(0.5, 1.5, RUNS),
    }

    # where the grid of the counts lies is drawn: the place of a single one is no sample
    zeros = rig.sensors.of("angle").resolution * np.random.default_rng(2).random((RUNS, 2))

    def ensemble(record: str = "measured") -> Ensemble:
        return simulate_ensemble(
            rig, reference, duration=DURATION, rate=RATE, values=values, encoder_zero=zeros, record=record
        )

    whole = ensemble("all")
    plan = plan_batch([whole.recording(k) for k in (0, RUNS // 3, 2 * RUNS // 3, RUNS - 1)], rig)
    del whole

    def momentum(runs: Ensemble) -> Batch:
        return momentum_batch(runs.channel("angle"), runs.channel("wheel_angle"), RATE, rig, plan)

    def energy(runs: Ensemble) -> Batch:
        channels = (runs.channel(name) for name in ("angle", "wheel_angle", "command"))
        return energy_batch(*channels, RATE, rig, plan)

    cores = len(os.sched_getaffinity(0))
    print(f"{RUNS} runs of {DURATION:g} s at {RATE:g} Hz on {cores} cores, best of {REPEATS}")
    heads = f"{'simulate s':>12}{'identify s':>12}{'runs/s':>9}{'at rest':>9}"
    heads += f"{'mean':>10}{'rms':>9}{'rms z':>7}{'covered':>9}"
    print(f"{'method':10}{heads}")
    for name, method in (("momentum", momentum), ("energy", energy)):
        method(ensemble())
        best, least = (np.inf, 0.0), np.inf
        for _ in range(REPEATS):
            start, work = time.perf_counter(), time.process_time()
            runs = ensemble()
            middle = time.perf_counter()
            found = method(runs)
            best = min(best, (time.perf_counter() - start, middle - start))
            least = min(least, time.process_time() - work)
            del runs
        error = found.inertia / values["axis.inertia"] - 1.0
        z = (found.inertia - values["axis.inertia"]) / found.u
        print(
            f"{name:10}{best[1]:12.3f}{best[0] - best[1]:12.3f}{RUNS / best[0]:9.0f}{cores * RUNS / least:9.0f}"
            f"{np.mean(error):10.1e}{np.sqrt(np.mean(error**2)):9.1e}"
            f"{np.sqrt(np.mean(z**2)):7.2f}{np.mean(np.abs(z) < 1.96):9.3f}"
        )


if __name__ == "__main__":
    main()
