"""From a rig's columns, units, zeros and signs (`rig.log`) to the model's channels, and back for saving."""

from __future__ import annotations

import difflib
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from swingid.errors import InputError
from swingid.model.rig.fields import seconds, stated
from swingid.model.rig.tables import LogConventions
from swingid.recording.findings import Finding
from swingid.recording.points import ANGLE
from swingid.recording.rates import RateIs, integral, rate_of, with_angle
from swingid.units import Quantity

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from swingid.model.rig import Rig
    from swingid.numerics.arrays import Array
    from swingid.recording.formats.table import Table

    Channels = dict[str, Array]


TURN = 2.0 * np.pi

#: Column names of a file written without a rig, which are also the defaults of [log].
DEFAULT_COLUMNS = {
    "time": "t",
    "angle": "q1",
    "angle_speed": "w1",
    "wheel_angle": "q2",
    "wheel_speed": "w2",
    "voltage": "u",
    "torque": "tau",
    "reference": "ym",
    "adaptive_gain": "k",
    "bridge": "bridge",
    "supply": "supply",
}


def _plain(value: object) -> object:
    """The value of a key without its uncertainty."""
    return value.value if isinstance(value, Quantity) else value


_CHANGING = ("_unit", "_zero", "_sign", "_is", "_scale", "_offset", "_gain")
DEFAULT_KEYS: dict[str, object] = {
    key: _plain(field.default) for key, field in LogConventions.model_fields.items() if key.endswith(_CHANGING)
}
"""Keys of [log] that change numbers, with their defaults."""


@dataclass(frozen=True, slots=True)
class Scale:
    """One channel's convention: model value = factor * logged value + offset.

    The factor holds the sign. `turn` is one turn in logged units, None where there are no turns.
    """

    factor: float = 1.0
    offset: float = 0.0
    turn: float | None = None

    def to_model(self, values: Array) -> Array:
        """Logged values in the model's convention; exact when the factor is 1 or -1 and the offset 0."""
        scaled = values if self.factor == 1.0 else values * self.factor
        return scaled if self.offset == 0.0 else scaled + self.offset

    def to_log(self, values: Array) -> Array:
        """The inverse of `to_model`: SI values of the model in logged units."""
        shifted = values if self.offset == 0.0 else values - self.offset
        return shifted if self.factor == 1.0 else shifted / self.factor


