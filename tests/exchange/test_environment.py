"""SwingId-v0 keeps Gymnasium's rules, moves as the twin, and our controller swings up and balances."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest

import swingid as sw
from swingid.errors import UsageError
from swingid.result.result import Parameter, Result
from swingid.simulation.twin import Setup, run_of

gymnasium = pytest.importorskip("gymnasium", reason="needs pip install 'swingid[gym]'")
from gymnasium.utils.env_checker import check_env  # noqa: E402

from refusals import coded  # noqa: E402
from swingid.exchange.environment import SwingEnv, baseline, identified_rig  # noqa: E402

MADE = "swingid.exchange.environment:SwingId-v0"


@pytest.mark.parametrize("task", ["swing-up", "balance"])
def test_it_keeps_the_rules_of_gymnasium(task: str) -> None:
    env = gymnasium.make(MADE, task=task)
    assert isinstance(env.unwrapped, SwingEnv)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", message=".*(infinity|unbounded|render).*")
        check_env(env.unwrapped, skip_render_check=True)


def test_it_moves_as_the_twin() -> None:
    """The readings of an episode are those of a simulation under the same held voltages."""
    rig = sw.Rig.load("paper")
    env = SwingEnv(rig, randomise=False, duration=2.0)
    _, info = env.reset(seed=1, options={"angle": 0.3})
    actions = 0.4 * np.sin(8.5 * np.arange(1000) * env.period)
    seen = [info["angle"]]
    for action in actions:
        _, _, _, over, info = env.step(np.array([action]))
        seen.append(info["angle"])
    assert over
    drive = np.repeat(actions * 10.0, env.hold)
    truth = run_of(Setup(rig, duration=2.0, rate=1000.0, drive=np.append(drive, 0.0), initial_angle=0.3)).truth
    assert np.abs(np.array(seen) - truth.angle[:: env.hold]).max() < 2 * np.pi / 16384


def test_the_same_seed_gives_the_same_episode_and_draws_differ() -> None:
    rig = sw.Rig.load("paper").changed({"axis.inertia": "3.022e-3 ± 1e-4"})
    env = SwingEnv(rig)
    inertias = []
    for seed in (1, 1, 2):
        env.reset(seed=seed)
        assert env.plant is not None
        inertias.append(env.plant.values[0])
    assert inertias[0] == inertias[1] != inertias[2]
    fixed = SwingEnv(rig, randomise=False)
    fixed.reset(seed=1)
    assert fixed.plant is not None
    assert fixed.plant.values[0] == pytest.approx(3.022e-3 + 11.34e-5 + 0.21e-5)


def test_values_and_uncertainties_are_those_of_the_result() -> None:
    parameters = {
        "inertia": Parameter.of(2.5e-3, 1e-5, "kg m^2"),
        "viscous": Parameter.of(2e-3, None, "N m s"),
        "coulomb": Parameter.of(-1e-6, 1e-6, "N m"),
    }
    rig = identified_rig(Result("momentum", "ok", parameters), sw.Rig.load("paper"))
    assert rig.axis.inertia == sw.Rig.load("paper").changed({"axis.inertia": "2.5e-3 ± 1e-5"}).axis.inertia
    assert rig.axis.friction.viscous is not None
    assert rig.axis.friction.viscous.std is None
    assert rig.axis.friction.coulomb is None  # found below 0, which no rig has


def play(env: SwingEnv, seed: int) -> tuple[float, float]:
    """Share of the last third within 0.3 rad of upright, and the time (s) that the episode took."""
    _, info = env.reset(seed=seed)
    act, near, steps = baseline(env), [], 0
    while True:
        _, _, fallen, over, info = env.step(act(info))
        steps += 1
        near.append(abs(env.off) < 0.3)
        if fallen or over:
            return float(np.mean(near[-len(near) // 3 :])), steps * env.period


def uncertain() -> Any:
    names = ("axis.inertia", "drive.wheel.inertia", "drive.motor.torque_per_volt")
    rig = sw.Rig.load("paper")
    values = {"axis.inertia": 3.022e-3, "drive.wheel.inertia": 11.34e-5, "drive.motor.torque_per_volt": 52.04e-4}
    return rig.changed({name: f"{values[name]} ± {0.01 * values[name]}" for name in names})


def test_our_controller_balances() -> None:
    env = SwingEnv(uncertain(), task="balance")
    played = [play(env, seed) for seed in range(4)]
    assert all(near == 1.0 and time == pytest.approx(10.0) for near, time in played)


def test_our_controller_swings_up() -> None:
    env = SwingEnv(uncertain(), task="swing-up", duration=20.0)
    played = [play(env, seed)[0] for seed in range(4)]
    assert sum(near == 1.0 for near in played) == 4


def test_doing_nothing_does_not_balance() -> None:
    env = SwingEnv(task="balance")
    env.reset(seed=0)
    for _ in range(5000):
        _, reward, fallen, over, _ = env.step(np.zeros(1))
        if fallen or over:
            break
    assert fallen
    assert reward < -0.3


def test_a_rig_without_a_wheel_is_refused() -> None:
    rig = sw.Rig.from_text('name = "arm"\n[axis]\ngravity_torque = 0.2\ninertia = 3e-3\n[drive]\nkind = "none"\n')
    with pytest.raises(UsageError, check=coded("no-wheel")):
        SwingEnv(rig)
    with pytest.raises(UsageError, match="task"):
        SwingEnv(task="fly")  # type: ignore[arg-type]
