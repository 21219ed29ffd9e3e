"""Does the bound of the energy method's symmetry error hold? On the twin, for random gains, motions and friction laws.

    python benchmarks/symmetry.py [--runs 500] [--variant printed|better]

The true error due to asymmetry is what the work of the true friction (less the one that the method fits beside the
inertia), along the true motion, adds to the inertia through the method's own weights of its nodes: only this script
knows it. The log has the paper's encoders. Printed: the share of the runs in which the bound from the log holds, with
its binomial error, how large it is beside the true error, and how often the 95 % interval of the whole result covers.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np

import swingid as sw
from swingid.control.compensator import Compensator
from swingid.errors import UnanswerableError
from swingid.methods.energy import method
from swingid.methods.energy.symmetry import asymmetry_bound
from swingid.model.friction import static_curve
from swingid.simulation import simulate_run

PAPER = sw.Rig.builtin("paper")


def friction(random: np.random.Generator) -> dict[str, object]:
    """A friction law without memory: each kind as likely as another, sizes over a decade."""

    def size(middle: float) -> float:
        return float(middle * 10 ** random.uniform(-0.5, 0.5))

    kind = random.integers(7)
    viscous = {"viscous": size(1e-3)}
    laws: list[dict[str, object]] = [
        viscous,
        {"coulomb": size(2e-3)},
        viscous | {"coulomb": size(2e-3)},
        {"quadratic": size(3e-4)},
        viscous | {"cubic": size(5e-5)},
        {"viscous_positive": size(1e-3), "viscous_negative": size(1e-3)},
        {"coulomb": 2e-3, "static": 2e-3 + size(1.5e-3), "stribeck_speed": size(0.3)} | viscous,
    ]
    return laws[kind]


def motion(random: np.random.Generator) -> str:
    """A sine or a sum of two within the motor's reach, away from resonance."""
    amplitude, frequency = random.uniform(0.3, 0.7), random.uniform(6.8, 8.5)
    if random.random() < 0.3:
        parts = ((0.7 * amplitude, frequency), (0.3 * amplitude, 1.5 * frequency))
        return "multisine " + " + ".join(f"{a:.3f} rad {w:.3f} rad/s" for a, w in parts)
    return f"sine {amplitude:.3f} rad {frequency:.3f} rad/s"


def made(seed: int) -> tuple[sw.Rig, str, Compensator]:
    random = np.random.default_rng([11, seed])
    changes = {"axis.friction": None} | {f"axis.friction.{key}": value for key, value in friction(random).items()}
    rig = PAPER.changed(changes)
    gains = {"delta0": random.uniform(0.01, 0.1), "sigma0": random.uniform(0.05, 0.2), "lambda0": random.uniform(1, 5)}
    return rig, motion(random), replace(Compensator.paper(rig), **gains)


def one(seed: int, variant: str) -> tuple[float, float, float, float, str] | None:
    """True error due to asymmetry, its bound, the whole error, the standard uncertainty (all relative), the law."""
    rig, words, controller = made(seed)
    fine = np.linspace(0, 15, 150_001)
    run = simulate_run(rig, sw.parse_reference(words), controller, duration=15.0, seed=seed, truth_times=fine)
    given = rig.changed({"axis.inertia": None, "axis.friction": None})
    seen = []

    def recorded(fit, profile):
        seen.append(fit)
        return asymmetry_bound(fit, profile)

    method.asymmetry_bound = recorded
    try:
        result = sw.identify(run.recording, given, "energy", variant=variant)
    except UnanswerableError:
        return None
    (fit,) = seen
    v = run.truth.speed
    shapes = {"coulomb": np.sign(v), "viscous": v, "quadratic": v * np.abs(v), "offset": 1.0, "viscous_even": np.abs(v)}
    if "coulomb" not in fit.unknowns:
        shapes = {}  # (6) takes nothing of friction into account; (7) stands apart
    torque = np.array([static_curve(x, run.truth.parameters) for x in v])
    torque -= sum(fit.value(name) * shape for name, shape in shapes.items())
    work = np.concatenate([[0.0], np.cumsum((torque[1:] * v[1:] + torque[:-1] * v[:-1]) / 2 * np.diff(fine))])
    error = float(fit.fit.influence[0] @ np.interp(fit.rows.instants.ravel(), fine, work))
    truth = PAPER.axis.inertia.value
    bound = result.details.extra["symmetry_bound"]
    whole = result.inertia.value - truth
    law = " + ".join(rig.axis.friction.model_fields_set)
    return error / truth, bound / truth, whole / truth, (result.inertia.standard_uncertainty or np.nan) / truth, law


def main(arguments: Iterable[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=500)
    parser.add_argument("--variant", choices=["printed", "better"])
    chosen = parser.parse_args(arguments)
    print("| variant | runs | bound holds | true error (median, 95 %) | bound (median, 95 %) | interval covers |")
    print("|---|---|---|---|---|---|")
    for variant in [chosen.variant] if chosen.variant else ["printed", "better"]:
        with ProcessPoolExecutor(os.cpu_count()) as pool:
            found = [f for f in pool.map(partial(one, variant=variant), range(chosen.runs), chunksize=4) if f]
        error, bound, whole, u = (np.array([f[k] for f in found]) for k in range(4))
        share = float(np.mean(np.abs(error) <= bound))
        covers = float(np.mean(np.abs(whole) <= 1.96 * u))
        n = len(found)

        def spread(x: np.ndarray) -> str:
            return f"{100 * np.median(np.abs(x)):.4f} %, {100 * np.quantile(np.abs(x), 0.95):.4f} %"

        def with_error(p: float, count: int = n) -> str:
            return f"{100 * p:.1f} ± {100 * np.sqrt(max(p * (1 - p), 1 / count) / count):.1f} %"

        print(
            f"| {variant} | {n} | {with_error(share)} | {spread(error)} | {spread(bound)} | {with_error(covers)} |",
            flush=True,
        )
        for f in found:
            if abs(f[0]) > f[1]:
                print("  ", *(f"{x:.2e}" for x in f[:4]), f[4])


if __name__ == "__main__":
    main()
