"""What is asked of a design, read and checked: the expected rig, the wanted uncertainty, the limits."""

from __future__ import annotations

import math
from dataclasses import dataclass

from swingid.balance.identifiability import HOPELESS
from swingid.errors import InputError, UnanswerableError, UsageError
from swingid.model.rig import Rig
from swingid.study.design.candidates import Limits
from swingid.units import Quantity, parse_quantity

ANGLE = 0.8
"""Largest angle of a rotary axis where none is asked for, rad; the paper's."""


@dataclass(frozen=True)
class Asked:
    """A design's question, checked: the rig as expected, the wanted relative uncertainty, the limits."""

    expected: Rig
    share: float
    limits: Limits


def asked(
    rig: Rig,
    uncertainty: float | str,
    *,
    duration: float,
    max_angle: float | None,
    max_speed: float | None,
    inertia: float | str | None,
    gravity_torque: float | str | None,
    rate: float,
    settling: float,
) -> Asked:
    """Check everything that `design` is asked; raises as it does, but never for what the motions cannot do."""
    expected = expected_rig(rig, inertia, gravity_torque)
    assert expected.axis.inertia is not None
    share = wanted_share(uncertainty, expected.axis.inertia.value, rig)
    limits = limits_of(rig, max_angle, max_speed)
    for name, value in (("duration", duration), ("rate", rate)):
        if not 0 < value < math.inf:
            raise UsageError(f"{name} must be a positive number, and is {value}.", code="out-of-range")
    if not 0 <= settling < math.inf:
        raise UsageError(f"settling must be zero or positive, and is {settling}.", code="out-of-range")
    if duration < settling + 3:
        raise UsageError(
            f"duration is {duration:g} s, but the controller takes {settling:g} s to settle; allow more.",
            code="too-short",
        )
    return Asked(expected, share, limits)


def expected_rig(rig: Rig, inertia: float | str | None, gravity_torque: float | str | None) -> Rig:
    """The rig as it is expected to be; InputError for what is not known at all."""
    if rig.drive.kind == "none":
        raise UnanswerableError(
            f"rig {rig.name} has no drive, so its motion cannot be chosen; release it from a large angle.",
            code="no-drive",
        )
    linear = rig.axis.kind == "linear"
    changes: dict[str, Quantity] = {}
    if inertia is not None:
        changes["axis.inertia"] = _read(inertia, "kg" if linear else "kg*m^2", "inertia")
        if not changes["axis.inertia"].value > 0:
            raise UsageError(f"inertia is {inertia}, but must be positive.", code="out-of-range")
    elif rig.axis.inertia is None:
        raise InputError(
            f'{rig.source}: axis.inertia is missing; state what you expect there or as --inertia "3e-3 kg*m^2".',
            code="no-inertia",
        )
    if gravity_torque is not None:
        changes["axis.gravity_torque"] = _read(gravity_torque, "N*m", "gravity_torque")
    elif isinstance(rig.axis.gravity_torque, str):
        raise InputError(
            f"{rig.source}: axis.gravity_torque is unknown; state what you expect as --gravity-torque.",
            code="no-gravity-torque",
        )
    return rig.changed(changes) if changes else rig


def _read(value: float | str, unit: str, name: str) -> Quantity:
    """A quantity that the caller gave; UsageError for what is none."""
    try:
        return parse_quantity(float(value) if _is_number(value) else value, unit, name)
    except InputError as error:
        raise UsageError(error.message, code=error.code) from None


def _is_number(value: float | str) -> bool:
    try:
        float(value)
    except ValueError:
        return False
    return True


def wanted_share(uncertainty: float | str, inertia: float, rig: Rig) -> float:
    """The wanted relative standard uncertainty."""
    if isinstance(uncertainty, str) and not _is_number(uncertainty) and not uncertainty.rstrip().endswith("%"):
        share = _read(uncertainty, "kg" if rig.axis.kind == "linear" else "kg*m^2", "uncertainty").value / inertia
    else:
        share = _read(uncertainty, "", "uncertainty").value
    if not 0 < share < HOPELESS:
        raise UsageError(
            f"uncertainty is {share:.3g} of the inertia, but must be above 0 and below {HOPELESS:g}; "
            'write for example "0.05 %".',
            code="out-of-range",
        )
    return share


def limits_of(rig: Rig, max_angle: float | None, max_speed: float | None) -> Limits:
    """The limits of angle, speed and voltage; UsageError for what is no limit."""
    if max_angle is None:
        if rig.axis.kind == "linear":
            raise UsageError("a linear axis needs max_angle, its largest excursion in m.", code="no-limit")
        max_angle = ANGLE
    for name, value in (("max_angle", max_angle), ("max_speed", max_speed)):
        if value is not None and not 0 < value < math.inf:
            raise UsageError(f"{name} must be a positive number, and is {value}.", code="out-of-range")
    motor = rig.drive.motor
    return Limits(max_angle, max_speed, None if motor is None else motor.voltage_limit)
