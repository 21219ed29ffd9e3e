"""The table [log] of a rig file as a guess: what to confirm, each line with what it rests on."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from swingid.recording.inspect.roles import Roles

WIDTH = 38


def log_table(roles: Roles) -> str:
    """TOML text of [log] with a comment per line."""
    lines = [_line("[log]", "guessed from the file: confirm each line")]
    time = roles.found.get("time")
    if time is None:
        lines.append(_line("# rate = 1000", "rows per second: no column rises as a clock does, so state it"))
    else:
        lines.append(_line(f"time = {json.dumps(time.column, ensure_ascii=False)}", time.why))
        if time.unit != "s":
            lines.append(_line(f'time_unit = "{time.unit}"', "of the clock"))
    angle = roles.found.get("angle")
    if angle is not None:
        lines.append(_line(f"angle = {json.dumps(angle.column, ensure_ascii=False)}", angle.why))
        lines.append(_line(f'angle_unit = "{angle.unit}"', "of the body"))
        if not roles.linear:
            up = bool(roles.zero_up)
            text = "the motion is about half a turn" if up else "as far as the file tells"
            lines.append(_line(f'angle_zero = "{"up" if up else "down"}"', text))
        lines.append(_line("angle_sign = 1", "counter-clockwise positive; no file tells"))
    lines += _drive_lines(roles)
    reference = roles.found.get("reference")
    if reference is not None:
        column = json.dumps(reference.column, ensure_ascii=False)
        lines.append(_line(f"reference = {column}", f"{reference.why}; for plots only"))
    return "\n".join(lines) + "\n"


def _drive_lines(roles: Roles) -> list[str]:
    lines = []
    for key in ("wheel_angle", "wheel_speed", "voltage", "torque"):
        role = roles.found.get(key)
        if role is None:
            continue
        lines.append(_line(f"{key} = {json.dumps(role.column, ensure_ascii=False)}", role.why))
        if key.startswith("wheel"):
            lines.append(_line(f'{key}_unit = "{role.unit}"', "of the wheel"))
        if key == "wheel_angle":
            lines.append(_line("wheel_angle_sign = 1", "inspect --rig tests it against the angle"))
            text = 'to the pendulum; or "absolute": inspect --rig compares both'
            lines.append(_line('wheel_angle_is = "relative"', text))
        if key == "torque":
            text = "N m (N) per unit of the column, with its uncertainty: yours to state"
            lines.append(_line("torque_gain = 1", text))
    if "voltage" in roles.found or "torque" in roles.found:
        lines.append(_line("drive_held = true", "row k's command acts until row k+1; false: measured at row k"))
    return lines


def _line(text: str, comment: str) -> str:
    return f"{text:<{WIDTH - 1}} # {comment}"
