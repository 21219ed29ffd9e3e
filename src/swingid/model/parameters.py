"""The constants of a rig as one float64 vector, which every compiled kernel reads.

A place in the vector has a name (``p[A11]``) and a record in `PARAMETERS`: symbol, unit, meaning. The
vector is built in two moves: `constants` collects the rig's quantities by their rig.toml keys, `vector`
turns plain values under those keys into the vector. Between the two, values may be drawn from their
uncertainties.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from swingid.errors import InputError

if TYPE_CHECKING:
    from swingid.model.rig import Rig
    from swingid.numerics.arrays import Array
    from swingid.units import Quantity

# Places in the vector.
A11, A12, A22, B, DIRECT = 0, 1, 2, 3, 4
GEAR, C1, C2, ETA, D1, D2, F2, F3 = 5, 6, 7, 8, 9, 10, 11, 12
WHEEL_STATIC, AXIS_STICKS = 13, 14
VISCOUS_P, VISCOUS_N, COULOMB_P, COULOMB_N, STATIC_P, STATIC_N = 15, 16, 17, 18, 19, 20
STRIBECK_SPEED, QUADRATIC, CUBIC, OFFSET, SIGMA0, SIGMA1 = 21, 22, 23, 24, 25, 26
SIZE = 27


@dataclass(frozen=True, slots=True)
class ParameterRecord:
    """One place of the vector: its name in code, the paper's or the literature's symbol, SI unit, meaning."""

    name: str
    symbol: str
    unit: str
    meaning: str


PARAMETERS: tuple[ParameterRecord, ...] = (
    ParameterRecord("A11", "a11", "kg m^2", "J1 + J2 + Jr; without a wheel J1 alone (linear axis: kg)"),
    ParameterRecord("A12", "a12", "kg m^2", "J2 + N Jr; 0 without a wheel"),
    ParameterRecord("A22", "a22", "kg m^2", "J2 + N^2 Jr; 1 without a wheel, where nothing moves by it"),
    ParameterRecord("B", "b", "N m", "amplitude of the gravity torque b sin q1"),
    ParameterRecord(
        "DIRECT", "", "1", "1 where the command is a torque on the axis, 0 where it is a voltage or nothing"
    ),
    ParameterRecord("GEAR", "N", "1", "rotor turns per wheel turn"),
    ParameterRecord("C1", "c1", "N m/V", "motor torque per volt"),
    ParameterRecord("C2", "c2", "N m s", "motor torque lost per wheel speed (back-EMF)"),
    ParameterRecord("ETA", "eta", "1", "efficiency"),
    ParameterRecord("D1", "d1", "N m", "upper edge of the dead zone, >= 0"),
    ParameterRecord("D2", "d2", "N m", "lower edge of the dead zone, <= 0"),
    ParameterRecord("F2", "f2", "N m s", "viscous friction of motor and gearbox"),
    ParameterRecord("F3", "f3", "N m", "Coulomb friction of motor and gearbox"),
    ParameterRecord("WHEEL_STATIC", "N f3", "N m", "torque on the wheel that releases it; infinite without a wheel"),
    ParameterRecord("AXIS_STICKS", "", "1", "1 where the axis can stick (some Coulomb or static friction, no LuGre)"),
    ParameterRecord("VISCOUS_P", "", "N m s", "viscous coefficient of the axis for q1' > 0 (the paper's f1 N)"),
    ParameterRecord("VISCOUS_N", "", "N m s", "viscous coefficient of the axis for q1' < 0"),
    ParameterRecord("COULOMB_P", "Fc", "N m", "Coulomb friction of the axis for q1' > 0"),
    ParameterRecord("COULOMB_N", "Fc", "N m", "Coulomb friction of the axis for q1' < 0"),
    ParameterRecord("STATIC_P", "Fs", "N m", "friction at the brink of motion towards q1' > 0, >= Coulomb"),
    ParameterRecord("STATIC_N", "Fs", "N m", "friction at the brink of motion towards q1' < 0, >= Coulomb"),
    ParameterRecord("STRIBECK_SPEED", "vs", "rad/s", "speed over which static falls to Coulomb; 0: at once"),
    ParameterRecord("QUADRATIC", "", "N m s^2", "coefficient of q1' |q1'|"),
    ParameterRecord("CUBIC", "", "N m s^3", "coefficient of q1'^3"),
    ParameterRecord("OFFSET", "", "N m", "constant torque against the positive direction"),
    ParameterRecord("SIGMA0", "sigma0", "N m/rad", "stiffness of the LuGre bristles; 0: no LuGre"),
    ParameterRecord("SIGMA1", "sigma1", "N m s", "damping of the LuGre bristles"),
)

FRICTION_KEYS = (
    "viscous", "coulomb", "static", "stribeck_speed", "quadratic", "cubic", "viscous_positive",
    "viscous_negative", "coulomb_positive", "coulomb_negative", "offset",
)  # fmt: skip
MOTOR_KEYS = (
    "rotor_inertia",
    "gear_ratio",
    "torque_per_volt",
    "back_emf",
    "viscous",
    "coulomb",
    "efficiency",
)


def constants(rig: Rig) -> dict[str, Quantity]:
    """Every constant of the rig that moves it, by its rig.toml key, in a fixed order.

    Raises InputError where the axis' inertia or gravity torque is not a number: motion needs both.
    """
    from swingid.units import Quantity

    axis = rig.axis
    if axis.inertia is None:
        raise InputError(
            f"rig {rig.name!r} gives no axis.inertia, without which no motion can be computed; add it",
            code="missing-inertia",
        )
    if isinstance(axis.gravity_torque, str):
        raise InputError(
            f"rig {rig.name!r} has axis.gravity_torque = {axis.gravity_torque!r}, which gives no motion; "
            "put a number there",
            code="unknown-gravity",
        )
    found = {"axis.inertia": axis.inertia, "axis.gravity_torque": axis.gravity_torque}
    for key in FRICTION_KEYS:
        quantity = getattr(axis.friction, key)
        if quantity is not None:
            found[f"axis.friction.{key}"] = quantity
    if axis.friction.lugre is not None:
        for key in ("bristle_stiffness", "bristle_damping"):
            found[f"axis.friction.lugre.{key}"] = getattr(axis.friction.lugre, key)
    if rig.drive.kind == "reaction-wheel":
        assert rig.drive.wheel is not None
        assert rig.drive.motor is not None
        found["drive.wheel.inertia"] = rig.drive.wheel.inertia
        for key in MOTOR_KEYS:
            found[f"drive.motor.{key}"] = getattr(rig.drive.motor, key)
        d2, d1 = rig.drive.motor.dead_zone
        found["drive.motor.dead_zone.negative"] = Quantity(d2)
        found["drive.motor.dead_zone.positive"] = Quantity(d1)
    return found


def rig_vector(rig: Rig) -> Array:
    """The parameter vector (SIZE,) of a rig's stated values; errors as `constants` and `vector`."""
    return vector({key: quantity.value for key, quantity in constants(rig).items()}, rig.drive.kind)


def vector(values: Mapping[str, float], drive: str = "reaction-wheel") -> Array:
    """The parameter vector (SIZE,) from plain SI values under rig.toml keys; absent keys mean "not there".

    `drive` is "reaction-wheel", "direct" or "none". A direction's own coefficient (viscous_positive, ...)
    takes the place of the two-sided one; static friction below Coulomb friction is lifted to it. Raises
    InputError for LuGre without a friction level and for a mass matrix that is not positive definite.
    """
    p = np.zeros(SIZE)
    p[A11] = values["axis.inertia"]
    p[B] = values.get("axis.gravity_torque", 0.0)
    p[DIRECT] = float(drive == "direct")
    p[A22], p[GEAR], p[ETA], p[WHEEL_STATIC] = 1.0, 0.0, 1.0, math.inf
    if drive == "reaction-wheel":
        _motor(values, p)
    _friction(values, p)
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
    p[A11] += j2 + jr
    p[A12], p[A22], p[GEAR] = j2 + gear * jr, j2 + gear**2 * jr, gear
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
    p[AXIS_STICKS] = float(p[SIGMA0] == 0.0 and max(p[STATIC_P], p[STATIC_N]) > 0.0)
