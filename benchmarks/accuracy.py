"""How accurate the methods are: every figure that the README quotes, measured.

    python benchmarks/accuracy.py [ROW …] [--seeds 200]

Rows: ideal laws sticking sensors imperfect coverage curve real; all by default. Each log is made by the twin, written
to a file and read back; identification sees the file and the rig only. Errors are of J1, in per cent of the truth.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

import swingid as sw
from swingid.control.compensator import Compensator

RIG = sw.Rig.load("paper")
TRUTH = RIG.axis.inertia.value
REFERENCE = "sine 0.8 rad 8.5 rad/s"
STRIBECK = {"coulomb": 2e-3, "static": 4e-3, "stribeck_speed": 0.3}
LAWS: dict[str, dict[str, object]] = {
    "viscous": {},
    "Coulomb": {"coulomb": 2e-3},
    "Stribeck": STRIBECK,
    "quadratic": {"viscous": 2e-4, "quadratic": 4e-4},
    "cubic": {"viscous": 2e-4, "cubic": 6e-5},
    "direction-dependent": {"viscous": None, "viscous_positive": 1.716e-3, "viscous_negative": 0.572e-3},
    "LuGre, bristles 1e-4 rad": STRIBECK | {"lugre": {"bristle_stiffness": 20.0, "bristle_damping": 0.05}},
    "LuGre, bristles 1e-3 rad": {"coulomb": 3e-3, "lugre": {"bristle_stiffness": 3.0, "bristle_damping": 0.01}},
    "sticking": {"coulomb": 15e-3, "static": 20e-3},
    "8 x viscous": {"viscous": 9.152e-3},
}
STICKS = {"coulomb": 40e-3, "static": 60e-3}
PAPER_TIMES = (9.023, 9.413, 9.433, 9.823)


@dataclass(frozen=True)
class Case:
    """A log to make and identify: rig of the twin, rig that identification is given, and how the twin runs."""

    twin: sw.Rig
    given: sw.Rig
    rate: float = 1000.0
    seed: int = 0
    draw: bool = False
    ideal_gains: bool = False
    encoder_zero: tuple[float, float] = (0.0, 0.0)
    keep_every: int = 1
    reference: str = REFERENCE


def rigs(sensors: dict[str, object] | None = None, friction: dict[str, object] | None = None) -> tuple[sw.Rig, sw.Rig]:
    """The twin's rig and the one identification is given, which does not have the friction."""
    given = RIG.changed({f"sensors.{key}": value for key, value in (sensors or {}).items()})
    return given.changed({f"axis.friction.{key}": value for key, value in (friction or {}).items()}), given


def logged(case: Case) -> sw.Recording:
    """The log of a case, through a file."""
    step = 1 / case.rate
    gains = Compensator.paper_simulation if case.ideal_gains else Compensator.paper
    controller = gains(case.twin, sample_time=step)
    log = sw.simulate(
        case.twin,
        sw.parse_reference(case.reference),
        controller,
        duration=25.0,
        rate=case.rate,
        seed=case.seed,
        draw=case.draw,
        encoder_zero=case.encoder_zero,
    )
    if case.keep_every > 1:
        every = slice(None, None, case.keep_every)
        log = sw.Recording(
            time=log.time[every], angle=log.angle[every], wheel_angle=log.wheel_angle[every], voltage=log.voltage[every]
        )
    with tempfile.TemporaryDirectory() as folder:
        path = log.save(Path(folder) / "run.parquet", case.given)
        return sw.Recording.load(path, case.given)


def identified(case: Case, method: str = "momentum", **options: object) -> tuple[float, float, bool, bool]:
    """Error and standard uncertainty (per cent), whether the interval covers the truth, whether there is a warning."""
    result = sw.identify(logged(case), case.given, method=method, **options)
    inertia = result.inertia
    low, high = inertia.interval95 or (np.nan, np.nan)
    spread = 100 * (inertia.standard_uncertainty or np.nan) / TRUTH
    return 100 * (inertia.value / TRUTH - 1), spread, low <= TRUTH <= high, bool(result.warnings)


