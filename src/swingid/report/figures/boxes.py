"""Errors of the methods of a campaign, as boxes: their size, and their size in the uncertainty that was claimed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from swingid.report.style import new_figure, plain_powers
from swingid.result.plot import BLUE, GREEN, INK, SKY
from swingid.result.result import COVERAGE_FACTOR

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from swingid.study.campaign import Summary

Values = np.ndarray[Any, np.dtype[np.float64]]
WHISKERS = (2.5, 97.5)
"""Percentiles at the ends of the whiskers: 95 % lie between."""

LINEAR = 3.0
"""Errors in claimed uncertainties up to which the axis is linear."""


def draw_boxes(summary: Summary) -> Figure | None:
    """Absolute relative errors (log scale) and errors in standard uncertainties, a box per method; None without any."""
    pairs = [(cell.method, cell.quantity) for cell in summary.overall if cell.statistics.answered]
    if not pairs:
        return None
    sizes, claimed = [], []
    for method, quantity in pairs:
        own = (summary.columns["method"] == method) & (summary.columns["quantity"] == quantity)
        error = summary.columns["error"][own]
        u = summary.columns["u"][own] / np.abs(summary.columns["truth"][own])
        sizes.append(_known(100 * np.abs(error)))
        claimed.append(_known(error / u))
    figure, (left,) = new_figure(1.2 + 0.3 * len(pairs))
    figure.clear()
    left, right = figure.subplots(1, 2, sharey=True)
    names = [method if quantity == "inertia" else f"{method}, {quantity}" for method, quantity in pairs]
    _boxes(left, sizes)
    left.set_xscale("log")
    plain_powers(left.xaxis)
    left.set_xlabel("size of the error, %")
    left.set_yticks(range(len(names)), names)
    left.set_ylim(len(names) - 0.5, -0.5)
    _boxes(right, claimed)
    right.axvspan(-COVERAGE_FACTOR, COVERAGE_FACTOR, color=GREEN, alpha=0.15, lw=0)
    far = max((float(np.max(np.abs(values))) for values in claimed if len(values)), default=0.0)
    if far > 10:
        right.set_xscale("symlog", linthresh=LINEAR, linscale=1.5)
        right.set_xlim(-1.5 * far, 1.5 * far)
        power = 10.0 ** np.floor(np.log10(far))
        ticks = [-power, -2.0, 0.0, 2.0, power]
        right.set_xticks(ticks, [f"{tick:g}".replace("-", "−") for tick in ticks])
        right.minorticks_off()
    else:
        reach = max(1.1 * far, 3.0)
        right.set_xlim(-reach, reach)
    right.set_xlabel("error, in standard uncertainties claimed")
    for axes in (left, right):
        axes.grid(visible=False, axis="y")
        axes.tick_params(axis="y", length=0)
    return figure


def _known(values: Values) -> Values:
    return values[np.isfinite(values)]


def _boxes(axes: Axes, groups: list[Values]) -> None:
    axes.boxplot(
        groups,
        positions=range(len(groups)),
        orientation="horizontal",
        widths=0.5,
        whis=WHISKERS,
        patch_artist=True,
        manage_ticks=False,
        boxprops={"facecolor": SKY, "edgecolor": BLUE, "lw": 0.8},
        medianprops={"color": INK, "lw": 1.4},
        whiskerprops={"color": BLUE, "lw": 0.8},
        capprops={"color": BLUE, "lw": 0.8},
        flierprops={"marker": ".", "ms": 3, "mec": BLUE, "mew": 0, "mfc": BLUE, "alpha": 0.4, "rasterized": False},
    )
