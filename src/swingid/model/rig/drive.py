"""The table [drive] of rig.toml: the wheel, its motor or that of the axis, and the tilt of an axis.

Units in comments are those of a rotary axis; a linear axis takes kg, N, m in place of kg m², N m, rad.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Annotated, Literal, Self

from pydantic import Field, PlainValidator, ValidationInfo, model_validator

from swingid.errors import InputError
from swingid.model.rig.fields import Table, plain_number, quantity, read_quantity, refuse, scale_or_unknown, stated
from swingid.model.rig.windings import of_windings, without_unknown
from swingid.units import Quantity, UnknownScale

Torque = Annotated[Quantity, quantity("N*m", least=0)]
Tilt = Annotated[Quantity, quantity("rad", "rad", above=-math.pi / 2, below=math.pi / 2)]

NOT_LEVEL = Quantity(0.0, math.radians(0.5))
"""Tilt of an axis about which nothing is stated: what a look at it would not show."""

ROTOR_SHARE = 0.05
"""Standard uncertainty of N Jr, the rotor's part of a12, over J2 where no rotor inertia is stated.

The paper's motor has 8 %, the flat motors without gear of wheels of 0.2 kg have 2 % (AAU's and ETH's Cubli).
"""


@lru_cache(maxsize=64)
def cosine(tilt: Quantity) -> Quantity:
    """Mean and standard uncertainty of the cosine of an angle (rad) that is normally distributed.

    Both are of second order in the uncertainty of a small angle, and the cosine is never above 1 (GUM F.2.4.4).
    """
    variance = (tilt.std or 0.0) ** 2
    mean = math.cos(tilt.value) * math.exp(-variance / 2)
    spread = -math.expm1(-variance) * (1 - math.exp(-variance) * math.cos(2 * tilt.value)) / 2
    return Quantity(mean, math.sqrt(spread))


class Wheel(Table):
    """The reaction wheel: its central inertia J2, and the tilt (rad) of its axis against that of the body.

    With an unknown inertia what is identified is relative to it.
    """

    inertia: Annotated[Quantity | UnknownScale, scale_or_unknown("kg*m^2")]
    tilt: Tilt = NOT_LEVEL

    @property
    def along(self) -> Quantity:
        """The share of the wheel's angular momentum that is along the axis of the body."""
        return cosine(self.tilt)


def _dead_zone(raw: object, info: ValidationInfo) -> tuple[float, float]:
    if not isinstance(raw, list | tuple) or len(raw) != 2:
        refuse("not-a-quantity", "must be two torques, [d2, d1] with d2 <= 0 <= d1")
    edges = [read_quantity(edge, info, "N*m") for edge in raw]
    if any(edge.std is not None for edge in edges):
        refuse("uncertainty-unused", "takes no uncertainties; write two numbers")
    low, high = (edge.value for edge in edges)
    if not low <= 0 <= high:
        refuse("out-of-range", f"is [{low:g}, {high:g}], but must be [d2, d1] with d2 <= 0 <= d1")
    return low, high


class Motor(Table):
    """Motor and gear of (8) and (9): M = deadzone(η (c1 u − c2 q2')), friction f2, f3; N is `gear_ratio`.

    Defaults are a motor that adds nothing: no gear, no torque, and a massless rotor, on a reaction wheel uncertain by
    `ROTOR_SHARE`. The file may state torque_constant (k, N m/A, which is the back-EMF constant in V s) and resistance
    (R, ohm) in the place of torque_per_volt = N k/R and back_emf = N² k²/R. gear_friction: "unknown" where a motor on
    the axis has friction in proportion to its torque.
    """

    rotor_inertia: Annotated[Quantity, quantity("kg*m^2", least=0)] = Quantity(0.0)
    gear_ratio: Annotated[Quantity, quantity("", above=0)] = Quantity(1.0)
    torque_per_volt: Annotated[Quantity, quantity("N*m/V", "N/V", least=0)] = Quantity(0.0)
    back_emf: Annotated[Quantity, quantity("N*m*s", "N*s/m", least=0)] = Quantity(0.0)
    torque_constant: Annotated[Quantity, quantity("N*m/A", above=0)] | None = None
    resistance: Annotated[Quantity, quantity("ohm", above=0)] | None = None
    gear_friction: Literal["unknown"] | None = None
    viscous: Annotated[Quantity, quantity("N*m*s", least=0)] = Quantity(0.0)
    coulomb: Torque = Quantity(0.0)
    efficiency: Annotated[Quantity, quantity("", above=0, most=1)] = Quantity(1.0)
    dead_zone: Annotated[tuple[float, float], PlainValidator(_dead_zone)] = (0.0, 0.0)
    voltage_limit: Annotated[float, plain_number("V", above=0)] | None = None

    @model_validator(mode="before")
    @classmethod
    def _from_windings(cls, raw: object, info: ValidationInfo) -> object:
        """Torque per volt and back-EMF from torque constant, resistance and gear."""
        return of_windings(raw, info) if isinstance(raw, dict) else raw


