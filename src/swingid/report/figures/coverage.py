"""How often the 95 % intervals of a campaign hold the truth."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from swingid.identify.plot import BLUE, GREEN
from swingid.report.style import new_figure
from swingid.study.campaign.text import cell_name

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from swingid.study.campaign import Summary

WANTED = 95.0


def draw_coverage(summary: Summary) -> Figure | None:
    """Share of the intervals that hold the truth, with its binomial standard error; None where no interval is known."""
    cells = [cell for cell in summary.overall if math.isfinite(cell.statistics.coverage[0])]
    if not cells:
        return None
    figure, (ax,) = new_figure(0.8 + 0.26 * len(cells))
    for row, cell in enumerate(cells):
        share, error = cell.statistics.coverage
        ax.errorbar(100 * share, row, xerr=100 * error, fmt="o", ms=5, mew=0, color=BLUE, elinewidth=1.2, capsize=2.5)
    lowest = min(100 * (cell.statistics.coverage[0] - 2 * cell.statistics.coverage[1]) for cell in cells)
    ax.axvline(WANTED, color=GREEN, lw=1.4, zorder=0.5)
    ax.set_xlim(max(min(lowest, 90.0), -2.0), 101.0)
    ax.set_yticks(range(len(cells)), [cell_name(cell) for cell in cells])
    ax.set_ylim(len(cells) - 0.5, -0.5)
    ax.grid(visible=False, axis="y")
    ax.tick_params(axis="y", length=0)
    ax.set_xlabel("95 % intervals that hold the truth, % (bars: one binomial standard error)")
    return figure
