"""The error of every method at the levels of one factor of a campaign."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from swingid.report.figures.forest import LOOKS
from swingid.report.style import legend_above, new_figure, plain_powers
from swingid.result.plot import GREEN, GREY, INK, PALE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from swingid.study.campaign import Summary
    from swingid.study.campaign.summary import Cell

LEGEND_COLUMNS = 4

DECADE = 8.0
"""Ratio of errors from which on their axis is logarithmic: below it has no power of ten to label."""

ROW, METHOD = 0.28, 0.1
"""Height of a level by name, in inches, at least, and for each method."""

MANY_LOOKS = (*LOOKS, (GREEN, "P"), (INK, "X"), (GREY, "h"))
"""Colour and marker of a method, in turn."""


def draw_levels(summary: Summary, factor: str, quantity: str = "inertia") -> Figure | None:
    """RMSE by level: lines over a number, with the Cramér–Rao bound where it is known, dots by name else.

    None where a factor has fewer than two levels with an answer.
    """
    cells = [c for c in summary.by_level if (c.factor, c.quantity) == (factor, quantity) and c.statistics.rmse[0] > 0]
    levels = list(dict.fromkeys(c.level for c in summary.by_level if c.factor == factor))
    if len({c.level for c in cells}) < 2:
        return None
    methods = list(dict.fromkeys(c.method for c in cells))
    numbers = _numbers(levels)
    rows = math.ceil((len(methods) + 1) / LEGEND_COLUMNS)
    figure, (ax,) = new_figure((2.8 if numbers else 0.8 + max(ROW, METHOD * len(methods)) * len(levels)) + 0.2 * rows)
    for k, method in enumerate(methods):
        colour, marker = MANY_LOOKS[k % len(MANY_LOOKS)]
        own = [c for c in cells if c.method == method]
        sizes, errors = [100 * c.statistics.rmse[0] for c in own], [100 * c.statistics.rmse[1] for c in own]
        look: dict[str, Any] = {"ms": 5, "mew": 0, "color": colour, "elinewidth": 1.0, "capsize": 0, "label": method}
        if numbers:
            at = [numbers[c.level] for c in own]
            ax.errorbar(at, sizes, yerr=errors, fmt=f"{marker}-", **look)
        else:
            ax.errorbar(
                sizes, [levels.index(c.level) + shift(k, methods) for c in own], xerr=errors, fmt=marker, **look
            )
    if numbers:
        _over_numbers(ax, factor, list(numbers.values()), cells, numbers)
    else:
        ax.set_xscale("log")
        plain_powers(ax.xaxis)
        ax.set_xlabel("RMSE of the inertia, %")
        name_rows(ax, levels)
    legend_above(ax, LEGEND_COLUMNS)
    return figure


def shift(k: int, methods: Sequence[str]) -> float:
    """How far below the middle of a level's row the k-th method stands."""
    return (k - (len(methods) - 1) / 2) * 0.7 / len(methods)


def name_rows(ax: Axes, levels: Sequence[str]) -> None:
    """Levels by name on the vertical axis, the first on top, with lines between them."""
    ax.set_yticks(range(len(levels)), levels)
    ax.set_ylim(len(levels) - 0.5, -0.5)
    ax.grid(visible=False, axis="y")
    ax.tick_params(axis="y", length=0)
    for k in range(len(levels) - 1):
        ax.axhline(k + 0.5, color=PALE, lw=0.8, zorder=0.4)


def _numbers(levels: list[str]) -> dict[str, float]:
    """The levels as numbers, none where one is no number."""
    try:
        return {level: float(level) for level in levels}
    except ValueError:
        return {}


def _over_numbers(ax: Axes, factor: str, at: list[float], cells: list[Cell], numbers: dict[str, float]) -> None:
    """Axes over a number, logarithmic where it spans more than a decade, and the bound."""
    bounds = {
        numbers[c.level]: 100 * c.statistics.rmse[0] * math.sqrt(c.statistics.efficiency[0])
        for c in cells
        if math.isfinite(c.statistics.efficiency[0])
    }
    if bounds:
        where = sorted(bounds)
        ax.plot(where, [bounds[x] for x in where], "--", color=GREY, lw=1.2, label="Cramér–Rao bound")
    sizes = [100 * c.statistics.rmse[0] for c in cells] + list(bounds.values())
    if max(sizes) > DECADE * min(sizes):
        ax.set_yscale("log")
        plain_powers(ax.yaxis)
    else:
        ax.set_ylim(bottom=0.0)
        ax.yaxis.set_major_formatter(lambda value, _: f"{value:.6f}".rstrip("0").rstrip("."))
    if min(at) > 0 and max(at) > 10 * min(at):
        ax.set_xscale("log")
        plain_powers(ax.xaxis)
    else:
        ax.set_xticks(np.unique(at))
    ax.set_xlabel(factor)
    ax.set_ylabel("RMSE of the inertia, %")
