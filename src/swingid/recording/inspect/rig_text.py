"""Rig files from the guessed roles of columns: the table [log], a commented file to fill in, a rig for a first look."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from swingid.errors import SwingidError
from swingid.model.rig import Rig
from swingid.recording.grid import TURN, is_decimal
from swingid.recording.inspect.candidates import counts_ticks

if TYPE_CHECKING:
    from swingid.recording.inspect.candidates import Role
    from swingid.recording.inspect.columns import Column
    from swingid.recording.inspect.roles import Roles


WIDTH = 38


def log_table(roles: Roles) -> str:
    """TOML text of [log] with a comment per line."""
    lines = [_line("[log]", "guessed from the file: confirm each line")]
    time = roles.found.get("time")
    if time is None:
        each, frames = (30, "frames of the video") if "point_x" in roles.found else (1000, "rows")
        lines.append(_line(f"# rate = {each}", f"{frames} per second: there is no column of times, so state it"))
    else:
        lines.append(_column("time", time))
        if counts_ticks(time.column):
            text = "of a tick: no log determines it, and identify needs it (here of a timer of 2 MHz)"
            lines.append(_line('# time_unit = "0.5 us"', text))
        elif time.unit != "s":
            lines.append(_line(f'time_unit = "{time.unit}"', "of the clock"))
    lines.append(
        _line('# clock = "0 ± 100 ppm"', "by how much the clock is fast; this is taken where it is not stated")
    )
    lines += _point_lines(roles)
    angle = roles.found.get("angle")
    if angle is not None:
        lines.append(_column("angle", angle))
        lines.append(_line(f'angle_unit = "{angle.unit}"', "of the body"))
        if not roles.linear:
            up = bool(roles.zero_up)
            text = "the motion is about half a turn" if up else "as far as the file shows"
            lines.append(_line(f'angle_zero = "{"up" if up else "down"}"', text))
        lines.append(_line("angle_sign = 1", "counter-clockwise positive; not determined by a file"))
    rate = roles.found.get("angle_speed")
    if rate is not None:
        lines.append(_column("angle_speed", rate))
        lines.append(_line(f'angle_speed_unit = "{rate.unit}"', "of the rate of the body; its integral is the angle"))
        lines.append(_line('# angle_speed_scale = "1 ± 0.01"', "of the gyroscope, with its uncertainty"))
    lines += _drive_lines(roles)
    reference = roles.found.get("reference")
    if reference is not None:
        lines.append(_column("reference", reference) + "; for plots only")
    return "\n".join(lines) + "\n"


def _point_lines(roles: Roles) -> list[str]:
    """The lines of a mark in a video."""
    if "point_x" not in roles.found:
        return []
    x, y = (json.dumps(roles.column(f"point_{axis}"), ensure_ascii=False) for axis in "xy")
    lines = [_line(f"point = [{x}, {y}]", f"a mark on the body: {roles.found['point_x'].why}")]
    if "pivot_x" in roles.found:
        x, y = (json.dumps(roles.column(f"pivot_{axis}"), ensure_ascii=False) for axis in "xy")
        lines.append(_line(f"# pivot = [{x}, {y}]", "a mark that stays where it is; else the pivot is fitted"))
    else:
        lines.append(_line("# pivot = [0, 0]", "its place, or the columns of a mark on it; else it is fitted"))
    lines.append(_line("angle_sign = 1", "counter-clockwise positive; not determined by a file"))
    return lines


def _drive_lines(roles: Roles) -> list[str]:
    lines = []
    for key in ("wheel_angle", "wheel_speed", "voltage", "torque"):
        role = roles.found.get(key)
        if role is None:
            continue
        lines.append(_column(key, role))
        if key.startswith("wheel"):
            lines.append(_line(f'{key}_unit = "{role.unit}"', "of the wheel"))
        if key == "wheel_angle":
            lines.append(_line("wheel_angle_sign = 1", "inspect --rig tests it against the angle"))
        if key.startswith("wheel"):
            text = 'to the pendulum, or "absolute": yours to state, for it changes the inertia'
            lines.append(_line('# wheel_angle_is = "relative"', text))
        if key == "voltage" and roles.drive == "motor":
            text = "volts per unit of the column, as of pulse widths, with its uncertainty"
            lines.append(_line('# voltage_scale = "12 ± 0.1 V / 255"', text))
        if key == "torque":
            text = "N m (N) per unit of the column, with its uncertainty: yours to state, for it sets the scale"
            lines.append(_line("# torque_gain = 1", text))
    if "voltage" in roles.found or "torque" in roles.found:
        lines.append(_line("drive_held = true", "row k's command acts until row k+1; false: measured at row k"))
    return lines


def _line(text: str, comment: str) -> str:
    return f"{text:<{WIDTH - 1}} # {comment}"


def _column(key: str, role: Role) -> str:
    return _line(f"{key} = {json.dumps(role.column, ensure_ascii=False)}", role.why)


def trial_rig(roles: Roles, columns: Mapping[str, Column], table: str) -> Rig | None:
    """The rig of a guessed [log] table, its constants placeholders; None without an angle or a clock.

    Counts are read by the next power of two above their range.
    """
    if "time" not in roles.found or not roles.has_motion:
        return None
    kind = "linear" if roles.linear else "rotary"
    parts = [f'name = "guess"\n[axis]\nkind = "{kind}"\n', f'[drive]\nkind = "{roles.drive}"\n']
    if roles.linear:
        parts[1] = parts[1].replace("reaction-wheel", "none")
    else:
        parts[0] += "gravity_torque = 1.0\n" if roles.drive == "none" else 'gravity_torque = "unknown"\n'
    if roles.drive == "reaction-wheel":
        parts.append("[drive.wheel]\ninertia = 1.0\n")
    parts.append(_counts_of_sensors(roles, columns))
    try:
        tomllib.loads(table)
        return Rig.from_text("".join([*parts, table]), "the guessed rig")
    except (SwingidError, tomllib.TOMLDecodeError):
        return None


def _counts_of_sensors(roles: Roles, columns: Mapping[str, Column]) -> str:
    text = ""
    for role, head in (("angle", "[sensors]"), ("wheel_angle", "[sensors.wheel]")):
        guess = roles.found.get(role)
        if guess is not None and guess.unit == "counts":
            text += f"{head}\ncounts_per_turn = {counts_of(columns[guess.column].span)}\n"
    return text


def counts_of(span: float) -> int:
    """Counts per turn of an encoder that logs counts over `span`: a power of two, at most 2³² as of a counter."""
    return int(2 ** np.ceil(np.log2(min(max(span, 2.0) + 1, 2.0**32))))


WHEEL_ONLY = ("[drive.wheel]", "[drive.motor]")
LINEAR = """[axis]
kind = "linear"                       # kg, N, m: "inertia" is the moving mass
# model_uncertainty = "0.005 %"       # of every result, for what no equation has: soft base, filters, backlash

