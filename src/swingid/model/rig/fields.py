"""Field types of rig.toml: quantities with a unit for each axis kind, and refusals that say what to do."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, NoReturn, TypedDict, Unpack

from pydantic import BaseModel, ConfigDict, PlainValidator, StringConstraints, ValidationInfo, model_validator
from pydantic_core import PydanticCustomError

from swingid.errors import InputError
from swingid.model.terms import Term, further_terms
from swingid.quantity_text import shown
from swingid.units import Quantity, UnknownScale, parse_quantity

if TYPE_CHECKING:
    from pydantic._internal._model_construction import ModelMetaclass
else:
    ModelMetaclass = type(BaseModel)  # where pydantic keeps it is no part of its interface

Column = Annotated[str, StringConstraints(strict=True, min_length=1)]


MACHINERY = frozenset(name for name in dir(BaseModel) if not name.startswith("_"))
"""Names that every model has from pydantic, among them those of its first version (`dict`, `copy`, `parse_obj`)."""


class _TableType(ModelMetaclass):
    """Type of the tables: `dir` of a table lists what is its own."""

    def __dir__(self) -> list[str]:
        return [name for name in super().__dir__() if name not in MACHINERY]


class Table(BaseModel, metaclass=_TableType):
    """A table of rig.toml: frozen, and every unknown key is an error."""

    model_config = ConfigDict(extra="forbid", frozen=True, arbitrary_types_allowed=True)

    def __dir__(self) -> list[str]:
        return [name for name in super().__dir__() if name not in MACHINERY]


def refuse(code: str, problem: str, key: str = "") -> NoReturn:
    """Raise PydanticCustomError, which pydantic turns into a validation error at this place (or at its `key`).

    `problem` is a predicate: the place's dotted path is put before it.
    """
    raise PydanticCustomError("swingid", "{problem}", {"problem": problem, "slug": code, "key": key})


EXTREME = 1e30
"""SI values lie between its inverse and this; beyond, a power of ten is wrong, and products overflow or vanish."""


def measurable(quantity: Quantity) -> Quantity:
    """The quantity; refused where its number is one that nothing measured has."""
    for number in (quantity.value, quantity.std or 0.0):
        if number and not 1 / EXTREME <= abs(number) <= EXTREME:
            refuse("out-of-range", f"contains {number:.3g} in SI units, which nothing has; check its power of ten")
    return quantity


def quantity_in(raw: object, unit: str) -> Quantity:
    """The quantity that `raw` states in this SI unit; refused as by `parse_quantity` and `measurable`."""
    try:
        return measurable(parse_quantity(raw, unit, ""))
    except InputError as error:
        refuse(error.code, error.message)


def read_quantity(raw: object, info: ValidationInfo, rotary: str, linear: str | None = None) -> Quantity:
    """`quantity_in` with the unit that fits the axis kind in `info.context`."""
    kind = (info.context or {}).get("kind", "rotary")
    return quantity_in(raw, linear if linear is not None and kind == "linear" else rotary)


class Limits(TypedDict, total=False):
    """Limits of a value (SI): at least `least`, above `above`, at most `most`, below `below`."""

    least: float
    above: float
    most: float
    below: float


def quantity(rotary: str, linear: str | None = None, **limits: Unpack[Limits]) -> PlainValidator:
    """A validator that reads a Quantity in `rotary` units (`linear` on a linear axis) within limits."""
    return PlainValidator(lambda raw, info: _within(read_quantity(raw, info, rotary, linear), limits))


def quantity_or_unknown(
    rotary: str, linear: str | None = None, **limits: Unpack[Limits]
) -> Callable[[object, ValidationInfo], Quantity | str]:
    """A reader as of `quantity` that also takes the text "unknown": to be identified."""

    def read(raw: object, info: ValidationInfo) -> Quantity | str:
        if raw == "unknown":
            return "unknown"
        if isinstance(raw, str) and raw.strip().isalpha():
            refuse("not-a-quantity", f'is {shown(raw)}; write a number, text like "78 ± 0.4 mN*m", or "unknown"')
        return _within(read_quantity(raw, info, rotary, linear), limits)

    return read


def scale_or_unknown(unit: str) -> PlainValidator:
    """A validator of a positive constant that sets the scale; "unknown" gives an `UnknownScale`."""
    return _scale(lambda _raw: (unit, None))


def torque_or_unknown() -> PlainValidator:
    """`scale_or_unknown` of the torque (force) per logged unit: 0.12, "0.12 N*m/A", "0.12 N*m"."""

    def units(raw: object) -> tuple[str, str | None]:
        per = re.search(r"/\s*m?([AV])\s*$", _unit_of(raw))
        logged = f"/{per[1]}" if per else ""
        return (f"N*m{logged}", f"N{logged}") if has_unit(raw) else ("", None)

    return _scale(units)


def _scale(units: Callable[[object], tuple[str, str | None]]) -> PlainValidator:
    def found(raw: object, info: ValidationInfo) -> Quantity:
        value = quantity_or_unknown(*units(raw), above=0)(raw, info)
        return UnknownScale(1.0) if isinstance(value, str) else value

    return PlainValidator(found)


def plain_number(rotary: str, linear: str | None = None, **limits: Unpack[Limits]) -> PlainValidator:
    """Read as `quantity` does a number that describes a spread or a limit; an uncertainty is refused."""

    def read(raw: object, info: ValidationInfo) -> float:
        quantity = read_quantity(raw, info, rotary, linear)
        if quantity.std is not None:
            refuse("uncertainty-unused", "takes no uncertainty; write the number alone")
        return _within(quantity, limits).value

    return PlainValidator(read)


def has_unit(raw: object) -> bool:
    """Return whether a scale is stated in a unit, as "61.3 ± 0.2 deg", "61.3 deg/V" and "3.3 N/A" are."""
    return re.search(r"[^\W\d_]|°", _unit_of(raw).replace("ppm", "")) is not None


def _unit_of(raw: object) -> str:
    """The text of a quantity in which its unit is; "" of a number."""
    text = raw if isinstance(raw, str) else raw.get("unit") if isinstance(raw, dict) else None
    return text if isinstance(text, str) else ""


def per_logged_unit(raw: object, info: ValidationInfo) -> Quantity:
    """A positive scale of a logged angle: a pure number, or an angle (m on a linear axis) per V or per logged unit."""
    unit = "/V" if re.search(r"/\s*m?V\s*$", _unit_of(raw)) else ""
    if has_unit(raw):
        return _within(read_quantity(raw, info, f"rad{unit}", f"m{unit}"), {"above": 0.0})
    return _within(read_quantity(raw, info, ""), {"above": 0.0})


def choice_or_number(*choices: str) -> PlainValidator:
    """A validator that takes one of these texts, or a finite number as it stands."""

    def read(raw: object) -> str | float:
        if isinstance(raw, str) and raw in choices:
            return raw
        if isinstance(raw, int | float) and not isinstance(raw, bool) and math.isfinite(raw):
            return float(raw)
        named = ", ".join(repr(choice) for choice in choices)
        refuse("wrong-value", f"must be {named} or a number, not {shown(raw)}")

    return PlainValidator(read)


SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""Seconds per unit of the time."""


