"""Rig files of the corpus as plain data and TOML text: the paper's pendulum with other friction, sensors and drives."""

from __future__ import annotations

import json
from collections.abc import Mapping
from copy import deepcopy
from typing import Any

Tree = dict[str, Any]

PAPER: Tree = {
    "name": "corpus",
    "axis": {"kind": "rotary", "gravity_torque": 78e-3},
    "drive": {
        "kind": "reaction-wheel",
        "wheel": {"inertia": 11.34e-5},
        "motor": {
            "rotor_inertia": 0.21e-5,
            "gear_ratio": 4.4,
            "torque_per_volt": 52.04e-4,
            "back_emf": 3.697e-6,
            "viscous": 3.687e-5,
            "coulomb": 302.02e-5,
            "efficiency": 0.9,
            "dead_zone": [-2.996e-4, 5.485e-4],
            "voltage_limit": 10,
        },
    },
    "sensors": {"counts_per_turn": 16384, "nonlinearity": 0, "latency": 0},
    "log": {"time": "t", "angle": "q1", "wheel_angle": "q2", "voltage": "u", "reference": "ym"},
}
"""What identification is told of the paper's rig: no inertia of the axis, no friction."""

INERTIA = 302.2e-5
DRY = {"viscous": 5e-4, "coulomb": 3e-3}
LAWS: dict[str, Tree] = {
    "none": {},
    "viscous": {"viscous": 1.144e-3},
    "strong-viscous": {"viscous": 9.152e-3},
    "coulomb": DRY,
    "stribeck": {**DRY, "static": 5e-3, "stribeck_speed": 0.3},
    "sharp-stribeck": {**DRY, "static": 5e-3, "stribeck_speed": 0.05},
    "quadratic": {"viscous": 2e-4, "quadratic": 3e-4},
    "cubic": {"viscous": 2e-4, "cubic": 5e-5},
    "direction-dependent": {"viscous_positive": 1.716e-3, "viscous_negative": 0.572e-3},
    "offset": {**DRY, "offset": 1e-3},
    "short-lugre": {**DRY, "lugre": {"bristle_stiffness": 30.0, "bristle_damping": 1e-3}},
    "lugre": {**DRY, "lugre": {"bristle_stiffness": 3.0, "bristle_damping": 1e-3}},
    "sticking": {"viscous": 5e-4, "coulomb": 15e-3, "static": 20e-3},
    "stribeck-quadratic": {"coulomb": 2e-3, "static": 4e-3, "stribeck_speed": 0.3, "quadratic": 2e-4},
}
"""Every friction law of the rig file."""

STATED = {
    "drive.wheel.inertia": "113.4 ± 0.3 kg*mm^2",
    "axis.gravity_torque": "78 ± 0.2 mN*m",
    "sensors.latency": "0 ± 0.2 ms",
    "sensors.nonlinearity": "0.1 deg",
}
"""Uncertainties as a careful user states them."""

DIRECT = {"drive": {"kind": "direct"}, "log": {"torque": "tau"}}
FREE = {"drive": {"kind": "none"}, "log": {"time": "t", "angle": "q1"}}
LINEAR: Tree = {
    "name": "slide",
    "axis": {"kind": "linear"},
    "drive": {"kind": "direct"},
    "sensors": {"resolution": 5e-8, "latency": 0},
    "log": {"torque": "f", "torque_gain": "35.15 ± 0.1"},
}
BLANK = {f"drive.motor.{key}": None for key in ("torque_per_volt", "back_emf", "viscous", "coulomb", "dead_zone")}
"""Changes that leave a rig without motor constants."""

SERVO: Tree = {
    "name": "servo",
    "axis": {"gravity_torque": 0.4807},
    "drive": {"kind": "motor", "motor": {"back_emf": 0.0372}},
    "sensors": {"counts_per_turn": 4096, "nonlinearity": 0, "latency": 0},
    "log": {},
}
SERVO_CONSTANTS = {
    "axis.inertia": 5e-3,
    "axis.friction": {"coulomb": 0.009, "viscous": 0.0037},
    "drive.motor.torque_per_volt": 0.0963,
}
"""A motor on the axis, and what identification is not told of it."""

SPINNING: Tree = {
    "name": "spinning",
    "axis": {"gravity_torque": 0, "friction": {"coulomb": 2e-4, "viscous": 2e-6, "quadratic": 1.5e-8}},
    "drive": {"kind": "none"},
    "sensors": {"counts_per_turn": 64, "nonlinearity": 0, "latency": 0},
    "log": {},
}
GYRO: Tree = {
    "name": "gyro",
    "axis": {"gravity_torque": 0.5, "inertia": 0.01, "friction": {"viscous": 4e-4, "coulomb": 3e-4}},
    "drive": {"kind": "none"},
    "sensors": {"angle_speed": {"noise": "0.05 deg/s", "resolution": "0.0610352 deg/s", "bias": "0 ± 0.5 deg/s"}},
    "log": {"angle_speed": "gz"},
}
UNTOLD = {"axis.inertia": None, "axis.friction": None}
BIFILAR = {"axis.bifilar": {"mass": "1.5 ± 0.001 kg", "length": "0.6 ± 0.001 m", "distance": "0.2 ± 0.0005 m",
                            "upper_distance": 0.3}}  # fmt: skip
TRIFILAR = {"axis.trifilar": {"mass": "1.5 ± 0.001 kg", "height": 0.6, "radius": "0.12 ± 0.0005 m"}}


def changed(tree: Tree, changes: Mapping[str, Any]) -> Tree:
    """The tree with other values at dotted keys; None takes a key away."""
    new = deepcopy(tree)
    for path, value in changes.items():
        *tables, key = path.split(".")
        table = new
        for name in tables:
            table = table.setdefault(name, {})
        if value is None:
            table.pop(key, None)
        else:
            table[key] = deepcopy(value)
    return new


def twin_of(given: Tree, law: str = "viscous", **changes: Any) -> Tree:
    """The rig with the inertia and the friction that identification is not told."""
    return changed(given, {"axis.inertia": INERTIA, "axis.friction": LAWS[law], **changes})


def to_toml(tree: Tree, path: str = "") -> str:
    """The tree as TOML text."""
    lines = [f"{key} = {_value(value)}" for key, value in tree.items() if not isinstance(value, dict)]
    for key, value in tree.items():
        if isinstance(value, dict):
            lines += [f"[{path}{key}]", to_toml(value, f"{path}{key}.")]
    return "\n".join(lines)


def _value(value: Any) -> str:
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return f"[{', '.join(_value(one) for one in value)}]"
    return repr(value)
