"""Field types of rig.toml: quantities with a unit for each axis kind, and refusals that say what to do."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, NoReturn

from pydantic import BaseModel, ConfigDict, PlainValidator, StringConstraints, ValidationInfo
from pydantic_core import PydanticCustomError

from swingid.errors import InputError
from swingid.units import Quantity, parse_quantity

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


def read_quantity(raw: object, info: ValidationInfo, rotary: str, linear: str | None = None) -> Quantity:
    """`parse_quantity` with the unit that fits the axis kind in `info.context`."""
    kind = (info.context or {}).get("kind", "rotary")
    try:
        return parse_quantity(raw, linear if linear is not None and kind == "linear" else rotary, "")
    except InputError as error:
        refuse(error.code, error.message)


def quantity(
    rotary: str,
    linear: str | None = None,
    *,
    least: float | None = None,
    above: float | None = None,
    most: float | None = None,
) -> PlainValidator:
    """A validator that reads a Quantity in `rotary` units (`linear` on a linear axis) within limits.

    The value must be at least `least`, above `above`, at most `most` (SI); None is no limit.
    """

    def read(raw: object, info: ValidationInfo) -> Quantity:
        found = read_quantity(raw, info, rotary, linear)
        _check_limits(found.value, least, above, most)
        return found

    return PlainValidator(read)


def plain_number(
    rotary: str,
    linear: str | None = None,
    *,
    least: float | None = None,
    above: float | None = None,
    below: float | None = None,
) -> PlainValidator:
    """As `quantity`, for numbers that describe a spread or a limit themselves: an uncertainty is refused."""

    def read(raw: object, info: ValidationInfo) -> float:
        found = read_quantity(raw, info, rotary, linear)
        if found.std is not None:
            refuse("uncertainty-unused", "takes no uncertainty; write the number alone")
        _check_limits(found.value, least, above, None)
        if below is not None and found.value >= below:
            refuse("out-of-range", f"is {found.value:g}, but must be below {below:g}")
        return found.value

    return PlainValidator(read)


def _check_limits(value: float, least: float | None, above: float | None, most: float | None) -> None:
    if above is not None and value <= above:
        limit = "positive" if above == 0 else f"above {above:g}"
        refuse("out-of-range", f"is {value:g}, but must be {limit}")
    if least is not None and value < least:
        limit = "must not be negative" if least == 0 else f"must be at least {least:g}"
        refuse("out-of-range", f"is {value:g}, but {limit}")
    if most is not None and value > most:
        refuse("out-of-range", f"is {value:g}, but must be at most {most:g}")


def stated(table: BaseModel, key: str) -> bool:
    """Whether the file itself gave `key` of this table."""
    return key in table.model_fields_set


def given(*values: Any) -> bool:
    """Whether any of these optional values is there."""
    return any(value is not None for value in values)
