"""Rigs as they might be written, logs with faults, and everything that is made of both: methods, inspect, validate."""

from __future__ import annotations

import random
import tomllib
from copy import deepcopy
from functools import cache
from typing import Any

import numpy as np

from fuzz.corpus import motions
from fuzz.mutations import _change, _toml, mutated_columns
from swingid.control.compensator import Compensator
from swingid.control.references import Sine
from swingid.identification import identify
from swingid.methods.table import METHODS
from swingid.model.rig import Rig
from swingid.recording.formats.table import Table
from swingid.recording.recording import Recording
from swingid.result.result import Result
from swingid.simulation import simulate

ASKED = (*METHODS, "inspect", "validate", "compare")
"""What is asked of a rig and a log."""

OPTIONS: dict[str, tuple[dict[str, Any], ...]] = {
    "output-error": (
        *({"input": "wheel"}, {"input": "voltage"}, {"input": "torque"}, {"law": "viscous"}, {"law": "stribeck"}),
        *({"loss": "huber"}, {"segment": 0.5}, {"free": ["axis.gravity_torque"]}),
    ),
    "energy": ({"variant": "printed"}, {"velocities": "observers"}),
    "momentum": ({"memory": "off"}, {"memory": "on"}),
    "equation-error": ({"cutoff": 10.0}, {"cutoff": 1e-3}),
}
"""Options that are tried now and then."""

SETTINGS: dict[str, tuple[Any, ...]] = {
    "axis.kind": ("linear", "rotary"),
    "axis.gravity_torque": (0, "unknown", "78 ± 20 mN*m", "78e-3 ± 1e-9 N*m", 1e-12, 1e9, "0.1 ± 10 N*m"),
    "axis.stiffness": (0.02, "unknown", "0 ± 0.01 N*m", "1e6 ± 1 N*m", "unknown ± 1"),
    "axis.spring_zero": (0.1, "0 ± 0.5 rad", 1e6),
    "axis.cogging": ({"order": 7, "amplitude": "unknown"}, {"order": 1e4, "amplitude": "0.01 ± 0.01 N*m", "phase": 1}),
    "axis.friction": ({"load": 0.1}, {"load": "0.1 ± 0.1"}, {"lugre": {"bristle_stiffness": 10}}, {"coulomb": 1e3}),
    "drive.kind": ("none", "direct", "reaction-wheel"),
    "drive.wheel.inertia": ("11.34e-5 ± 5e-5 kg*m^2", 1e-12, 1e6, 3.5e-3),
    "drive.motor.torque_per_volt": (0, "5e-3 ± 5e-3 N*m/V", 1e6),
    "drive.motor.back_emf": ("4e-6 ± 4e-6 N*m*s", 1e3),
    "drive.motor.gear_ratio": (1e-6, "4.4 ± 0.1", 1e5),
    "drive.motor.efficiency": (1e-6, "0.9 ± 0.3"),
    "drive.motor.coulomb": (0, 1e3, "3e-3 ± 3e-3 N*m"),
    "sensors.counts_per_turn": (1, 3, 360, 4096, 1e9),
    "sensors.noise": (0, 1e-12, 1e-3, 5.0),
    "sensors.nonlinearity": ("0.1 deg", 10, "1e-9 rad"),
    "sensors.latency": ("0 ± 1 ms", 0.05, "1 ± 1 s", -0.01),
    "sensors.jitter": (1e-4, 1.0),
    "sensors.dropouts": (0.1, 0.9),
    "sensors.wheel.latency": ("0 ± 1 ms", 0.3),
    "log.angle_unit": ("deg", "turns", "counts", "m"),
    "log.angle_zero": ("up", 0.5, 1e6),
    "log.angle_sign": (-1,),
    "log.wheel_angle_sign": (-1,),
    "log.wheel_angle_is": ("absolute",),
    "log.wheel_scale": (2, 1e-6),
    "log.torque_sign": (-1,),
    "log.torque_gain": ("1 ± 1", 1e-9, "2 ± 0.1"),
    "log.voltage_sign": (-1,),
    "log.drive_held": (False, True),
    "log.time_unit": ("ms", "ns"),
    "log.rate": (1, 50, 1e5),
    "log.angle": ("q2", "u", "t"),
}
"""What keys are set to: plausible, mistaken and extreme."""


