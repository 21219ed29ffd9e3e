"""A rig that only reads the columns that were guessed, so that a log can be looked at before there is a rig file."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from swingid.errors import SwingidError
from swingid.model.rig import Rig

if TYPE_CHECKING:
    from swingid.recording.inspect.columns import Column
    from swingid.recording.inspect.roles import Roles


def trial_rig(roles: Roles, columns: Mapping[str, Column], table: str) -> Rig | None:
    """The rig of a guessed [log] table, its constants placeholders; None without an angle or a clock.

    Counts are read by the next power of two above their range.
    """
    if not {"time", "angle"} <= roles.found.keys():
        return None
    kind = "linear" if roles.linear else "rotary"
    parts = [f'name = "guess"\n[axis]\nkind = "{kind}"\n', f'[drive]\nkind = "{roles.drive}"\n']
    if roles.linear:
        parts[1] = parts[1].replace("reaction-wheel", "none")
    else:
        parts[0] += "gravity_torque = 1.0\n" if roles.drive == "none" else 'gravity_torque = "unknown"\n'
    if roles.drive == "reaction-wheel":
        parts.append("[drive.wheel]\ninertia = 1.0\n")
    parts.append(_sensors(roles, columns))
    try:
        tomllib.loads(table)
        return Rig.from_text("".join([*parts, table]), "the guessed rig")
    except (SwingidError, tomllib.TOMLDecodeError):
        return None


def _sensors(roles: Roles, columns: Mapping[str, Column]) -> str:
    text = ""
    for role, head in (("angle", "[sensors]"), ("wheel_angle", "[sensors.wheel]")):
        guess = roles.found.get(role)
        if guess is not None and guess.unit == "counts":
            text += f"{head}\ncounts_per_turn = {counts_of(columns[guess.column].span)}\n"
    return text


def counts_of(span: float) -> int:
    """Counts per turn of an encoder that logs counts over `span`: a power of two."""
    return int(2 ** np.ceil(np.log2(max(span, 2.0) + 1)))