def seconds(unit: str) -> float:
    """Seconds per unit of the time: of a name in `SECONDS`, or of a tick that is stated as a time, "0.5 us"."""
    return SECONDS[unit] if unit in SECONDS else parse_quantity(unit, "s", "").value


def unit_of_time(raw: object) -> str:
    """The unit of a clock: a name in `SECONDS`, or the time of a tick as text with a unit."""
    if isinstance(raw, str) and raw in SECONDS:
        return raw
    problem = f"must be 's', 'ms', 'us', 'ns', or the time of a tick such as \"0.5 us\", not {shown(raw)}"
    if not isinstance(raw, str) or not raw.strip()[-1:].isalpha():
        refuse("wrong-value", problem)
    try:
        tick = parse_quantity(raw, "s", "")
    except InputError:
        refuse("wrong-value", problem)
    if tick.value <= 0:
        refuse("wrong-value", problem)
    if tick.std is not None:
        refuse("wrong-value", f"is {shown(raw)}; state the uncertainty of the clock as clock, without it here")
    return raw


def two_columns(raw: object) -> tuple[str, str]:
    """The names of two columns, of x and y."""
    if isinstance(raw, list | tuple) and len(raw) == 2 and all(isinstance(name, str) and name for name in raw):
        return raw[0], raw[1]
    refuse("wrong-value", f'must be the columns of x and y, such as ["x", "y"], not {shown(raw)}')