"""
HEAD = "[log]"

KINDS = {
    "reaction-wheel": "its motor swings the axis",
    "direct": "a motor of known torque on the axis",
    "motor": "a motor on the axis, its voltage known",
    "none": "free decay",
}
UNKNOWN_GRAVITY = 'gravity_torque = "unknown"            # or "78 ± 0.4 mN*m": g, mass, lever; 0: balanced, on a wire'
OPEN_CONSTANTS = "# Values behind a # are those of the paper's rig: put yours, and take the # away."


def rig_text(template: str, roles: Roles, columns: Mapping[str, Column], table: str, name: str, log: str) -> str:
    """TOML text that `Rig.from_text` reads; template: that of ``swingid init``, table: of `log_table`.

    name: of the rig. log: the file that was looked at, for the head's comment.
    """
    head, *sections = re.split(r"(?m)^(?=\[)", template)
    head = head.replace('name = "my-rig"', f'name = "{name}"')
    head = re.sub(r"(?m)^# The values here .*$", OPEN_CONSTANTS, head)
    head = f"# Made by swingid init --from {log}: [log] and [sensors] are guesses, to be confirmed.\n#\n{head}"
    parts = [head]
    for section in sections:
        title = section.split("]")[0] + "]"
        if title == HEAD:
            parts.append(table)
        elif title in WHEEL_ONLY and roles.drive != "reaction-wheel":
            continue
        elif title == "[drive]":
            parts.append(_drive(roles))
        elif title == "[sensors]":
            parts.append(_sensors(roles, columns))
        elif roles.linear and title == "[axis]":
            parts.append(LINEAR)
        elif title == "[axis]":
            parts.append(re.sub(r"(?m)^gravity_torque = .*$", UNKNOWN_GRAVITY, _open(section, "inertia")))
        elif title in ("[axis.friction]", *WHEEL_ONLY) and not (roles.linear and title == "[axis.friction]"):
            parts.append(_open(section))
        elif title != "[axis.friction]":
            parts.append(section)
    return "".join(parts)


def _drive(roles: Roles) -> str:
    """The section [drive]; a reaction wheel is not offered for a log without a column of it."""
    wheel = roles.drive == "reaction-wheel"
    others = [f'"{kind}" ({what})' for kind, what in KINDS.items() if kind not in (roles.drive, "reaction-wheel")]
    kind = f'kind = "{roles.drive}"'
    text = f"[drive]\n{kind:<38}# or {' or '.join(others)}\n"
    text += "" if wheel else f"# {NO_WHEEL}\n"
    return f"{text}\n{MOTOR if roles.drive == 'motor' else ''}"


MOTOR = """# [drive.motor]                       # constants that are not stated are found
# gear_friction = "unknown"           # friction in proportion to the voltage, as of a gear

