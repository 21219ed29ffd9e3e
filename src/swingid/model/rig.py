"""The rig: what is known of a pendulum, its drive, its sensors and its log, as rig.toml says it.

Values are SI quantities with their standard uncertainties. `axis.inertia` and `axis.friction` are the twin's truth
and no method reads them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo, model_validator

from swingid.errors import InputError
from swingid.model.rig_file import BUILT_IN, read_builtin, read_file, tables_of, validate
from swingid.units import Quantity, parse_quantity


@dataclass(frozen=True)
class _Unit:
    """Expected unit on a rotary and on a linear axis, and the range that values must keep."""

    rotary: str
    linear: str | None = None
    least: float = -math.inf
    above: float = -math.inf
    most: float = math.inf

    def quantity(self, raw: object, info: ValidationInfo) -> Quantity:
        """Parse and check; a ValueError's text is the sentence after the key."""
        if isinstance(raw, Quantity):
            return raw
        linear = bool(info.context and info.context.get("linear"))
        unit = self.linear if linear and self.linear is not None else self.rotary
        try:
            quantity = parse_quantity(raw, unit, "")
        except InputError as error:
            raise ValueError(error.message.removeprefix(": ")) from error
        if quantity.value < self.least:
            raise ValueError(f"{quantity.value:g} is {_below(self.least)}; give a value of at least {self.least:g}.")
        if quantity.value <= self.above:
            raise ValueError(f"{quantity.value:g} is not positive; give a value above {self.above:g}.")
        if quantity.value > self.most:
            raise ValueError(f"{quantity.value:g} is too large; give a value of at most {self.most:g}.")
        return quantity

    def number(self, raw: object, info: ValidationInfo) -> float:
        """As `quantity`, for keys that are themselves a spread or a count and carry no uncertainty."""
        if isinstance(raw, int | float) and not isinstance(raw, bool) and type(raw) is float and math.isinf(raw):
            raise ValueError("it is not finite.")
        quantity = self.quantity(raw, info)
        if quantity.std is not None:
            raise ValueError("it carries no uncertainty; give the value alone.")
        return quantity.value


def _below(least: float) -> str:
    return "negative" if least == 0 else "too small"


def _quantity(rotary: str, linear: str | None = None, **limits: float) -> Any:
    return BeforeValidator(_Unit(rotary, linear, **limits).quantity)


def _number(rotary: str, linear: str | None = None, **limits: float) -> Any:
    return BeforeValidator(_Unit(rotary, linear, **limits).number)


Inertia = Annotated[Quantity, _quantity("kg*m**2", "kg", above=0.0)]
WheelInertia = Annotated[Quantity, _quantity("kg*m**2", above=0.0)]
RotorInertia = Annotated[Quantity, _quantity("kg*m**2", least=0.0)]
Torque = Annotated[Quantity, _quantity("N*m", "N")]
Friction0 = Annotated[Quantity, _quantity("N*m", "N", least=0.0)]
Friction1 = Annotated[Quantity, _quantity("N*m*s", "N*s/m", least=0.0)]
Friction2 = Annotated[Quantity, _quantity("N*m*s**2", "N*s**2/m**2", least=0.0)]
Friction3 = Annotated[Quantity, _quantity("N*m*s**3", "N*s**3/m**3", least=0.0)]
Speed = Annotated[Quantity, _quantity("rad/s", "m/s", above=0.0)]
Stiffness = Annotated[Quantity, _quantity("N*m/rad", "N/m", above=0.0)]
TorquePerVolt = Annotated[Quantity, _quantity("N*m/V", least=0.0)]
MotorViscous = Annotated[Quantity, _quantity("N*m*s", least=0.0)]
MotorTorque = Annotated[Quantity, _quantity("N*m", least=0.0)]
Ratio = Annotated[Quantity, _quantity("", above=0.0)]
Share = Annotated[Quantity, _quantity("", above=0.0, most=1.0)]
Gain = Annotated[Quantity, _quantity("")]
Seconds = Annotated[Quantity, _quantity("s")]
AngleStd = Annotated[float, _number("rad", "m", least=0.0)]
TimeStd = Annotated[float, _number("s", least=0.0)]
Counts = Annotated[float, _number("", above=0.0)]
Fraction = Annotated[float, _number("", least=0.0, most=0.9)]
Volts = Annotated[float, _number("V", above=0.0)]
Hertz = Annotated[float, _number("Hz", above=0.0)]
Factor = Annotated[float, _number("")]
TorqueEdge = Annotated[float, _number("N*m")]
Sign = Literal[1, -1]


