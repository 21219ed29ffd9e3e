"""The scale reference of the estimate: the wheel's inertia, the measured torque, or gravity.

Equation (I) is homogeneous, so the angles alone give ratios only.
"""

from __future__ import annotations

import numpy as np

from swingid.errors import InputError, UnanswerableError, require_rig
from swingid.model.equation import Equation
from swingid.model.rig import Rig
from swingid.model.terms import rig_terms
from swingid.numerics.arrays import Array
from swingid.preparation.decays import FEWEST_TURNS, FLOOR
from swingid.preparation.motion import Motion, find_motion
from swingid.preparation.noise import channel_noise
from swingid.preparation.reference import refuse_without_scale
from swingid.preparation.segment import SWINGS_OFF, usable_part
from swingid.recording.findings import Kind
from swingid.recording.recording import Recording


def equation_of(rig: Rig, *, elsewhere: bool = False) -> Equation:
    """Equation (I) of a rig. Raises UnanswerableError where nothing sets its scale.

    elsewhere: whether something that is no key of the rig sets the scale, as a known body added to the axis.
    """
    equation = Equation.of(rig)
    held = any(equation.value(term.name) for term in equation.conservative)
    if not elsewhere:
        refuse_without_scale(rig)
    if rig.drive.channel is None and not held and not elsewhere:
        raise UnanswerableError(
            f"rig {rig.name}: axis.gravity_torque is 0, but in a free decay gravity alone sets the scale; give "
            'axis.gravity_torque, or axis.stiffness of a spring, a number or "unknown" (for ratios).',
            code="no-scale",
        )
    if equation.stated.get("wheel") == 0:
        raise UnanswerableError(
            f"rig {rig.name}: drive.wheel.inertia is 0, but the wheel's inertia sets the scale; give it.",
            code="no-scale",
        )
    return equation


def refuse_terms(rig: Rig, method: str) -> None:
    """Raise UnanswerableError where the rig has springs, cogging or other further terms, for a method without them."""
    keys = [term.term.key or f"axis.{term.name.partition('_')[0]}" for term in rig_terms(rig)]
    if keys:
        raise UnanswerableError(
            f"rig {rig.name}: {', '.join(dict.fromkeys(keys))} is no term of the balance of {method}; leave it out, or "
            "identify with the method momentum, energy, equation-error or output-error.",
            code="unknown-term",
        )


def refuse_motor(rig: Rig, what: str) -> None:
    """Raise UnanswerableError where a motor is on the axis, for what has no terms of it; UsageError for no rig."""
    require_rig(rig)
    if rig.drive.channel == "voltage":
        raise UnanswerableError(
            f"rig {rig.name}: drive.kind is 'motor', a motor on the axis, which {what} does not have; use identify "
            "with the method momentum.",
            code="unknown-drive",
        )


def refuse_rates(rig: Rig, what: str) -> None:
    """Raise UnanswerableError where the rig logs a rate and no angle, for what reads angles only."""
    if rig.log.has_rate_alone:
        raise UnanswerableError(
            f"rig {rig.name}: log.angle_speed is a rate, whose bias and zero {what} does not estimate; use the method "
            "momentum, energy, equation-error or output-error on the whole log, or log the angle.",
            code="rate-alone",
        )


LATEST = 0.1
"""A latency beyond this share of the log is an error of the rig file."""


