"""The table [device] of rig.toml: how the counts and the voltage of a live rig's device become those of the model."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from swingid.model.rig.fields import Column, Table, plain_number
from swingid.model.rig.tables import Sign


class DeviceTable(Table):
    """A device of a live rig, see `swingid commission`, which writes this table; no method reads it.

    address: what `swingid run` connects to. Signs: -1 where counts fall as the model's angles grow, and where a
    positive output gives the model's negative voltage; `axis_sign` is a choice of direction. axis_zero: counts where
    the body hangs. Limits at which the guard gives 0 V: magnitudes of the angle (rad), of the speeds (rad/s) and of
    the current (A).
    """

    address: Column | None = None
    axis_sign: Sign = 1
    wheel_sign: Sign = 1
    voltage_sign: Sign = 1
    axis_zero: Annotated[int, Field(strict=True, ge=-(2**31), lt=2**31)] = 0
    angle_limit: Annotated[float, plain_number("rad", above=0)] = 1.6
    speed_limit: Annotated[float, plain_number("rad/s", above=0)] = 20.0
    wheel_speed_limit: Annotated[float, plain_number("rad/s", above=0)] = 500.0
    current_limit: Annotated[float, plain_number("A", above=0)] | None = None