def equation_error(case: Case, cutoff: float = 20.0) -> float:
    """Error of the robotics standard: Butterworth zero-phase, central differences, least squares, viscous + Coulomb."""
    from scipy.signal import butter, filtfilt

    log = logged(case)
    steady = log.segment(6.0, 25.0)
    rate = case.rate / case.keep_every
    b, a = butter(4, cutoff, fs=rate)
    step = 1 / rate

    def smooth(values: np.ndarray) -> np.ndarray:
        return filtfilt(b, a, values)

    q1, q2 = smooth(steady.angle), smooth(steady.wheel_angle)
    speed, a1, a2 = (
        np.gradient(q1, step),
        np.gradient(np.gradient(q1, step), step),
        np.gradient(np.gradient(q2, step), step),
    )
    inside = slice(int(0.5 * rate), -int(0.5 * rate))
    columns = np.column_stack([a1, speed, np.sign(speed)])[inside]
    target = -(RIG.drive.a12 * a2 + RIG.axis.gravity_torque.value * np.sin(q1))[inside]
    a11 = np.linalg.lstsq(columns, target, rcond=None)[0][0]
    carried = RIG.drive.wheel.inertia.value + RIG.drive.motor.rotor_inertia.value
    return 100 * ((a11 - carried) / TRUTH - 1)


def over_seeds(work: Callable[[int], tuple], seeds: int) -> list[tuple]:
    """`work` of every seed, on all cores."""
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(work, range(seeds), chunksize=4))


def row(what: str, measured: str, reach: str) -> None:
    print(f"| {what} | {measured} | {reach} |", flush=True)


def rows_ideal(_: int) -> None:
    twin, given = rigs({"counts_per_turn": None})
    case = Case(twin, given, rate=10_000.0, ideal_gains=True)
    printed = identified(case, "energy", variant="printed", nodes=PAPER_TIMES, work="held")[0]
    row("paper's ideal simulation and times, energy as printed, held work", f"{printed:+.3f} %", "0.2 % (paper: 1.4 %)")
    row("same log, momentum", f"{identified(case)[0]:+.5f} %", "0.001 %")
    row("same log, energy (default)", f"{identified(case, 'energy')[0]:+.4f} %", "0.1 %")


def rows_laws(_: int) -> None:
    for name, friction in LAWS.items():
        case = Case(*rigs(friction=friction))
        momentum, spread, _, warned = identified(case)
        row(f"{name}: momentum", f"{momentum:+.4f} ± {spread:.4f} %{' warned' if warned else ''}", "0.02 %")
        row(f"{name}: energy", f"{identified(case, 'energy')[0]:+.3f} %", "0.3 %")


def rows_sticking(_: int) -> None:
    error, spread, _, warned = identified(Case(*rigs(friction=STICKS)))
    row("an axis that sticks at every turning point: momentum", f"{error:+.4f} ± {spread:.4f} %", "0.1 % or a warning")
    if warned:
        print("(with a warning)")


SENSORS = {
    "noise 10 mrad, 1 kHz": ({"counts_per_turn": None, "noise": 0.01}, 1, "0.03 %"),
    "8 bit, 1 kHz": ({"counts_per_turn": 256}, 1, "0.2 %"),
    "14 bit, 50 Hz": ({}, 20, "0.03 %"),
    "noise 10 mrad, 50 Hz": ({"counts_per_turn": None, "noise": 0.01}, 20, "0.15 %"),
}


def coarse(name: str, seed: int) -> tuple[float, float, float]:
    """Errors of momentum and of equation error, and momentum's uncertainty, for one seed of a coarse sensor.

    The loop runs at 1 kHz on these sensors; a slow log keeps every twentieth row of it.
    """
    sensors, keep_every, _ = SENSORS[name]
    twin, given = rigs(sensors, STRIBECK)
    # each seed has its own place of the encoders' grids
    zero = tuple(np.random.default_rng([1, seed]).uniform(0, given.sensors.of("angle").resolution, 2))
    case = Case(twin, given, seed=seed, encoder_zero=zero, keep_every=keep_every)
    error, spread, _, _ = identified(case)
    return error, equation_error(case), spread


def rows_sensors(seeds: int) -> None:
    seeds = min(seeds, 100)
    for name, (_, _, reach) in SENSORS.items():
        found = np.array(over_seeds(partial(coarse, name), seeds))
        momentum, standard = np.sqrt(np.mean(found[:, :2] ** 2, axis=0))
        text = f"{momentum:.4f} % (says {np.median(found[:, 2]):.4f} %); equation error at 20 Hz {standard:.3f} %"
        row(f"{name}: momentum, RMSE of {seeds} seeds", text, reach)


def imperfect(seed: int) -> tuple[float, float, bool, bool]:
    sensors = {"nonlinearity": "0.1 deg", "jitter": 1e-4, "wheel": {"latency": "0 ± 0.5 ms"}}
    twin, given = rigs(sensors, STRIBECK)
    motor = {
        f"drive.motor.{key}": 1.05 * getattr(given.drive.motor, key).value
        for key in ("torque_per_volt", "viscous", "coulomb")
    }
    return identified(Case(twin, given.changed(motor), seed=seed, draw=True))


