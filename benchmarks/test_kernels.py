"""The compiled kernels by pytest-benchmark: make bench, or pytest with --benchmark-enable."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import swingid as sw
from swingid.batch import energy_batch, momentum_batch, plan_batch
from swingid.simulation.ensemble import simulate_ensemble

DURATION, RATE = 25.0, 1000.0
PAPER = sw.Rig.builtin("paper")
MOTION = sw.parse_reference("sine 0.8 rad 8.5 rad/s")
FRICTION = {
    "viscous": {},
    "coulomb": {"axis.friction.coulomb": 3e-3},
    "stribeck": {"axis.friction.coulomb": 3e-3, "axis.friction.static": 5e-3, "axis.friction.stribeck_speed": 0.05},
    "cubic": {"axis.friction.cubic": 1e-5},
    "lugre": {
        "axis.friction.coulomb": 3e-3,
        "axis.friction.lugre": {"bristle_stiffness": 3.0, "bristle_damping": 0.01},
    },
}


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> sw.Recording:
    run = sw.simulate(PAPER, MOTION, sw.Compensator.paper(PAPER), duration=DURATION, rate=RATE, seed=1)
    path: Path = tmp_path_factory.mktemp("log") / "run.parquet"
    return sw.Recording.load(run.save(path, PAPER), PAPER)


@pytest.mark.parametrize("law", FRICTION)
def test_single_run(benchmark, law: str) -> None:
    rig = PAPER.changed(FRICTION[law])
    controller = sw.Compensator.paper(rig)
    run = benchmark(lambda: sw.simulate(rig, MOTION, controller, duration=DURATION, rate=RATE))
    assert len(run.time) == round(DURATION * RATE) + 1


@pytest.mark.parametrize("law", ["viscous", "coulomb", "stribeck"])
def test_ensemble_of_64(benchmark, law: str) -> None:
    rig, inertias = PAPER.changed(FRICTION[law]), 302.2e-5 * np.linspace(0.7, 1.5, 64)
    values = {"axis.inertia": inertias}
    runs = benchmark(lambda: simulate_ensemble(rig, MOTION, duration=DURATION, rate=RATE, values=values, threads=1))
    assert len(runs) == 64
    assert not runs.alone.any()


@pytest.mark.parametrize("method", ["momentum", "energy"])
def test_batch_of_64(benchmark, method: str) -> None:
    told, inertias = PAPER.changed({"axis.inertia": None, "axis.friction": None}), 302.2e-5 * np.linspace(0.7, 1.5, 64)
    runs = simulate_ensemble(PAPER, MOTION, duration=DURATION, rate=RATE, values={"axis.inertia": inertias})
    plan = plan_batch([runs.recording(k) for k in (0, 32, 63)], told)
    angle, wheel, voltage = (runs.channel(name) for name in ("angle", "wheel_angle", "command"))
    if method == "momentum":
        found = benchmark(lambda: momentum_batch(angle, wheel, RATE, told, plan, threads=1))
    else:
        found = benchmark(lambda: energy_batch(angle, wheel, voltage, RATE, told, plan, threads=1))
    assert found.inertia == pytest.approx(inertias, rel=2e-3)


@pytest.mark.parametrize("method", ["momentum", "energy", "equation-error", "output-error", "backstepping"])
def test_identify(benchmark, log: sw.Recording, method: str) -> None:
    rig = PAPER.changed({"axis.inertia": None, "axis.friction": None})
    result = benchmark.pedantic(lambda: sw.identify(log, rig, method=method), rounds=3, warmup_rounds=1)
    assert result.inertia.value == pytest.approx(302.2e-5, rel=0.02)