@dataclass(frozen=True)
class Conventions:
    """What a rig's [log] states, resolved: a column and a Scale for each channel, and how axis and wheel are read.

    `columns`, `scales`: by channel, as the fields of a Recording. `drive_kind` is None for a file written without a
    rig. `wheel` is the channel that measures the wheel's motion, its angle or its speed, and `wheel_rate_is` what a
    logged speed is; `axis` holds the channels that measure the motion of the axis. `rate` (1/s) is set where the log
    has no time column; `wheel_is_absolute` where the wheel's angle is against the room; `stated` holds the keys of
    [log] that the rig file sets itself, `keys` the values of those that change numbers: kept in saved files and
    compared on loading.
    """

    columns: dict[str, str]
    scales: dict[str, Scale]
    rate: float | None
    wheel_is_absolute: bool
    drive_held: bool
    drive_kind: str | None
    stated: frozenset[str]
    keys: dict[str, object]
    wheel: Literal["wheel_angle", "wheel_speed"] = "wheel_angle"
    wheel_rate_is: RateIs = "instant"
    axis: tuple[str, ...] = ("angle",)
    axis_rate_is: RateIs = "instant"

    @classmethod
    def plain(cls) -> Conventions:
        """SI units, t, q1, q2, u, tau, ym, k: what a file written without a rig uses."""
        turn = Scale(turn=TURN)
        scales = {"angle": turn, "wheel_angle": turn, "reference": turn}
        return cls(dict(DEFAULT_COLUMNS), scales, None, False, True, None, frozenset(), dict(DEFAULT_KEYS))

    @classmethod
    def live(cls, rig: Rig) -> Conventions:
        """Return the conventions of a live run's journal, whatever [log] states for other logs of the rig."""
        return replace(cls.plain(), drive_kind=rig.drive.kind)

    @classmethod
    def of(cls, rig: Rig) -> Conventions:
        """The conventions of `rig.log`; InputError for one that lacks what it needs."""
        log = rig.log
        kind = rig.drive.kind
        columns = {name: getattr(log, name, None) or default for name, default in DEFAULT_COLUMNS.items()}
        if log.point is not None:
            columns["angle"] = ANGLE
        unit, turn = _unit(rig, log.angle_unit, "angle")
        unit, turn = unit * log.angle_scale.value, None if turn is None else turn / log.angle_scale.value
        if stated(log, "angle_offset"):
            zero = log.angle_offset.value
        elif isinstance(log.angle_zero, str):
            zero = np.pi if log.angle_zero == "up" else 0.0
        else:
            zero = -log.angle_sign * unit * log.angle_zero
        angle = Scale(log.angle_sign * unit, zero, turn)
        scales = {"angle": angle, "reference": Scale(angle.factor, zero, turn)}
        scales["time"] = Scale(seconds(log.time_unit) / (1 + log.clock.value))
        scales["voltage"] = Scale(log.voltage_sign * log.voltage_scale.value)
        scales["torque"] = Scale(log.torque_gain.value * log.torque_sign)
        if kind == "reaction-wheel":
            sign = log.wheel_angle_sign * log.wheel_scale.value
            unit, turn = _unit(rig, log.wheel_angle_unit, "wheel")
            scales["wheel_angle"] = Scale(sign * unit, 0.0, turn)
            scales["wheel_speed"] = Scale(sign * _speed_unit(rig, log.wheel_speed_unit, "wheel"))
        absolute = log.wheel_angle_is == "absolute"
        prefixes = {
            "reaction-wheel": ("time_", "angle_", "wheel_", "voltage_"),
            "direct": ("time_", "angle_", "torque_"),
            "motor": ("time_", "angle_", "voltage_"),
            "none": ("time_", "angle_"),
        }
        keys = {key: _plain(getattr(log, key)) for key in DEFAULT_KEYS if key.startswith(prefixes[kind])}
        wheel: Literal["wheel_angle", "wheel_speed"] = "wheel_angle" if log.wheel_speed is None else "wheel_speed"
        axis = ("angle", *(("angle_speed",) if log.angle_speed is not None else ()))[int(log.has_rate_alone) :]
        scales["angle_speed"] = Scale(
            log.angle_sign * log.angle_speed_scale.value * _speed_unit(rig, log.angle_speed_unit)
        )
        rate = None if log.rate is None else log.rate * (1 + log.clock.value)
        return cls(
            columns=columns,
            scales=scales,
            rate=rate,
            wheel_is_absolute=absolute,
            drive_held=log.drive_held,
            drive_kind=kind,
            stated=frozenset(log.model_fields_set),
            keys=keys,
            wheel=wheel,
            wheel_rate_is=log.wheel_speed_is,
            axis=axis,
            axis_rate_is=log.angle_speed_is,
        )

    def scale(self, channel: str) -> Scale:
        """The convention of a channel; as it is where none is stated."""
        return self.scales.get(channel, Scale())

    @property
    def channels(self) -> tuple[str, ...]:
        """The channels that a log of this rig may have, time apart."""
        drive = {
            "reaction-wheel": (self.wheel, "voltage"),
            "direct": ("torque",),
            "motor": ("voltage", *(key for key in ("bridge", "supply") if key in self.stated)),
            "none": (),
            None: ("wheel_angle", "voltage", "torque"),
        }[self.drive_kind]
        return (*self.axis, *drive, "reference", "adaptive_gain")

    def to_model(self, logged: Mapping[str, Array]) -> Channels:
        """Channels in the model's units and signs; an angle counted from the top comes back near 0.

        `logged` holds "time" in s and, in logged units, any of the channels; angles must be continuous.
        """
        model = {name: v if name == "time" else self.scale(name).to_model(v) for name, v in logged.items()}
        if self.scales["angle"].offset and self.scales["angle"].turn is not None and "angle" in model:
            turns = TURN * np.round(np.median(model["angle"]) / TURN)
            for name in ("angle", "reference"):
                if name in model and turns:
                    model[name] = model[name] - turns
        if "supply" in model:
            model["voltage"] = model["voltage"] * model.pop("supply")
        if "angle_speed" in model:
            model = with_angle(model, self.axis_rate_is)
        if "wheel_speed" in model:
            model["wheel_angle"] = integral(model["time"], model["wheel_speed"], self.wheel_rate_is)
        if self.wheel_is_absolute and "wheel_angle" in model:
            model["wheel_angle"] = model["wheel_angle"] - model["angle"]
        return model

    def to_log(self, model: Mapping[str, Array]) -> Channels:
        """The inverse of `to_model`: columns of a file by their names, time included where the log has it."""
        channels = dict(model)
        if "supply" in self.channels and "voltage" in channels:
            channels["supply"] = np.ones_like(channels["voltage"])
        if self.wheel == "wheel_speed":
            channels.pop("wheel_angle", None)
        if self.wheel_is_absolute and "wheel_angle" in channels:
            channels["wheel_angle"] = channels["wheel_angle"] + channels["angle"]
        if "angle" not in self.axis and "angle_speed" in channels:
            del channels["angle"]
        return {self.columns[n]: self.scale(n).to_log(v) for n, v in channels.items()}

    def speed_of(self, time: Array, wheel: Array, angle: Array) -> Array:
        """The speed (rad/s) that a rig of these conventions would log of a wheel angle against the pendulum (rad)."""
        turned = wheel + angle if self.wheel_is_absolute else wheel
        return rate_of(time, turned, self.wheel_rate_is)


