"""How an online estimate came to its value."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from swingid.format import common_exponent, power_of_ten, pretty_unit
from swingid.report.style import legend_above, new_figure
from swingid.result.plot import BLUE, GREEN, GREY, PALE
from swingid.result.result import Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure

REACH = 0.3
"""The curve is shown within this share of the answer; it may come from ten times as far."""


def draw_convergence(result: Result) -> Figure | None:
    """The estimate over the log, ±5 % and ±1 % of the answer, and when it stays within these."""
    curve = result.details.convergence if result.details else None
    if curve is None or "inertia" not in result.parameters:
        return None
    inertia = result.inertia
    exponent = common_exponent([inertia.value])
    scale = 10.0**-exponent
    figure, (ax,) = new_figure(2.9)
    ax.axvspan(*curve.settled, color=PALE, lw=0, zorder=0, label="averaged for the answer")
    ax.axhline(inertia.value * scale, color=GREEN, lw=1.4, label="answer")
    for style, (band, seconds) in zip(((0, (5, 2)), (0, (1, 2))), curve.within.items(), strict=False):
        share = float(band.removesuffix("%")) / 100
        for side in (-1, 1):
            ax.axhline(inertia.value * scale * (1 + side * share), color=GREY, lw=0.8, ls=style)
        if seconds is not None:
            reached = float(curve.times[0]) + seconds
            ax.axvline(reached, color=GREY, lw=0.9, ls=style, label=f"within {band} after {seconds:.3g} s")
    ax.plot(curve.times, np.asarray(curve.values) * scale, color=BLUE, lw=1.2, label="online estimate")
    ax.set_ylim(*(inertia.value * scale * edge for edge in (1 - REACH, 1 + REACH)))
    ax.set_xlim(float(curve.times[0]), float(curve.times[-1]))
    ax.set_xlabel("time, s")
    power = f"{power_of_ten(exponent)} " if exponent else ""
    ax.set_ylabel(f"inertia, {power}{pretty_unit(inertia.unit)}")
    legend_above(ax)
    return figure
