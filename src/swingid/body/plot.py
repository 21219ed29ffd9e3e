"""The picture of a tensor: what the axes measured against the fit, the elements, the directions on a hemisphere."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from swingid.format import common_exponent, plus_minus, power_of_ten
from swingid.numerics.arrays import Array
from swingid.result.plot import BLUE, GREEN, GREY, INK, ORANGE, PALE, VERMILION
from swingid.uncertainty.freedom import COVERAGE_FACTOR

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from swingid.body.fit import AxisRow
    from swingid.body.principal import Principal
    from swingid.uncertainty.budget import Parameter


def plot_tensor(
    elements: Mapping[str, Parameter], principal: Sequence[Principal], rows: Sequence[AxisRow], following: Array
) -> Figure:
    """Draw a tensor by its elements, principal axes, measured axes and the best next one; no global state of pyplot."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.6, 4.4), layout="constrained")
    grid: Any = figure.add_gridspec(2, 2, width_ratios=(1.25, 1.0))
    largest = principal[0].moment.value
    _elements(figure.add_subplot(grid[0, 0]), elements, largest)
    _residuals(figure.add_subplot(grid[1, 0]), rows, largest)
    _directions(figure.add_subplot(grid[:, 1]), principal, rows, following)
    return figure


def _plain(ax: Axes) -> None:
    ax.spines[["top", "right"]].set_visible(False)
    ax.grid(visible=True, axis="y", color=PALE)
    ax.set_axisbelow(True)


def _elements(ax: Axes, elements: Mapping[str, Parameter], largest: float) -> None:
    """Six elements with their intervals; the intervals are mostly within the marks, so numbers stand above."""
    exponent = common_exponent([largest])
    scale = 10.0**-exponent
    for k, parameter in enumerate(elements.values()):
        reach = COVERAGE_FACTOR * (parameter.standard_uncertainty or 0.0) * scale
        ax.bar(k, scale * parameter.value, width=0.6, color=BLUE if k < 3 else ORANGE, alpha=0.75)
        ax.errorbar(k, scale * parameter.value, yerr=reach, fmt="none", ecolor=INK, capsize=3, elinewidth=1)
        text = plus_minus(scale * parameter.value, scale * (parameter.standard_uncertainty or 0.0), fine=True)
        up = parameter.value >= 0
        ax.annotate(text.replace("\u00a0±", "\n±"), (k, scale * parameter.value), (0, 4 if up else -4), ha="center",
                    textcoords="offset points", va="bottom" if up else "top", fontsize=7)  # fmt: skip
    ax.axhline(0, color=GREY, lw=0.7)
    ax.margins(y=0.3)
    ax.set_xticks(range(6), [f"J_{name}" for name in elements], parse_math=False)
    ax.set_ylabel(f"element, {power_of_ten(exponent)} kg m²" if exponent else "element, kg m²")
    _plain(ax)


def _residuals(ax: Axes, rows: Sequence[AxisRow], largest: float) -> None:
    """Measured less fitted of every axis, with the 95 % interval of the measurement."""
    for k, axis in enumerate(rows):
        reach = COVERAGE_FACTOR * (axis.central.standard_uncertainty or 0.0)
        off = axis.central.value - axis.fitted
        ax.errorbar(k, 100 * off / largest, yerr=100 * reach / largest, fmt="o", ms=4, color=BLUE, elinewidth=1)
    ax.axhline(0, color=GREEN, lw=1.2)
    ax.set_xticks(range(len(rows)), [axis.name for axis in rows], rotation=30, ha="right", fontsize=7,
                  parse_math=False)  # fmt: skip
    ax.set_ylabel("measured − fitted,\n% of largest moment")
    _plain(ax)


def _directions(ax: Axes, principal: Sequence[Principal], rows: Sequence[AxisRow], following: Array) -> None:
    """Axes, principal axes and the best next axis, seen along z; equal areas (Lambert), lower half mirrored."""
    for radius in (30, 60, 90):
        circle = np.linspace(0, 2 * np.pi, 200)
        size = np.sqrt(2) * np.sin(np.radians(radius) / 2)
        ax.plot(size * np.cos(circle), size * np.sin(circle), color=PALE if radius < 90 else GREY, lw=0.8, zorder=0)
    shown = _onto_disc(np.stack([axis.direction for axis in rows]))
    ax.scatter(shown[:, 0], shown[:, 1], s=34, color=BLUE, label="axes measured", zorder=3)
    for (x, y), axis in zip(shown, rows, strict=True):
        ax.annotate(axis.name, (x, y), (4, 4), textcoords="offset points", fontsize=7, color=INK, parse_math=False)
    known = {k: moment.direction for k, moment in enumerate(principal, 1) if not moment.together}
    if known:
        places = _onto_disc(np.stack(list(known.values())))
        ax.scatter(places[:, 0], places[:, 1], s=60, marker="x", color=VERMILION, label="principal axes", zorder=4)
        for (x, y), number in zip(places, known, strict=True):
            ax.annotate(str(number), (x, y), (-9, -9), textcoords="offset points", fontsize=8, color=VERMILION)
    x, y = _onto_disc(following[None])[0]
    ax.scatter(x, y, s=70, marker="*", color=ORANGE, label="best next axis", zorder=2)
    ax.annotate("x", (1.17, 0), ha="center", va="center", color=GREY)
    ax.annotate("y", (0, 1.17), ha="center", va="center", color=GREY)
    ax.set_aspect("equal")
    ax.set_axis_off()
    ax.set_xlim(-1.1, 1.25)
    ax.set_ylim(-1.1, 1.22)
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, 0.0), ncols=3, frameon=False, fontsize=8)


def _onto_disc(directions: Array) -> Array:
    """Places (n, 2) of directions (n, 3) on a disc of radius 1, the centre is +z or −z."""
    up = directions * np.where(directions[:, 2:] < 0, -1.0, 1.0)
    places: Array = up[:, :2] / np.sqrt(1 + up[:, 2:])
    return places
