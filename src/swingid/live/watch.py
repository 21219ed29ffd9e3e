"""The host's guard of a run: the firmware's limits, tighter, and the energy of the body, on the samples that come.

It sees a sample some milliseconds late, so it is no protection but a second look: a sentence from it is a hard stop.
"""

from __future__ import annotations

import math
from collections import deque

from swingid.live import guard as at
from swingid.live.codes import apart
from swingid.live.frames import Frame
from swingid.live.machine import ENERGISED

TIGHTER = 0.9
"""Share of the firmware's limits at which the host stops."""


STOPPED = "the host's guard has stopped the run"


class HostGuard:
    """Called with the Sample frames of a batch; returns what is wrong in a sentence, or None.

    parameters: those of the device. inertia (kg m^2), gravity_torque (N m): of the body as expected, nan where they are
    not known; energy (J): what it must not exceed, infinite for no limit.
    """

    def __init__(
        self,
        parameters: list[float],
        *,
        inertia: float = math.nan,
        gravity_torque: float = math.nan,
        energy: float = math.inf,
    ) -> None:
        self._p = parameters
        self._inertia, self._gravity, self._energy = inertia, gravity_torque, energy
        self._past: deque[Frame] = deque(maxlen=int(parameters[at.SPEED_SPAN]) + 1)

    def __call__(self, frames: list[Frame]) -> str | None:
        """Look at a batch."""
        for frame in frames:
            before = self._past[-1] if self._past else None
            if before is not None and (frame.sequence - before.sequence) % 2**32 > 2**31:
                continue  # an older one that comes late
            self._past.append(frame)
            if before is not None and frame.sequence != before.sequence and apart(frame.time, before.time) <= 0:
                return f"{STOPPED}: the device's clock does not go on, from {before.time} to {frame.time} us"
            if frame.state in ENERGISED and (why := self._wrong(frame)) is not None:
                return f"{STOPPED}: {why}"
        return None

    def _wrong(self, frame: Frame) -> str | None:
        p, first = self._p, self._past[0]
        angle = apart(frame.axis, int(p[at.AXIS_ZERO])) * p[at.AXIS_STEP]
        if abs(angle) > TIGHTER * p[at.ANGLE_LIMIT]:
            return f"the angle is {angle:.3g} rad, its limit {TIGHTER * p[at.ANGLE_LIMIT]:.3g} rad"
        if not abs(frame.voltage) <= p[at.VOLTAGE_LIMIT] * (1 + 1e-6):
            return f"the device applies {frame.voltage:.3g} V, its limit is {p[at.VOLTAGE_LIMIT]:.3g} V"
        time = ((frame.time - first.time) % 2**32) * 1e-6
        if len(self._past) < (self._past.maxlen or 0) or not 0 < time < 1.0:
            return None
        speed = apart(frame.axis, first.axis) * p[at.AXIS_STEP] / time
        wheel = apart(frame.wheel, first.wheel) * p[at.WHEEL_STEP] / time
        for name, value, limit in (
            ("axis", speed, p[at.SPEED_LIMIT]),
            ("wheel", wheel, p[at.WHEEL_SPEED_LIMIT]),
        ):
            if abs(value) > TIGHTER * limit:
                return f"the {name} turns at {value:.3g} rad/s, its limit is {TIGHTER * limit:.3g} rad/s"
        energy = energy_of(angle, speed, self._inertia, self._gravity)
        if energy > self._energy:
            return f"the body's energy is {energy:.3g} J, and was to stay below {self._energy:.3g} J"
        return None


def energy_of(angle: float, speed: float, inertia: float, gravity_torque: float) -> float:
    """Energy (J) of the body at an angle (rad) and a speed (rad/s) about where it hangs."""
    return 0.5 * inertia * speed * speed + gravity_torque * (1.0 - math.cos(angle))
