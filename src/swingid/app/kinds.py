"""The kinds of rigs that the page offers, and what each needs to be known: questions in words, ways to answer them.

An answer is a set of values at dotted keys of rig.toml; "not known" is one of the ways, and says what it costs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from swingid.model.rig import encoder_kinds


@dataclass(frozen=True, slots=True)
class Field:
    """A value to be typed: its key in rig.toml, words, an example; options: to choose from, values at keys by words."""

    key: str
    words: str
    example: str = ""
    options: Mapping[str, Mapping[str, object]] = field(default_factory=dict)

    def holds(self, text: str) -> bool:
        """Return whether a text fills it; one that was chosen from other options does not."""
        return text in self.options if self.options else bool(text)


@dataclass(frozen=True, slots=True)
class Way:
    """A way to answer a question: fields to fill in, values that follow at once, what it costs ("" for nothing)."""

    words: str
    fields: tuple[Field, ...] = ()
    values: Mapping[str, object] = field(default_factory=dict)
    cost: str = ""


@dataclass(frozen=True, slots=True)
class Question:
    """What is to be known, where it is measured, and the ways to answer; the first way is offered.

    after: questions that must be answered in their first way; else this one is of no use.
    """

    name: str
    words: str
    where: str
    ways: tuple[Way, ...]
    after: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of rig: its title, one sentence, its drawing (name, part of its width), channels, and questions.

    needs: a channel of each of these sets must be there. fixed: values at keys of rig.toml that it implies.
    """

    name: str
    title: str
    words: str
    picture: tuple[str, float, float]
    drive: str
    questions: tuple[Question, ...]
    needs: tuple[tuple[str, ...], ...] = (("angle", "angle_speed"),)
    fixed: Mapping[str, object] = field(default_factory=dict)
    linear: bool = False

    @property
    def moves(self) -> str:
        """How the drawing moves: it slides, turns about an axis that is seen from above, or swings."""
        if self.linear:
            return "slide"
        return "turn" if self.name in ("wire", "bifilar", "trifilar", "flywheel") else "swing"

    def missing(self, columns: Mapping[str, str]) -> tuple[str, ...]:
        """The channels of which one is needed and none has a column; a mark on the body gives its angle."""
        has = {role for role, column in columns.items() if column}
        if {"point_x", "point_y"} <= has:
            has.add("angle")
        return next((some for some in self.needs if not has & {*some}), ())


ENCODERS = {f"{kind.name}: {kind.words}": kind for kind in encoder_kinds.KINDS if kind.name != "ideal"}
"""Kinds of encoders by name and words."""


def _encoder(name: str, table: str, words: str, unknown: Way) -> Question:
    """What an encoder is; unknown: what follows where it is not known."""
    kind, steps = f"{table}.sensor", f"{table}.counts_per_turn"
    fixed = {text: {kind: encoder.name, steps: encoder.counts} for text, encoder in ENCODERS.items() if encoder.counts}
    others = {text: {kind: encoder.name} for text, encoder in ENCODERS.items() if not encoder.counts}
    return Question(
        name,
        words,
        "On its label or in its data sheet. An incremental encoder of 600 lines has 2400 counts per turn.",
        (
            unknown,
            Way("by its name", (Field(kind, "encoder", options=fixed),)),
            Way("kind and counts", (Field(kind, "kind", options=others), Field(steps, "counts per turn", "2400"))),
            Way("kind only", (Field(kind, "kind", options=others),), cost="Its steps are estimated from the log."),
            Way("ideal", values={kind: "ideal"}, cost="As in a simulation: no error within a turn is in the interval."),
        ),
    )


BALANCED = Way("balanced", values={"axis.gravity_torque": 0}, cost="The axis goes through the centre of mass.")


def _gravity(cost: str, *more: Way) -> Question:
    return Question(
        "gravity",
        "Weight of the body, times its distance from the axis",
        "Weigh the body; balance it on an edge for the distance of its centre of mass from the axis. "
        "Or hold it level on a scale.",
        (
            Way("mass and distance", (
                Field("axis.mass", "mass m", "147.6 ± 0.2 g"),
                Field("axis.lever", "axis to centre of mass l", "147.8 ± 0.5 mm"),
            )),
            Way("product m g l", (Field("axis.gravity_torque", "m g l", "78 ± 0.4 mN m"),)),
            *more,
            Way("not known", values={"axis.gravity_torque": "unknown"}, cost=cost),
        ),
    )  # fmt: skip


def _value(name: str, words: str, where: str, key: str, example: str, cost: str, unknown: str = "unknown") -> Question:
    values = {key: unknown} if unknown else {}
    ways = Way("value", (Field(key, words, example),)), Way("not known", values=values, cost=cost)
    return Question(name, words, where, ways)


