"""A command beyond what the drive gives: the motor got the limit that the rig file states."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from swingid.recording.recording import Finding

if TYPE_CHECKING:
    from swingid.model.rig import Rig
    from swingid.recording.conventions import Channels, Conventions

ROUNDING = 1e-3
"""Of the limit: what a logger may round a command up to."""


def limited(
    channels: Channels, conventions: Conventions, rig: Rig, *, held: bool, off: frozenset[str]
) -> tuple[Channels, list[Finding]]:
    """The channels (logged units) with commanded voltages within ± `drive.motor.voltage_limit`, and what was done.

    held: the voltage is a command; one that was measured is what the motor got, and is left alone.
    """
    motor = rig.drive.motor
    if "voltage" not in channels or motor is None or motor.voltage_limit is None or not held:
        return channels, []
    scale = conventions.scales.get("voltage")
    limit = motor.voltage_limit / abs(scale.factor if scale is not None else 1.0)
    voltage = channels["voltage"]
    beyond = int(np.count_nonzero(np.abs(voltage) > (1 + ROUNDING) * limit))
    if beyond == 0:
        return channels, []
    column = conventions.columns["voltage"]
    where = f"column {column!r} goes beyond drive.motor.voltage_limit = {motor.voltage_limit:g} V in {beyond} of "
    where += f"{voltage.size} rows"
    if "limit" in off:
        message = f"{where}, and was left so; if it is a command, the motor got less."
        return channels, [Finding("voltage-beyond-limit", message, "warning")]
    message = (
        f"{where}; the limit was taken there, as what the motor got (drive_held = false says that it was measured)."
    )
    limited_voltage = np.clip(voltage, -limit, limit)
    return {**channels, "voltage": limited_voltage}, [Finding("voltage-limited", message, "note", "limit")]
