"""The Gymnasium environment ``SwingId-v0``: swing a reaction wheel pendulum up, or keep it upright.

    import gymnasium
    env = gymnasium.make("swingid.exchange.environment:SwingId-v0", result="run.json", rig="rig.toml", task="balance")

The plant is the digital twin with its encoders and held voltage. With a result it has the identified values, and in
each episode every constant is drawn from its standard uncertainty (domain randomisation).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from swingid.control.compensator import Compensator
from swingid.errors import UsageError, missing_package
from swingid.live.plant import Plant
from swingid.model.rig import Rig
from swingid.numerics.arrays import Array
from swingid.result.result import Result
from swingid.units import Quantity

try:
    import gymnasium
    from gymnasium import spaces
except ImportError:
    raise missing_package("the environment SwingId-v0", "gymnasium", "gym") from None

NAME = "SwingId-v0"
TASKS = ("swing-up", "balance")

RATE, HOLD, DURATION = 1000.0, 2, 10.0
"""Samples of the plant per second, samples for which an action is held, seconds of an episode."""

FALLEN = 0.6
"""Angle from upright (rad) at which balancing has failed."""

NEAR, PUMP, EAGER = 0.25, 0.35, 20.0
"""Of the baseline: angle (rad) from upright where it catches, share of the voltage that pumps, gain of the energy."""

GAIN, SHIFT, LARGEST, SLOW = 120.0, -3e-4, 0.2, 0.02
"""Of the baseline near upright: gain k tilde (held), shift of the reference per wheel speed (s) and its limit (rad),
time (s) over which the wheel's speed is smoothed."""


def identified_rig(result: Result, rig: Rig) -> Rig:
    """The rig with the inertia, friction and gravity torque of a result, each with its standard uncertainty."""
    values = {
        name: Quantity(parameter.value, parameter.standard_uncertainty or None)
        for name, parameter in result.parameters.items()
        if parameter.value > 0 or name == "offset"
    }
    changes: dict[str, object] = {"axis.inertia": values["inertia"], "axis.friction": None}
    if "gravity_torque" in values:
        changes["axis.gravity_torque"] = values["gravity_torque"]
    named = ("viscous", "coulomb", "static", "stribeck_speed", "quadratic", "cubic", "offset")
    changes |= {f"axis.friction.{name}": values[name] for name in named if name in values}
    return rig.changed(changes)


class SwingEnv(gymnasium.Env):  # type: ignore[misc]  # gymnasium has no types here
    """A reaction wheel pendulum under a held voltage.

    rig: a Rig, a path or a built-in name. result: a Result or its JSON file, whose values and uncertainties replace
    those of the rig. task: "swing-up" from rest near hanging, or "balance" from near upright, which ends where the rig
    has fallen. randomise: draw every constant from its uncertainty in each episode. hold: samples for which an action
    is held. Action: the voltage over its limit, in [-1, 1]. Observation: sine and cosine of the angle, its speed and
    the wheel's (rad/s), by differences of the readings. Reward: minus the squared angle from upright (rad), less small
    shares of speed and voltage. Raises UsageError for a rig without a wheel or a voltage limit.
    """

    def __init__(
        self,
        rig: Rig | str | Path = "paper",
        result: Result | str | Path | None = None,
        *,
        task: Literal["swing-up", "balance"] = "swing-up",
        randomise: bool = True,
        hold: int = HOLD,
        duration: float = DURATION,
    ) -> None:
        self.rig = rig if isinstance(rig, Rig) else Rig.load(rig)
        if result is not None:
            from swingid.result.file import load_result

            self.rig = identified_rig(result if isinstance(result, Result) else load_result(result), self.rig)
        motor = self.rig.drive.motor
        if self.rig.drive.wheel is None or motor is None or motor.voltage_limit is None:
            message = f"rig {self.rig.name!r} has no wheel with a voltage limit, which {NAME} needs"
            raise UsageError(message, code="no-wheel")
        if task not in TASKS or hold < 1 or not duration > 0:
            message = f"give a task of {', '.join(TASKS)}, hold of at least 1 sample and a positive duration"
            raise UsageError(message, code="bad-task")
        self.limit, self.task, self.randomise = float(motor.voltage_limit), task, randomise
        self.hold, self.duration = hold, duration
        self.period = hold / RATE
        most = np.array([1.0, 1.0, np.inf, np.inf], np.float32)
        self.observation_space = spaces.Box(-most, most, dtype=np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, (1,), np.float32)
        self.plant: Plant | None = None
        self.readings = self.before = (0.0, 0.0)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, float]]:
        """Begin an episode; options may hold "angle", the angle at the start (rad)."""
        super().reset(seed=seed)
        middle, spread = (0.0, 0.1) if self.task == "swing-up" else (math.pi, 0.05)
        angle = float((options or {}).get("angle", middle + self.np_random.uniform(-spread, spread)))
        rows = int(self.duration * RATE) + self.hold + 1
        seed_drawn = int(self.np_random.integers(2**31))
        self.plant = Plant(self.rig, rate=RATE, rows=rows, seed=seed_drawn, draw=self.randomise, initial_angle=angle)
        self.readings = self.before = self.plant.angles()
        return self._observed(), self._info(0.0)

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, float]]:
        """Hold the voltage of the action for `hold` samples."""
        if self.plant is None:
            raise UsageError("call reset before step", code="no-episode")
        share = float(np.clip(np.asarray(action, dtype=np.float64).reshape(-1)[0], -1.0, 1.0))
        for _ in range(self.hold):
            self.plant.hold(share * self.limit)
        self.before, self.readings = self.readings, self.plant.angles()
        observed = self._observed()
        off = self.off
        reward = -(off**2 + 0.01 * float(observed[2]) ** 2 + 0.001 * share**2)
        fallen = self.task == "balance" and abs(off) > FALLEN
        over = self.plant.time >= self.duration - 1e-9
        return observed, reward, fallen, over, self._info(share * self.limit)

    @property
    def off(self) -> float:
        """Angle from upright (rad) as read, from -π to π."""
        return math.remainder(self.readings[0] - math.pi, 2 * math.pi)

    def _observed(self) -> Array:
        speeds = [(now - was) / self.period for now, was in zip(self.readings, self.before, strict=True)]
        observation = [math.sin(self.readings[0]), math.cos(self.readings[0]), *speeds]
        return np.array(observation, dtype=np.float32)

    def _info(self, voltage: float) -> dict[str, float]:
        return {"angle": self.readings[0], "wheel_angle": self.readings[1], "voltage": voltage}


