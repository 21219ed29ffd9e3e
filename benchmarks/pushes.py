"""Pushes by hand: how often one is found where there is none, and what pushes do to the inertia when left out.

    python benchmarks/pushes.py alarms [--logs 300]
    python benchmarks/pushes.py found [--draws 5] [--method momentum]

alarms: logs of the twin without a push. Friction law, motion (sine, multisine, chirp, strokes, triangle, or an open
loop under steps of voltage), encoders, noise, latency, rate, duration and lost rows are drawn at random for each.
found: the paper's rig with Stribeck friction, 0.8 sin 8.5 t, 25 s at 1 kHz, 14-bit encoders; half sines of torque at a
random moment, of either sign.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

import swingid as sw
from accuracy import STRIBECK, TRUTH, rigs
from swingid.control.compensator import Compensator
from swingid.errors import SwingidError
from swingid.preparation.push import find_pushes
from swingid.recording.recording import CHANNELS

GRAVITY = 78e-3
DRY = {"viscous": 5e-4, "coulomb": 3e-3}
LAWS: tuple[dict[str, object], ...] = (
    {},
    {"viscous": 1.144e-3},
    DRY,
    {**DRY, "static": 5e-3, "stribeck_speed": 0.3},
    {**DRY, "static": 5e-3, "stribeck_speed": 0.05},
    {"viscous": 2e-4, "quadratic": 3e-4},
    {"viscous": 2e-4, "cubic": 5e-5},
    {"viscous": None, "viscous_positive": 1.716e-3, "viscous_negative": 0.572e-3},
    {**DRY, "lugre": {"bristle_stiffness": 3.0, "bristle_damping": 1e-3}},
    {"viscous": 5e-4, "coulomb": 15e-3, "static": 20e-3},
)
SENSORS: tuple[dict[str, object], ...] = (
    {"counts_per_turn": 16384},
    {"counts_per_turn": 4096},
    {"counts_per_turn": 256},
    {"counts_per_turn": None, "noise": 1e-3},
    {"counts_per_turn": None, "noise": 1e-2},
    {"counts_per_turn": None},
    {"counts_per_turn": 16384, "nonlinearity": "0.3 deg"},
    {"counts_per_turn": 16384, "jitter": "0.2 ms"},
    {"counts_per_turn": 16384, "wheel": {"latency": "0.5 ms"}},
    {"counts_per_turn": 16384, "wheel": {"latency": "5 ms"}},
)


def half_sine(time: np.ndarray, at: float, length: float, peak: float) -> np.ndarray:
    """Torque (N m) from `at` on, `length` s long."""
    share = (time - at) / length
    return np.where((share > 0) & (share < 1), peak * np.sin(np.pi * share), 0.0)


def motion(rng: np.random.Generator) -> str:
    """A reference motion at random."""
    size, speed = rng.uniform(0.2, 1.4), rng.uniform(3, 12)
    return str(
        rng.choice(
            [
                f"sine {size:.3f} rad {speed:.3f} rad/s",
                f"multisine {size / 2:.3f} rad {speed / 2:.3f} rad/s + {size / 2:.3f} rad {speed:.3f} rad/s",
                f"chirp {size:.3f} rad 0.3 Hz {speed / 6:.3f} Hz 20 s",
                f"strokes {size:.3f} rad {3 / speed:.3f} s {rng.uniform(0, 1):.3f} s",
                f"triangle {size:.3f} rad {speed / 3:.3f} rad/s",
                "open loop",
            ]
        )
    )


def clean_log(seed: int) -> tuple[sw.Recording, sw.Rig, str]:
    """A log without a push, what the rig file says, and in words what was drawn."""
    rng = np.random.default_rng([11, seed])
    law, sensors = LAWS[rng.integers(len(LAWS))], SENSORS[rng.integers(len(SENSORS))]
    twin, _ = rigs(sensors, law)
    given = twin.changed(
        {"axis.inertia": None, "axis.friction": None, "sensors.nonlinearity": 0, "sensors.wheel": None}
    )
    duration, rate, text = float(rng.choice([6, 15, 25])), float(rng.choice([500, 1000])), motion(rng)
    if text == "open loop":
        volts = np.repeat(rng.uniform(-10, 10, 400), int(rng.uniform(0.05, 0.6) * rate))[: int(duration * rate) + 1]
        log = sw.simulate(
            twin, duration=duration, rate=rate, seed=seed, drive=np.resize(volts, int(duration * rate) + 1)
        )
    else:
        controller = Compensator.paper(twin, sample_time=1 / rate)
        log = sw.simulate(twin, sw.parse_reference(text), controller, duration=duration, rate=rate, seed=seed)
    kept = rng.random(len(log)) >= rng.choice([0, 0, 0.05, 0.2])
    kept &= np.arange(len(log)) % int(rng.choice([1, 1, 5, 20])) == 0
    columns = {name: values[kept] for name in CHANNELS if (values := getattr(log, name)) is not None}
    return sw.Recording(**columns), given, f"{text}, {law}, {sensors}, {duration:g} s at {rate:g}/s, {len(log)} rows"


def alarms(logs: int) -> Iterator[str]:
    """How many logs without a push have one found in them, and which."""
    found = []
    for seed in range(logs):
        log, rig, words = clean_log(seed)
        pushes = find_pushes(log, rig)
        if pushes:
            found.append(seed)
            yield f"seed {seed}: {words}: " + ", ".join(f"{p.start:.2f} to {p.stop:.2f} s" for p in pushes)
    yield f"{len(found)} of {logs} logs without a push have one found in them"


def pushed(seed: int, length: float, share: float) -> tuple[sw.Recording, sw.Rig, float]:
    """A log with a push of this length (s) and share of the gravity torque, the rig, and when it begins."""
    twin, given = rigs({"counts_per_turn": 16384, "nonlinearity": 0}, STRIBECK)
    rng = np.random.default_rng([3, seed, round(100 * share), round(100 * length)])
    at, peak = rng.uniform(0.0, 25.0 - length), share * GRAVITY * rng.choice([-1, 1])
    push = half_sine(np.arange(25001) / 1000, at, length, peak)
    log = sw.simulate(
        twin, sw.parse_reference("sine 0.8 rad 8.5 rad/s"), Compensator.paper(twin), duration=25.0, seed=seed, push=push
    )
    return log, given, at


def found(draws: int, method: str) -> Iterator[str]:
    """Error and uncertainty of the inertia by size and length of the push."""
    yield "| push | length, s | found | largest error, % | says, % | covered | if kept: largest error, % | says, % |"
    yield "|---|---|---|---|---|---|---|---|"
    for share in (0.05, 0.2, 1.0, 5.0):
        for length in (0.05, 0.2, 1.0):
            seen, cells = 0, []
            for mended in (True, False):
                errors, says, covered, refused = [], [], 0, 0
                for seed in range(draws):
                    log, rig, _ = pushed(seed, length, share)
                    seen += mended and bool(find_pushes(log, rig))
                    log = log if mended else replace(log, repairs_off=frozenset(["push"]))
                    try:
                        inertia = sw.identify(log, rig, method).inertia
                    except SwingidError:
                        refused += 1
                        continue
                    errors.append(100 * (inertia.value / TRUTH - 1))
                    says.append(100 * inertia.standard_uncertainty / TRUTH)
                    covered += bool(inertia.interval95[0] <= TRUTH <= inertia.interval95[1])
                worst = f"{max(errors, key=abs):+.4f}" if errors else "–"
                cells += [worst, f"{np.median(says):.4f}" if says else "–"]
                if mended:
                    cells.append(f"{covered} of {len(errors)}" + (f", {refused} refused" if refused else ""))
            yield f"| {100 * share:.0f} % | {length} | {seen} of {draws} | {' | '.join(cells)} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["alarms", "found"])
    parser.add_argument("--logs", type=int, default=300)
    parser.add_argument("--draws", type=int, default=5)
    parser.add_argument("--method", default="momentum")
    given = parser.parse_args()
    for line in alarms(given.logs) if given.what == "alarms" else found(given.draws, given.method):
        print(line, flush=True)


if __name__ == "__main__":
    main()
