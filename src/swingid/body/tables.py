"""The file of the axes: which result belongs to which direction, and where the centre of mass is; read and checked."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from pydantic import AfterValidator, Field, PlainValidator, model_validator

from swingid.errors import InputError
from swingid.model.rig.fields import Column, Table, given, quantity, quantity_in, refuse
from swingid.model.rig.toml_file import checked, tables_of, text_of
from swingid.numerics.arrays import Array
from swingid.quantity_text import shown
from swingid.units import Quantity

STEEPEST = math.radians(10)
"""Largest tilt (rad): above it the second order of the direction, tilt², exceeds 3 % of a moment."""

FILE = "a file of axes"

LARGEST = 10_000_000
"""Bytes beyond which no file of axes is read."""


def _vector(raw: object) -> tuple[float, float, float]:
    """A direction: three finite numbers, not all zero; its length has no meaning."""
    numbers = [part for part in raw if _is_number(part)] if isinstance(raw, list) else []
    if not isinstance(raw, list) or len(raw) != 3 or len(numbers) != 3:
        refuse("wrong-value", f"must be three numbers such as [1, 1, 0], not {shown(raw)}")
    x, y, z = (float(part) for part in numbers)
    if max(abs(x), abs(y), abs(z)) < 1e-100:
        refuse("zero-vector", "has no length; give the direction of the axis in the body frame, such as [0, 0, 1]")
    return x, y, z


def _is_number(part: object) -> bool:
    return isinstance(part, int | float) and not isinstance(part, bool) and abs(part) < 1e100


def _place(raw: object) -> tuple[Quantity, Quantity, Quantity]:
    """A place in the body frame: three lengths."""
    if not isinstance(raw, list) or len(raw) != 3:
        refuse("wrong-value", f'must be three lengths such as ["0 mm", "0 mm", "12 ± 0.1 mm"], not {shown(raw)}')
    x, y, z = (quantity_in(part, "m") for part in raw)
    return x, y, z


def _known(quantity: Quantity) -> Quantity:
    if not quantity.std:
        refuse("no-uncertainty", 'has no uncertainty, so it has no weight; write "value ± standard uncertainty unit"')
    return quantity


def _tilt(raw: object) -> float:
    """A small angle, the standard uncertainty of a direction."""
    tilt = quantity_in(raw, "rad")
    if tilt.std is not None:
        refuse("uncertainty-unused", "takes no uncertainty; write the number alone")
    if not 0 <= tilt.value <= STEEPEST:
        degrees = math.degrees(tilt.value)
        refuse(
            "out-of-range", f'is {degrees:.3g} deg, but must be from 0 to 10 deg; write it with its unit, "0.05 deg"'
        )
    return tilt.value


def _torque(raw: object) -> Quantity | str:
    """A torque, or "result"."""
    return raw if raw == "result" else quantity_in(raw, "N*m")


def _fixture(raw: object) -> Quantity | str:
    """A path ending in .json, or an inertia."""
    if isinstance(raw, str) and raw.lower().endswith(".json"):
        return raw
    return quantity_in(raw, "kg*m^2")


Vector = Annotated[tuple[float, float, float], PlainValidator(_vector)]
Place = Annotated[tuple[Quantity, Quantity, Quantity], PlainValidator(_place)]

LEVERS = ("distance", "point", "gravity_torque")
"""Keys that state where the centre of mass is from an axis; an axis has one of them."""


class EveryAxis(Table):
    """[every_axis]: keys of every axis that does not state them itself.

    tilt: standard uncertainty of the direction about each of two lines across the axis (rad). mounting: axes of one
    mounting share its rotation. fixture: what is on the axis without the body, as a result or an inertia (kg m²).
    distance (m) of the centre of mass from the axis, or a point on the axis in the body frame (m), or the gravity
    torque of the body (N m) about a horizontal axis; "result": the one in the axis' result.
    """

    path: ClassVar[str] = "every_axis"
    tilt: Annotated[float | None, PlainValidator(_tilt)] = None
    mounting: Column | None = None
    fixture: Annotated[Quantity | str | None, PlainValidator(_fixture)] = None
    distance: Annotated[Quantity | None, quantity("m", least=0.0)] = None
    point: Place | None = None
    gravity_torque: Annotated[Quantity | str | None, PlainValidator(_torque)] = None

    @model_validator(mode="after")
    def _one_lever(self) -> Self:
        stated = [key for key in LEVERS if getattr(self, key) is not None]
        if len(stated) > 1:
            problem = f"is given beside {stated[0]}; each states the distance of the centre of mass, so give one"
            refuse("contradiction", problem, stated[1])
        return self


class AxisTable(EveryAxis):
    """[[axis]]: one axis, by a result file or by the inertia about it (kg m²); direction in the body frame."""

    name: Column | None = None
    direction: Vector
    result: Column | None = None
    inertia: Annotated[Quantity | None, quantity("kg*m^2", above=0.0), AfterValidator(_known)] = None

    @model_validator(mode="after")
    def _one_inertia(self) -> Self:
        if given(self.result) and given(self.inertia):
            refuse("contradiction", "is given beside result; give one of them", "inertia")
        return self


class Body(Table):
    """[body]: its mass (kg), its centre of mass in the body frame (m), the local gravity (m/s²)."""

    name: Column | None = None
    mass: Annotated[Quantity | None, quantity("kg", above=0.0)] = None
    centre_of_mass: Place | None = None
    gravity: Annotated[Quantity | None, quantity("m/s^2", above=0.0)] = None


class Mounting(Table):
    """[mounting.NAME]: standard uncertainty of the rotation about each line of the body frame (rad)."""

    rotation: Annotated[float, PlainValidator(_tilt)]


class AxesFile(Table):
    """The whole file."""

    body: Body = Body()
    every_axis: EveryAxis = EveryAxis()
    mounting: dict[str, Mounting] = Field(default_factory=dict)
    axis: list[dict[str, Any]]


@dataclass(frozen=True)
class Axes:
    """The axes of one body as stated: tables with the keys of [every_axis] filled in; `names` of the axes."""

    source: str
    folder: Path
    body: Body
    mountings: Mapping[str, float]
    tables: tuple[AxisTable, ...]
    names: tuple[str, ...]

    @property
    def directions(self) -> Array:
        """Unit vectors in the body frame, (n, 3)."""
        vectors = np.array([table.direction for table in self.tables], dtype=np.float64)
        vectors = vectors / np.max(np.abs(vectors), axis=1, keepdims=True)
        directions: Array = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
        return directions

    def place(self, k: int) -> str:
        """Axis k in a message: the file, the number from 1, the name."""
        name = self.tables[k].name
        return f"{self.source}: axis {k + 1}" + (f" ({name})" if name else "")


def load_axes(path: str | Path, results: int = 0) -> Axes:
    """The axes of a file ending in .toml; `results`: number of results that come from outside of it, in its order.

    Raises InputError that names file, axis and key for a file that is missing, unreadable, no TOML or no list of axes.
    """
    text = text_of(path, missing="docs/tensor.md shows one", folder="give the file of the axes in it", most=LARGEST)
    return axes_from_text(text.removeprefix("\ufeff"), str(path), Path(path).parent, results)


def axes_from_text(text: str, source: str = "axes.toml", folder: Path | None = None, results: int = 0) -> Axes:
    """The axes of TOML text; result files are looked for in `folder`. Errors as `load_axes`."""
    hint = "; a result file goes with --axes FILE.toml" if text.lstrip().startswith("{") else ""
    document = tables_of(text, source, hint)
    if "drive" in document:
        message = f"{source} is a rig file; give the file with entry [[axis]] table for each axis, see docs/tensor.md"
        raise InputError(message, code="not-axes")
    listed = document.get("axis")
    if not isinstance(listed, list) or not listed or not all(isinstance(entry, dict) for entry in listed):
        message = f"{source}: axis must be a list of tables; write entry [[axis]] for each axis, see docs/tensor.md"
        raise InputError(message, code="not-axes")
    file = checked(document, AxesFile, source, FILE)
    tables = []
    for k, raw in enumerate(file.axis):
        name = raw.get("name")
        place = f"{source}: axis {k + 1}" + (f" ({name[:60]})" if isinstance(name, str) else "")
        axis = checked(raw, AxisTable, place, FILE)
        tables.append(_filled(axis, file.every_axis))
        _check(tables[-1], file, place, results)
    names = tuple(table.name or table.result or f"axis {k + 1}" for k, table in enumerate(tables))
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise InputError(f"{source}: two axes are called {twice!r}; give each its own name", code="contradiction")
    mountings = {name: mounting.rotation for name, mounting in file.mounting.items()}
    return Axes(source, folder or Path(), file.body, mountings, tuple(tables), names)


def _filled(axis: AxisTable, every: EveryAxis) -> AxisTable:
    """The axis with what [every_axis] states; a lever of its own replaces any of that table."""
    has_lever = any(getattr(axis, key) is not None for key in LEVERS)
    more = {
        key: getattr(every, key)
        for key in type(every).model_fields
        if getattr(axis, key) is None and not (has_lever and key in LEVERS)
    }
    return axis.model_copy(update=more)


def _check(axis: AxisTable, file: AxesFile, place: str, results: int) -> None:
    """Raise InputError where the keys of an axis, with those of the body, do not determine its inertia."""

    def stop(key: str, problem: str, code: str = "missing-key") -> None:
        raise InputError(f"{place}: {key} {problem}", code=code)

    if axis.result is None and axis.inertia is None and not results:
        stop("result", 'is missing; give a result of identify, or inertia = "value ± uncertainty kg*m^2"')
    if axis.tilt is None:
        stop("tilt", 'is missing; give the standard uncertainty of the direction, such as "0.05 deg" ("0 deg": exact)')
    if axis.mounting is not None and axis.mounting not in file.mounting:
        stop("mounting", f"is {axis.mounting[:60]!r}, which has no table [mounting.{axis.mounting[:60]}]; add it")
    if not any(getattr(axis, key) is not None for key in LEVERS):
        stop("distance", 'is missing; give the distance of the centre of mass ("0 mm": on the axis), point or '
             "gravity_torque")  # fmt: skip
    on_axis = axis.distance is not None and axis.distance.value == 0 and not axis.distance.std
    if file.body.mass is None and not on_axis:
        raise InputError(
            f'{place}: body.mass is missing, which m d^2 needs; weigh the body, or give distance = "0 mm" for an axis '
            "through the centre of mass",
            code="missing-key",
        )
    if axis.point is not None and file.body.centre_of_mass is None:
        stop("point", "needs body.centre_of_mass, the centre of mass in the body frame; add it, or give distance")
    if axis.gravity_torque == "result" and axis.inertia is not None:
        stop("gravity_torque", 'is "result", but the axis has no result; write the torque in N*m', "contradiction")
    if axis.gravity_torque == "result" and isinstance(axis.fixture, Quantity):
        problem = 'is "result" and contains the fixture, whose torque an inertia does not state'
        stop("gravity_torque", f"{problem}; give the fixture's result, or the body's own torque", "contradiction")
