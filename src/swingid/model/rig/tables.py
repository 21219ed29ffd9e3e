"""The tables [axis] and [log] of rig.toml.

Units in comments are those of a rotary axis; a linear axis takes kg, N, m in place of kg m², N m, rad.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import BeforeValidator, Field, PlainValidator, StringConstraints, ValidationInfo, model_validator

from swingid.model.rig.drive import NOT_LEVEL, Tilt, cosine
from swingid.model.rig.fields import (
    Column,
    Table,
    TermTable,
    choice_or_number,
    given,
    has_unit,
    per_logged_unit,
    plain_number,
    quantity,
    quantity_or_unknown,
    refuse,
    stated,
    torque_or_unknown,
    two_columns,
    two_columns_or_place,
    unit_of_time,
)
from swingid.model.rig.gravity import weighed
from swingid.model.rig.suspension import Bifilar, Suspension, Trifilar
from swingid.quantity_text import shown
from swingid.spellings import canonical
from swingid.units import Quantity

Inertia = Annotated[Quantity, quantity("kg*m^2", "kg", above=0)]
Force = Annotated[Quantity, quantity("N*m", "N", least=0)]
AnyForce = Annotated[Quantity, quantity("N*m", "N")]
Viscous = Annotated[Quantity, quantity("N*m*s", "N*s/m", least=0)]


class Lugre(Table):
    """Bristles of LuGre, σ0 (N m/rad) and σ1 (N m s); the friction levels are `coulomb` (and `static`) of Friction."""

    bristle_stiffness: Annotated[Quantity, quantity("N*m/rad", "N/m", above=0)]
    bristle_damping: Viscous = Quantity(0.0)


class Friction(TermTable):
    """The friction of the suspension, F(q1'), as a sum of the laws given: true values, which no method uses.

    Units as the key's name implies: torques N m, viscous N m s, quadratic N m s², cubic N m s³, speeds rad/s.
    Direction-dependent coefficients are given for both directions, in the place of the two-sided one.
    """

    path: ClassVar[str] = "axis.friction"
    viscous: Viscous | None = None
    coulomb: Force | None = None
    static: Force | None = None
    stribeck_speed: Annotated[Quantity, quantity("rad/s", "m/s", above=0)] | None = None
    quadratic: Annotated[Quantity, quantity("N*m*s^2", "N*s^2/m^2", least=0)] | None = None
    cubic: Annotated[Quantity, quantity("N*m*s^3", "N*s^3/m^3", least=0)] | None = None
    viscous_positive: Viscous | None = None
    viscous_negative: Viscous | None = None
    coulomb_positive: Force | None = None
    coulomb_negative: Force | None = None
    offset: AnyForce | None = None
    lugre: Lugre | None = None

    @model_validator(mode="after")
    def _laws_fit_together(self) -> Self:
        for name in ("viscous", "coulomb"):
            sides = {side: getattr(self, f"{name}_{side}") for side in ("positive", "negative")}
            if getattr(self, name) is not None and given(*sides.values()):
                refuse("contradiction", f"is given beside {name}_positive or {name}_negative; keep one kind", name)
            for side, other in (("positive", "negative"), ("negative", "positive")):
                if sides[side] is None and sides[other] is not None:
                    refuse("missing-key", f"is missing beside {name}_{other}; give both directions", f"{name}_{side}")
        levels = [q.value for q in (self.coulomb, self.coulomb_positive, self.coulomb_negative) if q is not None]
        if self.static is not None and self.static.value < max(levels, default=0.0):
            refuse(
                "contradiction",
                f"is {self.static.value:g}, below the Coulomb friction {max(levels):g}; it is the friction at rest",
                "static",
            )
        if self.stribeck_speed is not None and self.static is None:
            refuse("missing-key", "is missing beside stribeck_speed; add the friction at rest", "static")
        if self.lugre is not None and max(levels, default=0.0) <= 0:
            refuse("missing-key", "is needed (and positive) beside lugre; add the friction level", "coulomb")
        dry = [key for key, term in self.term_keys().items() if term.is_dry and hasattr(self, key)]
        if self.lugre is not None and dry:
            refuse("contradiction", f"is given beside {dry[0]}, but its bristles have one friction level only", "lugre")
        return self


class Cogging(Table):
    """Cogging: a torque A sin(n q + φ) of the angle; n: periods per turn (linear axis: 2π over the period in m)."""

    order: Annotated[float, plain_number("", "1/m", above=0)]
    amplitude: Annotated[Quantity | Literal["unknown"], PlainValidator(quantity_or_unknown("N*m", "N"))]
    phase: Annotated[Quantity | Literal["unknown"] | None, PlainValidator(quantity_or_unknown("rad"))] = None

    @model_validator(mode="before")
    @classmethod
    def _unknown_with_its_phase(cls, raw: object) -> object:
        if isinstance(raw, dict) and raw.get("amplitude") == "unknown" and "phase" not in raw:
            return {**raw, "phase": "unknown"}
        return raw

    @model_validator(mode="after")
    def _phase_fits(self) -> Self:
        if self.phase == "unknown" and self.amplitude != "unknown":
            refuse("contradiction", "is unknown beside a stated amplitude; make both unknown", "phase")
        if self.amplitude == "unknown" and isinstance(self.phase, Quantity) and self.phase.std is not None:
            refuse("uncertainty-unused", "takes no uncertainty beside an unknown amplitude", "phase")
        return self


def _gravity_torque(raw: object, info: ValidationInfo) -> Quantity | str:
    torque = quantity_or_unknown("N*m", "N")(raw, info)
    if isinstance(torque, Quantity) and torque.value < 0:
        refuse(
            "out-of-range",
            f"is {torque.value:g}, but must not be negative: angles count from hanging (see log.angle_zero)",
        )
    return torque


class Axis(TermTable):
    """What swings: its kind, gravity's amplitude b (N m; 0: balanced), and what only the twin uses.

    The file may state mass (kg), lever or centre_of_mass (m, from the axis) and g (m/s²) or latitude (rad) in the place
    of gravity_torque, which is their product then. `inertia` is the paper's J1 with a wheel, the whole axis without.
    bifilar, trifilar: a body on strings about the vertical, or suspension by what acts (the others give it, too).
    tilt (rad): of the axis against the horizontal.
    model_uncertainty: relative standard uncertainty of every parameter for what no equation here contains.
    """

    path: ClassVar[str] = "axis"
    kind: Literal["rotary", "linear"] = "rotary"
    gravity_torque: Annotated[Quantity | Literal["unknown"], PlainValidator(_gravity_torque)] = Quantity(0.0)
    inertia: Inertia | None = None
    friction: Friction = Friction()
    cogging: Cogging | None = None
    bifilar: Bifilar | None = None
    trifilar: Trifilar | None = None
    suspension: Suspension | None = None
    tilt: Tilt = NOT_LEVEL
    model_uncertainty: Annotated[float, plain_number("", least=0, below=1)] = 5e-5
    mass: Annotated[Quantity, quantity("kg", above=0)] | None = None
    lever: Annotated[Quantity, quantity("m", least=0)] | None = None
    centre_of_mass: Annotated[Quantity, quantity("m", least=0)] | None = None
    g: Annotated[Quantity, quantity("m/s^2", above=0)] | None = None
    latitude: Annotated[float, plain_number("rad", least=-math.pi / 2, most=math.pi / 2)] | None = None

    @model_validator(mode="before")
    @classmethod
    def _weighed(cls, raw: object, info: ValidationInfo) -> object:
        """The gravity torque from mass, lever and free fall."""
        return weighed(raw, info) if isinstance(raw, dict) else raw

    @model_validator(mode="after")
    def _hangs_on_strings(self) -> Self:
        """The suspension from the geometry of its strings."""
        tables = {key: getattr(self, key) for key in ("bifilar", "trifilar", "suspension")}
        there = [key for key, table in tables.items() if table is not None]
        if len(there) > 1:
            refuse("contradiction", f"is given beside axis.{there[1]}; keep one", there[0])
        if there and self.kind == "linear":
            refuse("contradiction", "has no meaning on a linear axis", there[0])
        strings = self.bifilar or self.trifilar
        if strings is not None and getattr(self.gravity_torque, "value", 1.0) != 0.0:
            text = f"is given beside axis.{there[0]}, whose axis is vertical; leave it out"
            refuse("contradiction", text, "gravity_torque")
        if strings is not None:
            self.__dict__["suspension"] = Suspension.model_validate(strings.suspension())
        return self

    @property
    def along(self) -> Quantity:
        """The share of the gravity torque that acts about an axis with this tilt."""
        return cosine(self.tilt)

    @property
    def acting_gravity(self) -> Quantity | None:
        """The gravity torque that acts about the tilted axis, without the uncertainty of the tilt; None: unknown."""
        b = self.gravity_torque
        if isinstance(b, str):
            return None
        return Quantity(b.value * self.along.value, None if b.std is None else b.std * self.along.value)

    @model_validator(mode="after")
    def _linear_has_no_gravity(self) -> Self:
        if self.kind == "linear" and stated(self, "tilt") and (self.tilt.value or self.tilt.std):
            refuse("contradiction", "has no meaning on a linear axis, which has no gravity torque", "tilt")
        if self.kind == "linear" and self.gravity_torque != Quantity(0.0):
            refuse(
                "contradiction",
                "has no meaning on a linear axis; a constant force is axis.friction.offset",
                "gravity_torque",
            )
        return self


def _no_bool(raw: Any) -> Any:
    if isinstance(raw, bool):
        refuse("wrong-value", f"must be 1 or -1, not {str(raw).lower()}")
    return raw


Sign = Annotated[Literal[1, -1], BeforeValidator(_no_bool)]
AngleUnit = Literal["rad", "deg", "turns", "counts"]
SpeedUnit = Literal["rad/s", "deg/s", "turns/s", "rpm", "counts/s", "m/s", "mm/s"]
RateIs = Literal["instant", "mean", "held"]


class LogConventions(Table):
    """How the rig writes its logs; a channel that the drive kind does not have is not read.

    `model_fields_set` holds what the file stated: a default column may be absent from a log, a stated one may
    not. With `rate` (rows per second) rows are evenly spaced and `time` is not read. Row k's voltage or torque
    acts from t_k to t_(k+1) if `drive_held`, else it is a measurement at t_k; angles are those at t_k.
    `angle_zero` as a number is the logged value at which the body hangs (a linear axis: that is 0). `angle_scale` is
    angle (in its unit) per logged unit, of a potentiometer in V; `angle_offset` (rad, m) the angle at the logged value
    0, in the place of `angle_zero`. `wheel_scale` is wheel turns per logged turn, `voltage_scale` V per logged unit.
    `angle_speed` is the rate of the angle, in its place or beside it (`angle_speed_scale`: rate per logged unit);
    `wheel_speed` replaces the wheel's angle. A rate is that at its row, the mean since the row before, or held until
    the next one. Torque (force) = torque_sign * torque_gain * column. bridge: column that is 0 while that of a motor on
    the axis is open, so that no current flows; supply: column of its supply (V), of which `voltage` then is the share.
    time_unit is "s", "ms", "us", "ns" or the time of a tick of the clock, "0.5 us".
    clock: relative deviation of the log's clock, positive where it is fast. point: columns of x and y of a mark on the
    body, from which the angle is made; pivot: columns of a second mark, on the body or on the pivot, or its place,
    without which it is fitted; skip_rows, comment: lines of text before the header, and the mark of lines that are
    left out; point_down: the direction in the picture in which the body hangs.
    """

    time: Column = "t"
    time_unit: Annotated[str, PlainValidator(unit_of_time)] = "s"
    rate: Annotated[float, plain_number("Hz", above=0)] | None = None
    angle: Column = "q1"
    angle_unit: Literal["rad", "deg", "turns", "counts", "m", "mm"] = "rad"
    angle_zero: Annotated[Literal["down", "up"] | float, choice_or_number("down", "up")] = "down"
    angle_sign: Sign = 1
    angle_scale: Annotated[Quantity, PlainValidator(per_logged_unit)] = Quantity(1.0)
    angle_offset: Annotated[Quantity, quantity("rad", "m")] = Quantity(0.0)
    angle_speed: Column | None = None
    angle_speed_unit: SpeedUnit = "rad/s"
    angle_speed_is: RateIs = "instant"
    angle_speed_scale: Annotated[Quantity, quantity("", above=0)] = Quantity(1.0)
    wheel_angle: Column = "q2"
    wheel_angle_unit: AngleUnit = "rad"
    wheel_angle_sign: Sign = 1
    wheel_angle_is: Literal["relative", "absolute"] = "relative"
    wheel_scale: Annotated[Quantity, quantity("", above=0)] = Quantity(1.0)
    wheel_speed: Column | None = None
    wheel_speed_unit: Literal["rad/s", "deg/s", "turns/s", "rpm", "counts/s"] = "rad/s"
    wheel_speed_is: RateIs = "instant"
    voltage: Column = "u"
    voltage_sign: Sign = 1
    voltage_scale: Annotated[Quantity, quantity("V", above=0)] = Quantity(1.0)
    torque: Column = "tau"
    torque_gain: Annotated[Quantity, torque_or_unknown()] = Quantity(1.0)
    torque_sign: Sign = 1
    bridge: Column | None = None
    supply: Column | None = None
    reference: Column = "ym"
    drive_held: bool = True
    clock: Annotated[Quantity, quantity("", above=-0.5, below=1)] = Quantity(0.0, 1e-4)
    point: Annotated[tuple[str, str] | None, PlainValidator(two_columns)] = None
    pivot: Annotated[tuple[str, str] | tuple[float, float] | None, PlainValidator(two_columns_or_place)] = None
    skip_rows: Annotated[int, Field(strict=True, ge=0)] = 0
    comment: Annotated[str, StringConstraints(strict=True, min_length=1, max_length=8)] | None = None
    point_down: Literal["+y", "-y", "+x", "-x"] | None = None

    @model_validator(mode="before")
    @classmethod
    def _units_as_spelled(cls, raw: Any) -> Any:
        if not isinstance(raw, dict):
            return raw
        # "grad" heads degrees in German logs, but elsewhere it is a four hundredth of a turn: it is refused
        units = {key: unit for key, unit in raw.items() if key.endswith("_unit") and isinstance(unit, str)}
        return raw | {key: canonical(unit) for key, unit in units.items() if unit.strip().lower() != "grad"}

    @model_validator(mode="before")
    @classmethod
    def _held_is_true_or_false(cls, raw: Any) -> Any:
        # pydantic would also take "yes" and 1
        if isinstance(raw, dict) and not isinstance(raw.get("drive_held", True), bool):
            refuse("wrong-value", f"must be true or false, not {shown(raw['drive_held'])}", "drive_held")
        return raw

    @model_validator(mode="before")
    @classmethod
    def _one_unit_of_the_angle(cls, raw: Any) -> Any:
        if isinstance(raw, dict) and "angle_unit" in raw and has_unit(raw.get("angle_scale")):
            refuse("contradiction", "is given beside an angle_scale with a unit of its own; keep one", "angle_unit")
        return raw

    @model_validator(mode="after")
    def _one_source_each(self) -> Self:
        if stated(self, "rate") and stated(self, "time"):
            refuse("contradiction", "is given beside time; keep the column, or the rate of evenly spaced rows", "rate")
        if stated(self, "rate") and stated(self, "time_unit"):
            refuse("contradiction", "is given beside rate, which reads no column of the time; keep one", "time_unit")
        if stated(self, "angle_offset") and stated(self, "angle_zero"):
            refuse(
                "contradiction", "is given beside angle_zero, the logged value of the same; keep one", "angle_offset"
            )
        for key in ("angle", "angle_unit", "angle_scale") if self.point is not None else ():
            if stated(self, key):
                refuse("contradiction", "is given beside point, from which the angle is made; keep one", key)
        for key in ("pivot", "point_down"):
            if getattr(self, key) is not None and self.point is None:
                refuse("missing-key", f"is missing beside {key}; name the columns of the mark", "point")
        if self.has_rate_alone:
            for key in ("angle_unit", "angle_zero", "angle_scale", "angle_offset"):
                if stated(self, key):
                    refuse(
                        "contradiction",
                        "belongs to a column of the angle, and angle_speed is a rate; name that "
                        f"column as angle, or leave {key} out",
                        key,
                    )
        for key in ("angle_speed_unit", "angle_speed_is", "angle_speed_scale"):
            if stated(self, key) and self.angle_speed is None:
                refuse("missing-key", f"is missing beside {key}; name the column of the rate", "angle_speed")
        if stated(self, "wheel_speed") and stated(self, "wheel_angle"):
            refuse("contradiction", "is given beside wheel_angle; keep the angle", "wheel_speed")
        return self

    @property
    def has_rate_alone(self) -> bool:
        """Return whether the rate of the axis was logged, and not its angle."""
        return self.angle_speed is not None and not stated(self, "angle") and self.point is None
