"""How well a motor is calibrated: errors, intervals and time over kinds of tests and sensors.

    python benchmarks/calibrate.py [--seeds 100]

Each log is made by the twin with the paper's motor; calibration starts from constants that are 5 % wrong. Errors in
per cent of the truth: root mean square over the seeds; coverage: share of the 95 % intervals that hold the truth.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np

import swingid as sw
from swingid.control.references import Sine

PAPER = sw.Rig.builtin("paper")
MOTOR = PAPER.drive.motor
ETA, GEAR = MOTOR.efficiency.value, MOTOR.gear_ratio.value
TRUTH = {
    "motor.gain": ETA * MOTOR.torque_per_volt.value,
    "motor.damping": ETA * MOTOR.back_emf.value + GEAR * MOTOR.viscous.value,
    "motor.breakaway_positive": MOTOR.coulomb.value + MOTOR.dead_zone[1],
    "motor.breakaway_negative": MOTOR.coulomb.value - MOTOR.dead_zone[0],
    "motor.coulomb": MOTOR.coulomb.value,
    "motor.back_emf": MOTOR.back_emf.value,
}
OFF = {
    "drive.motor.torque_per_volt": 1.05 * MOTOR.torque_per_volt.value,
    "drive.motor.viscous": 0.95 * MOTOR.viscous.value,
    "drive.motor.coulomb": 1.05 * MOTOR.coulomb.value,
    "axis.inertia": None,
    "axis.friction": None,
}
PARTS = ((3.0, 1.1), (2.5, 2.9), (2.0, 7.3), (1.0, 19.0))


def voltage(rate: float, seed: int, duration: float = 10.0) -> np.ndarray:
    """A multi-harmonic voltage whose phases the seed shifts."""
    t = np.arange(int(duration * rate) + 1) / rate
    return sum(a * np.sin(w * t + (1.7 + 0.37 * seed) * k) for k, (a, w) in enumerate(PARTS))


def clamped(rig: sw.Rig, rate: float, seed: int) -> sw.Recording:
    """A voltage test with the rod held by a friction that never lets go."""
    held = rig.changed({"axis.friction": {"coulomb": 10.0}})
    return sw.simulate(held, duration=10, rate=rate, seed=seed, drive=voltage(rate, seed))


def free_rod(rig: sw.Rig, rate: float, seed: int) -> sw.Recording:
    """The same voltage with the rod free to swing."""
    return sw.simulate(rig, duration=10, rate=rate, seed=seed, drive=voltage(rate, seed))


def closed_loop(rig: sw.Rig, rate: float, seed: int) -> sw.Recording:
    """The paper's identification run itself."""
    return sw.simulate(rig, Sine(0.8, 8.5, 0.1 * seed), duration=12, rate=rate, seed=seed)


CASES: dict[str, tuple[Callable[..., sw.Recording], dict[str, object], float]] = {
    "clamped, 14 bit, 1 kHz": (clamped, {"counts_per_turn": 16384}, 1000),
    "clamped, 10 bit, 1 kHz": (clamped, {"counts_per_turn": 1024}, 1000),
    "clamped, 1 mrad, 1 kHz": (clamped, {"noise": 1e-3}, 1000),
    "clamped, 14 bit, 50 Hz": (clamped, {"counts_per_turn": 16384}, 50),
    "clamped, 0.1 deg, 0.3 ms": (clamped, {"nonlinearity": "0.1 deg", "latency": "0 ± 0.3 ms"}, 1000),
    "free rod, 14 bit": (free_rod, {"counts_per_turn": 16384}, 1000),
    "closed loop, 14 bit": (closed_loop, {"counts_per_turn": 16384}, 1000),
}


def row(make: Callable[..., sw.Recording], sensors: dict[str, object], rate: float, seeds: int) -> str:
    """One row of the table."""
    rig = PAPER.changed({"sensors": sensors})
    errors: dict[str, list[float]] = {name: [] for name in TRUTH}
    inside: list[bool] = []
    took = []
    for seed in range(seeds):
        log = make(rig, rate, seed)
        start = time.perf_counter()
        result = sw.calibrate(log, rig.changed(OFF)).result
        took.append(time.perf_counter() - start)
        for name, true in TRUTH.items():
            if name in result.parameters:
                p = result.parameters[name]
                errors[name].append(100 * (p.value / true - 1))
                inside.append(p.interval95[0] <= true <= p.interval95[1])
    cells = [
        f"{np.sqrt(np.mean(np.square(e))):>10.2g}" if len(e) > seeds / 2 else f"{'—':>10}" for e in errors.values()
    ]
    share = np.mean(inside)
    return "".join(cells) + f"{100 * share:>9.1f} %{np.median(took):>8.2f} s"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=100)
    seeds = parser.parse_args().seeds
    names = ("gain", "damping", "break +", "break -", "coulomb", "back-EMF")
    print(f"{'':26}" + "".join(f"{name:>10}" for name in names) + f"{'coverage':>11}{'time':>10}")
    for name, (make, sensors, rate) in CASES.items():
        print(f"{name:26}" + row(make, sensors, rate, seeds), flush=True)


if __name__ == "__main__":
    main()
