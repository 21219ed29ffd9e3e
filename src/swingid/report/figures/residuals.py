"""What the balance leaves unexplained, over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from swingid.numerics.arrays import Array
from swingid.report.style import WIDTH, legend_above, prefixed
from swingid.result.plot import BLUE, GREY, INK
from swingid.result.result import Details

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


MOST_DOTS = 800
BINS = 120

_SAMPLE = ("sample", "angle")


def draw_residuals(details: Details, *, linear: bool) -> Figure | None:
    """Mean torque (or force) that each window leaves, or the angle that each sample does, and how they are spread."""
    known = np.isfinite(details.residuals)
    if known.sum() < 2:
        return None
    times, values = details.residual_times[known], details.residuals[known]
    factor, unit = prefixed(values, details.residual_unit or ("N" if linear else "N m"))
    each, what = ("window", f"mean {'force' if linear else 'torque'}") if details.residual_unit is None else _SAMPLE
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, 2.2))
    ax, spread = figure.subplots(1, 2, sharey=True, width_ratios=(5, 1))
    if len(times) > MOST_DOTS:
        _draw_bands(ax, times, values * factor, f"all {each}s")
    else:
        ax.plot(times, values * factor, ls="", marker="o", ms=2.6, mew=0, color=BLUE, alpha=0.7)
    for axes in (ax, spread):
        axes.axhline(0, color=GREY, lw=0.8)
    spread.hist(
        values * factor, bins="sqrt" if len(values) < 2500 else 50, orientation="horizontal", color=BLUE, alpha=0.7
    )
    spread.set_xlabel(f"{each}s")
    spread.grid(visible=False)
    ax.set_xlabel("time, s" if each == "sample" else "time of the window, s")
    ax.set_ylabel(f"{what} left, {unit}")
    return figure


def _draw_bands(ax: Axes, times: Array, values: Array, everything: str) -> None:
    """Many values as bands: all of them, the middle 90 %, and the median, in equal counts."""
    groups = np.array_split(np.arange(len(times)), BINS)
    middle = [float(np.mean(times[group])) for group in groups]
    low, fifth, median, last, high = np.array([np.quantile(values[g], (0, 0.05, 0.5, 0.95, 1)) for g in groups]).T
    ax.fill_between(middle, low, high, color=BLUE, alpha=0.2, lw=0, label=everything)
    ax.fill_between(middle, fifth, last, color=BLUE, alpha=0.4, lw=0, label="nine in ten")
    ax.plot(middle, median, color=INK, lw=0.8, label="median")
    legend_above(ax)
