"""Before a run: the experiment on the twin against the limits, the device against the rig file, the body at rest."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from swingid.errors import InputError, UsageError
from swingid.live.guard import Board, Limits
from swingid.live.watch import TIGHTER, energy_of
from swingid.units import Quantity

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from swingid.control.compensator import Compensator
    from swingid.control.references import Reference
    from swingid.model.rig import Rig
    from swingid.numerics.arrays import Array
    from swingid.recording.recording import Recording


ENERGY = 2.0
"""How many times the largest energy of the rehearsal the body may have."""

SMALL = 0.1
"""Angle (rad) whose energy at rest is always allowed: less is no danger, and a tiny motion has its noise."""

FOLLOWS, STRAYS = 0.25, 0.6
"""Root of the mean square tracking error, over that of the reference in the last quarter of the rehearsal, beyond which
it is said, and refused. Of 42 motions of the paper's rigs by its gains those that the motor can make had 0.07 to 0.43;
those that it cannot (at its limit more than half of the time), or that are too small to move it, 0.51 to 1.4.
"""

SETTLED = 8.0
"""Seconds of a run from which on straying is refused: the gain needs up to 6 s, and a shorter run is mostly start."""


@dataclass(frozen=True)
class Rehearsed:
    """The largest values of the experiment on the twin: angle (rad), speeds (rad/s), voltage (V), time at the voltage
    limit without a break (s), energy of the body (J); tracking: root of the mean square error in the second half (rad);
    of_reference: that in the last quarter over the reference's own, 0 where it rests.
    """

    angle: float
    speed: float
    wheel_speed: float
    voltage: float
    saturated: float
    energy: float
    tracking: float
    of_reference: float = 0.0

    def words(self) -> str:
        """One line for people."""
        return (
            f"on the twin: {self.angle:.3g} rad, {self.speed:.3g} rad/s, wheel {self.wheel_speed:.3g} rad/s, "
            f"{self.voltage:.3g} V, tracking error {self.tracking:.2g} rad"
            + (f", {self.of_reference:.0%} of the reference" if self.of_reference > FOLLOWS else "")
        )


def rehearsed(
    rig: Rig,
    motion: Reference,
    controller: Compensator,
    limits: Limits,
    seen: Callable[[Recording], None] = lambda _: None,
    /,
    *,
    duration: float,
    rate: float,
    fade: float,
) -> Rehearsed:
    """Run the experiment on the twin of the rig file, with the fade (s) that ends it.

    seen: called with the log of the twin, before it is held against the limits.

    Raises UsageError (code "out-of-range") for too few samples, (code "beyond-limits") where it passes the host's
    limits, which are tighter than the firmware's, (code "does-not-follow") where it strays from its reference,
    InputError where the rig file does not have what the twin needs.
    """
    from swingid.simulation import simulate

    rows = int(duration * rate + 1e-9)
    if rows < 2 * limits.speed_span:
        text = f"--duration {duration:g} s is {rows} samples of the device, and the guard needs {2 * limits.speed_span}"
        raise UsageError(f"{text}; give a longer one", code="out-of-range")
    try:
        log = simulate(rig, _faded(motion, duration, fade), controller, duration=duration + fade, rate=rate)
    except InputError as error:
        if error.code != "not-finite":
            raise
        raise UsageError(f"{BEYOND}: the loop is unstable; choose other gains", code="beyond-limits") from None
    seen(log)
    assert log.voltage is not None
    assert log.reference is not None
    angle, step = log.angle, limits.speed_span
    speed = (angle[step:] - angle[:-step]) * (rate / step)
    wheel = np.zeros(1)
    if log.wheel_angle is not None:
        wheel = (log.wheel_angle[step:] - log.wheel_angle[:-step]) * (rate / step)
    inertia, gravity = expected(rig)
    energy = [energy_of(q, v, inertia, gravity) for q, v in zip(angle[step:], speed, strict=True)]
    missed, last = (log.reference - angle)[rows // 2 : rows], slice(rows - rows // 4, rows)
    result = Rehearsed(
        angle=float(np.abs(angle).max()),
        speed=float(np.abs(speed).max()),
        wheel_speed=float(np.abs(wheel).max()),
        voltage=float(np.abs(log.voltage).max()),
        saturated=_longest(np.abs(log.voltage) >= limits.voltage * (1 - 1e-9)) / rate,
        energy=float(np.nanmax(energy)) if np.isfinite(energy).any() else math.inf,
        tracking=float(np.sqrt(np.mean(missed**2))),
        of_reference=_share((log.reference - angle)[last], log.reference[last]),
    )
    for name, value, limit, unit in (
        ("the angle", result.angle, limits.angle, "rad"),
        ("the speed of the axis", result.speed, limits.speed, "rad/s"),
        ("the speed of the wheel", result.wheel_speed, limits.wheel_speed, "rad/s"),
        ("the time at the voltage limit", result.saturated, limits.saturated, "s"),
    ):
        if value > TIGHTER * limit:
            text = f"{BEYOND}: {name} reaches {value:.3g} {unit}, and the host stops at {TIGHTER * limit:.3g} {unit}; "
            raise UsageError(text + "choose a smaller or slower --reference", code="beyond-limits")
    if result.of_reference > STRAYS and duration >= SETTLED:
        text = f"on the twin the body does not follow the reference: its error is {result.tracking:.2g} rad, "
        text += f"{result.of_reference:.0%} of the motion; choose a motion that the motor can make, or other gains"
        raise UsageError(text, code="does-not-follow")
    return result


def _share(missed: Array, reference: Array) -> float:
    """Root mean square of the error over that of the reference, both (n,); 0 where the reference rests."""
    power = float(np.mean(reference**2))
    return math.sqrt(float(np.mean(missed**2)) / power) if power > 0.0 else 0.0


def _faded(motion: Reference, duration: float, fade: float) -> Callable[[Array], Array]:
    """The motion up to `duration` (s), then what the device makes of it: its last value goes to 0 within `fade` (s)."""

    def reference(t: Array) -> Array:
        share = np.clip((duration + fade - t) / fade, 0.0, 1.0) if fade > 0.0 else np.where(t < duration, 1.0, 0.0)
        return np.asarray(motion(np.minimum(t, duration)) * share)

    return reference


BEYOND = "the rehearsal on the twin passes the limits of the guard"


def _longest(true: NDArray[np.bool_]) -> int:
    """Length of the longest run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], true.astype(int), [0]])))
    return int((edges[1::2] - edges[::2]).max(initial=0))


