"""Lost rows where the time is made of the row number: how often they are found where none are, and what is restored.

    python benchmarks/lost_rows.py alarms [--logs 300]
    python benchmarks/lost_rows.py found [--draws 3]

The motions and rigs of the plan `trust` (wheel at one and at two frequencies, direct drive, free swing; 12 s at 1 kHz),
references, amplitudes and dry friction drawn at random. alarms: logs without lost rows, of encoders of 1000 to 16384
counts or noise of 0.1 to 2 mrad, a third each as they are, read unevenly and stamped so, read unevenly and stamped
evenly; then one with each of the faults that could be taken for lost rows. found: rows left out at random, time made
anew; constants are stated exactly.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

import swingid as sw
from swingid.errors import SwingidError
from swingid.numerics.spline import spline_at, spline_slopes
from swingid.recording.recording import CHANNELS, Recording
from swingid.study.campaign import load_plan
from swingid.study.campaign.trial import experiment_at
from swingid.study.experiment import Experiment
from swingid.study.faults.experiment import with_faults
from swingid.study.faults.registry import parse_fault

MOTIONS = ("wheel, sine", "wheel, two tones", "direct drive", "free swing")
METHODS = ("momentum", "energy", "equation-error", "output-error")
SENSORS = (16384, 4096, 1000, 1e-4, 3e-4, 2e-3)
"""Counts per turn, or noise in rad."""

OTHERS = (
    *("polled: 500 Hz", "polled: 200 Hz", "polled: 50 Hz", "jitter: 1 ms", "spikes: 20", "lost counts: 10 mrad"),
    *("push: 300 %", "stop: medium", "backlash: 0.1°", "slow rows: 100 Hz", "correlated noise: 1 mrad"),
)


def experiments() -> dict[str, Experiment]:
    """The experiment of each motion, of the plan `trust` without a fault, with constants stated exactly."""
    plan = load_plan("trust")
    found: dict[str, Experiment] = {}
    for number, point in enumerate(plan.points):
        labels = point.labels
        if (labels["fault"], labels["constants"], labels["sensors"]) == ("none", 0.0, "14 bit"):
            experiment = experiment_at(plan, number)
            stated = experiment.stated
            if stated.drive.kind == "direct":
                stated = stated.changed({"log.torque_gain": 1.0})
            found.setdefault(str(labels["motion"]), replace(experiment, stated=stated))
    return found


def varied(experiment: Experiment, motion: str, rng: np.random.Generator) -> Experiment:
    """With another reference, amplitude and dry friction."""
    size, speed = rng.uniform(0.2, 1.2), rng.uniform(3, 11)
    reference = None
    if motion == "wheel, sine":
        reference = sw.parse_reference(f"sine {size:.3f} rad {speed:.3f} rad/s")
    elif motion != "free swing":
        two = f"{size / 2:.3f} rad {speed:.3f} rad/s + {size / 2:.3f} rad {0.6 * speed:.3f} rad/s"
        reference = sw.parse_reference(f"multisine {two}")
    twin = experiment.twin.changed({"axis.friction.coulomb": float(rng.choice([0, 3e-4, 3e-3, 1e-2]))})
    angle = float(rng.uniform(0.2, 2.5)) if motion == "free swing" else 0.0
    return replace(experiment, twin=twin, reference=reference, initial_angle=angle)


def sensed(log: Recording, sensor: float, rng: np.random.Generator, jitter: float = 0.0) -> dict[str, np.ndarray]:
    """Columns of a perfect log as sensors read them, at instants that scatter."""
    columns = {name: np.array(values) for name in CHANNELS if (values := getattr(log, name)) is not None}
    instants = np.clip(log.time + np.clip(rng.normal(0, jitter, len(log)), -4e-4, 4e-4), 0, log.time[-1])
    for name in ("angle", "wheel_angle"):
        if name in columns:
            values = columns[name]
            if jitter:
                values = spline_at(log.time, values, spline_slopes(log.time, values), instants, 0)
            count = 2 * np.pi / sensor
            place = rng.uniform(0, count)
            columns[name] = (
                np.round((values + place) / count) * count if sensor > 1 else values + rng.normal(0, sensor, len(log))
            )
    return columns | {"instants": instants}


def perfect(experiment: Experiment) -> Experiment:
    """With sensors that read what is."""
    return replace(experiment, twin=experiment.twin.changed({"sensors.counts_per_turn": None, "sensors.noise": 0.0}))


NAMES = {"time": "t", "angle": "q1", "wheel_angle": "q2", "voltage": "u", "torque": "tau"}


def read(columns: dict[str, np.ndarray], rig: sw.Rig, **repairs: bool) -> Recording:
    """As a log with such columns is read."""
    return Recording.from_columns({NAMES[n]: v for n, v in columns.items() if n in NAMES}, rig, repairs=repairs)


def alarms(logs: int) -> Iterator[str]:
    """In how many logs without lost rows some are found, by kind of log."""
    made, total, wrong = experiments(), Counter[str](), Counter[str]()
    for seed in range(logs):
        rng = np.random.default_rng([21, seed])
        motion = MOTIONS[seed % len(MOTIONS)]
        experiment = varied(made[motion], motion, rng)
        log = perfect(experiment).log(seed)
        for sensor in SENSORS:
            for kind in ("even", "stamped where read", "stamped evenly"):
                jitter = 0.0 if kind == "even" else float(rng.choice([3e-5, 1e-4, 3e-4]))
                columns = sensed(log, sensor, rng, jitter)
                if kind == "stamped where read":
                    columns["time"] = columns["instants"]
                total[kind] += 1
                rig = experiment.stated
                if "lost-rows" in {one.code for one in read(columns, rig).findings}:
                    wrong[kind] += 1
                    yield f"seed {seed}, {motion}, {sensor}, {kind}, jitter {jitter:g} s"
        fault = OTHERS[seed // len(MOTIONS) % len(OTHERS)]
        faulty = with_faults(experiment, [parse_fault(fault)])
        total[fault] += 1
        try:
            wrong[fault] += "lost-rows" in {one.code for one in faulty.read(faulty.log(seed)).findings}
        except SwingidError:
            continue
    for kind, count in total.items():
        yield f"{kind}: {wrong[kind]} of {count}"


def found(draws: int) -> Iterator[str]:
    """What is restored, the largest error (%) of each method with and without, and how many ok answers are wrong."""
    made = experiments()
    yield f"| lost | motion | sensors | found in | time left off, % | {' | '.join(METHODS)} | ok, wrong |"
    yield f"|{'---|' * (6 + len(METHODS))}"
    for share in (0.002, 0.005, 0.01, 0.03):
        for motion in MOTIONS:
            for sensor, words in ((16384, "14 bit"), (3e-4, "0.3 mrad")):
                seen, left = 0, list[float]()
                errors = {name: (list[float](), list[float]()) for name in METHODS}
                ok = wrong = 0
                for seed in range(draws):
                    rng = np.random.default_rng([22, seed, round(1e4 * share)])
                    experiment = made[motion]
                    log = perfect(experiment).log(seed)
                    kept = np.flatnonzero(rng.random(len(log)) >= share)
                    columns = {name: values[kept] for name, values in sensed(log, sensor, rng).items()}
                    columns["time"] = log.time[: len(kept)]
                    rig = experiment.stated.changed({} if sensor > 1 else {"sensors.counts_per_turn": None})
                    repaired = read(columns, rig)
                    seen += "lost-rows" in {one.code for one in repaired.findings}
                    true = log.time[kept[-1]] - log.time[kept[0]]
                    left.append((repaired.duration - true) / true)
                    for name in METHODS:
                        for place, one in enumerate((repaired, read(columns, rig, **{"lost-rows": False}))):
                            try:
                                result = sw.identify(one, rig, name)
                            except SwingidError:
                                continue
                            value, true_one = result.inertia, experiment.twin.axis.inertia
                            assert true_one is not None
                            assert value.interval95 is not None
                            off = value.value - true_one.value
                            errors[name][place].append(100 * off / true_one.value)
                            if place == 0 and result.status == "ok":
                                ok += 1
                                wrong += abs(off) > 0.75 * (value.interval95[1] - value.interval95[0])
                cells = [
                    " without ".join(f"{max(found, key=abs):+.3f}" if found else "–" for found in errors[name])
                    for name in METHODS
                ]
                yield (
                    f"| {share:.1%} | {motion} | {words} | {seen} of {draws} | {100 * max(left, key=abs):+.3f} |"
                    f" {' | '.join(cells)} | {ok}, {wrong} |"
                )


def main() -> None:
    """Print one of the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("alarms", "found"))
    parser.add_argument("--logs", type=int, default=300)
    parser.add_argument("--draws", type=int, default=3)
    given = parser.parse_args()
    for line in alarms(given.logs) if given.what == "alarms" else found(given.draws):
        print(line, flush=True)


if __name__ == "__main__":
    main()
