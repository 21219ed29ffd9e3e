"""What each factor of a campaign does to the inertia of one method, the strongest first."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from swingid.format import percent
from swingid.report.style import legend_above, new_figure
from swingid.result.plot import BLUE, INK, ORANGE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from swingid.study.campaign import Summary
    from swingid.study.campaign.summary import Effect

MOST = 20

DECADES = 4.0
"""Below so many decades from the largest effect the axis is linear."""


def draw_tornado(summary: Summary, method: str, quantity: str = "inertia") -> Figure | None:
    """Bars from the lowest to the highest mean error over the levels of each factor, and the largest RMSE.

    None with fewer than two factors.
    """
    effects = [e for e in summary.effects if (e.method, e.quantity) == (method, quantity)]
    if len(effects) < 2:
        return None
    effects = sorted(effects, key=_size, reverse=True)[:MOST]
    largest = 100 * max(_size(effects[0]), 1e-9)
    figure, (ax,) = new_figure(1.0 + 0.3 * len(effects))
    for row, effect in enumerate(effects):
        low, high, size = 100 * effect.low[0], 100 * effect.high[0], 100 * effect.rmse[0]
        first = row == 0
        ax.barh(row, min(low, 0.0), color=ORANGE, height=0.6, label="lowest mean error" if first else None)
        ax.barh(row, max(high, 0.0), color=BLUE, height=0.6, label="highest mean error" if first else None)
        ax.plot([-size, size], [row, row], "|-", color=INK, lw=0.9, ms=7, label="± largest RMSE" if first else None)
        ax.annotate(
            f"{percent(effect.rmse[0])} at {effect.rmse[1]}",
            (1.01, row),
            xycoords=("axes fraction", "data"),
            va="center",
            size=8.0,
            color=INK,
            annotation_clip=False,
        )
    smallest = 100 * _size(effects[-1])
    if smallest < largest / 30:
        linear = max(largest / 10**DECADES, min(smallest, largest / 10))
        ax.set_xscale("symlog", linthresh=linear, linscale=0.5)
        decades = 10.0 ** np.arange(np.ceil(np.log10(linear)), np.floor(np.log10(largest)) + 1)
        decades = decades[:: max(1, len(decades) // 3)]
        ax.set_xticks(
            [*(-decades[::-1]), 0.0, *decades], [*(f"−{d:g}" for d in decades[::-1]), "0", *(f"{d:g}" for d in decades)]
        )
        ax.minorticks_off()
    ax.set_xlim(-1.5 * largest, 1.5 * largest)
    ax.axvline(0.0, color=INK, lw=0.8)
    ax.set_yticks(range(len(effects)), [effect.factor for effect in effects])
    ax.set_ylim(len(effects) - 0.5, -0.5)
    ax.grid(visible=False, axis="y")
    ax.tick_params(axis="y", length=0)
    ax.set_xlabel("error of the inertia, %")
    legend_above(ax)
    return figure


def _size(effect: Effect) -> float:
    return max(abs(effect.low[0]), abs(effect.high[0]), effect.rmse[0])