def expected(rig: Rig) -> tuple[float, float]:
    """Inertia (kg m^2) and gravity torque (N m) that the rig file states, nan where it doesn't."""
    inertia, gravity = rig.axis.inertia, rig.axis.gravity_torque
    return (
        inertia.value if isinstance(inertia, Quantity) else math.nan,
        gravity.value if isinstance(gravity, Quantity) else math.nan,
    )


def energy_limit(twin: Rehearsed, rig: Rig) -> float:
    """The energy (J) at which the host's guard stops a run: twice that of the rehearsal, or that of a small angle."""
    inertia, gravity = expected(rig)
    small = energy_of(SMALL, 0.0, inertia, gravity)
    return max(ENERGY * twin.energy, small if math.isfinite(small) else 0.0)


def require_same_rig(rig: Rig, board: Board, name: str) -> None:
    """Raise InputError where device and rig file contradict each other in counts per turn or voltage."""
    for channel, has in (("angle", board.axis_counts), ("wheel", board.wheel_counts)):
        stated = rig.sensors.of(channel).resolution  # type: ignore[arg-type]
        if stated > 0.0 and has and abs(2 * math.pi / stated / has - 1) > 1e-3:
            text = f"{rig.source}: sensors state {2 * math.pi / stated:.0f} counts per turn ({channel}), and {name} "
            raise InputError(f"{text}has {has}; correct the one that is wrong", code="other-counts")
    limit = None if rig.drive.motor is None else rig.drive.motor.voltage_limit
    if limit is not None and limit > board.voltage_limit * (1 + 1e-6):
        text = f"{rig.source}: drive.motor.voltage_limit is {limit:g} V, and {name} gives {board.voltage_limit:g} V"
        raise InputError(f"{text} at most; state that", code="other-voltage")
    if rig.drive.wheel is not None and not board.wheel_counts:
        raise InputError(f"{rig.source} has a reaction wheel, and {name} no encoder for it", code="other-rig")
