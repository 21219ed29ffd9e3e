"""The inertia tensor as an answer: values, intervals, principal axes, consistency; as text and JSON."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from swingid.body.cad import Comparison
from swingid.body.directions import NAMES, TWICE, matrix_of, row_between, rows_of
from swingid.body.fit import AxisRow
from swingid.body.principal import Principal
from swingid.errors import UsageError
from swingid.format import interval, number, percent
from swingid.numerics.arrays import Array
from swingid.result.data import Message, plain
from swingid.result.summary import TITLES, message_lines, value_text
from swingid.table import aligned
from swingid.uncertainty.budget import BudgetEntry, Parameter, correlation_of, stated
from swingid.uncertainty.uncertain import Uncertain, weighted_sum
from swingid.units import Quantity, parse_quantity

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SCHEMA = "swingid.tensor/1"
UNIT = "kg m^2"


@dataclass(frozen=True)
class Tensor:
    """The inertia tensor about the centre of mass in the body frame; J_xy = −∫xy dm, as in URDF and MJCF.

    elements: by name (xx, yy, zz, xy, xz, yz). sources: the same as sums of independent sources, for predictions.
    covariance (6, 6). chi_square with degrees_of_freedom (0: six axes, nothing to check), its probability by chance.
    condition: of the directions. next_direction (3,) and the share of the mean variance it leaves.
    """

    status: Literal["ok", "warning"]
    elements: dict[str, Parameter]
    sources: tuple[Uncertain, ...]
    covariance: Array
    principal: tuple[Principal, ...]
    axes: tuple[AxisRow, ...]
    chi_square: float
    degrees_of_freedom: int
    probability: float | None
    condition: float
    next_direction: Array
    next_left: float
    mass: Uncertain | None = None
    name: str | None = None
    predictions: tuple[tuple[str, Parameter], ...] = ()
    comparison: Comparison | None = None
    warnings: tuple[Message, ...] = ()
    notes: tuple[Message, ...] = ()
    budget: tuple[BudgetEntry, ...] = ()
    provenance: dict[str, object] = field(default_factory=dict)

    @property
    def matrix(self) -> Array:
        """The tensor as a matrix, (3, 3)."""
        return matrix_of(np.array([self.elements[name].value for name in NAMES]))

    def about(self, direction: object, distance: str | float | Quantity = 0.0) -> Parameter:
        """The inertia about an axis: direction in the body frame, distance of the centre of mass from it (m).

        Raises UsageError for a direction that is none, or a distance without a mass.
        """
        vector = np.asarray(direction, dtype=np.float64)
        if vector.shape != (3,) or not np.isfinite(vector).all() or not np.any(vector):
            raise UsageError("a direction is three numbers that are not all 0, such as 0 0 1", code="bad-direction")
        vector = vector / np.linalg.norm(vector)
        inertia = weighted_sum(self.sources, rows_of(vector[None])[0])
        d = parse_quantity(distance, "m", "distance")
        if d.value or d.std:
            if self.mass is None:
                raise UsageError("the inertia about an axis off the centre of mass needs body.mass", code="no-mass")
            inertia += self.mass * Uncertain.of(d.value, d.std or 0.0, stated("distance", None), "prediction") ** 2
        return inertia.parameter(UNIT)

    def product(self, first: object, second: object) -> Parameter:
        """The element aᵀ J b between two unit vectors, as the products of inertia in another frame."""
        row = row_between(np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64))
        return weighted_sum(self.sources, row).parameter(UNIT)

    def to_dict(self) -> dict[str, Any]:
        """Plain data, schema "swingid.tensor/1"."""
        return {
            "schema": SCHEMA,
            "method": "tensor",
            "status": self.status,
            "name": self.name,
            "elements": self.elements,
            "matrix": self.matrix,
            "covariance": self.covariance,
            "correlation": correlation_of(NAMES, self.covariance),
            "principal": [
                {
                    "moment": moment.moment,
                    "axis": moment.direction,
                    "determined": not moment.together,
                    "angle_standard_uncertainty": moment.angle,
                }
                for moment in self.principal
            ],
            "axes": self.axes,
            "consistency": {
                "chi_square": self.chi_square,
                "degrees_of_freedom": self.degrees_of_freedom,
                "probability": self.probability,
            },
            "condition_number": self.condition,
            "next_axis": {"direction": self.next_direction, "variance_left": self.next_left},
            "predictions": [{"axis": words, "inertia": parameter} for words, parameter in self.predictions],
            "comparison": None if self.comparison is None else self.comparison.to_dict(),
            "warnings": self.warnings,
            "notes": self.notes,
            "budget": self.budget,
            "provenance": self.provenance,
            "error": None,
        }

    def to_json(self) -> str:
        """The tensor as JSON text."""
        return json.dumps(plain(self.to_dict()), indent=2, ensure_ascii=False, allow_nan=False) + "\n"

    def summary(self) -> str:
        """The tensor as text for a terminal."""
        parts = [
            ("Inertia tensor about the centre of mass", self._head()),
            ("Elements", self._elements()),
            ("Principal moments and axes", self._principal()),
            ("Axes", self._axes()),
            ("Uncertainty, share of the mean variance of all elements", self._budget()),
            ("Predictions", [f"    {words:<24} {_with_interval(p)}" for words, p in self.predictions]),
            ("Comparison", [] if self.comparison is None else self.comparison.lines()),
            ("Warnings", message_lines(self.warnings)),
            ("Notes", message_lines(self.notes)),
        ]
        return "\n".join(line for title, lines in parts if lines for line in (f"[[{title}]]", *lines))

    def plot(self) -> Figure:
        """Elements with their intervals, and the directions of axes and principal axes; returns the figure."""
        from swingid.body.plot import plot_tensor

        return plot_tensor(self.elements, self.principal, self.axes, self.next_direction)

    def _head(self) -> list[str]:
        rows = [
            ("body", self.name),
            ("status", f"{self.status} ({TITLES[self.status]})"),
            ("axes", f"{len(self.axes)}, condition number of their directions {self.condition:.2g}"),
            ("agree", self._agreement()),
            ("next", f"axis {direction_text(self.next_direction)} would reduce the mean variance by "
                     f"{percent(1 - self.next_left)}"),
        ]  # fmt: skip
        return [f"    {name:<7} = {value}" for name, value in rows if value]

    def _agreement(self) -> str:
        if self.probability is None:
            return "six axes determine six elements, and nothing checks them; add axes"
        chance = "< 0.1 %" if self.probability < 1e-3 else percent(self.probability)
        return (
            f"chi-square {self.chi_square:.2g} with {self.degrees_of_freedom} degrees of freedom, as large by chance "
            f"with probability {chance}"
        )

    def _elements(self) -> list[str]:
        largest = self.principal[0].moment.value
        values = {name: value_text(p) for name, p in self.elements.items()}
        shares = {name: percent((p.standard_uncertainty or 0.0) / largest) for name, p in self.elements.items()}
        wide = max(map(len, values.values()))
        return [
            f"    {name}: {values[name]:<{wide}}  ({shares[name]} of the largest moment)  95 %: {_interval(p)}"
            for name, p in self.elements.items()
        ]

    def _principal(self) -> list[str]:
        lines = []
        for k, principal in enumerate(self.principal):
            moment = principal.moment
            where = f"axis {direction_text(principal.direction)} ± {number(math.degrees(principal.angle), '', 2)} deg"
            if principal.together:
                others = " and ".join(str(j + 1) for j in principal.together)
                where = f"axis not determined: not distinguishable from moment {others}"
            lines.append(f"    {k + 1}: {_with_interval(moment)}  {where}")
        return lines

    def _axes(self) -> list[str]:
        rows = []
        for axis in self.axes:
            off = "not checked by the others"
            if axis.deviation is not None:
                off = f"{axis.deviation:+.1f} u from the others"
            about, central = value_text(axis.about_axis), value_text(axis.central)
            rows.append((axis.name, direction_text(axis.direction), about, central, off))
        return aligned([("axis", "direction", "about the axis", "through the centre of mass", ""), *rows])

    def _budget(self) -> list[str]:
        """Sources by their share of Σ u² over the nine elements of the matrix, the largest first."""
        power: dict[tuple[str, str], float] = {}
        for name, twice in zip(NAMES, TWICE, strict=True):
            for entry in self.budget:
                if entry.parameter == name:
                    key = entry.type, entry.source
                    power[key] = power.get(key, 0.0) + twice * entry.standard_uncertainty**2
        total = sum(power.values())
        shown = sorted(power.items(), key=lambda item: -item[1])
        return [f"    {kind}  {source:<40} {percent(part / total)}" for (kind, source), part in shown
                if part >= 1e-3 * total]  # fmt: skip


def direction_text(direction: Array) -> str:
    """'[0.577 0.577 -0.577]'."""
    return "[" + " ".join(f"{part + 0.0:.3f}" for part in np.round(direction, 3)) + "]"


def _with_interval(parameter: Parameter) -> str:
    return f"{value_text(parameter)}  95 %: {_interval(parameter)}"


def _interval(parameter: Parameter) -> str:
    return "unknown" if parameter.interval95 is None else interval(parameter.interval95, middle=parameter.value)
