"""How often the 95 % intervals of a campaign hold the truth."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from swingid.report.figures.levels import LEGEND_COLUMNS, MANY_LOOKS, METHOD, ROW, name_rows, shift
from swingid.report.style import legend_above, new_figure
from swingid.result.plot import BLUE, GREEN
from swingid.study.campaign.text import cell_name

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from swingid.study.campaign import Summary

WANTED = 95.0
LEAST = 90.0
"""%, from which the axis reaches at least to 100 %."""


def draw_coverage(summary: Summary) -> Figure | None:
    """Share of the intervals that hold the truth, with its binomial standard error; None where no interval is known."""
    cells = [cell for cell in summary.overall if math.isfinite(cell.statistics.coverage[0])]
    if not cells:
        return None
    figure, (ax,) = new_figure(0.8 + 0.26 * len(cells))
    for row, cell in enumerate(cells):
        share, error = cell.statistics.coverage
        bar = _bars([100 * share], [100 * error])
        ax.errorbar(100 * share, row, xerr=bar, fmt="o", ms=5, mew=0, color=BLUE, elinewidth=1.2, capsize=2.5)
    lowest = min(100 * (cell.statistics.coverage[0] - 2 * cell.statistics.coverage[1]) for cell in cells)
    _shares(ax, lowest)
    ax.set_yticks(range(len(cells)), [cell_name(cell) for cell in cells])
    ax.set_ylim(len(cells) - 0.5, -0.5)
    ax.grid(visible=False, axis="y")
    ax.tick_params(axis="y", length=0)
    return figure


def draw_coverage_by(summary: Summary, factor: str, quantity: str = "inertia") -> Figure | None:
    """The same for every method at each level of a factor; None with fewer than two levels that have intervals."""
    own = [c for c in summary.by_level if (c.factor, c.quantity) == (factor, quantity)]
    cells = [c for c in own if math.isfinite(c.statistics.coverage[0])]
    levels = list(dict.fromkeys(c.level for c in own))
    if len({c.level for c in cells}) < 2:
        return None
    methods = list(dict.fromkeys(c.method for c in cells))
    rows = math.ceil(len(methods) / LEGEND_COLUMNS)
    figure, (ax,) = new_figure(0.8 + max(ROW, METHOD * len(methods)) * len(levels) + 0.2 * rows)
    for k, method in enumerate(methods):
        colour, marker = MANY_LOOKS[k % len(MANY_LOOKS)]
        of_method = [c for c in cells if c.method == method]
        shares = [100 * c.statistics.coverage[0] for c in of_method]
        errors = [100 * c.statistics.coverage[1] for c in of_method]
        places = [levels.index(c.level) + shift(k, methods) for c in of_method]
        ax.errorbar(
            shares,
            places,
            xerr=_bars(shares, errors),
            fmt=marker,
            ms=5,
            mew=0,
            color=colour,
            elinewidth=1.0,
            capsize=0,
            label=method,
        )
    _shares(ax, min(100 * (c.statistics.coverage[0] - 2 * c.statistics.coverage[1]) for c in cells))
    name_rows(ax, levels)
    legend_above(ax, LEGEND_COLUMNS)
    return figure


def _bars(shares: list[float], errors: list[float]) -> list[list[float]]:
    """Lengths of bars to both sides, none beyond 100 %."""
    return [errors, [min(error, 100.0 - share) for share, error in zip(shares, errors, strict=True)]]


def _shares(ax: Axes, lowest: float) -> None:
    """The axis of shares (%), from `lowest` or less, with the line of what is claimed."""
    ax.axvline(WANTED, color=GREEN, lw=1.4, zorder=0.5)
    ax.set_xlim(max(min(lowest, LEAST), -2.0), 101.0)
    ax.set_xlabel("95 % intervals that hold the truth, % (bars: one binomial standard error)")
