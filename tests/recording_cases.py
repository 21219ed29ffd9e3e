"""Rigs by their [log] table, and a motion with known values, for the tests of recordings."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from swingid.model.rig import Rig
from swingid.recording import Recording

_WHEEL = """
[drive]
kind = "reaction-wheel"
[drive.wheel]
inertia = 11.34e-5
[drive.motor]
rotor_inertia = 0.21e-5
gear_ratio = 4.4
torque_per_volt = 52.04e-4
"""


def rig_with(
    kind: str = "reaction-wheel", axis: str = "rotary", sensors: str = "", gravity: float = 78e-3, **log: object
) -> Rig:
    """A rig of this drive and axis whose [log] holds these keys."""
    drive = _WHEEL if kind == "reaction-wheel" else f'[drive]\nkind = "{kind}"\n'
    keys = "\n".join(f"{key} = {_toml(value)}" for key, value in log.items())
    tables = [f'[axis]\nkind = "{axis}"\ngravity_torque = {gravity}', drive, f"[sensors]\n{sensors}", f"[log]\n{keys}"]
    text = "\n".join(['name = "test"', *tables])
    return Rig.from_text(text, "test.toml")


def _toml(value: object) -> str:
    return f'"{value}"' if isinstance(value, str) else str(value).lower()


def swing(rate: float = 1000.0, duration: float = 5.0, amplitude: float = 0.8, wheel: float = 20.0) -> Recording:
    """A reaction wheel pendulum's motion that starts at rest and swings with 8.5 rad/s; peak wheel speed 8.5 wheel."""
    time = np.arange(round(duration * rate)) / rate
    share = np.minimum(1.0, time)
    start = share**3 * (10 - 15 * share + 6 * share**2)  # without a kink, which would hide a spike of 50 Hz beside it
    reference = amplitude * np.sin(8.5 * time) * start
    angle = amplitude * np.sin(8.5 * time - 0.02) * start
    wheel_angle = -wheel * np.sin(8.5 * time - 0.02) * start
    return Recording(time, angle, wheel_angle, 5.0 * np.cos(8.5 * time), reference=reference, adaptive_gain=10.0 + time)


def write_columns(path: Path, columns: dict[str, object], separator: str = ",", newline: str = "\n") -> Path:
    """A text table of these columns (numbers or texts), written as any other program would."""
    rows = zip(*columns.values(), strict=True)
    lines = [separator.join(columns)] + [
        separator.join(c if isinstance(c, str) else repr(float(c)) for c in r) for r in rows
    ]
    path.write_bytes(newline.join([*lines, ""]).encode())
    return path


def columns_of(recording: Recording) -> dict[str, object]:
    """The recording's channels by the default names of a file."""
    names = {"t": "time", "q1": "angle", "q2": "wheel_angle", "u": "voltage"}
    return {column: getattr(recording, channel).copy() for column, channel in names.items()}
