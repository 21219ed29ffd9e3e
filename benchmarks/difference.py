"""How well the inertia of an added body is found: the paper's body, 96.1e-5 kg m² (the paper is 7 % off).

    python benchmarks/difference.py [--seeds 20]

Each row: the twin runs the rig without and with the body, both logs are identified, the results subtracted. Errors are
of the body's inertia about the axis, in per cent of the truth. The paper's sensors are two 14-bit encoders; their
grid lies differently in every run. "stated": median standard uncertainty; "in 95 %": intervals that hold the truth.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

import swingid as sw
from swingid.control.compensator import Compensator
from swingid.control.references import Sine

TARE, BODY = sw.Rig.load("paper"), sw.Rig.load("paper-body")
TRUTH = BODY.axis.inertia.value - TARE.axis.inertia.value
BALANCED = {"axis.gravity_torque": 0.0}
SKEWED = {"sensors.nonlinearity": "0.1 deg"}
UNSURE = {"drive.wheel.inertia": "11.34e-5 ± 0.3 %", "axis.gravity_torque": None}
STRIBECK = {"axis.friction": {"coulomb": 2e-3, "static": 4e-3, "stribeck_speed": 0.3}}


@dataclass(frozen=True)
class Row:
    """A pair of runs: speeds of the reference (rad/s), changes of both rigs, of the loaded one, method."""

    name: str
    loaded: float = 8.5
    both: Mapping[str, object] | None = None
    body: Mapping[str, object] | None = None
    method: str = "momentum"
    draw: bool = False


ROWS = (
    Row("paper's sensors, both at 8.5 rad/s"),
    Row("with the body at 11 rad/s", loaded=11.0),
    Row("with the body at 6 rad/s, as the paper (near resonance)", loaded=6.0),
    Row("body on the other side, b = 0, at 8.5 rad/s", body=BALANCED),
    Row("body on the other side, b = 0, at 2 rad/s", loaded=2.0, body=BALANCED),
    Row("Stribeck friction", both=STRIBECK),
    Row("encoders off by 0.1 deg once per turn", both=SKEWED),
    Row("wheel known to 0.3 %, b to 0.2 %, drawn", both=UNSURE, draw=True),
    Row("the same, b = 0 with the body", both=UNSURE, body=BALANCED, draw=True),
    Row("energy, motor exact", method="energy"),
)


def rig_of(base: sw.Rig, *changes: Mapping[str, object] | None) -> sw.Rig:
    """A rig with its changes; gravity_torque None: its own value, uncertain by 0.2 %."""
    for change in changes:
        own = dict(change or {})
        if "axis.gravity_torque" in own and own["axis.gravity_torque"] is None:
            own["axis.gravity_torque"] = f"{base.axis.gravity_torque.value} ± 0.2 %"
        base = base.changed(own)
    return base


def identified(rig: sw.Rig, speed: float, row: Row, seed: int) -> sw.Result:
    """The result of one run of the twin, whose inertia and friction identification is not told."""
    zero = tuple(np.random.default_rng([seed, int(rig is TARE), round(speed * 10)]).uniform(0, 1e-3, 2))
    controller = Compensator.paper(rig, sample_time=1e-3)
    log = sw.simulate(
        rig,
        Sine(0.8, speed),
        controller,
        duration=22.0,
        rate=1000.0,
        seed=seed,
        draw=row.draw,
        encoder_zero=zero,
    )
    given = rig.changed({"axis.inertia": None, "axis.friction": None})
    return sw.identify(log.segment(2.0, 22.0), given, row.method)


def errors(row: Row, seeds: int) -> tuple[np.ndarray, np.ndarray]:
    """Relative errors and relative standard uncertainties, (seeds,) each."""
    off, spread = [], []
    for seed in range(seeds):
        tare = identified(rig_of(TARE, row.both), 8.5, row, seed)
        loaded = identified(rig_of(BODY, row.both, row.body), row.loaded, row, seed)
        found = sw.difference(tare, loaded).inertia
        off.append(found.value / TRUTH - 1)
        spread.append((found.standard_uncertainty or np.nan) / TRUTH)
    return np.array(off), np.array(spread)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=20)
    seeds = parser.parse_args().seeds
    print(f"added body of {TRUTH:.4g} kg m^2, {seeds} pairs of runs each; errors in %")
    print(f"{'':<56}{'mean':>9}{'largest':>9}{'stated':>9}{'in 95 %':>9}")
    for row in ROWS:
        off, spread = errors(row, seeds)
        held = np.mean(np.abs(off) < 1.96 * spread)
        numbers = (100 * off.mean(), 100 * np.abs(off).max(), 100 * np.median(spread))
        print(f"{row.name:<56}" + "".join(f"{x:9.4f}" for x in numbers) + f"{100 * held:8.0f} %", flush=True)


if __name__ == "__main__":
    main()
