"""What a person has told the page of a log and its rig, and the rig.toml that follows from it."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from swingid.app.analysis import Case
from swingid.app.kinds import KINDS, Kind, Question, Way, kind_of, kind_of_rig
from swingid.errors import SwingidError
from swingid.format import plus_minus
from swingid.model.rig import Rig
from swingid.model.rig.edit import edited
from swingid.units import Quantity

ROLES = {
    "time": "time",
    "angle": "angle",
    "angle_speed": "rate of the body",
    "point_x": "x of a mark on it",
    "point_y": "y of a mark on it",
    "wheel_angle": "angle of the wheel",
    "wheel_speed": "speed of the wheel",
    "voltage": "voltage",
    "torque": "torque or force",
    "reference": "reference",
}
"""What a column may be, in words."""

UNITS: Mapping[str, tuple[str, ...]] = {
    "time": ("s", "ms", "us", "ns"),
    "angle": ("rad", "deg", "turns", "counts", "m", "mm"),
    "angle_speed": ("rad/s", "deg/s", "turns/s", "rpm", "m/s", "mm/s"),
    "wheel_angle": ("rad", "deg", "turns", "counts"),
    "wheel_speed": ("rad/s", "deg/s", "turns/s", "rpm"),
}
"""Units that each channel may have in a log."""

CHANNELS = {"reaction-wheel": ("wheel_angle", "wheel_speed", "voltage"), "direct": ("torque",), "motor": ("voltage",)}
"""Channels beside time and motion that a log of each kind of drive may have."""

SIGNED = ("angle", "wheel_angle", "voltage", "torque")

SOURCE = "rig.toml"

STRINGS = re.compile(r"axis\.(bi|tri)filar\.")
"""Keys of strings that hold a body."""


@dataclass
class Draft:
    """Files (path by shown name), columns and units by role, kind of rig, answers, parts, mends; `base`: a rig file.

    answers: of each question the number of the way and the texts by key. added: inertia of a known body per log.
    """

    logs: dict[str, Path] = field(default_factory=dict)
    base: str = ""
    name: str = "my-rig"
    columns: dict[str, str] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    why: dict[str, str] = field(default_factory=dict)
    signs: dict[str, int] = field(default_factory=dict)
    zero: str = "down"
    rate: str = ""
    skip: int = 0
    ticks: bool = False
    kind: str = ""
    answers: dict[str, tuple[int, dict[str, str]]] = field(default_factory=dict)
    parts: list[tuple[float, float]] = field(default_factory=list)
    mends: dict[str, object] = field(default_factory=dict)
    added: list[str] = field(default_factory=list)

    @classmethod
    def of(cls, logs: Mapping[str, Path], rig: Rig | None) -> Draft:
        """Make the draft of logs and the rig file that belongs to them, if there is one."""
        if rig is None:
            return cls(logs=dict(logs))
        return cls(logs=dict(logs), base=rig.text, name=rig.name, kind=kind_of_rig(rig))

    def take_guess(self, looked: Mapping[str, Any]) -> None:
        """Columns, units and zero as `analysis.looked` guesses them."""
        self.columns = {role: role_found["column"] for role, role_found in looked["roles"].items()}
        self.units = {role: role_found["unit"] for role, role_found in looked["roles"].items() if role_found["unit"]}
        self.why = {role: role_found["why"] for role, role_found in looked["roles"].items()}
        self.zero = "up" if looked["zero_up"] else "down"
        self.rate = ""
        self.skip = int(looked["skip"])
        self.ticks = bool(looked["ticks"])
        if self.ticks:
            self.units["time"] = ""

    def assign(self, column: str, role: str) -> None:
        """Give a column a role ("" for none); what had that role before has none."""
        self.columns = {other: name for other, name in self.columns.items() if name != column and other != role}
        if role:
            self.columns[role] = column
            self.why[role] = "your choice"
            self.units.setdefault(role, UNITS.get(role, ("",))[0])

    @property
    def has_clock(self) -> bool:
        """Return whether times are known: a column of them with its unit, or the rows of each second."""
        return bool(self.units.get("time") or not self.ticks if "time" in self.columns else self.rate)

    @property
    def moves(self) -> bool:
        """Return whether columns give the motion of the body: its angle, its rate, or both places of a mark on it."""
        return bool({"angle", "angle_speed"} & self.columns.keys()) or {"point_x", "point_y"} <= self.columns.keys()

    @property
    def linear(self) -> bool:
        """Return whether the motion is a length."""
        if self.base and self.rig_kind is not None:
            return self.rig_kind.linear
        units = [self.units.get(role, "") for role in ("angle", "angle_speed") if role in self.columns]
        return any(unit.removesuffix("/s") in ("m", "mm") for unit in units)

    @property
    def rig_kind(self) -> Kind | None:
        """The kind of rig that was chosen."""
        return kind_of(self.kind) if self.kind in {kind.name for kind in KINDS} else None

    def way(self, question: Question) -> tuple[Way, dict[str, str]]:
        """The way to answer a question that was chosen, and its texts."""
        number, texts = self.answers.get(question.name, (0, {}))
        return question.ways[number], texts

    def asks(self, question: Question) -> bool:
        """Return whether a question is open: not one that is of no use after the answers to others."""
        if question.name == "relative":
            return "wheel_angle" in self.columns
        return all(self.answers.get(name, (0, {}))[0] == 0 for name in question.after)

    def filled(self) -> int:
        """How many values were given."""
        return sum(bool(texts.get(field.key)) for choice, texts in self._ways() for field in choice.fields)

    def open_fields(self) -> list[str]:
        """Words of the fields that are still empty."""
        return [
            field.words
            for choice, texts in self._ways()
            for field in choice.fields
            if not field.holds(texts.get(field.key, ""))
        ]

    def _ways(self) -> list[tuple[Way, dict[str, str]]]:
        """The way and the texts of each question that is open; none beside a rig file."""
        kind = self.rig_kind
        questions = () if kind is None or self.base else kind.questions
        return [self.way(question) for question in questions if self.asks(question)]

    def values(self, *, filled: bool = False) -> dict[str, object]:
        """What was told, at dotted keys of rig.toml; filled: fields that are still empty have their examples."""
        if self.base:
            return dict(self.mends)
        kind = self.rig_kind
        values: dict[str, object] = {"name": self.name}
        if kind is not None:
            values |= {"axis.kind": "linear"} if kind.linear else {}
            values |= {**kind.fixed, "drive.kind": kind.drive}
            for question in kind.questions:
                choice, texts = self.way(question)
                if not self.asks(question):
                    continue
                values |= choice.values
                for field in choice.fields:
                    text = texts.get(field.key) or (field.example if filled else "")
                    if text:
                        values |= field.options.get(text, {}) if field.options else {field.key: _typed(text)}
        if "axis.stiffness" in values:  # of a wire, or in the place of strings whose sizes are not known
            values = {"axis.gravity_torque": 0} | {key: at for key, at in values.items() if not STRINGS.match(key)}
        return values | self._log_values() | self.mends

    def _log_values(self) -> dict[str, object]:
        drive = self.rig_kind.drive if self.rig_kind else "none"
        columns = {**self.columns}
        if "angle" in columns:
            columns.pop("angle_speed", None)
        mark = [columns[role] for role in ("point_x", "point_y") if role in columns]
        if "wheel_angle" in columns:
            columns.pop("wheel_speed", None)
        known = ("time", "angle", "angle_speed", "reference", *CHANNELS.get(drive, ()))
        values: dict[str, object] = {}
        if self.skip:
            values["log.skip_rows"] = self.skip
        if self.rate and "time" not in columns:
            values["log.rate"] = _typed(self.rate)
        if len(mark) == 2 and not {"angle", "angle_speed"} & columns.keys():
            values["log.point"] = mark
        for role in (role for role in known if role in columns):
            values[f"log.{role}"] = columns[role]
            unit = self.units.get(role, "")
            if (unit in UNITS.get(role, ()) and unit != UNITS[role][0]) or (role == "time" and self.ticks and unit):
                values[f"log.{role}_unit"] = unit
            if role == "angle" and self.zero != "down" and not self.linear:
                values["log.angle_zero"] = _typed(self.zero)
            if self.signs.get(role) == -1 and role in SIGNED:
                values[f"log.{role}_sign"] = -1
        return values

    def text(self, *, filled: bool = False) -> str:
        """The rig.toml that follows, see `values`."""
        text = edited(self.base, self.values(filled=filled))[0]
        return text if self.base else _in_tables(text)

    def rig(self, *, filled: bool = False) -> Rig:
        """The rig that follows; raises InputError as `Rig.from_text`, naming the key."""
        return Rig.from_text(self.text(filled=filled), SOURCE, default_name=self.name)

    def trouble(self) -> tuple[str, str]:
        """Key and sentence of what is wrong with what was told so far, ("", "") for nothing."""
        try:
            self.rig(filled=True)
        except SwingidError as error:
            sentence = error.message.removeprefix(f"{SOURCE}: ")
            return sentence.split()[0], sentence
        return "", ""

    def where_to_say(self, key: str, sentence: str) -> str:
        """The sentence of `trouble`, with the question and the way to answer it that state the key."""
        kind = self.rig_kind
        for question in () if kind is None or self.base else kind.questions:
            for choice in question.ways:
                if key in [field.key for field in choice.fields] and choice != self.way(question)[0]:
                    return f"{sentence.rstrip('.')}; under “{question.words}” choose “{choice.words}”."
        return sentence

    def read_as(self, key: str) -> str:
        """The quantity at a key as it was read, in SI; "" where there is none."""
        try:
            at: Any = self.rig(filled=True)
        except SwingidError:
            return ""
        for part in key.split("."):
            at = getattr(at, part, None)
        return plus_minus(at.value, at.std) if isinstance(at, Quantity) else ""


def _typed(text: object) -> object:
    """A number where the text is one, else the text."""
    if not isinstance(text, str):
        return text
    plain = text.strip()
    if re.fullmatch(r"[+-]?\d+", plain):
        return int(plain)
    if re.fullmatch(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", plain):
        return float(plain)
    return plain


def _in_tables(text: str) -> str:
    """TOML with one table after the other, outer ones first, as people read it."""
    blocks = [block.strip() for block in text.split("\n[")]
    head = [block for block in blocks[:1] if block]
    tables = [f"[{block}" for block in blocks[1:]]
    order = ("[axis", "[drive", "[sensors", "[log", "[device")
    tables.sort(
        key=lambda block: (next((k for k, name in enumerate(order) if block.startswith(name)), 9), block.split("]")[0])
    )
    return "\n\n".join([*head, *tables]) + "\n"


MEND = re.compile(r"([a-z_]+(?:\.[a-z_]+)*) = (\"[^\"]*\"|-?[\d.]+(?:e-?\d+)?|true|false)")
UNDER = re.compile(r"under \[([\w.]+)\]")

BY_CODE: Mapping[str, Mapping[str, object]] = {
    "gravity-torque-disagrees": {"axis.gravity_torque": "unknown"},
    "torque-gain-missing": {"log.torque_gain": "unknown"},
}
"""What answers a warning whose sentence names no value."""


def mend_of(code: str, sentence: str, draft: Draft) -> dict[str, object]:
    """The keys and values that a warning proposes, where rig.toml takes them; {} where it proposes none."""
    under = UNDER.search(sentence)
    mend: dict[str, object] = {}
    last = None
    for match in MEND.finditer(sentence):
        if last is not None and sentence[last : match.start()] != " and ":
            break  # what else is named is another way
        table = f"{under[1]}." if under and "." not in match[1] else ""
        mend[f"{table}{match[1]}"] = json.loads(match[2])
        last = match.end()
    mend = {key: value for key, value in mend.items() if "." in key} or dict(BY_CODE.get(code, {}))
    try:
        text = draft.text()
        new = edited(text, mend)[0]
        Rig.from_text(new)
    except SwingidError:
        return {}
    return mend if tomllib.loads(new) != tomllib.loads(text) else {}


def case_of(draft: Draft) -> Case:
    """What is to be identified."""
    logs = tuple((name, str(path)) for name, path in draft.logs.items())
    alone = len(logs) == 1
    added = tuple(text or "0" for text in draft.added) if any(draft.added) and not alone else ()
    return Case(logs, draft.text(), tuple(draft.parts) if alone else (), added)