class Section(BaseModel):
    """A table of rig.toml: frozen, and every unknown key an error."""

    model_config = ConfigDict(frozen=True, extra="forbid", arbitrary_types_allowed=True)


class Lugre(Section):
    """LuGre bristles: stiffness sigma0 (N m/rad or N/m) and damping sigma1 (N m s or N s/m)."""

    bristle_stiffness: Stiffness
    bristle_damping: Friction1 = Quantity(0.0)


class Friction(Section):
    """Friction of the axis, the twin's truth: any of these terms, None where absent."""

    viscous: Friction1 | None = None
    coulomb: Friction0 | None = None
    static: Friction0 | None = None
    stribeck_speed: Speed | None = None
    quadratic: Friction2 | None = None
    cubic: Friction3 | None = None
    viscous_positive: Friction1 | None = None
    viscous_negative: Friction1 | None = None
    coulomb_positive: Friction0 | None = None
    coulomb_negative: Friction0 | None = None
    offset: Torque | None = None
    lugre: Lugre | None = None

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        for name in ("viscous", "coulomb"):
            directed = [getattr(self, f"{name}_{side}") for side in ("positive", "negative")]
            if getattr(self, name) is not None and any(directed):
                raise ValueError(f"{name} and {name}_positive or {name}_negative exclude each other; give one kind.")
            if (directed[0] is None) != (directed[1] is None):
                raise ValueError(f"{name}_positive and {name}_negative come together; give both.")
        levels = [q.value for q in (self.coulomb, self.coulomb_positive, self.coulomb_negative) if q is not None]
        if self.static is not None and levels and self.static.value < max(levels):
            raise ValueError(f"static {self.static.value:g} is below coulomb {max(levels):g}; it is the larger one.")
        return self


class Axis(Section):
    """The swinging body: kind, gravity torque b (N m; "unknown" = identify it), and the twin's truth."""

    kind: Literal["rotary", "linear"] = "rotary"
    gravity_torque: Literal["unknown"] | Torque = Quantity(0.0)
    inertia: Inertia | None = None
    friction: Friction = Friction()


class Wheel(Section):
    """The reaction wheel: central inertia J2 (kg m²)."""

    inertia: WheelInertia


def _dead_zone(raw: object, info: ValidationInfo) -> tuple[float, float]:
    if not isinstance(raw, list | tuple) or len(raw) != 2:
        raise ValueError("it is not a pair; give [d2, d1] with d2 <= 0 <= d1 in N*m.")
    low, high = (_Unit("N*m").number(edge, info) for edge in raw)
    if not low <= 0 <= high:
        raise ValueError(f"[{low:g}, {high:g}] is not in order; give [d2, d1] with d2 <= 0 <= d1 in N*m.")
    return low, high


class Motor(Section):
    """Motor and gear of the wheel: Jr, N, c1, c2, f2, f3, η, the dead zone (d2, d1), and the voltage limit."""

    rotor_inertia: RotorInertia = Quantity(0.0)
    gear_ratio: Ratio = Quantity(1.0)
    torque_per_volt: TorquePerVolt = Quantity(0.0)
    back_emf: MotorViscous = Quantity(0.0)
    viscous: MotorViscous = Quantity(0.0)
    coulomb: MotorTorque = Quantity(0.0)
    efficiency: Share = Quantity(1.0)
    dead_zone: Annotated[tuple[float, float], BeforeValidator(_dead_zone)] = (0.0, 0.0)
    voltage_limit: Volts | None = None