@dataclass
class Reading:
    """A log as it is read: rig, conventions, the file's name for messages, repairs that are switched `off`; findings.

    held: whether the drive was held. span: the part of the log (s) to use, None for all of it. before: rows of the file
    before these, where it is read in pieces. averaged: rows of the log that each row is the mean of. texts: by channel,
    the first text that stood in the place of a number.
    """

    rig: Rig
    conventions: Conventions
    name: str
    off: frozenset[str]
    held: bool
    findings: list[Finding]
    span: tuple[float, float] | None = None
    before: int = 0
    averaged: int = 1
    texts: dict[str, str] = field(default_factory=dict)

    def column(self, channel: str) -> str:
        """The column of a channel, in words."""
        return f"column {self.conventions.columns[channel]!r}"

    def found(
        self,
        code: str,
        message: str,
        level: Literal["note", "warning"],
        repair: str | None = None,
        *,
        at: Iterable[float] = (),
        **more: Any,
    ) -> None:
        """Add a finding; at: instants (s) where it happened; more: fields of a `Finding`."""
        spans = tuple((float(instant), float(instant)) for instant in at)
        self.findings.append(Finding(code, message, level, repair, spans=spans, **more))


def gather(table: Table, reading: Reading) -> Channels:
    """The rig's channels out of a file's table, in logged units (the time in s).

    Cells without a number are NaN; `reading` gets the first text among them. Raises InputError for a missing column
    (naming the nearest that exist and the key of [log] that sets it), for columns of unequal length, and for a column
    without numbers.
    """
    conventions, name = reading.conventions, reading.name
    logged: Channels = {}
    voltage_is_due = "voltage" in conventions.stated and not table.metadata  # what swingid wrote, it wrote whole
    wanted = ("time", *conventions.channels) if conventions.rate is None else conventions.channels
    for channel in wanted:
        column = table.find(conventions.columns[channel])
        if column is None:
            optional = channel == "voltage" and not voltage_is_due and conventions.drive_kind != "motor"
            if channel in ("reference", "adaptive_gain") or optional:
                continue
            raise _missing(table, channel, conventions, name)
        if channel == "adaptive_gain" and not table.metadata:
            continue  # in a file of other origin a column "k" may be anything
        logged[channel], text = table.numbers(column)
        if text is not None:
            reading.texts[channel] = text
        if channel not in ("reference", "adaptive_gain") and np.isnan(logged[channel]).all():
            sample = f" but text such as {text!r}" if text else ""
            message = f"{name}: column {column!r} holds no numbers{sample}; set [log] {channel} to the column"
            raise InputError(f"{message} that holds the {channel}.", code="no-numbers")
    main = conventions.axis[0]
    rows = len(logged[main])
    for channel, values in logged.items():
        if len(values) != rows:
            columns = conventions.columns
            message = f"{name}: {columns[channel]!r} has {len(values)} values but {columns[main]!r} has {rows}"
            raise InputError(f"{message}; a log needs one value of each per row.", code="unequal-length")
    if conventions.rate is not None:
        logged = {"time": np.arange(rows) / conventions.rate, **logged}
    else:
        logged["time"] = conventions.scale("time").to_model(logged["time"])
    return logged


def _unit(rig: Rig, unit: str, which: Literal["angle", "wheel"]) -> tuple[float, float | None]:
    """Radians (metres) per logged unit, and logged units per turn (None on a linear axis)."""
    if rig.axis.kind == "linear":
        return {"mm": 1e-3}.get(unit, 1.0), None
    if unit == "counts":
        count = rig.sensors.of(which).resolution  # a Rig with this unit has counts_per_turn
        return count, float(round(TURN / count))
    per_turn = {"rad": TURN, "deg": 360.0, "turns": 1.0}[unit]
    return TURN / per_turn, per_turn


def _speed_unit(rig: Rig, unit: str, which: Literal["angle", "wheel"] = "angle") -> float:
    """Radians (metres) per second per logged unit of a rate."""
    return TURN / 60 if unit == "rpm" else _unit(rig, unit.removesuffix("/s"), which)[0]


def _missing(table: Table, channel: str, conventions: Conventions, name: str) -> InputError:
    """The error for a column that is not there: what there is, and what to set."""
    column = conventions.columns[channel]
    names = list(table.columns)
    near = difflib.get_close_matches(column.lower(), [n.lower() for n in names], n=3, cutoff=0.5)
    shown = [n for n in names if n.lower() in near] or names[:8]
    listed = ", ".join(repr(n[:40]) for n in shown) + (", ..." if len(shown) < len(names) else "")
    message = f"{name} has no column {column!r} but {listed or 'none at all'}; set [log] {channel} in the rig file to"
    message += " the right one"
    if channel == "angle":
        message += " (or [log] angle_speed where a rate was logged)"
    if channel == "time":
        message += " (or [log] rate where rows are evenly spaced)"
    if channel in ("wheel_angle", "wheel_speed", "torque"):
        message += f', or another [drive] kind than "{conventions.drive_kind}"'
    return InputError(f"{message}.", code="missing-column")
