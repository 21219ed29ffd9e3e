"""Maps of a closed loop over two factors of a campaign: tracking, settling, chatter, error of the inertia."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from swingid.report.style import new_figure
from swingid.result.plot import INK, PALE, VERMILION

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from swingid.study.campaign import Summary

Values = np.ndarray[Any, np.dtype[np.float64]]

PANELS = (
    ("tracking", 1e3, "tracking error, RMS, mrad"),
    ("settling", 1.0, "gain k̃ settled within 1 % after, s"),
    ("chatter", 1.0, "change of the voltage per sample, RMS, V"),
    ("error", 100.0, "size of the inertia's error, %"),
)
"""Column of the results, factor, words."""

FOLLOWS = 0.2
"""Share of the wanted motion's RMS up to which the tracking error counts as following it."""

DARK = 0.55
"""Share of the colour scale from which on numbers are written in white."""


def draw_map(summary: Summary, pair: tuple[str, str]) -> Figure | None:
    """Four panels over the levels of two factors, the median over all else; None where one has fewer than two levels.

    Empty: no run there came to an end. The error is that of the first method.
    """
    across, up = (np.unique(summary.columns[name].astype(str if _is_text(summary, name) else float)) for name in pair)
    if len(across) < 2 or len(up) < 2:
        return None
    figure, _ = new_figure(2.0 + 0.5 * len(up))
    figure.clear()
    panels = figure.subplots(2, 2, sharex=True, sharey=True).ravel()
    method = summary.plan.tables.base.methods[:1]
    for axes, (column, factor, words) in zip(panels, PANELS, strict=True):
        values = np.full((len(up), len(across)), np.nan)
        rows = summary.columns["method"] == (method[0] if method else "")
        for i, y in enumerate(up):
            for j, x in enumerate(across):
                own = rows & (summary.columns[pair[0]] == x) & (summary.columns[pair[1]] == y)
                known = np.abs(summary.columns[column][own])
                known = known[np.isfinite(known)]
                values[i, j] = factor * np.median(known) if len(known) else np.nan
        _panel(axes, values, words)
        if column == "tracking":
            _cross_out(axes, summary, pair, (across, up))
    for axes in panels[2:]:
        axes.set_xticks(range(len(across)), [_label(x) for x in across])
        axes.set_xlabel(pair[0])
    for axes in panels[::2]:
        axes.set_yticks(range(len(up)), [_label(y) for y in up])
        axes.set_ylabel(pair[1])
    return figure


def _is_text(summary: Summary, name: str) -> bool:
    return summary.columns[name].dtype.kind not in "fi"


def _label(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _cross_out(axes: Axes, summary: Summary, pair: tuple[str, str], levels: tuple[Values, Values]) -> None:
    """A cross over the cells where the loop does not follow in half of the runs."""
    share = summary.columns["tracking"] / summary.columns["wanted"]
    for (i, y), (j, x) in product(enumerate(levels[1]), enumerate(levels[0])):
        own = share[(summary.columns[pair[0]] == x) & (summary.columns[pair[1]] == y)]
        if len(own) and not np.nanmedian(np.where(np.isfinite(own), own, np.inf)) <= FOLLOWS:
            axes.plot([j - 0.5, j + 0.5], [i - 0.5, i + 0.5], color=VERMILION, lw=0.9)
            axes.plot([j - 0.5, j + 0.5], [i + 0.5, i - 0.5], color=VERMILION, lw=0.9)


def _short(value: float) -> str:
    return f"{value:.0f}" if value >= 99.5 else f"{value:.2g}" if value >= 1e-3 else f"{value:.0e}".replace("e-0", "e-")


def _panel(axes: Axes, values: Values, words: str) -> None:
    """Cells coloured by the logarithm of their value, with the value in them."""
    logs = np.log10(np.where(values > 0, values, np.nan))
    low, high = (np.nanmin(logs), np.nanmax(logs)) if np.isfinite(logs).any() else (0.0, 1.0)
    axes.set_facecolor(PALE)
    axes.imshow(logs, cmap="YlGnBu", vmin=low, vmax=max(high, low + 0.5), origin="lower", aspect="auto")
    for (i, j), value in np.ndenumerate(values):
        if np.isfinite(value):
            share = (logs[i, j] - low) / max(high - low, 0.5) if np.isfinite(logs[i, j]) else 0.0
            axes.text(j, i, _short(value), ha="center", va="center", size=7.0, color="white" if share > DARK else INK)
    axes.set_title(words)
    axes.grid(visible=False)
    axes.tick_params(length=0)
