"""Momentum and equation error side by side over coarse, noisy and slow sensors, and the coverage of their intervals.

    python benchmarks/sensors.py [grid] [coverage] [--seeds 20] [--runs 200]

grid: error of J1 in per cent, mean ± spread over seeds, Stribeck friction, 25 s of 0.8 sin 8.5 t; each seed has its own
noise and its own place of the encoders' grids. "textbook" is the form of the comparison in the theory: filtered
angles, differences and the sign of the speed, each term for itself. coverage: the 95 % interval with white noise of
1 mrad on both angles and a friction law that matches. Each log is written to a file and read back.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from functools import partial

import numpy as np

import swingid as sw
from accuracy import STRIBECK, TRUTH, Case, equation_error, logged, over_seeds, rigs

PERFECT = {"counts_per_turn": None}
SENSORS: dict[str, tuple[dict[str, object], int]] = {
    "14 bit, 1 kHz": ({}, 1),
    "12 bit, 1 kHz": ({"counts_per_turn": 4096}, 1),
    "10 bit, 1 kHz": ({"counts_per_turn": 1024}, 1),
    "8 bit, 1 kHz": ({"counts_per_turn": 256}, 1),
    "noise 1 mrad, 1 kHz": ({**PERFECT, "noise": 1e-3}, 1),
    "noise 10 mrad, 1 kHz": ({**PERFECT, "noise": 1e-2}, 1),
    "noise 100 mrad, 1 kHz": ({**PERFECT, "noise": 1e-1}, 1),
    "14 bit, 50 Hz": ({}, 20),
    "noise 10 mrad, 50 Hz": ({**PERFECT, "noise": 1e-2}, 20),
}
"""Sensors of both angles, and which rows of the 1 kHz loop are logged."""

METHODS: dict[str, tuple[str, dict[str, object]]] = {
    "momentum": ("momentum", {}),
    "equation error, own cut-off": ("equation-error", {}),
    "20 Hz": ("equation-error", {"cutoff": 20.0}),
    "instruments": ("equation-error", {"instruments": True}),
    "instruments, 20 Hz": ("equation-error", {"instruments": True, "cutoff": 20.0}),
}


def error_of(log: sw.Recording, given: sw.Rig, method: str, options: dict[str, object]) -> tuple[float, float]:
    """Error and standard uncertainty of J1 in per cent; NaN where there is no number."""
    try:
        inertia = sw.identify(log, given, method=method, **options).inertia
    except sw.errors.SwingidError:
        return np.nan, np.nan
    return 100 * (inertia.value / TRUTH - 1), 100 * (inertia.standard_uncertainty or np.nan) / TRUTH


def case_of(name: str, seed: int) -> Case:
    sensors, keep_every = SENSORS[name]
    twin, given = rigs(sensors, STRIBECK)
    zero = tuple(np.random.default_rng([1, seed]).uniform(0, given.sensors.of("angle").resolution, 2))
    return Case(twin, given, seed=seed, encoder_zero=zero, keep_every=keep_every)


def on_one_log(name: str, seed: int) -> list[tuple[float, float]]:
    """Error and uncertainty of every method, then of the textbook form (which has no uncertainty)."""
    case = case_of(name, seed)
    log = logged(case)
    found = [error_of(log, case.given, *chosen) for chosen in METHODS.values()]
    return [*found, (equation_error(case), np.nan)]


def print_grid(seeds: int) -> None:
    names = [*METHODS, "textbook, 20 Hz"]
    print(f"| sensors | {' | '.join(names)} |\n|{'---|' * (len(names) + 1)}")
    for sensors in SENSORS:
        found = np.array(over_seeds(partial(on_one_log, sensors), seeds))
        cells = []
        for errors, says in zip(found[..., 0].T, found[..., 1].T, strict=True):
            given = np.isfinite(errors)
            text = f"{np.mean(errors[given]):+.4f} ± {np.std(errors[given]):.4f}" if given.any() else "none"
            text += f" (says {np.median(says[given]):.4f})" if np.isfinite(says).any() else ""
            cells.append(text + (f", {np.sum(~given)} refused" if not given.all() else ""))
        print(f"| {sensors} | {' | '.join(cells)} |", flush=True)


def covered(names: tuple[str, ...], seed: int) -> list[tuple[float, float]]:
    """Error and uncertainty of the methods on one log with noise of 1 mrad and viscous friction."""
    twin, given = rigs({**PERFECT, "noise": 1e-3})
    case = Case(twin, given, seed=seed)
    log = logged(case)
    return [error_of(log, given, *METHODS[name]) for name in names]


def coverage(runs: int, names: Iterable[str] = METHODS) -> dict[str, tuple[float, float, float]]:
    """Share of the 95 % intervals that hold the truth, median half-width over RMSE, RMSE in per cent; by method."""
    names = tuple(names)
    found = np.array(over_seeds(partial(covered, names), runs))
    errors, half = found[..., 0], 1.959964 * found[..., 1]
    rmse = np.sqrt(np.mean(errors**2, axis=0))
    share = np.mean(np.abs(errors) <= half, axis=0)
    values = zip(share, np.median(half, axis=0) / rmse, rmse, strict=True)
    return dict(zip(names, [tuple(map(float, one)) for one in values], strict=True))


def print_coverage(runs: int) -> None:
    print("| method | 95 % interval covers | median half-width | RMSE |\n|---|---|---|---|")
    for name, (share, width, rmse) in coverage(runs).items():
        binomial = np.sqrt(share * (1 - share) / runs)
        print(f"| {name} | {100 * share:.1f} ± {100 * binomial:.1f} % | {width:.2f} x RMSE | {rmse:.4f} % |")


def main(arguments: Iterable[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", nargs="*", choices=["grid", "coverage", []])
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--runs", type=int, default=200)
    chosen = parser.parse_args(arguments)
    if not chosen.what or "grid" in chosen.what:
        print_grid(chosen.seeds)
    if not chosen.what or "coverage" in chosen.what:
        print_coverage(chosen.runs)


if __name__ == "__main__":
    main()