class Drive(Section):
    """What moves the axis: a reaction wheel with its motor, a direct drive (torque known), or nothing."""

    kind: Literal["reaction-wheel", "direct", "none"]
    wheel: Wheel | None = None
    motor: Motor | None = None

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.kind == "reaction-wheel" and self.wheel is None:
            raise ValueError('kind is "reaction-wheel" but there is no [drive.wheel]; give its inertia there.')
        if self.kind != "reaction-wheel" and (self.wheel or self.motor):
            section = "wheel" if self.wheel else "motor"
            raise ValueError(f'kind is "{self.kind}", which has no [drive.{section}]; remove it or change kind.')
        return self

    @property
    def a12(self) -> float:
        """a12 = J2 + N Jr (kg m²), reaction wheel only."""
        return self._coupled(1)

    @property
    def a22(self) -> float:
        """a22 = J2 + N² Jr (kg m²), reaction wheel only."""
        return self._coupled(2)

    def _coupled(self, power: int) -> float:
        if self.wheel is None:
            raise ValueError("only a reaction wheel has a12 and a22")
        rotor = 0.0 if self.motor is None else self.motor.gear_ratio.value**power * self.motor.rotor_inertia.value
        return self.wheel.inertia.value + rotor


@dataclass(frozen=True)
class Sensor:
    """One resolved channel: resolution, nonlinearity, noise in rad or m (0 = ideal), latency and jitter in s.

    Row k holds the angle at t_k + latency (positive = read late) + jitter drawn per row. nonlinearity is the standard
    deviation of α and β in measured = q + α cos q + β sin q; dropouts the fraction of rows lost.
    """

    resolution: float
    nonlinearity: float
    noise: float
    latency: Quantity
    jitter: float
    dropouts: float


class Channel(Section):
    """Sensor keys of one channel; None where not given."""

    counts_per_turn: Counts | None = None
    resolution: AngleStd | None = None
    nonlinearity: AngleStd | None = None
    noise: AngleStd | None = None
    latency: Seconds | None = None
    jitter: TimeStd | None = None
    dropouts: Fraction | None = None

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.counts_per_turn is not None and self.resolution is not None:
            raise ValueError("counts_per_turn and resolution exclude each other; give one of them.")
        return self


class Sensors(Channel):
    """The axis' encoder, and under [sensors.wheel] what differs on the wheel's."""

    wheel: Channel | None = None

    def of(self, name: str) -> Sensor:
        """The channel "angle" or "wheel", resolved; the wheel inherits what it does not give."""
        own: Channel = self.wheel if name == "wheel" and self.wheel is not None else self

        def given(key: str) -> Any:
            value = getattr(own, key)
            return getattr(self, key) if value is None else value

        source = own if own.counts_per_turn is not None or own.resolution is not None else self
        resolution = source.resolution or 0.0
        if source.counts_per_turn is not None:
            resolution = 2 * math.pi / source.counts_per_turn
        return Sensor(
            resolution,
            given("nonlinearity") or 0.0,
            given("noise") or 0.0,
            given("latency") or Quantity(0.0),
            given("jitter") or 0.0,
            given("dropouts") or 0.0,
        )


AngleUnit = Literal["rad", "deg", "turns", "counts", "m"]


class LogConventions(Section):
    """Columns, units and signs of this rig's logs ([log]); see docs/rig.md."""

    time: str | None = "t"
    rate: Hertz | None = None
    angle: str = "q1"
    angle_unit: AngleUnit = "rad"
    angle_zero: Literal["down", "up"] = "down"
    angle_sign: Sign = 1
    wheel_angle: str = "q2"
    wheel_angle_unit: Literal["rad", "deg", "turns", "counts"] = "rad"
    wheel_angle_sign: Sign = 1
    wheel_angle_is: Literal["relative", "absolute"] = "relative"
    wheel_scale: Factor = 1.0
    wheel_speed: str | None = None
    wheel_speed_unit: str = "rad/s"
    voltage: str = "u"
    voltage_sign: Sign = 1
    torque: str = "tau"
    torque_gain: Gain = Quantity(1.0)
    torque_sign: Sign = 1
    reference: str = "ym"
    drive_held: bool = True

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.rate is not None and "time" in self.model_fields_set and self.time is not None:
            raise ValueError("time and rate exclude each other; keep time where the log has a time column.")
        if self.wheel_scale == 0 or self.torque_gain.value == 0:
            raise ValueError("wheel_scale and torque_gain must not be 0.")
        return self


