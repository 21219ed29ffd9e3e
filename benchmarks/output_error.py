"""Output error: how fast beside what a user would write, how accurate, how honest.

    python benchmarks/output_error.py [ROW …] [--runs 200]

Rows: speed accuracy wrong coverage real; all by default. Logs are the twin's; identification sees log and rig only.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np

import swingid as sw
from swingid.control.compensator import Compensator
from swingid.control.references import Sine

RIG = sw.Rig.load("paper")
TRUTH = RIG.axis.inertia.value
GIVEN = RIG.changed({"axis.inertia": None, "axis.friction": None})
STRIBECK = {"coulomb": 3e-3, "viscous": 5e-4, "static": 5e-3, "stribeck_speed": 0.3}
LAWS: dict[str, tuple[dict[str, object], str]] = {
    "viscous": ({"viscous": 1.144e-3}, "viscous"),
    "Coulomb": ({"coulomb": 3e-3, "viscous": 5e-4}, "coulomb + viscous"),
    "Stribeck": (STRIBECK, "stribeck"),
    "quadratic": ({"viscous": 2e-4, "quadratic": 3e-4}, "viscous + quadratic"),
    "cubic": ({"viscous": 2e-4, "cubic": 5e-5}, "viscous + cubic"),
    "direction-dependent": (
        {"viscous_positive": 1.716e-3, "viscous_negative": 0.572e-3},
        "viscous, direction-dependent",
    ),
    "sticking": ({"coulomb": 15e-3, "viscous": 5e-4}, "coulomb + viscous"),
}
NOISE = {"sensors.counts_per_turn": None, "sensors.noise": 1e-3}


def row(what: str, measured: str, reach: str) -> None:
    print(f"| {what} | {measured} | {reach} |", flush=True)


def steady(friction: dict[str, object], seed: int = 0, **sensors: object) -> sw.Recording:
    """The 7 s after 6 s of a closed-loop run at 1 kHz."""
    rig = RIG.changed({"axis.friction": None} | {f"axis.friction.{key}": value for key, value in friction.items()})
    rig = rig.changed(sensors)
    return sw.simulate(rig, Sine(0.8, 8.5), Compensator.paper(rig), duration=13.0, seed=seed).segment(6.0, 13.0)


def error(result: sw.Result) -> float:
    return 100 * (result.inertia.value / TRUTH - 1)


def best_of(work: Callable[[], object], repeats: int) -> float:
    durations = []
    for _ in range(repeats):
        begin = time.perf_counter()
        work()
        durations.append(time.perf_counter() - begin)
    return min(durations)


def users_way(log: sw.Recording) -> tuple[float, float, int]:
    """Inertia, seconds and simulations of `solve_ivp` inside `least_squares`, both with their default settings.

    Viscous friction and four initial values beside the inertia; the voltage is looked up as it was held; steps no
    longer than a sample, or the solver would not see the voltage change.
    """
    from scipy.integrate import solve_ivp
    from scipy.optimize import least_squares

    motor, a12, a22 = RIG.drive.motor, RIG.drive.a12, RIG.drive.a22
    carried = RIG.drive.wheel.inertia.value + motor.rotor_inertia.value
    n, c1, c2, eta = (q.value for q in (motor.gear_ratio, motor.torque_per_volt, motor.back_emf, motor.efficiency))
    f2, f3, (d2, d1) = motor.viscous.value, motor.coulomb.value, motor.dead_zone
    b, start, step = RIG.axis.gravity_torque.value, log.time[0], log.time[1] - log.time[0]
    voltage, count = log.voltage, 0

    def simulated(unknowns: np.ndarray) -> np.ndarray:
        nonlocal count
        count += 1
        a11, friction = 1e-3 * unknowns[0] + carried, 1e-3 * unknowns[1]
        determinant = a11 * a22 - a12 * a12

        def rates(t: float, x: np.ndarray) -> list[float]:
            ideal = eta * (c1 * voltage[min(int((t - start) / step + 1e-9), len(voltage) - 1)] - c2 * x[3])
            torque = ideal - d1 if ideal > d1 else ideal - d2 if ideal < d2 else 0.0
            r1 = -b * np.sin(x[0]) - friction * x[1]
            r2 = n * (torque - f2 * n * x[3] - f3 * np.sign(x[3]))
            return [x[1], (a22 * r1 - a12 * r2) / determinant, x[3], (a11 * r2 - a12 * r1) / determinant]

        span = (float(log.time[0]), float(log.time[-1]))
        return solve_ivp(rates, span, unknowns[2:], t_eval=log.time, max_step=step, rtol=1e-6, atol=1e-8).y[[0, 2]]

    def residuals(unknowns: np.ndarray) -> np.ndarray:
        return (simulated(unknowns) - np.stack([log.angle, log.wheel_angle])).ravel()

    speeds = [(values[20] - values[0]) / (20 * step) for values in (log.angle, log.wheel_angle)]
    first = [3.3, 1.0, log.angle[0], speeds[0], log.wheel_angle[0], speeds[1]]
    begin = time.perf_counter()
    found = least_squares(residuals, first, x_scale=[1, 1, 0.1, 1, 1, 10])
    return 1e-3 * float(found.x[0]), time.perf_counter() - begin, count


def rows_speed(_: int) -> None:
    """The user's fit runs on the first second; its simulations take time in proportion to the log, so it is scaled."""
    log = steady({"viscous": 1.144e-3})
    laws = {
        "viscous friction": {"law": "viscous"},
        "law found by itself": {},
        "measured wheel as input": {"input": "wheel"},
    }
    durations = {}
    for name, options in laws.items():
        work = partial(sw.identify, log, GIVEN, method="output-error", **options)
        work()
        durations[name] = best_of(work, 5)
        row(f"7 s at 1 kHz, warm, {name}", f"{durations[name]:.3f} s", "0.3 s")
    cut = log.segment(6.0, 7.0)
    inertia, seconds, count = users_way(cut)
    scaled = seconds * len(log) / len(cut)
    own = durations["viscous friction"]
    what = f"solve_ivp + least_squares, 1 s of it ({count} simulations, error {100 * (inertia / TRUTH - 1):+.3f} %)"
    row(what, f"{seconds:.1f} s", "")
    row("the same scaled to 7 s, over output-error with viscous friction", f"{scaled / own:.0f} times", "100 times")