def require_channels(log: Recording, rig: Rig) -> None:
    """Raise InputError where the log lacks what the rig's drive needs, has another drive, or is too short.

    UnanswerableError where the scale reference is not stated.
    """
    unstated = next((finding for finding in log.findings if finding.kind is Kind.NO_SCALE), None)
    if unstated is not None:
        raise UnanswerableError(f"{log.source.path or 'the log'}: {unstated.message}", code="no-scale")
    sensors = {"sensors.latency": rig.sensors.of("angle"), "sensors.wheel.latency": rig.sensors.of("wheel")}
    for key, sensor in sensors.items():
        late = abs(sensor.latency.value)
        if late > LATEST * log.duration:
            raise InputError(
                f"rig {rig.name}: {key} is {late:g} s, too much for a log of {log.duration:g} s; state it in s or ms.",
                code="long-latency",
            )
    drives = {"voltage": log.voltage, "torque": log.torque}
    acting = next((name for name, values in drives.items() if values is not None and np.any(values)), None)
    name = rig.drive.channel
    if name is None and acting is not None:
        raise InputError(
            f"{log.source.path or 'the log'} contains a {acting} that is not 0, but rig {rig.name} has no drive; use "
            "the rig that belongs to the log.",
            code="other-drive",
        )
    if name is not None and getattr(log, name) is None:
        kind = {"wheel_angle": "a reaction wheel", "torque": "direct", "voltage": "a motor"}[name]
        raise InputError(
            f"{log.source.path or 'the log'} has no {name.replace('_', ' ')}, but the rig's drive is {kind}; name its "
            f"column as {name} under [log], or use a rig of another drive kind.",
            code=f"missing-{name.replace('_', '-')}",
        )


def require_drive(log: Recording, rig: Rig) -> None:
    """Raise InputError where the channel of the drive is constant, but the body gains energy: it was not logged.

    Friction only takes energy, and a constant torque has a potential, so in such a log all swings shrink.
    """
    name = rig.drive.channel
    values: Array | None = None if name is None else getattr(log, name)
    if name is None or values is None or np.ptp(values) > 0:
        return
    motion = find_motion(log.time, log.angle, channel_noise(log, rig).angle)
    if len(motion.turning_times) == 0 or _only_loses(log, rig, motion):
        return
    at = "constant" if name == "wheel_angle" else f"{values[0]:.4g}"
    raise InputError(
        f"{log.source.path or 'the log'}: the {name.replace('_', ' ')} is {at} in all rows, but the body moves as one "
        f"that gains energy, so what drives it was not logged; name the column that was as {name} under [log], or "
        'state [drive] kind = "none" for a free decay.',
        code="constant-drive",
    )


FARTHER = 0.5
"""Share of a motion by which a body turns farther from its zero than before where something drives it: that of a free
one turns nearer to its rest, from which the zero may be off by a quarter of the motion."""


def _only_loses(log: Recording, rig: Rig, motion: Motion) -> bool:
    """Return whether what is used of a log is a free decay, but for its first swings, in which a hand may hold the
    body.

    Of fewer swings than show one, whether they shrink and do not lead away from where the body rests.
    """
    if len(motion.turning_times) < FEWEST_TURNS:
        turns = motion.turning_angles
        zero = 0.0 if rig.axis.kind == "linear" else 2 * np.pi * round(float(np.mean(turns)) / (2 * np.pi))
        away = np.diff(np.abs(turns - zero)) > FARTHER * float(np.ptp(log.angle))
        return not np.any(away) and bool(np.all(np.diff(motion.swing_sizes) <= 0))
    start, stop = float(log.time[0]), float(log.time[-1])
    try:
        begin, _, _ = usable_part(motion, None, start, stop)
    except UnanswerableError:
        return False
    sizes = motion.within(begin, stop).swing_sizes
    if np.ptp(sizes) < FLOOR * np.max(sizes):  # without any loss: something drives it
        return False
    used, _, _ = usable_part(motion, rig.drive.channel, start, stop, log.left_out)
    return int(np.count_nonzero((motion.turning_times > used) & (motion.turning_times < begin))) <= SWINGS_OFF


def require_motor(log: Recording, rig: Rig, equation: Equation, method: str) -> None:
    """Raise InputError without the voltage of a reaction wheel's motor, UnanswerableError without its constants."""
    if "wheel" not in equation.coefficients:
        return
    if log.voltage is None:
        raise InputError(
            f"{log.source.path or 'the log'} has no voltage, which the {method} method needs; name its column as "
            "voltage under [log], or use the momentum method, which does not.",
            code="missing-voltage",
        )
    motor = rig.drive.motor
    if motor is None or motor.torque_per_volt.value == 0:
        raise UnanswerableError(
            f"rig {rig.name}: drive.motor.torque_per_volt is not given, but the {method} method needs the motor's "
            "constants; give them, or use the momentum method, which does not need them.",
            code="no-motor-constants",
        )
