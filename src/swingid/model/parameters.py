"""The constants of a rig as one float64 vector, which every compiled kernel reads.

The vector is built in two moves: `constants` collects the rig's quantities by their rig.toml keys, `vector` turns plain
values under those keys into the vector. Between the two, values may be drawn from their uncertainties. Name, symbol and
unit of a constant are in `terms`. (Kernels under njit have the numbers of the places compiled in.)
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from swingid.errors import InputError
from swingid.model.terms import FRICTION_KEYS, MOTOR_KEYS, MOTOR_TERMS, TERMS, Term, further_terms, stated_at

if TYPE_CHECKING:
    from swingid.model.rig import Rig
    from swingid.numerics.arrays import Array
    from swingid.units import Quantity

# Places in the vector (``p[A11]``), SI. Inertias of (I), (II): a11 = J1 + J2 + Jr (without a wheel J1), a12 = J2 + N Jr
# (without 0), a22 = J2 + N² Jr (without 1, where nothing moves by it); b; torque on the axis per unit of the command
# (1 where that is the torque, c1 of a motor on the axis, else 0).
A11, A12, A22, B, DIRECT = 0, 1, 2, 3, 4
# Gear N; c1, c2, η of (8); edges d1 >= 0 >= d2 of the dead zone; motor friction f2, f3.
GEAR, C1, C2, ETA, D1, D2, F2, F3 = 5, 6, 7, 8, 9, 10, 11, 12
# Torque N f3 that releases the wheel (infinite without one); 1 where the axis can stick (dry friction, no LuGre).
WHEEL_STATIC, AXIS_STICKS = 13, 14
# Friction of the axis for q1' > 0 (P) and q1' < 0 (N): viscous, Coulomb, and static >= Coulomb at the brink of motion.
VISCOUS_P, VISCOUS_N, COULOMB_P, COULOMB_N, STATIC_P, STATIC_N = 15, 16, 17, 18, 19, 20
# Speed over which static falls to Coulomb friction (0: at once); coefficients of v|v| and v³; constant torque against
# the positive direction; stiffness (0: no LuGre) and damping of the LuGre bristles.
STRIBECK_SPEED, QUADRATIC, CUBIC, OFFSET, SIGMA0, SIGMA1 = 21, 22, 23, 24, 25, 26
# How many further terms there are (`further`), then a slot of places for each: what the registry records of it.
FURTHER, FIRST_SLOT, SLOT = 27, 28, 6
COEFFICIENT, SHIFT, ORDER, KIND, POWER, ODD = 0, 1, 2, 3, 4, 5
MOST_FURTHER = 8
SIZE = FIRST_SLOT + SLOT * MOST_FURTHER

PLACES: dict[str, tuple[int, ...]] = {
    "inertia": (A11,),
    "gravity_torque": (B,),
    "viscous": (VISCOUS_P, VISCOUS_N),
    "viscous_positive": (VISCOUS_P,),
    "viscous_negative": (VISCOUS_N,),
    "coulomb": (COULOMB_P, COULOMB_N, STATIC_P, STATIC_N),
    "coulomb_positive": (COULOMB_P, STATIC_P),
    "coulomb_negative": (COULOMB_N, STATIC_N),
    "stribeck": (STATIC_P, STATIC_N),
    "stribeck_speed": (STRIBECK_SPEED,),
    "quadratic": (QUADRATIC,),
    "cubic": (CUBIC,),
    "offset": (OFFSET,),
}
"""Places that grow with a term's coefficient, one for one; "stribeck" is the static less the Coulomb friction."""


TILTS = AXIS_TILT, WHEEL_TILT = "axis.tilt", "drive.wheel.tilt"
"""Keys of the tilts (rad)."""