def rows_accuracy(_: int) -> None:
    for name, (friction, law) in LAWS.items():
        log = steady(friction)
        found = [
            sw.identify(log, GIVEN, method="output-error", **options)
            for options in ({"law": law}, {}, {"input": "wheel"})
        ]
        texts = [
            f"{error(result):+.5f} ± {100 * result.inertia.standard_uncertainty / TRUTH:.5f} %" for result in found
        ]
        row(f"{name}: right law; found law; wheel as input", "; ".join(texts), "0.1 %")


def rows_wrong(_: int) -> None:
    """What breaks, and whether it says so: a motor constant 5 % off, viscous friction fitted where it is Stribeck's."""
    off = GIVEN.changed({"drive.motor.torque_per_volt": 1.05 * RIG.drive.motor.torque_per_volt.value})
    viscous, stribeck = steady({"viscous": 1.144e-3}), steady(STRIBECK)
    cases = {
        "torque per volt 5 % off": (viscous, off, {"law": "viscous"}),
        "torque per volt 5 % off, wheel as input": (viscous, off, {"law": "viscous", "input": "wheel"}),
        "torque per volt 5 % off, but free": (viscous, off, {"law": "viscous", "free": "torque_per_volt"}),
        "true Stribeck, fitted viscous": (stribeck, GIVEN, {"law": "viscous"}),
        "true Stribeck, fitted viscous, wheel as input": (stribeck, GIVEN, {"law": "viscous", "input": "wheel"}),
    }
    for name, (log, rig, options) in cases.items():
        result = sw.identify(log, rig, method="output-error", **options)
        told = ", ".join(warning.code for warning in result.warnings) or "no warning"
        row(name, f"{error(result):+.3f} ± {100 * result.inertia.standard_uncertainty / TRUTH:.3f} %, {told}", "")


def covered(seed: int, **options: object) -> tuple[float, float, bool]:
    """Error and half-width of the 95 % interval (per cent), whether it covers the truth; white noise of 1 mrad."""
    rig = GIVEN.changed({"sensors.counts_per_turn": None, "sensors.noise": 1e-3})
    log = steady({"viscous": 1.144e-3}, seed=seed, **NOISE)
    result = sw.identify(log, rig, method="output-error", **options)
    low, high = result.inertia.interval95
    return error(result), 50 * (high - low) / TRUTH, low <= TRUTH <= high


def coverage(runs: int, **options: object) -> tuple[float, float, float]:
    """Share of runs (fixed seeds) whose interval covers the truth, its binomial error, median half-width over RMSE."""
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        found = list(pool.map(partial(covered, **options), range(runs), chunksize=4))
    errors, halves = np.array([f[0] for f in found]), np.array([f[1] for f in found])
    share = float(np.mean([f[2] for f in found]))
    return share, float(np.sqrt(share * (1 - share) / runs)), float(np.median(halves) / np.sqrt(np.mean(errors**2)))


def rows_coverage(runs: int) -> None:
    cases = {
        "viscous friction": {"law": "viscous"},
        "law found by itself": {},
        "wheel as input": {"law": "viscous", "input": "wheel"},
    }
    for name, options in cases.items():
        share, binomial, width = coverage(runs, **options)
        row(f"noise 1 mrad, {runs} runs, {name}: covers", f"{100 * share:.1f} ± {100 * binomial:.1f} %", "93 … 97 %")
        row("its median half-width", f"{width:.2f} x RMSE", "1.8 … 2.4 x")


def rows_real(_: int) -> None:
    here = Path(__file__).resolve().parents
    data = Path(os.environ.get("SWINGID_DATA", here[2] / "shared" / "data"))
    if not data.exists():
        print(f"(no measurements: {data} is missing)")
        return
    for name, path, published in (
        ("emps", "emps/DATA_EMPS.mat", "95.1 kg"),
        ("free_pendulum", "free_pendulum/free_swing.csv", "0.003331 kg m^2"),
    ):
        rig = sw.Rig.load(here[1] / f"examples/rigs/{name}.toml")
        result = sw.identify(sw.Recording.load(data / path, rig), rig, method="output-error")
        told = ", ".join(warning.code for warning in result.warnings) or "no warning"
        text = f"{result.inertia.value:.5g} ± {result.inertia.standard_uncertainty:.2g}, {told}"
        row(f"{name}, law {result.provenance['options']['law']}", text, published)


ROWS = {
    "speed": rows_speed,
    "accuracy": rows_accuracy,
    "wrong": rows_wrong,
    "coverage": rows_coverage,
    "real": rows_real,
}


def main(arguments: Iterable[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rows", nargs="*", choices=[*ROWS, []], metavar="ROW")
    parser.add_argument("--runs", type=int, default=200)
    chosen = parser.parse_args(arguments)
    print("| what | measured | reach |\n|---|---|---|")
    for name in chosen.rows or ROWS:
        ROWS[name](chosen.runs)


if __name__ == "__main__":
    main()
