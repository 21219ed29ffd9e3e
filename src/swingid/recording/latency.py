"""The latencies that the rig file states, taken off by the methods: named, and with a switch."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from swingid.numerics.spline import spline_at, spline_slopes
from swingid.recording.recording import Finding, Recording

if TYPE_CHECKING:
    from swingid.model.rig import Rig
    from swingid.numerics.arrays import Array

REPAIR, LEFT = "latency", "latency-left"


def with_latency_told(log: Recording, rig: Rig) -> Recording:
    """The log with a note of the latencies that a method takes off; where that is switched off, so that none is seen.

    Methods take row k's angle for that at t_k + latency. With the repair "latency" off it is that at t_k: each channel
    is moved by its latency (its cubic spline), and a method that takes the latency off finds the readings as they were.
    Their uncertainty stays. Unchanged where the file states no latency, in a free decay, and where it was done before.
    """
    late = {"angle": rig.sensors.of("angle").latency.value}
    if log.wheel_angle is not None and rig.drive.kind == "reaction-wheel":
        late["wheel_angle"] = rig.sensors.of("wheel").latency.value
    done = any(found.code in (REPAIR, LEFT) for found in log.findings)
    if done or rig.drive.kind == "none" or not any(late.values()):
        return log
    sizes = {"angle": "angle", "wheel_angle": "wheel's angle"}
    shown = " and ".join(f"{1e3 * value:.4g} ms of the {sizes[name]}" for name, value in late.items() if value)
    if not any(found.code == "repair-off" and found.repair == REPAIR for found in log.findings):
        text = f"the known latency was taken off: {shown}."
        return replace(log, findings=(*log.findings, Finding("latency", text, "note", REPAIR)))
    text = f"the known latency, {shown}, was not taken off."
    found = (*log.findings, Finding(LEFT, text, "note"))
    if max(map(abs, late.values())) >= log.duration / 2:
        return replace(log, findings=found)  # a typing error, which methods refuse
    angle, wheel = _earlier(log.time, log.angle, late["angle"]), log.wheel_angle
    if wheel is not None:
        wheel = _earlier(log.time, wheel, late.get("wheel_angle", 0.0))
    most, least = max(0.0, *late.values()), min(0.0, *late.values())
    moved = replace(log, findings=found, angle=angle, wheel_angle=wheel)
    return moved.segment(float(log.time[0]) - least, float(log.time[-1]) - most)


def _earlier(time: Array, values: Array, late: float) -> Array:
    """A channel's values `late` seconds after each stamp."""
    if late == 0.0:
        return values
    return spline_at(time, values, spline_slopes(time, values), time + late, 0)
