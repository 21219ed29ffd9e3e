"""The JSON of "Better Actuator Models" (Rhoban/bam): an example of a small importer.

A header (mass, length, motor, trajectory) and `entries` with position, speed, load, input_volts, timestamp. `load` is
the duty of the bridge in 1/885, its sign wrapped into 16 bits (as the XL330's register Present PWM).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

FULL = 885
"""`load` at full duty."""

LARGEST = 1e6
"""Volts that no supply has: an integer of hundreds of digits, as damage makes it, is no float."""


def is_bam(header: Mapping[str, Any]) -> bool:
    """Whether a JSON object is such a log."""
    return {"motor", "trajectory", "entries"} <= header.keys()


def decoded(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """The entries with two more columns: `duty` from -1 to 1, and `bridge_volts`, duty times the supply."""
    found = []
    for row in rows:
        load, volts = row.get("load"), row.get("input_volts")
        more: dict[str, Any] = {}
        if isinstance(load, int) and abs(load) < 1 << 32:
            more["duty"] = (load - 65536 if load > 32767 else load) / FULL
            if isinstance(volts, int | float) and abs(volts) < LARGEST:
                more["bridge_volts"] = more["duty"] * volts
        found.append({**row, **more})
    return found
