"""A commented rig file for a log: the template with the guesses in the place of its [log], and only the log's drive."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from swingid.recording.inspect.encoder_steps import TURN
from swingid.recording.inspect.grid import is_decimal
from swingid.recording.inspect.trial import counts_of

if TYPE_CHECKING:
    from swingid.recording.inspect.candidates import Role
    from swingid.recording.inspect.columns import Column
    from swingid.recording.inspect.roles import Roles

WHEEL_ONLY = ("[drive.wheel]", "[drive.motor]")
LINEAR = """[axis]
kind = "linear"                       # kg, N, m: "inertia" is the moving mass

"""
HEAD = "[log]"

KINDS = {
    "reaction-wheel": "its motor swings the axis",
    "direct": "a motor of known torque on the axis",
    "none": "free decay",
}
UNKNOWN_GRAVITY = (
    'gravity_torque = "unknown"            # or as "78 ± 0.4 mN*m": g times the sum of mass times lever; 0 if balanced'
)
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
            others = [f'"{kind}" ({what})' for kind, what in KINDS.items() if kind != roles.drive]
            kind = f'kind = "{roles.drive}"'
            parts.append(f"[drive]\n{kind:<38}# or {' or '.join(others)}\n\n")
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


def _open(section: str, *keys: str) -> str:
    """A section with the values of these keys (of all) behind a #, for they are those of another rig."""
    return re.sub(rf"(?m)^((?:{'|'.join(keys) or '[a-z_]+'}) = [^#\n]*?)(?:  (?= *#)|$)", r"# \1", section)


def _sensors(roles: Roles, columns: Mapping[str, Column]) -> str:
    lines = ["[sensors]                             # all optional"]
    angle = roles.found.get("angle")
    lines += [] if angle is None else _resolution(angle, columns[angle.column])
    lines += [
        '# nonlinearity = "0.1 deg"            # standard deviation of the once-per-turn cosine and sine parts',
        '# noise = "0.1 mrad"                  # standard deviation, white',
        '# latency = "0 ± 0.3 ms"              # of the angle against the time column; positive = read late',
    ]
    if roles.linear:
        lines = [line for line in lines if "nonlinearity" not in line and "mrad" not in line]
    wheel = roles.found.get("wheel_angle")
    more = [] if wheel is None else _resolution(wheel, columns[wheel.column])
    if more and (len(lines) < 2 or more[0].split("#")[0] != lines[1].split("#")[0]):
        lines += ["", "[sensors.wheel]                       # what differs at the wheel", *more]
    return "\n".join([*lines, "", ""])


def _resolution(role: Role, column: Column) -> list[str]:
    """The line that states the steps of an encoder, where they are seen."""
    if role.unit == "counts":
        text = f"counts_per_turn = {counts_of(column.span)}"
        return [f"# {text:<36}# of the encoder: no log tells it, and identify needs it (here a power of two)"]
    if column.step <= 0 or (is_decimal(column.step) and column.kind != "whole numbers"):
        return []
    if role.unit in ("m", "mm"):
        metres = column.step * (1e-3 if role.unit == "mm" else 1.0)
        return [f"resolution = {metres:.4g}".ljust(38) + "# m, as the log shows"]
    counts = TURN[role.unit] / column.step
    if abs(counts - round(counts)) > 0.05:
        return [f"resolution = {column.step / TURN[role.unit] * 2 * np.pi:.5g}".ljust(38) + "# rad, as the log shows"]
    return [f"counts_per_turn = {round(counts)}".ljust(38) + "# as the log shows"]
