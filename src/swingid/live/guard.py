"""The guard of a device: what ends a run at 0 V whatever the host does, and the parameters that say when.

The same decisions as ``firmware/core/guard.c``, in the same arithmetic. The parameters of a device are one array: what
the guard needs, in the places named here, then `Compensator.parameters`. A fault is latched; `FaultCode` names it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from swingid.control import law
from swingid.errors import UsageError
from swingid.live.codes import FaultCode, apart

if TYPE_CHECKING:
    from swingid.control.compensator import Compensator
    from swingid.model.rig import Rig
    from swingid.numerics.arrays import Array

# Places in the parameters.
AXIS_STEP, WHEEL_STEP, AXIS_ZERO, VOLTAGE_SIGN, REST, START_GAIN = 0, 1, 2, 3, 4, 5
ANGLE_LIMIT, SPEED_LIMIT, WHEEL_SPEED_LIMIT, VOLTAGE_LIMIT, CURRENT_LIMIT = 6, 7, 8, 9, 10
AXIS_JUMP, WHEEL_JUMP, FROZEN_VOLTAGE, FROZEN_SAMPLES, SATURATED_SAMPLES = 11, 12, 13, 14, 15
SPEED_SPAN, CONTROLLER = 16, 17

MOST_ORDER = 4
"""Of the chain (16) on a device: relative degree less 1."""

MOST_PARAMETERS = CONTROLLER + law.ALPHA + 2 * MOST_ORDER + 1
MOST_SPAN, HEARTBEAT_TIME, INVALID_SAMPLES = 32, 100_000, 5
"""Samples of a speed less 1; microseconds that a device runs without a heartbeat; samples without a reading."""


class Readings(NamedTuple):
    """What a device reads at one sample: raw counts (32 bits, wrapping), current (A, nan without one), and whether both
    encoders gave a reading; without, the last counts are repeated.
    """

    axis: int
    wheel: int
    current: float = math.nan
    valid: bool = True


@dataclass(frozen=True)
class Board:
    """A device before anybody has talked to it: samples per second (20 or more), counts per turn of both encoders, what
    its amplifier gives at most (V), hash of its firmware, highest order of a controller that it computes in a sample,
    counts of the wheel per second that it follows.
    """

    rate: float = 1000.0
    axis_counts: int = 16384
    wheel_counts: int = 16384
    voltage_limit: float = 10.0
    firmware: int = 0
    most_order: int = MOST_ORDER
    most_edges: float = math.inf

    @property
    def parameter_room(self) -> int:
        """Parameters of guard and controller that it takes."""
        return MOST_PARAMETERS - 2 * (MOST_ORDER - self.most_order)


@dataclass(frozen=True)
class Limits:
    """When the guard trips, and how counts become angles.

    angle (rad), speed, wheel_speed (rad/s): magnitudes; current (A) and voltage (V) likewise, the voltage is held
    within its limit and must not stay there longer than `saturated` (s). frozen (s): while the voltage is
    `frozen_voltage` or more, both encoders must move within this time; half the limit moves every rig that can be
    controlled. axis_zero: counts where the body hangs. Signs: of the counts and of the output. speed_span: samples over
    which the guard takes a speed, 20 of them make a count of 14 bits 0.02 rad/s at 1 kHz. jump: how many
    times the largest speed one sample's change of counts may be, besides 4 counts of noise.
    """

    angle: float
    speed: float
    wheel_speed: float
    voltage: float
    current: float = math.inf
    frozen: float = 0.25
    frozen_voltage: float | None = None
    saturated: float = 1.0
    speed_span: int = 20
    jump: float = 4.0
    axis_zero: int = 0
    axis_sign: int = 1
    wheel_sign: int = 1
    voltage_sign: int = 1
    rest: float = 0.0

    @classmethod
    def of(cls, rig: Rig) -> Limits:
        """Limits, zero and signs that a rig file states under `[device]`, and its own voltage limit.

        A body stays below the horizontal unless it says otherwise; the paper's motion has 0.8 rad, 7 rad/s and
        190 rad/s. Raises UsageError for a rig without a voltage limit.
        """
        motor, device = rig.drive.motor, rig.device
        if motor is None or motor.voltage_limit is None:
            message = f"rig {rig.name!r} has no drive.motor.voltage_limit, without which nothing is driven; state it"
            raise UsageError(message, code="no-voltage-limit")
        return cls(
            angle=device.angle_limit,
            speed=device.speed_limit,
            wheel_speed=device.wheel_speed_limit,
            voltage=float(motor.voltage_limit),
            current=math.inf if device.current_limit is None else device.current_limit,
            axis_zero=device.axis_zero,
            axis_sign=device.axis_sign,
            wheel_sign=device.wheel_sign,
            voltage_sign=device.voltage_sign,
        )


def parameters_of(controller: Compensator, board: Board, limits: Limits) -> Array:
    """All parameters of a device for a controller (its own sample time is not used).

    Raises UsageError for a controller of higher order than a device holds.
    """
    order = len(controller.k)
    if order > MOST_ORDER:
        message = f"a device holds controllers up to relative degree {MOST_ORDER + 1}, and this has {order + 1}"
        raise UsageError(message, code="bad-controller")
    h = 1.0 / float(np.float32(board.rate))
    head = np.zeros(CONTROLLER)
    head[AXIS_STEP] = limits.axis_sign * (2 * math.pi / board.axis_counts)
    head[WHEEL_STEP] = limits.wheel_sign * (2 * math.pi / board.wheel_counts) if board.wheel_counts else 0.0
    head[AXIS_ZERO], head[VOLTAGE_SIGN], head[REST] = limits.axis_zero, limits.voltage_sign, limits.rest
    head[START_GAIN] = controller.k_tilde0
    head[ANGLE_LIMIT], head[SPEED_LIMIT], head[WHEEL_SPEED_LIMIT] = limits.angle, limits.speed, limits.wheel_speed
    head[VOLTAGE_LIMIT], head[CURRENT_LIMIT] = limits.voltage, limits.current
    head[AXIS_JUMP] = math.ceil(4 + limits.jump * limits.speed * h / abs(head[AXIS_STEP]))
    head[WHEEL_JUMP] = math.inf
    if board.wheel_counts:
        head[WHEEL_JUMP] = math.ceil(4 + limits.jump * limits.wheel_speed * h / abs(head[WHEEL_STEP]))
    head[FROZEN_VOLTAGE] = limits.voltage / 2 if limits.frozen_voltage is None else limits.frozen_voltage
    head[FROZEN_SAMPLES] = max(1, round(limits.frozen / h))
    head[SATURATED_SAMPLES] = round(limits.saturated / h)
    head[SPEED_SPAN] = limits.speed_span
    return np.concatenate([head, controller.parameters(h)])


def _whole(x: float, least: float, most: float) -> bool:
    return least <= x <= most and float(int(x)) == x


def valid(p: Array, board: Board) -> bool:
    """Return whether a device can run with these parameters at all; the host refuses more, and says why."""
    controller = p[CONTROLLER:]
    if not CONTROLLER + law.ALPHA + 1 <= len(p) <= MOST_PARAMETERS or not _whole(controller[law.ORDER], 0, MOST_ORDER):
        return False
    if len(p) != CONTROLLER + law.ALPHA + 2 * int(controller[law.ORDER]) + 1:
        return False
    for i, value in enumerate(p):
        limit = ANGLE_LIMIT <= i <= FROZEN_VOLTAGE or i - CONTROLLER in (law.LIMIT, law.K_TILDE_MAX)
        if not (value >= 0.0 if limit else math.isfinite(value)):
            return False
    if any(not math.isfinite(p[i]) or p[i] == 0.0 for i in (ANGLE_LIMIT, SPEED_LIMIT, VOLTAGE_LIMIT)):
        return False
    return bool(
        p[AXIS_STEP] != 0.0
        and _whole(p[AXIS_ZERO], -(2.0**31), 2.0**31 - 1)
        and p[VOLTAGE_SIGN] in (1.0, -1.0)
        and p[START_GAIN] >= 0.0
        and _whole(p[FROZEN_SAMPLES], 1, 60000)
        and _whole(p[SATURATED_SAMPLES], 0, 60000)
        and _whole(p[SPEED_SPAN], 1, MOST_SPAN - 1)
        and controller[law.SAMPLE_TIME] == 1.0 / float(np.float32(board.rate))
        and all(0.0 <= controller[i] < 1.0 for i in (law.ERROR_DECAY, law.WHEEL_DECAY))
        and controller[law.LIMIT] > 0.0
    )


def counts(p: Array, board: Board) -> bool:
    """Return whether a device follows the wheel's counts up to the speed at which its guard ends the run."""
    return math.isinf(board.most_edges) or bool(p[WHEEL_SPEED_LIMIT] <= board.most_edges * abs(p[WHEEL_STEP]))


