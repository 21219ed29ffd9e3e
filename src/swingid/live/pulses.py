"""Measurements of a commissioning: a device's encoders while the body hangs, and tiny pulses in an open loop."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from swingid.errors import DeviceError
from swingid.live.codes import FaultCode, Mode
from swingid.live.guard import Board, Limits, parameters_of
from swingid.live.rest import Channel, counts_of
from swingid.live.running import Reason

if TYPE_CHECKING:
    from swingid.live.session import Session
    from swingid.model.rig import Rig
    from swingid.numerics.arrays import Array

TAIL_TIME = 2.5
"""Seconds of swinging after a pulse: a good part of a period."""

LEAD, PULSE = 0.05, 0.08
"""Seconds of 0 V before a pulse and of each of its two halves, + and -, which leave the wheel nearly at rest."""

SHARES = (0.05, 0.1, 0.2, 0.3, 0.5)
"""Shares of the voltage limit that are tried until wheel and axis move."""

WHEEL_MOVES, AXIS_MOVES = 0.1, 0.006
"""Angles (rad) that a pulse must make, and 8 counts of each at least."""

MOST_ANGLE, MOST_SPEED = 0.5, 6.0
"""Limits of the guard (rad, rad/s) while it is tested."""


@dataclass(frozen=True)
class Pulses:
    """A pulse and the swing after it: times (s), counts less their zero, voltage (V) held from each sample on."""

    time: Array
    axis: Array
    wheel: Array
    voltage: Array
    amplitude: float


def moving(
    session: Session, rig: Rig, board: Board, channels: tuple[Channel, Channel], progress: Callable[[str], None]
) -> Pulses:
    """The first pulse that moves wheel and axis; DeviceError where none does or the guard ends one."""
    axis, wheel = channels
    stated = Limits.of(rig)
    for share in SHARES:
        amplitude = float(np.float32(share * stated.voltage))
        session.load(_parameters(stated, board, axis))
        progress(f"a pulse of {amplitude:g} V")
        pulses = _pulse(session, amplitude, board.rate, channels)
        turned = float(np.ptp(pulses.wheel)) * wheel.step
        swung = float(np.ptp(pulses.axis)) * axis.step
        wheel_moves = turned > max(WHEEL_MOVES, 8 * wheel.step + 8 * wheel.noise)
        axis_moves = swung > max(AXIS_MOVES, 8 * axis.step + 8 * axis.noise)
        if wheel_moves and axis_moves:
            return pulses
    if not wheel_moves and not axis_moves:
        what = "neither wheel nor body moves: is the amplifier enabled, its supply on, the motor connected"
    elif axis_moves:
        what = "the body moves and the wheel's counts do not: is the wheel's encoder connected and its magnet in place"
    else:
        what = "the wheel turns and the body's counts do not: is the body free, its encoder connected, its magnet there"
    raise DeviceError(f"no motion at pulses up to {amplitude:.3g} V: {what}?", code="no-motion")


def _parameters(stated: Limits, board: Board, axis: Channel, angle: float = MOST_ANGLE) -> Array:
    """Parameters of a device for pulses in an open loop: the file's limits, those of the angle and speed tighter."""
    from swingid.control.compensator import Compensator
    from swingid.model.rig import Rig

    limits = Limits(
        angle=min(angle, stated.angle),
        speed=min(MOST_SPEED, stated.speed),
        wheel_speed=stated.wheel_speed,
        voltage=stated.voltage,
        current=stated.current,
        frozen_voltage=stated.voltage,
        axis_zero=round(axis.zero),
    )
    gains = Compensator.paper(Rig.load("paper"))  # not used in an open loop, but a device takes none without
    return parameters_of(gains, board, limits)


def guard_trips(session: Session, rig: Rig, board: Board, axis: Channel, pulses: Pulses) -> float:
    """The angle (rad) at which the device's guard gave 0 V, its limit lowered into the swing of the same pulse.

    The fault is cleared. Raises DeviceError where the guard does not trip, or trips for something else.
    """
    limit = float(np.abs(pulses.axis).max()) * axis.step / 2
    session.load(_parameters(Limits.of(rig), board, axis, limit))
    run = session.run(_volts(pulses.amplitude, board.rate), mode=Mode.OPEN_LOOP, fade=0.0)
    if run.end.fault is not FaultCode.ANGLE or (run.samples and run.samples[-1].voltage != 0.0):
        text = f"the device's guard did not end a pulse at {math.degrees(limit):.2g} deg ({run.end.sentence}): "
        raise DeviceError(text + "do not run this device; build its firmware anew", code="no-guard")
    session.clear()
    return limit


def _volts(amplitude: float, rate: float) -> Array:
    """A pulse with its two halves, and nothing before and after it (V)."""
    lead, half, tail = (round(t * rate) for t in (LEAD, PULSE, TAIL_TIME))
    return np.concatenate([np.zeros(lead), np.full(half, amplitude), np.full(half, -amplitude), np.zeros(tail)])


def _pulse(session: Session, amplitude: float, rate: float, channels: tuple[Channel, Channel]) -> Pulses:
    """One pulse and the swing after it; DeviceError where it does not end as planned."""
    volts = _volts(amplitude, rate)
    run = session.run(volts, mode=Mode.OPEN_LOOP, fade=0.0)
    if run.end.reason is not Reason.FINISHED or run.lost:
        why = run.end.sentence if run.end.reason is not Reason.FINISHED else f"{run.lost} samples were lost on the link"
        raise DeviceError(f"the pulse of {amplitude:.3g} V did not end as planned: {why}", code="pulse-ended")
    time, axis, wheel, voltage = counts_of(run.samples[: len(volts)])
    zero = wheel[: round(LEAD * rate)].mean()
    return Pulses(time, axis - channels[0].zero, wheel - zero, voltage, amplitude)
