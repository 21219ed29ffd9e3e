"""What the balance leaves unexplained, over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from swingid.identify.plot import BLUE, GREY
from swingid.identify.result import Details
from swingid.report.style import WIDTH, envelope, prefixed

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw_residuals(details: Details, *, linear: bool) -> Figure | None:
    """Mean torque (or force) that each window leaves, and how its values are spread."""
    known = np.isfinite(details.residuals)
    if known.sum() < 2:
        return None
    times, values = details.residual_times[known], details.residuals[known]
    factor, unit = prefixed(values, "N" if linear else "N m")
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, 2.2))
    ax, spread = figure.subplots(1, 2, sharey=True, width_ratios=(5, 1))
    many = len(times) > 600
    shown_times, shown = envelope(times, values * factor, 300) if many else (times, values * factor)
    ax.plot(shown_times, shown, ls="", marker="o", ms=2.2 if many else 3, mew=0, color=BLUE, alpha=0.7)
    for axes in (ax, spread):
        axes.axhline(0, color=GREY, lw=0.8)
    spread.hist(
        values * factor, bins="sqrt" if len(values) < 2500 else 50, orientation="horizontal", color=BLUE, alpha=0.7
    )
    spread.set_xlabel("windows")
    spread.grid(visible=False)
    ax.set_xlabel("time of the window, s")
    ax.set_ylabel(f"mean {'force' if linear else 'torque'} left, {unit}")
    return figure