def constants(rig: Rig) -> dict[str, Quantity]:
    """Every constant of the rig that moves it, by its rig.toml key, in a fixed order.

    Raises InputError where the axis' inertia or gravity torque is not a number: motion needs both.
    """
    from swingid.units import Quantity, UnknownScale

    axis, wheel = rig.axis, rig.drive.wheel
    scales = {"drive.wheel.inertia": wheel.inertia if wheel else None, "log.torque_gain": rig.log.torque_gain}
    for key, scale in scales.items():
        if isinstance(scale, UnknownScale):
            raise _no_motion(rig, key, "unknown", "unknown-scale")
    if axis.inertia is None:
        message = f"rig {rig.name!r} gives no axis.inertia, without which no motion can be computed; add it"
        raise InputError(message, code="missing-inertia")
    if isinstance(axis.gravity_torque, str):
        raise _no_motion(rig, "axis.gravity_torque", axis.gravity_torque, "unknown-gravity")
    stated = {"axis.inertia": axis.inertia, "axis.gravity_torque": axis.gravity_torque}
    for name in FRICTION_KEYS:
        quantity = stated_at(rig, TERMS[name].key)
        if isinstance(quantity, Quantity):
            stated[TERMS[name].key] = quantity
    if rig.drive.wheel is not None:
        assert rig.drive.motor is not None
        stated["drive.wheel.inertia"] = rig.drive.wheel.inertia
        for key in MOTOR_KEYS:
            stated[f"drive.motor.{key}"] = getattr(rig.drive.motor, key)
        d2, d1 = rig.drive.motor.dead_zone
        stated["drive.motor.dead_zone.negative"] = Quantity(d2)
        stated["drive.motor.dead_zone.positive"] = Quantity(d1)
    if rig.drive.channel == "voltage":
        stated |= _motor_on_axis(rig)
    for term in further_terms():
        for key in (term.key, term.shift, term.order):
            quantity = stated_at(rig, key) if stated_at(rig, term.key) is not None and key else None
            if isinstance(quantity, str):
                raise _no_motion(rig, key, quantity, "unknown-term")
            if quantity is not None:
                stated[key] = quantity
    for key in TILTS:
        tilt = stated_at(rig, key)
        if isinstance(tilt, Quantity) and (tilt.value or tilt.std):
            stated[key] = tilt
    return stated


def _motor_on_axis(rig: Rig) -> dict[str, Quantity]:
    """The constants of a motor on the axis by their keys; InputError where its torque per volt is not stated."""
    motor = rig.drive.motor
    assert motor is not None
    if "torque_per_volt" not in motor.model_fields_set:
        raise _no_motion(rig, "drive.motor.torque_per_volt", "unknown", "unknown-term")
    keys = (*MOTOR_TERMS, "rotor_inertia", "gear_ratio")
    return {f"drive.motor.{key}": getattr(motor, key) for key in keys}


def _no_motion(rig: Rig, key: str, stated: str, code: str) -> InputError:
    message = f"rig {rig.name!r} has {key} = {stated!r}, which gives no motion; put a number there"
    return InputError(message, code=code)


def rig_vector(rig: Rig) -> Array:
    """The parameter vector (SIZE,) of a rig's stated values; errors as `constants` and `vector`."""
    return vector({key: quantity.value for key, quantity in constants(rig).items()}, rig.drive.channel)


def vector(values: Mapping[str, float], channel: str | None = "wheel_angle") -> Array:
    """The parameter vector (SIZE,) from plain SI values under rig.toml keys; absent keys mean "not there".

    channel: of the drive, as of `Drive.channel`, None of a free axis. A direction's own coefficient
    (viscous_positive, ...) takes the place of the two-sided one; static friction below Coulomb friction is lifted to
    it. Raises InputError for LuGre without a friction level and for a mass matrix that is not positive definite.
    """
    p = np.zeros(SIZE)
    p[A11] = values["axis.inertia"]
    p[B] = values.get("axis.gravity_torque", 0.0) * math.cos(values.get(AXIS_TILT, 0.0))
    p[DIRECT] = float(channel == "torque")
    p[A22], p[GEAR], p[ETA], p[WHEEL_STATIC] = 1.0, 0.0, 1.0, math.inf
    if channel == "wheel_angle":
        _motor(values, p)
    _friction(values, p)
    if channel == "voltage":
        p[DIRECT] = values["drive.motor.torque_per_volt"]
        p[A11] += values["drive.motor.gear_ratio"] ** 2 * values["drive.motor.rotor_inertia"]
        p[[VISCOUS_P, VISCOUS_N]] += values["drive.motor.back_emf"]
    for term in further_terms():
        if term.key in values:
            add_term(p, term, values[term.key], values.get(term.order, 1.0), values.get(term.shift, 0.0))
    if not (p[A11] > 0.0 and p[A11] * p[A22] > p[A12] ** 2):
        raise InputError(
            f"axis.inertia = {values['axis.inertia']:g} is impossible beside the wheel's inertia and gear "
            "(a12^2 >= a11 a22); correct axis.inertia, drive.wheel.inertia or drive.motor.rotor_inertia",
            code="bad-inertia",
        )
    return p


