"""All methods side by side: right and wrong models, coverage of intervals, real logs; as a table.

    python benchmarks/methods.py [right wrong coverage doubt real] [--runs N]

"coverage" takes N runs (default 1000) on all cores, some minutes; "doubt", what each method finds hard, 40 of each.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

# the matrices here are small, and every core has a process of its own
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

import swingid as sw
from swingid.methods.table import METHODS
from swingid.simulation.ensemble import simulate_ensemble
from swingid.study.compare import compare
from swingid.study.experiment import encoder_places, through_file
from swingid.study.trials import Expectation

PAPER = sw.Rig.load("paper")
MOTION = sw.parse_reference("sine 0.8 rad 8.5 rad/s")
STRIBECK = {"viscous": 5e-4, "coulomb": 3e-3, "static": 5e-3, "stribeck_speed": 0.3}
VISCOUS = {"viscous": 1.144e-3}
PROJECT = Path(__file__).resolve().parents[1]
PIECE = 25
"""Runs that one process makes side by side."""

REACH = {"energy": "0.3 %", "backstepping": "1 %"}


def row(*cells: str) -> None:
    print("| " + " | ".join(cells) + " |", flush=True)


def twin(friction: Mapping[str, object], **sensors: object) -> sw.Rig:
    law = {"axis.friction": None} | {f"axis.friction.{key}": value for key, value in friction.items()}
    return PAPER.changed({**law, **{f"sensors.{key}": value for key, value in sensors.items()}})


def written(rig: sw.Rig, told: sw.Rig) -> sw.Recording:
    """What a lab would have: a file, read with a rig that knows neither inertia nor friction."""
    run = sw.simulate(rig, MOTION, sw.Compensator.paper(rig), duration=25.0, rate=1000.0, seed=1)
    with tempfile.TemporaryDirectory() as folder:
        return sw.Recording.load(run.save(Path(folder) / "run.parquet", told), told)


def told_of(rig: sw.Rig, **changes: object) -> sw.Rig:
    return rig.changed({"axis.inertia": None, "axis.friction": None, **changes})


def errors(log: sw.Recording, rig: sw.Rig, options: Mapping[str, Mapping[str, object]]) -> dict[str, str]:
    """Error ± claimed standard uncertainty of every method, and its warnings."""
    truth = PAPER.axis.inertia.value
    found = {}
    for method in METHODS:
        try:
            result = sw.identify(log, rig, method, **options.get(method, {}))
        except sw.errors.SwingidError as error:
            found[method] = f"refused ({error.code})"
            continue
        u = result.inertia.standard_uncertainty
        claimed = "" if u is None else f" ± {100 * u / truth:.2g}"
        codes = ", ".join(dict.fromkeys(w.code for w in result.warnings))
        found[method] = f"{100 * (result.inertia.value / truth - 1):+.4f}{claimed} %" + (f" ({codes})" if codes else "")
    return found


def rows_right(_: int) -> None:
    row("twin, 14 bit, exact motor constants", "friction", *METHODS)
    row(*["---"] * (2 + len(METHODS)))
    row("reach", "", *(REACH.get(method, "0.1 %") for method in METHODS))
    laws = {"viscous": (VISCOUS, "viscous"), "Stribeck": (STRIBECK, "stribeck")}
    for name, (friction, law) in laws.items():
        rig = twin(friction)
        right = {
            "output-error": {"law": law},
            "equation-error": {"friction": law},
        }
        row(
            "right law given" if law == "viscous" else "given where the method can",
            name,
            *errors(written(rig, told_of(rig)), told_of(rig), right).values(),
        )
        row("default options", name, *errors(written(rig, told_of(rig)), told_of(rig), {}).values())


def rows_wrong(_: int) -> None:
    row("twin, 14 bit", *METHODS)
    row(*["---"] * (1 + len(METHODS)))
    rig = twin(VISCOUS)
    log = written(rig, told_of(rig))
    for key in ("torque_per_volt", "efficiency"):
        off = told_of(rig, **{f"drive.motor.{key}": 1.05 * getattr(rig.drive.motor, key).value})
        row(f"drive.motor.{key} 5 % too high", *errors(log, off, {}).values())
    rig = twin(STRIBECK)
    forced = {"output-error": {"law": "viscous"}, "equation-error": {"friction": "viscous"}}
    row("viscous friction assumed, Stribeck true", *errors(written(rig, told_of(rig)), told_of(rig), forced).values())


VISCOUS_LAW: dict[str, dict[str, object]] = {
    "momentum": {},
    "energy": {},
    "output-error": {"law": "viscous"},
    "equation-error": {"instruments": True, "friction": "viscous"},
}
SENSORS: dict[str, tuple[dict[str, object], tuple[str, ...], str]] = {
    "white noise 1 mrad": ({"counts_per_turn": None, "noise": 1e-3}, tuple(VISCOUS_LAW), "93 … 97 %, 1.8 … 2.4 x"),
    "14-bit quantisation": ({"counts_per_turn": 16384}, ("momentum", "output-error"), ">= 93 %, <= 0.05 %"),
}


def covered(seeds: Sequence[int], case: str) -> list[dict[str, tuple[float, float, str]]]:
    """Relative error, half-width of the interval and refusal of each method, for one log per seed.

    The loops run side by side as one ensemble; where the grid of an encoder lies is drawn. Each log is written to a
    file and read back by a rig that knows neither inertia nor friction.
    """
    sensors, methods, _ = SENSORS[case]
    rig = twin(VISCOUS, **sensors)
    told, truth = told_of(rig), PAPER.axis.inertia.value
    grids = [rig.sensors.of(channel).resolution for channel in ("angle", "wheel")]
    zeros = np.array([np.random.default_rng([seed, 1]).random(2) - 0.5 for seed in seeds]) * grids
    controller = sw.Compensator.paper(rig)
    ensemble = simulate_ensemble(
        rig, MOTION, controller, duration=15.0, seeds=list(seeds), encoder_zero=zeros, threads=1
    )
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for k in range(len(seeds)):
            log = sw.Recording.load(ensemble.recording(k).save(Path(folder) / "run.parquet", told), told)
            answers = {}
            for method in methods:
                try:
                    inertia = sw.identify(log, told, method, **VISCOUS_LAW[method]).inertia
                except sw.errors.SwingidError as error:
                    answers[method] = float("nan"), float("nan"), error.code
                    continue
                low, high = inertia.interval95
                answers[method] = inertia.value / truth - 1, (high - low) / 2 / truth, ""
            found.append(answers)
    return found


def rows_coverage(runs: int) -> None:
    row("coverage over", "method", "covers", "median half-width", "RMSE", "reach")
    row(*["---"] * 6)
    pieces = [range(first, min(first + PIECE, runs)) for first in range(0, runs, PIECE)]
    for case, (_, methods, reach) in SENSORS.items():
        covered(range(1), case)  # kernels are compiled once, here
        with ProcessPoolExecutor(os.cpu_count()) as pool:
            found = [one for part in pool.map(partial(covered, case=case), pieces) for one in part]
        for method in methods:
            errors, halves, refused = zip(*(one[method] for one in found), strict=True)
            refusals = dict(Counter(code for code in refused if code))
            e = Expectation(method, np.array(errors), np.array(halves), refusals, {})
            share, error = e.coverage
            row(
                f"{case}, {e.answered} runs",
                method,
                f"{100 * share:.1f} ± {100 * error:.1f} %",
                f"{e.half_width / e.rmse:.2f} x RMSE ({100 * e.half_width:.4f} %)",
                f"{100 * e.rmse:.4f} %",
                reach,
            )


HIDDEN: dict[str, dict[str, object]] = {
    "viscous": VISCOUS,
    "Coulomb": {"viscous": 5e-4, "coulomb": 3e-3},
    "Stribeck": STRIBECK,
    "quadratic": {"viscous": 2e-4, "quadratic": 3e-4},
    "by direction": {"viscous_positive": 1.716e-3, "viscous_negative": 0.572e-3},
    "LuGre": {
        "viscous": 5e-4,
        "coulomb": 3e-3,
        "lugre": {"bristle_stiffness": 3.0, "bristle_damping": 1e-3},
    },
    "sticks at reversals": {"viscous": 5e-4, "coulomb": 15e-3, "static": 20e-3},
}
BODY = sw.Rig.load("paper-body")
DOUBTS: dict[tuple[str, str], tuple[sw.Rig, float]] = {
    **{("equation-error", f"{name} friction, hidden"): (twin(law), 8.5) for name, law in HIDDEN.items()},
    **{
        ("energy", f"rows read {spread:g} ms early or late"): (twin(VISCOUS, jitter=1e-3 * spread), 8.5)
        for spread in (0, 0.01, 0.1, 0.3, 1)
    },
    **{("backstepping", f"{speed} rad/s"): (PAPER, speed) for speed in (5.5, 6.0, 6.5, 8.5)},
    ("backstepping", "6 rad/s with the body, near resonance"): (BODY, 6.0),
}
DOUBT_RUNS = 40


def doubtful(seed: int, key: tuple[str, str]) -> tuple[float, float, str]:
    """Relative error and half-width of the interval of one log, and its warnings or refusal."""
    rig, speed = DOUBTS[key]
    told, truth = told_of(rig, **{"sensors.jitter": 0.0}), rig.axis.inertia.value
    motion = sw.parse_reference(f"sine 0.8 rad {speed} rad/s")
    place = encoder_places(rig, seed)
    run = sw.simulate(rig, motion, sw.Compensator.paper(rig), duration=25.0, seed=seed, encoder_zero=place)
    try:
        result = sw.identify(through_file(run, told), told, key[0])
    except sw.errors.SwingidError as error:
        return float("nan"), float("nan"), error.code
    low, high = result.inertia.interval95
    codes = ", ".join(dict.fromkeys(w.code for w in result.warnings))
    return result.inertia.value / truth - 1, (high - low) / 2 / truth, codes


def rows_doubt(_: int) -> None:
    row("method", "what it finds hard", "bias", "RMSE", "median half-width", "covers", "warns")
    row(*["---"] * 7)
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        for key in DOUBTS:
            errors, halves, codes = zip(*pool.map(partial(doubtful, key=key), range(DOUBT_RUNS)), strict=True)
            e = Expectation(key[0], np.array(errors), np.array(halves), {}, {})
            share, error = e.coverage
            row(
                *key,
                f"{100 * e.bias:+.4f} %",
                f"{100 * e.rmse:.4f} %",
                f"{100 * e.half_width:.4f} %",
                f"{100 * share:.0f} ± {100 * error:.0f} %",
                ", ".join(f"{code} {count}" for code, count in Counter(c for c in codes if c).items()),
            )


def rows_real(_: int) -> None:
    data = Path(os.environ.get("SWINGID_DATA", PROJECT.parent / "shared" / "data"))
    if not data.exists():
        print(f"(no measurements: {data} is missing)")
        return
    row("real log", "published", *METHODS)
    row(*["---"] * (2 + len(METHODS)))
    cases = (
        ("EMPS, mass in kg", "95.109 ± 0.108", "emps", "emps/DATA_EMPS.mat"),
        ("free pendulum, J in kg m²", "0.003331", "free_pendulum", "free_pendulum/free_swing.csv"),
    )
    for name, published, rig_name, file in cases:
        rig = sw.Rig.load(PROJECT / "examples" / "rigs" / f"{rig_name}.toml")
        cells = {}
        for trial in compare(sw.Recording.load(data / file, rig), rig).trials:
            if "inertia" not in trial.result.parameters:
                cells[trial.method] = f"refused ({trial.result.error.code})"
                continue
            inertia = trial.result.inertia
            cells[trial.method] = f"{inertia.value:.5g} ± {inertia.standard_uncertainty or float('nan'):.1g}"
            cells[trial.method] += " (warns)" if trial.result.warnings else ""
        row(name, published, *(cells[method] for method in METHODS))


ROWS = {
    "right": rows_right,
    "wrong": rows_wrong,
    "coverage": rows_coverage,
    "doubt": rows_doubt,
    "real": rows_real,
}


def main(arguments: Iterable[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rows", nargs="*", choices=[*ROWS, []], metavar="ROW")
    parser.add_argument("--runs", type=int, default=1000)
    chosen = parser.parse_args(arguments)
    for name in chosen.rows or ROWS:
        ROWS[name](chosen.runs)
        print()


if __name__ == "__main__":
    main()