def drawn(seed: int) -> tuple[float, float, bool, bool]:
    sensors = {"nonlinearity": "0.1 deg", "latency": "0 ± 0.5 ms", "wheel": {"latency": "0 ± 0.5 ms"}}
    twin, given = rigs(sensors, STRIBECK)
    gravity = {"axis.gravity_torque": "78e-3 ± 0.5 % N*m"}
    return identified(Case(twin.changed(gravity), given.changed(gravity), seed=seed, draw=True))


def rows_imperfect(seeds: int) -> None:
    errors = np.array([found[0] for found in over_seeds(imperfect, seeds)])
    text = f"{np.quantile(np.abs(errors), 0.95):.3f} % (RMSE {np.sqrt(np.mean(errors**2)):.3f} %)"
    what = "nonlinearity 0.1°, jitter 100 µs, wheel latency 0.5 ms, Stribeck, motor off by 5 %"
    row(f"{what}: momentum, 95th percentile of {seeds} seeds", text, "0.15 %")


def rows_coverage(seeds: int) -> None:
    found = over_seeds(drawn, seeds)
    errors, spreads = np.array([f[0] for f in found]), np.array([f[1] for f in found])
    covered, rmse = np.mean([f[2] for f in found]), np.sqrt(np.mean(errors**2))
    binomial = np.sqrt(covered * (1 - covered) / seeds)
    row(f"95 % interval over {seeds} seeds covers", f"{100 * covered:.1f} ± {100 * binomial:.1f} %", "92 … 98 %")
    row("its median half-width", f"{np.median(1.96 * spreads) / rmse:.2f} x RMSE ({rmse:.3f} %)", "2.5 x")


def rows_curve(_: int) -> None:
    twin, given = rigs(friction=STRIBECK | {"quadratic": 2e-4})
    curve = sw.identify(logged(Case(twin, given)), given).details.friction
    v = curve.speeds
    viscous = RIG.axis.friction.viscous.value
    truth = np.sign(v) * (2e-3 + 2e-3 * np.exp(-((v / 0.3) ** 2))) + viscous * v + 2e-4 * v * np.abs(v)
    # the curve's nodes are joined by straight lines; next to zero the first node stands for all speeds below the next
    worst = np.max(np.abs(curve.torques - truth)[np.abs(v) > 0.1])
    row(
        "friction curve, Stribeck + quadratic, above 0.1 rad/s",
        f"{100 * worst / truth.max():.1f} % of full scale",
        "3 %",
    )


def rows_real(_: int) -> None:
    data = Path(os.environ.get("SWINGID_DATA", Path(__file__).resolve().parents[2] / "shared" / "data"))
    if not data.exists():
        print(f"(no measurements: {data} is missing)")
        return
    rig = sw.Rig.load(Path(__file__).parents[1] / "examples/rigs/emps.toml")
    result = sw.identify(sw.Recording.load(data / "emps/DATA_EMPS.mat", rig), rig)
    mass = result.inertia
    row("EMPS: mass", f"{mass.value:.2f} ± {mass.standard_uncertainty:.2f} kg", "95.1 ± 0.5, interval contains 95.1")
    published = {
        "coulomb_positive": 20.14,
        "coulomb_negative": 20.63,
        "viscous_positive": 166.7,
        "viscous_negative": 240.4,
    }
    for name, value in published.items():
        row(
            f"EMPS: {name}",
            f"{result.parameters[name].value:.5g} ({result.parameters[name].value / value - 1:+.1%})",
            f"{value} within 3 %",
        )
    rig = sw.Rig.load(Path(__file__).parents[1] / "examples/rigs/free_pendulum.toml")
    result = sw.identify(sw.Recording.load(data / "free_pendulum/free_swing.csv", rig), rig)
    row(
        "free pendulum: J",
        f"{result.inertia.value:.6f} ({result.inertia.value / 0.003331 - 1:+.2%})",
        "0.003331 within 0.35 %",
    )
    loss = result.details.extra["loss_unexplained"]
    row("free pendulum: loss per swing unexplained", f"{loss:.1%}", "3 %")


ROWS = {
    "ideal": rows_ideal,
    "laws": rows_laws,
    "sticking": rows_sticking,
    "sensors": rows_sensors,
    "imperfect": rows_imperfect,
    "coverage": rows_coverage,
    "curve": rows_curve,
    "real": rows_real,
}


def main(arguments: Iterable[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rows", nargs="*", choices=[*ROWS, []], metavar="ROW")
    parser.add_argument("--seeds", type=int, default=200)
    chosen = parser.parse_args(arguments)
    print("| what | measured | reach |\n|---|---|---|")
    for name in chosen.rows or ROWS:
        ROWS[name](chosen.seeds)


if __name__ == "__main__":
    main()
