"""How much of a log serves each method, and why the rest does not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swingid.methods.table import METHODS, Method
from swingid.model.rig import Rig
from swingid.recording.recording import Recording
from swingid.study.inspect.motion import Swings

GAP = 5.0
"""Steps of the clock beyond which a stretch without rows serves nobody."""


@dataclass(frozen=True)
class Service:
    """Seconds of the log that a method can use, 0 where none; why: what takes the rest away."""

    method: str
    seconds: float
    why: str

    def to_dict(self) -> dict[str, object]:
        """As plain data for JSON."""
        return {"method": self.method, "seconds": self.seconds, "why": self.why}


def services(log: Recording, swings: Swings | None, drive: str, rig: Rig | None) -> list[Service]:
    """One line per method; without a rig what its constants allow is left open."""
    return [_service(method, log, swings, drive, rig) for method in METHODS.values()]


def _service(method: Method, log: Recording, swings: Swings | None, drive: str, rig: Rig | None) -> Service:
    lacking = _lacking(method, log, drive, rig)
    if swings is None or lacking:
        return Service(method.name, 0.0, lacking or "no motion that swings to and fro")
    start, stop = swings.start, swings.stop
    why = []
    first, last = float(log.time[0]), float(log.time[-1])
    if method.turning_points:
        turning = swings.motion.within(start, stop).turning_times
        start, stop = float(turning[0]), float(turning[-1])
    for seconds, reason in ((start - first, "before"), (last - stop, "after")):
        if seconds > 0.01 * (last - first):
            why.append(f"{seconds:.3g} s {reason} {_what(drive, reason, method)}")
    inside = log.segment(start, stop)
    steps = np.diff(inside.time)
    gaps = steps[steps > GAP * np.median(steps)] if len(steps) else steps
    usable = stop - start - swings.rest - float(gaps.sum())
    if swings.rest > 0:
        why.append(f"{swings.rest:.3g} s at rest")
    if gaps.size:
        why.append(f"{gaps.sum():.3g} s of gaps")
    return Service(method.name, max(usable, 0.0), ", ".join(why) or "all of it")


def _what(drive: str, reason: str, method: Method) -> str:
    if method.turning_points:
        return "the first turning point" if reason == "before" else "the last turning point"
    if reason == "before":
        return "the free decay" if drive == "none" else "the motion has settled"
    return "the free decay ends" if drive == "none" else "the end of the part"


def _lacking(method: Method, log: Recording, drive: str, rig: Rig | None) -> str:
    """What a method needs that is not there; "" where nothing is missing."""
    if drive == "reaction-wheel" and log.wheel_angle is None:
        return "no wheel angle"
    if drive == "direct" and log.torque is None:
        return "no torque"
    if method.gravity and rig is not None:
        gravity = rig.axis.gravity_torque
        if isinstance(gravity, str) or gravity.value == 0:
            return "needs a gravity torque above 0"
    if method.drive and drive == "none":
        return "needs a drive"
    if method.motor == "needed" and drive == "reaction-wheel":
        if log.voltage is None:
            return "no voltage"
        motor = None if rig is None else rig.drive.motor
        if rig is not None and (motor is None or motor.torque_per_volt.value == 0):
            return "the rig file has no motor constants"
    return ""