"""

NO_WHEEL = "A reaction wheel needs a column of its angle or speed, which this log does not have."


def _open(section: str, *keys: str) -> str:
    """A section with the values of these keys (of all) behind a #, for they are those of another rig."""
    return re.sub(rf"(?m)^((?:{'|'.join(keys) or '[a-z_]+'}) = [^#\n]*?)(?:  (?= *#)|$)", r"# \1", section)


RATE_SENSOR = """[sensors.angle_speed]                 # all optional
# noise = "0.05 deg/s"                # standard deviation, white
# bias = "0 ± 0.5 deg/s"              # its uncertainty; the log shows the value

"""


CAMERA = """[sensors]                             # all optional
sensor = "camera"                     # lens and view from aside; the pivot's part is that of its fit

"""


def _sensors(roles: Roles, columns: Mapping[str, Column]) -> str:
    lines = ["[sensors]                             # all optional"]
    angle = roles.found.get("angle")
    if "point_x" in roles.found:
        return CAMERA
    if angle is None:
        return RATE_SENSOR
    lines += _resolution(angle, columns[angle.column])
    lines += [
        '# sensor = "AS5048A"                  # its kind; docs/rig.md lists them',
        '# nonlinearity = "0.1 deg"            # standard deviation of the once-per-turn cosine and sine parts',
        '# noise = "0.1 mrad"                  # standard deviation, white',
        '# latency = "0 ± 0.3 ms"              # of the angle against the time column; positive = read late',
    ]
    if roles.linear:
        lines = [line for line in lines if "nonlinearity" not in line and "sensor =" not in line and "mrad" not in line]
    wheel = roles.found.get("wheel_angle")
    more = [] if wheel is None else _resolution(wheel, columns[wheel.column])
    if more and (len(lines) < 2 or more[0].split("#")[0] != lines[1].split("#")[0]):
        lines += ["", "[sensors.wheel]                       # what differs at the wheel", *more]
    return "\n".join([*lines, "", ""])


def _resolution(role: Role, column: Column) -> list[str]:
    """The line that states the steps of an encoder, where they are seen."""
    if role.unit == "counts":
        text = f"counts_per_turn = {counts_of(column.span)}"
        return [f"# {text:<36}# of the encoder: no log determines it, and identify needs it (here a power of two)"]
    if column.step <= 0 or (is_decimal(column.step) and column.kind != "whole numbers"):
        return []
    if role.unit in ("m", "mm"):
        metres = column.step * (1e-3 if role.unit == "mm" else 1.0)
        return [f"resolution = {metres:.4g}".ljust(38) + "# m, as the log shows"]
    counts = TURN[role.unit] / column.step
    if abs(counts - round(counts)) > 0.05:
        return [f"resolution = {column.step / TURN[role.unit] * 2 * np.pi:.5g}".ljust(38) + "# rad, as the log shows"]
    return [f"counts_per_turn = {round(counts)}".ljust(38) + "# as the log shows"]
