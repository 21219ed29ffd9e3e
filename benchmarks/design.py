"""Predicted and achieved: what `swingid design` promises beside the spread of the twin's errors, over many seeds.

    python benchmarks/design.py [--runs 60]

Each case is a rig and a wanted uncertainty. The proposal is run on the twin with everything drawn that the rig declares
as uncertain (constants, encoders, their places, noise), every log goes through a file, and momentum reads it. The
ratio should lie within 20 % of 1; its own error is 1/sqrt(2 runs). A last column says what the method itself claims.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterable

import numpy as np

import swingid as sw
from swingid.study.design import Design, design
from swingid.study.design.proposal import controller_of
from swingid.study.rehearse import rehearse

PAPER = sw.Rig.builtin("paper")
UNSURE = {
    "axis.gravity_torque": "78e-3 ± 0.2 % N*m",
    "drive.wheel.inertia": "11.34e-5 ± 0.1 % kg*m^2",
    "sensors.latency": "0 ± 0.3 ms",
    "sensors.wheel.latency": "0 ± 0.3 ms",
}
CASES: dict[str, tuple[dict[str, object], str, dict[str, object]]] = {
    "noise 10 mrad": ({"sensors.counts_per_turn": None, "sensors.noise": 1e-2}, "0.02 %", {}),
    "noise 3 mrad, 14 bit": ({"sensors.noise": 3e-3}, "0.005 %", {}),
    "8 bit": ({"sensors.counts_per_turn": 256}, "0.1 %", {}),
    "noise 10 mrad, gravity unknown": (
        {"sensors.noise": 1e-2, "axis.gravity_torque": "unknown"},
        "0.1 %",
        {"gravity_torque": "78 mN*m"},
    ),
    "constants ± 0.2 %": (UNSURE, "0.15 %", {}),
    "nonlinearity 0.1 deg": ({"sensors.nonlinearity": "0.1 deg", "sensors.noise": 1e-3}, "0.2 %", {}),
    "constants and nonlinearity": (UNSURE | {"sensors.nonlinearity": "0.1 deg"}, "0.2 %", {}),
    "14 bit, nothing else": ({}, "0.05 %", {}),
}


def achieved(rig: sw.Rig, plan: Design, runs: int, **expected: object) -> tuple[float, float]:
    """Root mean square of the relative errors over the runs, and the median uncertainty that the method claims."""
    twin = rig.changed({"axis.gravity_torque": expected["gravity_torque"]}) if "gravity_torque" in expected else rig
    if twin is not rig:
        return with_unknown_gravity(rig, twin, plan, runs)
    p = plan.proposal
    found = rehearse(
        rig,
        sw.parse_reference(p.reference),
        controller_of(rig, p),
        duration=p.duration,
        rate=p.rate,
        runs=runs,
        methods=["momentum"],
    ).of("momentum")
    return found.rmse, found.half_width / 1.96


def with_unknown_gravity(rig: sw.Rig, twin: sw.Rig, plan: Design, runs: int) -> tuple[float, float]:
    """As `achieved`, where the method is not told what the twin swings with."""
    p = plan.proposal
    truth = twin.axis.inertia.value
    given = rig.changed({"axis.inertia": None, "axis.friction": None})
    results = [
        sw.identify(
            sw.simulate(
                twin,
                sw.parse_reference(p.reference),
                controller_of(twin, p),
                duration=p.duration,
                rate=p.rate,
                seed=seed,
            ),
            given,
        ).inertia
        for seed in range(runs)
    ]
    errors = np.array([r.value / truth - 1 for r in results])
    return float(np.sqrt(np.mean(errors**2))), float(np.median([r.standard_uncertainty for r in results]) / truth)


def main(arguments: Iterable[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=60)
    runs = parser.parse_args(arguments).runs
    print("| rig | wanted | proposal | predicted | achieved (RMSE) | ratio | claimed | design takes |")
    print("|---|---|---|---|---|---|---|---|")
    for name, (changes, wanted, expected) in CASES.items():
        rig = PAPER.changed(changes)
        start = time.perf_counter()
        plan = design(rig, wanted, **expected)
        took = time.perf_counter() - start
        p = plan.proposal
        rmse, claimed = achieved(rig, plan, runs, **expected)
        ratio = f"{rmse / p.relative:.2f} ± {rmse / p.relative / np.sqrt(2 * runs):.2f}"
        cells = [name, wanted, f"{p.reference}, {p.duration:g} s", f"{100 * p.relative:.4f} %", f"{100 * rmse:.4f} %"]
        print("| " + " | ".join([*cells, ratio, f"{100 * claimed:.4f} %", f"{took:.1f} s"]) + " |", flush=True)


if __name__ == "__main__":
    main()