@cache
def runs() -> tuple[tuple[dict[str, np.ndarray], tuple[str, ...]], ...]:
    """Columns and rigs of `motions`, and of a run of the twin, whose voltage is that of the motion."""
    rig = Rig.builtin("paper")
    log = simulate(rig, Sine(0.8, 8.5), Compensator.paper(rig), duration=5.0, rate=100.0, seed=1)
    columns = {"t": log.time, "q1": log.angle, "q2": log.wheel_angle, "u": log.voltage}
    return (*motions(), (columns, (rig.changed({"axis.inertia": None, "axis.friction": None}).text,)))


def drawn_rig(text: str, draw: random.Random) -> str:
    """The rig file after none to four settings, now and then with a key that is wrong."""
    tree: dict[str, Any] = tomllib.loads(text)
    for _ in range(draw.choice((0, 0, 0, 1, 1, 1, 2, 4))):
        path = draw.choice(list(SETTINGS))
        _set(tree, path, deepcopy(draw.choice(SETTINGS[path])))
    if draw.random() < 0.05:
        _change(tree, draw)
    return _toml(tree, "")


def _set(tree: dict[str, Any], path: str, value: Any) -> None:
    *tables, key = path.split(".")
    for name in tables:
        tree = tree.setdefault(name, {})
    tree[key] = value


def drawn_log(columns: dict[str, np.ndarray], draw: random.Random) -> dict[str, np.ndarray]:
    """Columns that begin and end somewhere, with gaps, repeated rows, another rate, and faults of their values."""
    count = len(columns["t"])
    rows = np.arange(count)
    for _ in range(draw.choice((0, 0, 1, 2))):
        action, at = draw.choice(("gap", "repeat", "thin", "short", "tiny", "few")), draw.randrange(len(rows))
        if action == "gap":
            rows = np.delete(rows, slice(at, at + draw.choice((1, 5, 60))))
        elif action == "repeat":
            rows = np.insert(rows, at, rows[at : at + draw.choice((1, 20))])
        elif action == "thin":
            rows = rows[:: draw.choice((2, 5, 20))]
        elif action == "short":
            rows = rows[at : at + draw.choice((60, 120, 200))]
        else:
            rows = rows[: draw.choice((2, 3, 5, 9)) if action == "tiny" else draw.choice((17, 33))]
        if len(rows) < 2:
            rows = np.arange(2)
    columns = {name: values[rows] for name, values in columns.items()}
    if draw.random() < 0.05:
        del columns[draw.choice(list(columns))]
    return mutated_columns(columns, draw) if "t" in columns and draw.random() < 0.5 else columns


@cache
def known_result(run: int) -> Result:
    """What the log of a run without faults gives."""
    columns, texts = runs()[run]
    rig = Rig.from_text(texts[0], "rig.toml")
    return identify(Recording.from_columns(columns, rig), rig, "momentum")


def answer_case(draw: random.Random) -> None:
    """One thing asked of a drawn rig and log; raises what that raises."""
    run = draw.randrange(len(runs()))
    columns, texts = runs()[run]
    asked, text = draw.choice(ASKED), drawn_rig(draw.choice(texts), draw)
    columns = drawn_log(columns, draw)
    rig = Rig.from_text(text, "rig.toml")
    if asked == "inspect":
        from swingid.study.inspect.inspection import inspect_table

        found = inspect_table(Table(columns), draw.choice((None, rig, rig)))
        assert found.to_json()
        assert found.summary()
        return
    log = Recording.from_columns(columns, rig)
    if asked == "validate":
        from swingid.study.validate import validate

        validation = validate(known_result(run), log, rig, input=draw.choice((None, None, "wheel", "voltage")))
        assert validation.to_json()
        assert validation.summary()
    elif asked == "compare":
        from swingid.study.compare import compare

        comparison = compare(log, rig, draw.sample(list(METHODS), 2))
        assert comparison.to_json()
        assert comparison.summary()
    else:
        options = draw.choice(OPTIONS[asked]) if asked in OPTIONS and draw.random() < 0.2 else {}
        _check(identify(log, rig, asked, **options))


def _check(result: Result) -> None:
    assert result.to_json()
    assert result.summary()
    for parameter in result.parameters.values():
        assert np.isfinite(parameter.value)
        low, high = parameter.interval95 or (parameter.value, parameter.value)
        assert low <= parameter.value <= high, f"{parameter} is outside of its interval"
