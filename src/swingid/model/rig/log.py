"""The table [log] of rig.toml: the columns of this rig's logs, their units, zeros and signs."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, model_validator

from swingid.model.rig.fields import Column, Table, plain_number, quantity, refuse, stated
from swingid.units import Quantity, shown


def _no_bool(raw: Any) -> Any:
    if isinstance(raw, bool):
        refuse("wrong-value", f"must be 1 or -1, not {str(raw).lower()}")
    return raw


Sign = Annotated[Literal[1, -1], BeforeValidator(_no_bool)]
AngleUnit = Literal["rad", "deg", "turns", "counts"]


class LogConventions(Table):
    """How the rig writes its logs; a channel that the drive kind does not have is not read.

    `model_fields_set` tells what the file stated: a default column may be absent from a log, a stated one may
    not. With `rate` (rows per second) rows are evenly spaced and `time` is not read. Row k's voltage or torque
    acts from t_k to t_(k+1) if `drive_held`, else it is a measurement at t_k; angles are those at t_k.
    `wheel_scale` is wheel turns per logged turn. `wheel_speed` replaces the wheel's angle where only the speed was
    logged: the speed at the row, or ("mean") the turn since the row before, divided by the time.
    Torque (force) = torque_sign * torque_gain * column.
    """

    time: Column = "t"
    time_unit: Literal["s", "ms", "us", "ns"] = "s"
    rate: Annotated[float, plain_number("Hz", above=0)] | None = None
    angle: Column = "q1"
    angle_unit: Literal["rad", "deg", "turns", "counts", "m", "mm"] = "rad"
    angle_zero: Literal["down", "up"] = "down"
    angle_sign: Sign = 1
    wheel_angle: Column = "q2"
    wheel_angle_unit: AngleUnit = "rad"
    wheel_angle_sign: Sign = 1
    wheel_angle_is: Literal["relative", "absolute"] = "relative"
    wheel_scale: Annotated[float, plain_number("", above=0)] = 1.0
    wheel_speed: Column | None = None
    wheel_speed_unit: Literal["rad/s", "deg/s", "turns/s", "rpm", "counts/s"] = "rad/s"
    wheel_speed_is: Literal["instant", "mean"] = "instant"
    voltage: Column = "u"
    voltage_sign: Sign = 1
    torque: Column = "tau"
    torque_gain: Annotated[Quantity, quantity("", above=0)] = Quantity(1.0)
    torque_sign: Sign = 1
    reference: Column = "ym"
    drive_held: bool = True

    @model_validator(mode="before")
    @classmethod
    def _held_is_true_or_false(cls, raw: Any) -> Any:
        # pydantic would also take "yes" and 1
        if isinstance(raw, dict) and not isinstance(raw.get("drive_held", True), bool):
            refuse("wrong-value", f"must be true or false, not {shown(raw['drive_held'])}", "drive_held")
        return raw

    @model_validator(mode="after")
    def _one_source_each(self) -> Self:
        if stated(self, "rate") and stated(self, "time"):
            refuse("contradiction", "is given beside time; keep the column, or the rate of evenly spaced rows", "rate")
        if stated(self, "rate") and stated(self, "time_unit"):
            refuse("contradiction", "is given beside rate, which reads no column of the time; keep one", "time_unit")
        if stated(self, "wheel_speed") and stated(self, "wheel_angle"):
            refuse("contradiction", "is given beside wheel_angle; keep the angle", "wheel_speed")
        return self