def baseline(env: SwingEnv) -> Callable[[dict[str, float]], Array]:
    """A policy with our controller: from the `info` of a step to the action.

    Near upright the consecutive compensator with a constant gain follows a reference that moves by the wheel's speed,
    so that the wheel slows down. Far from it the voltage pumps energy into the swing. Call it anew for each episode.
    """
    rig, motor = env.rig, env.rig.drive.motor
    assert motor is not None
    assert rig.axis.inertia is not None
    total = rig.axis.inertia.value + rig.drive.carried
    b = float(rig.axis.acting_gravity.value) if isinstance(rig.axis.acting_gravity, Quantity) else 0.0
    controller = replace(Compensator.paper(rig, sample_time=env.period), k_tilde0=GAIN, k_tilde_max=GAIN)
    memory: dict[str, Any] = {"state": None, "angle": None, "wheel": 0.0, "smooth": 0.0, "time": 0.0, "turns": 0.0}

    def act(info: dict[str, float]) -> Array:
        q, wheel = info["angle"], info["wheel_angle"]
        first = memory["angle"] is None
        speed = 0.0 if first else (q - memory["angle"]) / env.period
        turning = 0.0 if first else (wheel - memory["wheel"]) / env.period
        memory["smooth"] += min(1.0, env.period / SLOW) * (turning - memory["smooth"])
        memory["angle"], memory["wheel"] = q, wheel
        off = math.remainder(q - math.pi, 2 * math.pi)
        if abs(off) < NEAR and (memory["state"] is not None or abs(speed) < 3.0):
            if memory["state"] is None:
                memory["state"], memory["turns"] = controller.initial_state(), q - off
            wanted = memory["turns"] + float(np.clip(SHIFT * memory["smooth"], -LARGEST, LARGEST))
            u, memory["state"] = controller.step(memory["time"], (wanted, q, wheel), memory["state"])
        else:
            memory["state"] = None
            energy = 0.5 * total * speed**2 - b * math.cos(q)
            share = float(np.clip(EAGER * (1.05 * b - energy) / max(b, 1e-12), -1.0, 1.0))
            u = -PUMP * env.limit * share * (1.0 if speed >= 0 else -1.0)
        memory["time"] += env.period
        return np.array([u / env.limit], dtype=np.float32)

    return act


if NAME not in gymnasium.registry:
    gymnasium.register(NAME, entry_point=SwingEnv)