RATIO = "The answer is a ratio to it, not in kg m²."
STIFFNESS_UNKNOWN = Way(
    "not known", values={"axis.stiffness": "unknown"}, cost="The answer is the stiffness over the inertia."
)
FREE_UNKNOWN = "The answer is m g l over the inertia, not kg m²."
DRIVEN_UNKNOWN = "It is identified with the inertia; that needs motions of two frequencies, and the interval is wider."
ENCODER = _encoder(
    "encoder",
    "sensors",
    "Encoder of the body",
    Way("not known", cost="Its steps are estimated from the log; its error within a turn counts as that of any kind."),
)
WHEEL_ENCODER = _encoder(
    "wheel-encoder", "sensors.wheel", "Encoder of the wheel",
    Way("as of the body, or not known", cost="What is stated of the body's encoder counts for the wheel's."),
)  # fmt: skip


def _strings(table: str, words: str, where: str, across: Field) -> tuple[Question, ...]:
    """Questions about strings that hold a body; words, where: what `across` is, the size of their place."""
    length = Field(f"{table}.length", "length L", "1.000 ± 0.002 m")
    mass = Field(f"{table}.mass", "mass", "2.10 ± 0.01 kg")
    ratio = Way("not known", values={mass.key: "unknown"}, cost="The answer is a ratio to the mass.")
    return (
        Question("length", "Length of the strings", "From clamp to clamp.",
                 (Way("value", (length,)), STIFFNESS_UNKNOWN)),
        Question("across", words, where, (Way("value", (across,)), STIFFNESS_UNKNOWN), ("length",)),
        Question("mass", "Mass of all that hangs", "Weigh it with what carries it.", (Way("value", (mass,)), ratio),
                 ("length", "across")),
    )  # fmt: skip


ROTOR = Question(
    "rotor", "Rotor of the wheel's motor", "It turns with the wheel; its inertia is in the data sheet of the motor.",
    (
        Way("not known", cost="It counts as 0 ± 5 % of the inertia of the wheel."),
        Way("value", (Field("drive.motor.rotor_inertia", "inertia of the rotor", "10 ± 1 g cm²"),
                      Field("drive.motor.gear_ratio", "turns of the rotor per turn of the wheel", "1"))),
        Way("part of the wheel's", values={"drive.motor.rotor_inertia": 0}),
    ),
    ("wheel",),
)  # fmt: skip


def _held(quantity: str) -> Question:
    return Question(
        "held", f"What the column of the {quantity} holds",
        "A command acts until the next row; a reply is measured.",
        (Way("commanded", values={"log.drive_held": True}), Way("measured", values={"log.drive_held": False})),
    )  # fmt: skip


GEAR = Question(
    "gear", "Gear between motor and axis", "Friction of a gear grows with the torque that it carries.",
    (Way("none, or not known"), Way("has a gear", values={"drive.motor.gear_friction": "unknown"})),
)  # fmt: skip