def _motor(values: Mapping[str, float], p: Array) -> None:
    """Wheel, gear and motor into the vector."""
    j2 = values["drive.wheel.inertia"]
    jr = values.get("drive.motor.rotor_inertia", 0.0)
    gear = values.get("drive.motor.gear_ratio", 1.0)
    along = math.cos(values.get(WHEEL_TILT, 0.0))
    p[A11] += (j2 + jr) * along
    p[A12], p[A22], p[GEAR] = (j2 + gear * jr) * along, j2 + gear**2 * jr, gear
    p[C1] = values.get("drive.motor.torque_per_volt", 0.0)
    p[C2] = values.get("drive.motor.back_emf", 0.0)
    p[ETA] = values.get("drive.motor.efficiency", 1.0)
    p[D1] = values.get("drive.motor.dead_zone.positive", 0.0)
    p[D2] = values.get("drive.motor.dead_zone.negative", 0.0)
    p[F2] = values.get("drive.motor.viscous", 0.0)
    p[F3] = values.get("drive.motor.coulomb", 0.0)
    p[WHEEL_STATIC] = abs(gear) * p[F3]


def _friction(values: Mapping[str, float], p: Array) -> None:
    """The axis' friction into the vector."""

    def get(key: str, default: float = 0.0) -> float:
        return values.get(f"axis.friction.{key}", default)

    viscous, coulomb = get("viscous"), get("coulomb")
    p[VISCOUS_P], p[VISCOUS_N] = get("viscous_positive", viscous), get("viscous_negative", viscous)
    p[COULOMB_P], p[COULOMB_N] = get("coulomb_positive", coulomb), get("coulomb_negative", coulomb)
    static = get("static")
    p[STATIC_P], p[STATIC_N] = max(static, p[COULOMB_P]), max(static, p[COULOMB_N])
    p[STRIBECK_SPEED], p[QUADRATIC], p[CUBIC] = get("stribeck_speed"), get("quadratic"), get("cubic")
    p[OFFSET] = get("offset")
    p[SIGMA0], p[SIGMA1] = get("lugre.bristle_stiffness"), get("lugre.bristle_damping")
    if p[SIGMA0] > 0.0 and not (p[COULOMB_P] > 0.0 and p[COULOMB_N] > 0.0):
        raise InputError(
            "axis.friction.lugre needs axis.friction.coulomb, the level at which its bristles slide; add it",
            code="lugre-without-coulomb",
        )
    p[AXIS_STICKS] = can_stick(p)


def add_term(p: Array, term: Term, coefficient: float, order: float, shift: float) -> int:
    """Put a further term into the next slot of the vector; returns the first place of it.

    Raises InputError where no slot is left.
    """
    count = int(p[FURTHER])
    if count == MOST_FURTHER:
        raise InputError(f"{term.key} is one term too many: a rig has up to {count} beside friction", code="too-many")
    place = FIRST_SLOT + SLOT * count
    p[FURTHER] = count + 1.0
    p[place : place + SLOT] = coefficient, shift, order, term.kind, term.power or 0, term.odd
    p[AXIS_STICKS] = can_stick(p)
    return place


def can_stick(p: Array) -> float:
    """1 where dry friction can hold the axis of this vector, 0 where none can."""
    slots = p[FIRST_SLOT:SIZE].reshape(-1, SLOT)
    dry = (slots[:, POWER] == 0.0) & (slots[:, ODD] != 0.0) & (slots[:, COEFFICIENT] > 0.0)
    return float(p[SIGMA0] == 0.0 and (max(p[STATIC_P], p[STATIC_N]) > 0.0 or bool(dry.any())))