def two_columns_or_place(raw: object) -> tuple[str, str] | tuple[float, float]:
    """The names of two columns, or a place in the picture as two numbers."""
    if not isinstance(raw, list | tuple) or any(isinstance(name, str) for name in raw):
        return two_columns(raw)
    numbers = [
        number
        for number in raw
        if isinstance(number, int | float) and not isinstance(number, bool) and math.isfinite(number)
    ]
    if len(numbers) == 2 == len(raw):
        return float(numbers[0]), float(numbers[1])
    refuse("wrong-value", f"must be [x, y] of the pivot, or the columns of a mark on it, not {shown(raw)}")


def _within(quantity: Quantity, limits: Limits) -> Quantity:
    """The quantity, refused where its value is outside of the limits."""
    value = quantity.value
    if "above" in limits and value <= limits["above"]:
        limit = "positive" if limits["above"] == 0 else f"above {limits['above']:g}"
        refuse("out-of-range", f"is {value:g}, but must be {limit}")
    if "least" in limits and value < limits["least"]:
        limit = "must not be negative" if limits["least"] == 0 else f"must be at least {limits['least']:g}"
        refuse("out-of-range", f"is {value:g}, but {limit}")
    if "most" in limits and value > limits["most"]:
        refuse("out-of-range", f"is {value:g}, but must be at most {limits['most']:g}")
    if "below" in limits and value >= limits["below"]:
        refuse("out-of-range", f"is {value:g}, but must be below {limits['below']:g}")
    return quantity


class TermTable(Table):
    """A table of rig.toml that also takes the keys of the further terms in the registry (`model.terms`).

    Such a key is an attribute of the table where the file states it. `path` of the table in the file.
    """

    model_config = ConfigDict(extra="allow")
    path: ClassVar[str]

    @classmethod
    def term_keys(cls) -> dict[str, Term]:
        """The keys that the registry adds to this table, with their terms; a term's shift has a key of its own."""
        places = [(key.rpartition("."), term) for term in further_terms() for key in (term.key, term.shift)]
        return {key: term for (table, _, key), term in places if table == cls.path}

    @model_validator(mode="before")
    @classmethod
    def _read_terms(cls, raw: object, info: ValidationInfo) -> object:
        if not isinstance(raw, dict):
            return raw
        terms, read = cls.term_keys(), dict(raw)
        for key in raw:
            if key in cls.model_fields:
                continue
            if key not in terms:
                raise PydanticCustomError("extra_forbidden", "is not a known key", {"key": str(key)})
            term = terms[key]
            if term.linear == "" and (info.context or {}).get("kind") == "linear":
                refuse("contradiction", "has no meaning on a linear axis", key)
            coefficient = term.key.rpartition(".")[2]
            if coefficient not in raw:
                refuse("missing-key", f"is missing beside {key}", coefficient)
            limits: Limits = {} if term.signed else {"least": 0.0}
            try:
                if key == coefficient:
                    read[key] = quantity_or_unknown(term.unit, term.linear, **limits)(raw[key], info)
                else:
                    read[key] = shift = read_quantity(raw[key], info, "rad", "m")
                    if shift.std is not None and raw[coefficient] == "unknown":
                        refuse("uncertainty-unused", f"takes no uncertainty beside an unknown {coefficient}")
            except PydanticCustomError as error:
                context = error.context or {}
                refuse(context["slug"], context["problem"], key)
        return read


def stated(table: BaseModel, key: str) -> bool:
    """Return whether the file itself gave `key` of this table."""
    return key in table.model_fields_set


def given(*values: Any) -> bool:
    """Return whether any of these optional values is there."""
    return any(value is not None for value in values)