CHANNELS = {"reaction-wheel": "wheel_angle", "direct": "torque", "motor": "voltage"}
"""Channel of a log by which a drive acts in equation (I), by its kind."""


class Drive(Table):
    """What moves the axis: a reaction wheel (with its motor), a known torque or force, a motor on the axis, or nothing.

    Of a motor on the axis, torque_per_volt and back_emf that the file does not state, or states as "unknown", are to be
    identified.
    """

    kind: Literal["reaction-wheel", "direct", "motor", "none"] = Field()
    wheel: Wheel | None = None
    motor: Motor | None = None

    @model_validator(mode="before")
    @classmethod
    def _kind_has_a_motor(cls, raw: object) -> object:
        if isinstance(raw, dict) and raw.get("kind") in ("reaction-wheel", "motor") and "motor" not in raw:
            return {**raw, "motor": Motor()}
        if isinstance(raw, dict) and raw.get("kind") == "motor" and isinstance(raw.get("motor"), dict):
            return {**raw, "motor": without_unknown(raw["motor"])}
        return raw

    @model_validator(mode="after")
    def _sections_fit_the_kind(self) -> Self:
        if self.kind == "reaction-wheel":
            if self.wheel is None:
                refuse(
                    "missing-key",
                    "is missing: kind = 'reaction-wheel' needs its inertia, or \"unknown\" for ratios",
                    "wheel",
                )
            rotor = self.motor is not None and self.motor.rotor_inertia.value
            if isinstance(self.wheel.inertia, UnknownScale) and rotor:
                problem = "is given beside an unknown wheel.inertia, which stands for wheel and rotor; leave it out"
                refuse("contradiction", problem, "motor.rotor_inertia")
            if self.motor is not None and self.motor.gear_friction is not None:
                refuse("contradiction", "belongs to kind = 'motor', not to 'reaction-wheel'", "motor.gear_friction")
            self._take_rotor(self.wheel.inertia)
            return self
        if self.kind == "motor":
            self._check_motor_on_axis()
            return self
        for key in ("wheel", "motor"):
            if getattr(self, key) is not None:
                refuse("contradiction", f"belongs to kind = 'reaction-wheel', not to {self.kind!r}", key)
        return self

    def _take_rotor(self, wheel: Quantity) -> None:
        """Take a rotor inertia that the file does not state as 0, uncertain; an unknown wheel stands for both."""
        if self.motor is None or stated(self.motor, "rotor_inertia") or isinstance(wheel, UnknownScale):
            return
        motor = self.motor.model_copy()
        motor.__dict__["rotor_inertia"] = Quantity(0.0, ROTOR_SHARE * wheel.value / motor.gear_ratio.value)
        self.__dict__["motor"] = motor

    def _check_motor_on_axis(self) -> None:
        """Refuse what a motor on the axis does not have apart from the axis."""
        if self.wheel is not None:
            refuse("contradiction", "belongs to kind = 'reaction-wheel', not to 'motor'", "wheel")
        for key in ("viscous", "coulomb", "efficiency", "dead_zone"):
            if self.motor is not None and stated(self.motor, key):
                what = "is given, but a motor on the axis has no friction apart from the axis: leave it out"
                refuse("contradiction", what, f"motor.{key}")

    @property
    def channel(self) -> str | None:
        """Name of the channel of a log by which it acts in equation (I); None of a free axis."""
        return CHANNELS.get(self.kind)

    @property
    def reflected(self) -> float:
        """N² Jr in kg m², the rotor's share of the inertia of an axis that it turns with; 0 without such a motor."""
        if self.kind != "motor" or self.motor is None:
            return 0.0
        return self.motor.gear_ratio.value**2 * self.motor.rotor_inertia.value

    @property
    def a12(self) -> float:
        """J2 + N Jr in kg m², the coupling in (I), as far as it is along the axis; InputError without a wheel."""
        wheel, rotor, gear = self._inertias()
        return (wheel + gear * rotor) * self._along

    @property
    def carried(self) -> float:
        """J2 + Jr in kg m², their part of a11; InputError without a wheel.

        A thin disc has J2 (1 − sin² γ / 2) about an axis at the angle γ to its own: to second order J2 cos γ.
        """
        wheel, rotor, _ = self._inertias()
        return (wheel + rotor) * self._along

    @property
    def a22(self) -> float:
        """J2 + N² Jr in kg m², the wheel's side of (II); InputError without a wheel."""
        wheel, rotor, gear = self._inertias()
        return wheel + gear**2 * rotor

    @property
    def _along(self) -> float:
        return 1.0 if self.wheel is None else self.wheel.along.value

    def _inertias(self) -> tuple[float, float, float]:
        if self.wheel is None or self.motor is None:
            message = f"a12 and a22 belong to a reaction wheel, but drive.kind is {self.kind!r}"
            raise InputError(message, code="no-wheel")
        return self.wheel.inertia.value, self.motor.rotor_inertia.value, self.motor.gear_ratio.value
