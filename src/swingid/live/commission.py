"""Commissioning: what a device's counts and voltage mean, found hanging still and from tiny pulses, before a first run.

Two relations decide, both free of the motor's constants and of the friction. A positive output turns the wheel: the
sign of the voltage. And equation (I) of small angles, integrated twice, is linear in what was counted:

    q2 = - A q1 - F integral q1 - B double integral q1 + c0 + c1 t + c2 t^2,   A = a11/a12, F = f1/a12, B = b/a12

c2 is the zero of the angle, which is known to half a count: of 14 bits that bends q2 by 0.4 rad within 2.7 s.

A > 0 where both counts grow in the same direction. B against the stated b and a12 is the ratio of the counts per
turn, and b A / B the inertia a11, both as far as the rig file's constants are right. Which direction of the axis is
positive nothing in the motion says; that is a choice.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from swingid.errors import DeviceError, InputError, UsageError
from swingid.format import plus_minus
from swingid.live.firmware import named, timing
from swingid.live.guard import Board, Limits
from swingid.live.pace import alone
from swingid.live.pulses import PULSE, Pulses, guard_trips, moving
from swingid.live.rest import STILLER, WAIT, Channel, at_rest, listening_time
from swingid.numerics.regression import fit_linear

if TYPE_CHECKING:
    from swingid.live.session import Session
    from swingid.model.rig import Rig
    from swingid.numerics.arrays import Array

CLOSE, FAR = 0.05, 0.25
"""Relative deviations of the ratio of counts from which it is a warning, and a refusal."""


@dataclass(frozen=True)
class Commissioning:
    """What was found.

    guard_angle: at which the guard has given 0 V when it was tested (rad).
    delay: from the voltage to the wheel's motion (s), with that of its encoder. ratio: how far the wheel turns over
    what its counts say, beside the axis', with its standard uncertainty; inertia likewise (kg m², of axis, wheel and
    rotor: a11). Both None where the rig file does not state gravity torque and wheel.
    """

    board: Board
    axis: Channel
    wheel: Channel
    amplitude: float
    axis_sign: int
    wheel_sign: int
    voltage_sign: int
    delay: float
    guard_angle: float
    ratio: tuple[float, float] | None
    inertia: tuple[float, float] | None
    warnings: tuple[str, ...] = ()

    def values(self, rig: Rig, address: str) -> dict[str, object]:
        """What is written into the rig file, by its keys; the limits that were in force stand beside it."""
        values: dict[str, object] = {"sensors.counts_per_turn": self.axis.counts}
        if self.wheel.counts != self.axis.counts:
            values["sensors.wheel.counts_per_turn"] = self.wheel.counts
        for key, channel in (("sensors.noise", self.axis), ("sensors.wheel.noise", self.wheel)):
            if channel.noise > 0.1 * channel.step:
                values[key] = float(f"{channel.noise:.3g}")
        sensors, board = rig.sensors, timing(self.board.firmware)
        if board is not None and not any(q.value or q.std for q in (sensors.latency, sensors.of_wheel.latency)):
            values |= {"sensors.latency": board.latency("axis"), "sensors.wheel.latency": board.latency("wheel")}
            values["sensors.jitter"] = board.jitter
        signs = {"axis_sign": self.axis_sign, "wheel_sign": self.wheel_sign, "voltage_sign": self.voltage_sign}
        values |= {"device.address": address, **{f"device.{key}": sign for key, sign in signs.items()}}
        device = rig.device
        return values | {
            "device.axis_zero": round(self.axis.zero),
            "device.angle_limit": device.angle_limit,
            "device.speed_limit": device.speed_limit,
            "device.wheel_speed_limit": device.wheel_speed_limit,
        }

    def lines(self) -> list[str]:
        """What was found, for people."""
        board = self.board
        rate = f"{board.rate:g} samples per second, {board.voltage_limit:g} V at most"
        said = [f"{rate}, firmware {named(board.firmware)}"]
        for name, channel in (("axis", self.axis), ("wheel", self.wheel)):
            noise = f"noise {channel.noise / channel.step:.2g} counts" if channel.noise else "no noise beside rounding"
            said.append(f"{name}: {channel.counts} counts per turn, hangs at {channel.zero:.1f}, {noise}")
        if (known := timing(board.firmware)) is not None:
            late = f"axis {known.latency('axis')}, wheel {known.latency('wheel')}"
            said.append(f"this board's readings against its voltage: {late}")
        said.append(f"moves at {self.amplitude:g} V, {1e3 * self.delay:.1f} ms after the voltage")
        said.append(f"guard: 0 V at {math.degrees(self.guard_angle):.2g} deg when it was tested")
        said.append(
            f"signs: axis {self.axis_sign:+d} (a choice), wheel {self.wheel_sign:+d}, voltage {self.voltage_sign:+d}"
        )
        if self.ratio is not None:
            said.append(f"turn of the wheel over what its counts say: {plus_minus(*self.ratio)}")
        if self.inertia is not None:
            said.append(f"inertia of body and wheel, roughly: {plus_minus(*self.inertia, 'kg*m^2')}")
        return [*said, *(f"warning: {warning}" for warning in self.warnings)]


def commission(
    session: Session, rig: Rig, *, wait: float = WAIT, progress: Callable[[str], None] = lambda _: None
) -> Commissioning:
    """Find zero, noise, signs, delay and what can be known of the counts of a device whose body hangs still.

    wait (s): for that.

    Raises UsageError for a rig without a reaction wheel, InputError where rig file and device contradict each other
    (code "wrong-sign", "wrong-counts"), DeviceError where the rig is not still, does not move, or its guard trips.
    """
    if rig.drive.wheel is None:
        text = f"commissioning needs a reaction wheel, and rig {rig.name!r} has drive.kind = {rig.drive.kind!r}; "
        raise UsageError(text + "find its signs by hand, as docs/rig.md says", code="not-offered")
    with nullcontext() if session.link.stream.virtual else alone():
        board = session.connect()
        session.require_ready()
        _agrees(rig, board)
        progress(f"listening for {listening_time(rig):.2g} s to the hanging body")
        axis, wheel = at_rest(session, rig, board, wait=wait, say=progress, swing=STILLER)
        assert wheel is not None  # `_agrees` has refused a device without
        pulses = moving(session, rig, board, (axis, wheel), progress)
        relation = _relation(pulses, axis.step, wheel.step)
        signs = _signs(rig, pulses, relation)
        ratio, inertia = _constants(rig, relation)
        progress("the guard, at a lower limit")
        trips = guard_trips(session, rig, board, axis, pulses)
    warnings = []
    delay = _delay(pulses)
    if delay > 1.5 / board.rate:
        text = f"the wheel answers {1e3 * delay:.1f} ms after the voltage, more than a sample: expect a larger "
        warnings.append(text + "tracking error; state sensors.latency if it is that of an encoder")
    if ratio is not None and abs(ratio[0] - 1.0) > CLOSE + 2 * ratio[1]:
        warnings.append(_counts_words(ratio))
    return Commissioning(board, axis, wheel, pulses.amplitude, *signs, delay, trips, ratio, inertia, tuple(warnings))


def _agrees(rig: Rig, board: Board) -> None:
    """InputError where the device says what the file contradicts; UsageError without a voltage limit."""
    limit = Limits.of(rig).voltage
    if limit > board.voltage_limit * (1 + 1e-6):
        text = f"{rig.source}: drive.motor.voltage_limit is {limit:g} V and the device gives {board.voltage_limit:g} V "
        raise InputError(text + "at most; lower it to that", code="wrong-limit")
    if not board.wheel_counts:
        raise InputError("the device has no encoder of the wheel, which commissioning needs", code="no-wheel-encoder")
    sensors = rig.sensors
    for name, sensor, counts in (
        ("axis", sensors.of("angle"), board.axis_counts),
        ("wheel", sensors.of("wheel"), board.wheel_counts),
    ):
        stated = round(2 * math.pi / sensor.resolution) if sensor.resolution > 0.0 else counts
        if stated != counts:
            key = f"counts_per_turn of the {name} in [sensors]"
            text = f"{rig.source}: {key} is {stated} and the device says {counts}; correct the file, or the firmware"
            raise InputError(f"{text} where the encoder makes {stated}", code="wrong-counts")


@dataclass(frozen=True)
class Relation:
    """A and B (1/s²) of equation (I) in stated steps of the encoders, and their covariance."""

    a: float
    b: float
    covariance: Array


def _relation(pulses: Pulses, axis_step: float, wheel_step: float) -> Relation:
    """A and B by least squares over a pulse and the swing after it."""
    t, h = pulses.time, float(np.median(np.diff(pulses.time)))
    q1, q2 = pulses.axis * axis_step, pulses.wheel * wheel_step

    def integral(x: Array) -> Array:
        return np.asarray(np.concatenate([[0.0], np.cumsum((x[1:] + x[:-1]) / 2)]) * h)

    once = integral(q1)
    columns = np.column_stack([-q1, -once, -integral(once), np.ones_like(t), t, t * t])
    fit = fit_linear(columns, q2)
    # errors of an integral are alike over many samples: count as many as there are halves of a pulse
    freedom = max(float(t[-1]) / PULSE - len(fit.values), 1.0)
    covariance = fit.normal * float(fit.residuals @ fit.residuals) / freedom
    return Relation(float(fit.values[0]), float(fit.values[2]), covariance[np.ix_([0, 2], [0, 2])])


def _signs(rig: Rig, pulses: Pulses, relation: Relation) -> tuple[int, int, int]:
    """Signs of axis, wheel and voltage; InputError where the file states others."""
    same = 1 if relation.a > 0 else -1
    if abs(relation.a) < 5 * math.sqrt(relation.covariance[0, 0]):
        text = "the body's motion after the pulse is not that of the wheel's reaction; is the body free to swing, and "
        raise DeviceError(text + "is the wheel's encoder on the wheel?", code="no-motion")
    pushed = pulses.voltage > 0
    last = int(np.flatnonzero(pushed)[-1]) + 1
    response = 1 if pulses.wheel[last] - pulses.wheel[np.flatnonzero(pushed)[0]] > 0 else -1
    device = rig.device
    axis = device.axis_sign
    wheel = axis * same
    measured = {"wheel_sign": wheel, "voltage_sign": wheel * response}
    for key, sign in measured.items():
        if key in device.model_fields_set and getattr(device, key) != sign:
            text = f"{rig.source}: wrong sign: device.{key} is {-sign:+d} and the pulses show {sign:+d}; swap the "
            what = "wires of the motor" if key == "voltage_sign" else "wires of an encoder's channels"
            raise InputError(f"{text}{what}, or delete the key and commission again", code="wrong-sign")
    return axis, measured["wheel_sign"], measured["voltage_sign"]


def _constants(rig: Rig, relation: Relation) -> tuple[tuple[float, float] | None, tuple[float, float] | None]:
    """The ratio of the counts and the inertia a11 with standard uncertainties; None without gravity torque or wheel."""
    from swingid.units import Quantity

    gravity, drive = rig.axis.gravity_torque, rig.drive
    wheel = None if drive.wheel is None else drive.wheel.inertia
    if not isinstance(gravity, Quantity) or not gravity.value or not isinstance(wheel, Quantity):
        return None, None
    motor = drive.motor
    a12 = wheel.value
    if motor is not None:
        a12 += motor.gear_ratio.value * motor.rotor_inertia.value
    a, b = abs(relation.a), relation.b * math.copysign(1.0, relation.a)
    ua, ub = math.sqrt(relation.covariance[0, 0]), math.sqrt(relation.covariance[1, 1])
    if b < 3 * ub:
        return None, None
    ratio, inertia = gravity.value / (a12 * b), gravity.value * a / b
    mixed = relation.covariance[0, 1] * math.copysign(1.0, relation.a) * math.copysign(1.0, relation.b)
    spread = max((ua / a) ** 2 + (ub / b) ** 2 - 2 * mixed / (a * b), 0.0)
    ratio_u = ratio * ub / b
    if abs(math.log(ratio)) > math.log1p(FAR) and abs(ratio - 1.0) > 3 * ratio_u:
        raise InputError(f"wrong counts: {_counts_words((ratio, ratio_u))}", code="wrong-counts")
    return (ratio, ratio_u), (inertia, inertia * math.sqrt(spread))


def _counts_words(ratio: tuple[float, float]) -> str:
    text = f"the wheel turns {plus_minus(*ratio)} times as far as its counts say, if the body's angle, gravity_torque "
    text += "and drive.wheel.inertia are right; "
    return text + "check counts per turn (edges of a quadrature encoder, a gear) and these"


def _delay(pulses: Pulses) -> float:
    """Seconds from the begin of the pulse to the wheel's motion: where a cubic through its first half is at rest."""
    pushed = np.flatnonzero(pulses.voltage > 0)
    first, last = int(pushed[0]), int(pushed[-1]) + 1
    t, wheel = pulses.time - pulses.time[first], np.abs(pulses.wheel)
    start = first + int(np.argmax(wheel[first:last] > wheel[first:last].max() / 16))
    curve = np.polynomial.Polynomial.fit(t[start:last], wheel[start:last], 3)
    rest = [float(x.real) for x in curve.deriv().roots() if abs(x.imag) < 1e-9 and x.real <= t[start]]
    return max(*rest, 0.0) if rest else 0.0
