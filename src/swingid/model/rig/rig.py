"""The Rig: what rig.toml states of an axis, its drive, its sensors and its logs, checked and in SI.

A constant without uncertainty counts as exact. `axis.inertia` and `axis.friction` are the twin's true values and the
start of searches, never an input of a method that identifies them.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import AfterValidator, Field, PrivateAttr, model_validator

from swingid.errors import UsageError
from swingid.model.rig import inside
from swingid.model.rig.device import DeviceTable
from swingid.model.rig.drive import Drive
from swingid.model.rig.fields import Column, Table, refuse, stated
from swingid.model.rig.gravity import in_place_of_weighing
from swingid.model.rig.sensors import NONLINEARITY, Sensors
from swingid.model.rig.tables import Axis, LogConventions
from swingid.model.rig.toml_file import checked, tables_of, text_of
from swingid.model.terms import MOTOR_KEYS, rig_terms
from swingid.quantity_text import shown
from swingid.units import Quantity


def _one_line(name: str) -> str:
    """A name for terminals and reports."""
    if any(ord(letter) < ord(" ") or letter == "\x7f" for letter in name):
        refuse("wrong-value", f"must be one line of text without control characters, not {shown(name)}")
    return name


BUILTIN_RIGS = ("paper", "paper-body")


class Rig(Table):
    """One rig. Read it with `Rig.load`, `Rig.builtin` or `Rig.from_text`, vary it with `changed`.

    `source` is the path or "built-in paper", `text` the TOML as read (for hashes and provenance).

    Examples
    --------
    >>> import swingid as sw
    >>> rig = sw.Rig.from_text('''
    ... [axis]
    ... mass = "107.0 ± 0.1 g"
    ... lever = "74.0 ± 0.1 mm"
    ... [drive]
    ... kind = "none"
    ... ''')
    >>> f"{rig.axis.gravity_torque.value:.4f} ± {rig.axis.gravity_torque.std:.4f} N m"
    '0.0776 ± 0.0002 N m'
    >>> rig.changed({"axis.lever": "75 mm"}).axis.lever.value
    0.075
    """

    name: Annotated[Column, AfterValidator(_one_line)]
    axis: Axis = Axis()
    drive: Drive
    sensors: Sensors = Field(default_factory=Sensors)
    log: LogConventions = Field(default_factory=LogConventions)
    device: DeviceTable = Field(default_factory=DeviceTable)
    _source: str = PrivateAttr("")
    _text: str = PrivateAttr("")
    _reference: str = PrivateAttr("")

    @property
    def source(self) -> str:
        """The place that the rig came from: a path, or "built-in paper"."""
        return self._source

    @property
    def text(self) -> str:
        """The TOML text as read."""
        return self._text

    @property
    def reference(self) -> str:
        """Key of the constant that is 1 because nothing sets the scale (`in_units_of`); "" where something does."""
        return self._reference

    @classmethod
    def load(cls, path_or_builtin: str | Path) -> Rig:
        """The rig of a file ending in .toml, a built-in one by its name ("paper", "paper-body"), or that inside the
        journal of a live run (.mcap).

        Raises InputError for a file that is missing, unreadable, no TOML or no rig, and UsageError for a name that is
        neither.
        """
        if str(path_or_builtin) in BUILTIN_RIGS:
            return cls.builtin(str(path_or_builtin))
        path = Path(path_or_builtin)
        if path.suffix.lower() == inside.ENDING:
            return cls.from_text(
                inside.rig_inside(path), f"{path_or_builtin} (rig.toml inside)", default_name=path.stem
            )
        if path.suffix.lower() != ".toml":
            within = path / "rig.toml"
            try:
                hint = f"; did you mean {within}?" if within.is_file() else ""
            except (OSError, ValueError):
                hint = ""
            message = (
                f"no rig {str(path_or_builtin)!r}: give a path ending in .toml or one of {', '.join(BUILTIN_RIGS)}"
            )
            raise UsageError(message + hint, code="unknown-rig")
        stem = "".join(letter for letter in path.stem if ord(letter) >= ord(" "))
        return cls.from_text(_read(path), str(path_or_builtin), default_name=stem)

    @classmethod
    def builtin(cls, name: str) -> Rig:
        """A built-in rig: "paper" (section 5) or "paper-body" (with the test body); UsageError for others."""
        if name not in BUILTIN_RIGS:
            message = f"no built-in rig {name!r}; there are {', '.join(BUILTIN_RIGS)}"
            raise UsageError(message, code="unknown-rig")
        from importlib.resources import files

        text = (files("swingid.model.rig") / "builtin" / f"{name}.toml").read_text(encoding="utf-8")
        return cls.from_text(text, f"built-in {name}")

    @classmethod
    def from_text(cls, text: str, source: str = "rig.toml", *, default_name: str = "rig") -> Rig:
        """The rig of TOML text; `source` names it in errors, `default_name` is its name where the text gives none.

        Raises InputError for text that is no TOML or no rig, naming the key.
        """
        return cls._validated({"name": default_name, **tables_of(text, source)}, source, text)

    @classmethod
    def _validated(cls, document: Mapping[str, Any], source: str, text: str) -> Rig:
        axis = document.get("axis")
        kind = axis.get("kind", "rotary") if isinstance(axis, dict) else "rotary"
        rig = checked(document, cls, source, context={"kind": kind})
        rig._source, rig._text = source, text
        return rig

    def changed(self, values: Mapping[str, object]) -> Rig:
        """The same rig with other values at dotted keys, checked like a file; None takes a key away.

        `rig.changed({"axis.friction.coulomb": "2 mN*m", "sensors.noise": 1e-3})`. A Quantity is a value too. A gravity
        torque takes the place of mass and lever. The `text` of the new rig holds the changes. Raises InputError as
        `from_text`.
        """
        from swingid.model.rig.edit import plain, to_toml, with_values

        document = with_values(_tables(self.text), in_place_of_weighing(values))
        text = to_toml(document)
        rig = self._validated({"name": self.name, **plain(document)}, self.source, text)
        rig._reference = self._reference
        return rig

    def in_units_of(self, key: str, values: Mapping[str, object]) -> Rig:
        """The rig with the constant at `key` as its unit, 1 and exact, and with `values` changed as in `changed`."""
        rig = self.changed({**values, key: 1.0})
        rig._reference = key
        return rig

    def constants_without_uncertainty(self) -> tuple[str, ...]:
        """Dotted keys of constants that identification may depend on and that count as exact, in file order.

        The motor's and the sensors' count where the file states them (what is not stated is not known either).
        """
        exact: dict[str, object] = {}
        if self.axis.kind == "rotary":
            exact["axis.gravity_torque"] = self.axis.gravity_torque
        for term in rig_terms(self):
            if term.value is not None:
                exact[term.term.key] = term.value
        if self.drive.wheel is not None:
            exact["drive.wheel.inertia"] = self.drive.wheel.inertia
        if self.drive.motor is not None:
            motor = self.drive.motor
            exact |= {f"drive.motor.{k}": getattr(motor, k) for k in MOTOR_KEYS if stated(motor, k)}
        if stated(self.sensors, "latency") and self.sensors.latency.value:
            exact["sensors.latency"] = self.sensors.latency
        if self.sensors.wheel is not None and self.sensors.wheel.latency.value:
            exact["sensors.wheel.latency"] = self.sensors.wheel.latency
        if self.drive.channel == "torque":
            exact["log.torque_gain"] = self.log.torque_gain
        if stated(self.log, "angle_scale"):
            exact["log.angle_scale"] = self.log.angle_scale
        return tuple(
            key
            for key, value in exact.items()
            if isinstance(value, Quantity) and value.std is None and key != self.reference
        )

    @model_validator(mode="after")
    def _marks_are_seen_by_a_camera(self) -> Self:
        """The kind of sensor of an angle that is made of the places of marks."""
        if self.log.point is not None:
            if self.axis.kind == "linear":
                text = "has no meaning on a linear axis; name the column of its place as angle"
                refuse("contradiction", text, "log.point")
            self.__dict__["sensors"] = self.sensors.of_camera(has_wheel=self.drive.wheel is not None)
        return self

    @model_validator(mode="after")
    def _tables_fit_together(self) -> Self:
        if self.axis.kind == "linear":
            self._check_linear()
        else:
            for key in ("angle_unit", "angle_speed_unit"):
                if (unit := getattr(self.log, key)) in ("m", "mm", "m/s", "mm/s"):
                    refuse("contradiction", f"is {unit!r}, but axis.kind is 'rotary'", f"log.{key}")
        self._check_rates()
        if self.drive.wheel is None:
            self._check_no_wheel()
        elif stated(self.log, "bridge") or stated(self.log, "supply"):
            key = "bridge" if stated(self.log, "bridge") else "supply"
            refuse("contradiction", "belongs to drive.kind = 'motor'; a wheel's motor has log.voltage", f"log.{key}")
        if self.drive.motor is not None and stated(self.log, "torque"):
            refuse("contradiction", "belongs to drive.kind = 'direct'; a motor has log.voltage", "log.torque")
        if self.drive.channel != "torque":
            for key in ("torque_gain", "torque_sign"):
                if stated(self.log, key):
                    refuse("contradiction", f"belongs to drive.kind = 'direct', not {self.drive.kind!r}", f"log.{key}")
        self._check_columns()
        self._check_counts()
        self._check_reachable()
        return self

    def _check_linear(self) -> None:
        if self.drive.wheel is not None:
            refuse("contradiction", "is 'reaction-wheel', which turns, but axis.kind is 'linear'", "drive.kind")
        for key in ("counts_per_turn", *NONLINEARITY):
            if stated(self.sensors, key):
                refuse("contradiction", "is per turn, but axis.kind is 'linear'", f"sensors.{key}")
        if stated(self.log, "angle_speed_unit") and self.log.angle_speed_unit not in ("m/s", "mm/s"):
            refuse(
                "contradiction", f"is {self.log.angle_speed_unit!r}, but axis.kind is 'linear'", "log.angle_speed_unit"
            )
        if stated(self.log, "angle_unit") and self.log.angle_unit not in ("m", "mm"):
            refuse("contradiction", f"is {self.log.angle_unit!r}, but axis.kind is 'linear'", "log.angle_unit")
        if self.log.angle_zero == "up":
            refuse("contradiction", "is 'up', which a linear axis does not have", "log.angle_zero")

    def _check_rates(self) -> None:
        """Sensors of rates belong to rates, those of angles to angles."""
        sensors, alone = self.sensors, self.log.has_rate_alone
        for name in ("angle_speed", "wheel_speed"):
            if getattr(sensors, name) is not None and getattr(self.log, name) is None:
                refuse("contradiction", f"is given, but log.{name} names no column", f"sensors.{name}")
        for key in (*NONLINEARITY, "noise", "resolution"):
            if alone and stated(sensors, key) and (key in NONLINEARITY or self.drive.wheel is None):
                other = "" if key in NONLINEARITY else f"; that of the rate is sensors.angle_speed.{key}"
                refuse("contradiction", f"is that of an angle, but log.angle_speed is a rate{other}", f"sensors.{key}")

    def _check_no_wheel(self) -> None:
        if self.sensors.wheel is not None:
            refuse("contradiction", f"is given, but drive.kind is {self.drive.kind!r}", "sensors.wheel")
        other = ["torque"] if self.drive.channel is None else []
        driven = ("wheel",) if self.drive.channel == "voltage" else ("wheel", "voltage", "bridge", "supply")
        of_another = [key for key in LogConventions.model_fields if key.startswith(driven)] + other
        surplus = [key for key in of_another if stated(self.log, key)]
        if surplus:
            beside = f", as are {', '.join(surplus[1:])}" if surplus[1:] else ""
            refuse("contradiction", f"is given{beside}, but drive.kind is {self.drive.kind!r}", f"log.{surplus[0]}")

    def _check_columns(self) -> None:
        """Every channel that is read has a column of its own."""
        log = self.log
        read = [] if stated(log, "rate") else ["time"]
        read += ["angle"] if not self.log.has_rate_alone else []
        read += ["angle_speed"] if log.angle_speed is not None else []
        if self.drive.wheel is not None:
            read += ["wheel_angle" if log.wheel_speed is None else "wheel_speed", "voltage"]
        elif self.drive.channel == "torque":
            read.append("torque")
        elif self.drive.channel == "voltage":
            read += ["voltage", *(key for key in ("bridge", "supply") if stated(log, key))]
        if stated(log, "reference"):
            read.append("reference")
        first: dict[str, str] = {}
        # A default is the one to be changed: what the file states comes first.
        for key in sorted(read, key=lambda key: not stated(log, key)):
            column = getattr(log, key)
            if column in first:
                problem = f"is {column!r}, which is also the column of log.{first[column]}; give each its own"
                refuse("contradiction", problem, f"log.{key}")
            first[column] = key

    def _check_counts(self) -> None:
        wheel = self.sensors.wheel
        has_counts = wheel is not None and (stated(wheel, "counts_per_turn") or stated(wheel, "resolution"))
        wheel_counts = wheel.counts_per_turn if has_counts and wheel is not None else self.sensors.counts_per_turn
        needed = (
            ("angle_unit", "counts", "sensors", self.sensors.counts_per_turn),
            ("angle_speed_unit", "counts/s", "sensors", self.sensors.counts_per_turn),
            ("wheel_angle_unit", "counts", "sensors.wheel", wheel_counts),
            ("wheel_speed_unit", "counts/s", "sensors.wheel", wheel_counts),
        )
        for key, unit, table, counts in needed:
            if getattr(self.log, key) == unit and counts is None:
                refuse("missing-key", f"is missing, but log.{key} is '{unit}'", f"{table}.counts_per_turn")

    def _check_reachable(self) -> None:
        """a11 a22 > a12²: the kinetic energy (4) of any motion is positive."""
        if self.axis.inertia is None or self.drive.wheel is None or self.drive.motor is None:
            return
        a12, a22 = self.drive.a12 / self.drive.wheel.along.value, self.drive.a22
        a11 = self.axis.inertia.value + self.drive.wheel.inertia.value + self.drive.motor.rotor_inertia.value
        if not a12 * a12 < a11 * a22:
            refuse(
                "unreachable-inertias",
                f"is {self.axis.inertia.value:g}, an unreachable combination with drive.wheel.inertia and "
                f"drive.motor: a12^2 = {a12 * a12:.6g} must be below a11 a22 = {a11 * a22:.6g}",
                "axis.inertia",
            )


@lru_cache(16)
def _tables(text: str) -> Mapping[str, Any]:
    """The tables of TOML text, not to be changed."""
    return tomllib.loads(text.removeprefix("\ufeff"))


def _read(path: Path) -> str:
    """The text of a rig file, or InputError with the reason why there is none."""
    missing = "'swingid init DIR' writes a rig.toml to start from"
    return text_of(path, missing=missing, folder="give the rig file in it")