class Guard:
    """The counts without their wraps, and what must not happen to them."""

    def __init__(self, board: Board) -> None:
        period = 1e6 / float(np.float32(board.rate))
        self.axis = self.wheel = 0
        self.seen = self.late = False
        self.time = self.heartbeat = self._idle_time = 0
        self._late_time = int(1.5 * period)
        # a heartbeat counts from the sample after it on, so that 0 V is there in time
        self._death_time = HEARTBEAT_TIME - (int(period) if period < 50000.0 else 50000)
        self._limit = float(np.float32(board.voltage_limit))
        self._raw = (0, 0)
        self._changes = (0, 0)
        self._past = [(0, 0)] * MOST_SPAN
        self._place = 0
        self.arm()

    def arm(self) -> None:
        """Begin to watch: forget what was counted before."""
        self.fresh = True
        self._invalid = self._axis_frozen = self._wheel_frozen = self._saturated = 0

    def track(self, time: int, readings: Readings, *, busy: bool = False) -> None:
        """Take one sample's readings at a device time (us, wrapping at 32 bits), in every state.

        busy: more of the host may wait than this sample has taken.
        """
        if self.seen:
            self.late = (time - self.time) % 2**32 > self._late_time
            self._changes = apart(readings.axis, self._raw[0]), apart(readings.wheel, self._raw[1])
            self.axis += self._changes[0]
            self.wheel += self._changes[1]
        else:
            self.seen = True
            self._idle_time = time
            self.axis, self.wheel = readings.axis, readings.wheel
            self._past = [(self.axis, self.wheel)] * MOST_SPAN
        self.time, self._raw = time, (readings.axis, readings.wheel)
        self._past[self._place] = self.axis, self.wheel
        self._place = (self._place + 1) % MOST_SPAN
        if not busy:
            self._idle_time = time
        if self.fresh:  # it may have waited behind other bytes, but was sent after the link was last empty
            self.fresh, self.heartbeat = False, self._idle_time
        self._invalid = 0 if readings.valid else min(self._invalid + 1, 60000)

    def check(self, readings: Readings, p: list[float], voltage: float) -> tuple[FaultCode, float]:
        """The first fault of this sample and what passed its limit; `voltage` (V) was held up to it."""
        has_wheel = p[WHEEL_STEP] != 0.0
        driven = abs(voltage) >= p[FROZEN_VOLTAGE]
        axis_change, wheel_change = self._changes
        self._axis_frozen = self._axis_frozen + 1 if driven and axis_change == 0 else 0
        self._wheel_frozen = self._wheel_frozen + 1 if driven and wheel_change == 0 and has_wheel else 0
        if self.late:
            return FaultCode.OVERRUN, 0.0
        age = (self.time - self.heartbeat) % 2**32
        if age >= self._death_time:
            return FaultCode.HEARTBEAT, float(age)
        if self._invalid >= INVALID_SAMPLES:
            return FaultCode.ENCODER, float(self._invalid)
        if abs(axis_change) > p[AXIS_JUMP]:
            return FaultCode.AXIS_JUMP, float(axis_change)
        if has_wheel and abs(wheel_change) > p[WHEEL_JUMP]:
            return FaultCode.WHEEL_JUMP, float(wheel_change)
        angle = self.angle(p)
        if abs(angle) > p[ANGLE_LIMIT]:
            return FaultCode.ANGLE, angle
        span = int(p[SPEED_SPAN])
        then = self._past[(self._place - 1 - span) % MOST_SPAN]
        duration = span * p[CONTROLLER + law.SAMPLE_TIME]
        speed = (self.axis - then[0]) * p[AXIS_STEP] / duration
        if abs(speed) > p[SPEED_LIMIT]:
            return FaultCode.SPEED, speed
        speed = (self.wheel - then[1]) * p[WHEEL_STEP] / duration
        if abs(speed) > p[WHEEL_SPEED_LIMIT]:
            return FaultCode.WHEEL_SPEED, speed
        if abs(readings.current) > p[CURRENT_LIMIT]:
            return FaultCode.CURRENT, readings.current
        if self._axis_frozen >= p[FROZEN_SAMPLES]:
            return FaultCode.AXIS_FROZEN, float(self._axis_frozen)
        if self._wheel_frozen >= p[FROZEN_SAMPLES]:
            return FaultCode.WHEEL_FROZEN, float(self._wheel_frozen)
        return FaultCode.NONE, 0.0

    def angle(self, p: list[float]) -> float:
        """Angle of the axis (rad) against its zero."""
        return (self.axis - int(p[AXIS_ZERO])) * p[AXIS_STEP]

    def wheel_angle(self, p: list[float]) -> float:
        """Angle of the wheel (rad) since its encoder was at 0."""
        return self.wheel * p[WHEEL_STEP]

    def within(self, voltage: float, p: list[float]) -> tuple[float, bool, FaultCode]:
        """Voltage (V) within its limits, whether that changed it, and the fault of one that is at its limit too long
        or no number.
        """
        limit = min(p[VOLTAGE_LIMIT], self._limit)
        if not math.isfinite(voltage):
            return 0.0, False, FaultCode.VOLTAGE
        self._saturated = self._saturated + 1 if abs(voltage) >= limit else 0
        fault = FaultCode.VOLTAGE if self._saturated > p[SATURATED_SAMPLES] else FaultCode.NONE
        return min(max(voltage, -limit), limit), abs(voltage) > limit, fault