KINDS = (
    Kind("wheel", "A driven wheel on a pendulum", "A motor turns a wheel; its reaction swings the body.",
         ("driven-wheel", 0, 1), "reaction-wheel", (
             _value("wheel", "Moment of inertia of the wheel", "About its own axis. A disc has m r²/2: weigh it, and "
                    "measure its radius.", "drive.wheel.inertia", "1134 ± 5 g cm²", RATIO),
             ROTOR,
             _gravity(DRIVEN_UNKNOWN, BALANCED),
             Question("relative", "What the wheel's sensor measures", "A sensor on the body sees the wheel turn "
                      "relative to the body.", (
                          Way("relative to the body", values={"log.wheel_angle_is": "relative"}),
                          Way("against the room", values={"log.wheel_angle_is": "absolute"}))),
             ENCODER, WHEEL_ENCODER),
         (("angle",), ("wheel_angle", "wheel_speed"))),
    Kind("free", "A free pendulum", "Lifted, let go, swings until it rests.", ("free-pendulum", 0, 1), "none",
         (_gravity(FREE_UNKNOWN), ENCODER)),
    Kind("wire", "A body on a wire", "Hangs on a wire and twists about the vertical.", ("strings", 0, 0.3), "none", (
        _value("stiffness", "Stiffness of the wire", "Torque per angle, from a known body or from a torque.",
               "axis.stiffness", "1.20 ± 0.01 mN m/rad", "The answer is the stiffness over the inertia."), ENCODER),
         fixed={"axis.gravity_torque": 0}),
    Kind("bifilar", "A body on two strings", "Twists about the vertical; strings of equal length.",
         ("strings", 0.31, 0.36), "none", (
             *_strings("axis.bifilar", "Distance of the strings", "At the body; above it is the same.",
                       Field("axis.bifilar.distance", "distance d", "450 ± 1 mm")), ENCODER)),
    Kind("trifilar", "A body on three strings", "Twists about the vertical; strings on a circle.",
         ("strings", 0.66, 0.34), "none", (
             *_strings("axis.trifilar", "Radius of the circle on which the strings hold the body", "From its middle.",
                       Field("axis.trifilar.radius", "radius r", "150 ± 0.5 mm")), ENCODER)),
    Kind("direct", "A known torque on the axis", "A motor whose torque is logged swings the body.",
         ("direct", 0, 1), "direct", (
             _value("gain", "Torque per unit of its column", "1 where the column is in N m; else from a lever on a "
                    "scale.", "log.torque_gain", "1 ± 0.02", "It is found from m g l, if that is stated."),
             _held("torque"), _gravity(DRIVEN_UNKNOWN, BALANCED), ENCODER), (("angle", "angle_speed"), ("torque",))),
    Kind("servo", "A motor on the axis", "Servo, gimbal, QUBE: its voltage or pulse width is known.",
         ("servo", 0, 1), "motor", (
             _gravity("Then torque per volt must be known.", BALANCED),
             _value("motor", "Torque per volt at the axis", "Gear included; from the data sheet: N k/R.",
                    "drive.motor.torque_per_volt", "0.14 ± 0.01 N m/V", "It is identified; m g l must be stated.", ""),
             _value("volts", "Volts per unit of the column", "1 where the column is in V; of pulse widths the supply "
                    "over the largest number.", "log.voltage_scale", "12 ± 0.1 V / 255",
                    "The column is taken as volts.", ""), _held("voltage"), GEAR, ENCODER),
         (("angle", "angle_speed"), ("voltage",))),
    Kind("flywheel", "A flywheel that runs down", "Balanced; spun up and let go.", ("flywheel", 0, 1), "none",
         (ENCODER,), fixed={"axis.gravity_torque": 0}),
    Kind("cart", "A carriage on a rail", "A known force moves it back and forth.", ("cart", 0, 1), "direct", (
        _value("gain", "Force per unit of its column", "1 where the column is in N.", "log.torque_gain",
               "20.0 ± 0.1", "The answer is this gain over the mass."), _held("force")),
         (("angle", "angle_speed"), ("torque",)), linear=True),
)  # fmt: skip
"""All kinds, in the order of docs/which-rig.md."""


def kind_of(name: str) -> Kind:
    """The kind of this name; KeyError for none."""
    return {kind.name: kind for kind in KINDS}[name]


def likely(columns: Mapping[str, str], *, linear: bool, returns: bool = True) -> str:
    """The name of the kind that the channels suggest; returns: whether the motion goes back and forth."""
    if linear:
        return "cart"
    if columns.get("wheel_angle") or columns.get("wheel_speed"):
        return "wheel"
    if columns.get("torque"):
        return "direct"
    if columns.get("voltage"):
        return "servo"
    return "free" if returns else "flywheel"


def kind_of_rig(rig: Any) -> str:
    """The kind of a Rig."""
    drive, axis = rig.drive.kind, rig.axis
    if axis.kind == "linear":
        return "cart"
    if drive != "none":
        return {"reaction-wheel": "wheel", "direct": "direct", "motor": "servo"}[drive]
    for name in ("bifilar", "trifilar"):
        if getattr(axis, name) is not None:
            return name
    if getattr(axis, "stiffness", None) is not None:
        return "wire"
    balanced = not isinstance(axis.gravity_torque, str) and axis.gravity_torque.value == 0
    return "flywheel" if balanced else "free"


@cache
def drawing(name: str, begin: float = 0.0, width: float = 1.0) -> str:
    """A drawing of a rig (or a part of its width) as SVG without a style of its own: that of the page colours it."""
    here = Path(__file__).resolve()
    places = here.with_name("rigs"), here.parents[3] / "docs" / "images" / "rigs"  # of a wheel, of the repository
    text = next(place / f"{name}.svg" for place in places if place.is_dir()).read_text(encoding="utf-8")
    inner = text[text.index("</style>") + len("</style>") :]
    box = text.split('viewBox="', 1)[1].split('"', 1)[0].split()
    whole = float(box[2])
    view = f"{begin * whole:g} {box[1]} {width * whole:g} {box[3]}"
    x, y, wide, high = view.split()
    cut = f'<svg x="{x}" y="{y}" width="{wide}" height="{high}" viewBox="{view}">{inner}'  # its own ends hide the rest
    return f'<svg class="swingid-rig" viewBox="{view}" aria-hidden="true">{cut}</svg>'