class Rig(Section):
    """A rig: name, axis, drive, sensors and log conventions. Load one with `Rig.load`.

    source: path or "built-in NAME"; text: the TOML it was read from.
    """

    name: str
    axis: Axis = Axis()
    drive: Drive
    sensors: Sensors = Sensors()
    log: LogConventions = LogConventions()
    source: str = Field(default="", exclude=True)
    text: str = Field(default="", exclude=True, repr=False)

    @classmethod
    def load(cls, rig: str | Path) -> Rig:
        """Rig from a path that ends in .toml or from a built-in name.

        Raises UsageError for a name that is no built-in, InputError for a file that is not a rig.
        """
        if isinstance(rig, str) and rig in BUILT_IN:
            return cls.builtin(rig)
        path, text = read_file(rig)
        return cls.from_text(text, str(path))

    @classmethod
    def builtin(cls, name: str) -> Rig:
        """One of the built-in rigs: "paper", and "paper-body" with the test body."""
        return cls.from_text(read_builtin(name), f"built-in {name}")

    @classmethod
    def from_text(cls, text: str, source: str = "rig.toml") -> Rig:
        """Rig from TOML text; `source` names it in messages. Raises InputError naming the key."""
        tables = tables_of(text, source)
        axis = tables.get("axis")
        linear = isinstance(axis, dict) and axis.get("kind") == "linear"
        return validate(cls, tables, {"linear": linear}, source, text)

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        linear = self.axis.kind == "linear"
        if linear and self.drive.kind == "reaction-wheel":
            raise ValueError("drive.kind: a reaction wheel turns, but axis.kind is linear; use a direct drive.")
        if linear and self.axis.gravity_torque != Quantity(0.0):
            raise ValueError("axis.gravity_torque: a linear axis has none here; remove it.")
        if (self.log.angle_unit == "m") != linear and "angle_unit" in self.log.model_fields_set:
            raise ValueError(f'log.angle_unit: "{self.log.angle_unit}" does not fit a {self.axis.kind} axis; change it.')
        for unit, key, channel in (
            (self.log.angle_unit, "angle_unit", self.sensors),
            (self.log.wheel_angle_unit, "wheel_angle_unit", self.sensors.wheel or self.sensors),
        ):
            if unit == "counts" and (channel.counts_per_turn or self.sensors.counts_per_turn) is None:
                raise ValueError(f'log.{key}: "counts" needs sensors.counts_per_turn; give it.')
        self._reachable()
        return self

    def _reachable(self) -> None:
        """The mass matrix must be positive definite: a12² < a11 a22."""
        if self.drive.wheel is None or self.axis.inertia is None:
            return
        rotor = 0.0 if self.drive.motor is None else self.drive.motor.rotor_inertia.value
        a11 = self.axis.inertia.value + self.drive.wheel.inertia.value + rotor
        if self.drive.a12**2 >= a11 * self.drive.a22:
            raise ValueError(
                f"axis.inertia: {self.axis.inertia.value:g} kg m^2 with this wheel, rotor and gear gives "
                f"a12^2 >= a11 a22, which no body has; check drive.motor.gear_ratio and the inertias."
            )

    def constants_without_uncertainty(self) -> tuple[str, ...]:
        """Dotted keys of the known constants that state no uncertainty and so count as exact."""
        keys: list[str] = []
        if isinstance(self.axis.gravity_torque, Quantity):
            stated = "gravity_torque" in self.axis.model_fields_set
            keys += ["axis.gravity_torque"] if stated and self.axis.gravity_torque.std is None else []
        for path, section in (("drive.wheel", self.drive.wheel), ("drive.motor", self.drive.motor), ("log", self.log)):
            for field in sorted(section.model_fields_set, key=list(type(section).model_fields).index) if section else ():
                value = getattr(section, field)
                if isinstance(value, Quantity) and value.std is None:
                    keys.append(f"{path}.{field}")
        return tuple(keys)
