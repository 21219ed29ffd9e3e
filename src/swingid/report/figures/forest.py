"""The answers of several methods to several logs on one axis."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from swingid.report.style import legend_above, new_figure
from swingid.result.plot import BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILION, file_label
from swingid.result.result import COVERAGE_FACTOR

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from swingid.study.compare import Comparison, Trial

LOOKS = ((BLUE, "o"), (ORANGE, "s"), (PURPLE, "D"), (SKY, "^"), (VERMILION, "v"))
"""Colour and marker of a log, in turn."""

WIDEST = 40.0
"""A bar so many times longer than the shortest does not set the scale; an arrow shows that it leaves the panel."""


def draw_forest(comparison: Comparison) -> Figure | None:
    """Inertia by method with 95 % bars, in percent from the truth of a simulated log, else from the first answer.

    None where no method answers.
    """
    answered = [trial for trial in comparison.trials if "inertia" in trial.result.parameters]
    if not answered:
        return None
    methods = list(dict.fromkeys(trial.method for trial in comparison.trials))
    logs = comparison.logs
    figure, (ax,) = new_figure(1.1 + (0.24 + 0.14 * len(logs)) * len(methods))
    origins = {log: _origin(comparison.of(log)) for log in logs}
    points = []
    for trial in answered:
        k = logs.index(trial.log)
        row = methods.index(trial.method) + (k - (len(logs) - 1) / 2) * 0.6 / max(len(logs), 1)
        off = 100 * (trial.result.inertia.value / origins[trial.log] - 1)
        u = trial.result.inertia.standard_uncertainty
        points.append((trial, row, off, 100 * COVERAGE_FACTOR * (u or 0.0) / abs(origins[trial.log])))
    reach = _reach([off for _, _, off, _ in points], [bar for *_, bar in points])
    for trial, row, off, bar in points:
        colour, marker = LOOKS[logs.index(trial.log) % len(LOOKS)]
        ax.errorbar(off, row, xerr=bar, fmt=marker, ms=5, mew=0, color=colour, elinewidth=1.2, capsize=2.5)
        _arrow_where_outside(ax, off, row, reach, colour)
    true = any(trial.truth is not None for trial in answered)
    ax.axvline(0.0, color=GREEN, lw=1.4, zorder=0.5)
    ax.set_xlim(-reach, reach)
    _name_rows(ax, methods, {trial.method for trial in answered})
    ax.set_xlabel(f"inertia from {'the truth' if true else 'the first method that answers'}, % (bars: 95 %)")
    if len(logs) > 1:
        for k, log in enumerate(logs):
            colour, marker = LOOKS[k % len(LOOKS)]
            ax.plot([], [], marker, ms=5, mew=0, color=colour, label=file_label(log))
        legend_above(ax)
    return figure


def _origin(trials: tuple[Trial, ...]) -> float:
    """Where a log's axis is 0: the truth, else the first answer."""
    for trial in trials:
        if trial.truth is not None:
            return trial.truth
    return next((t.result.inertia.value for t in trials if "inertia" in t.result.parameters), 1.0)


def _reach(offsets: list[float], bars: list[float]) -> float:
    """Half-width of the panel: everything, but for what lies so far out that the rest would be a line."""
    ends = np.abs(offsets) + np.array(bars)
    shown = ends[ends <= WIDEST * max(float(np.min(ends)), 1e-4)]
    return 1.15 * float(max(shown.max(), 1e-6))


def _arrow_where_outside(ax: Axes, off: float, row: float, reach: float, colour: str) -> None:
    if abs(off) <= reach:
        return
    edge = float(np.copysign(0.98 * reach, off))
    ax.annotate(
        f"{off:+.2g} %",
        (edge, row),
        xytext=(-40 if off > 0 else 40, 0),
        textcoords="offset points",
        size=8.5,
        va="center",
        ha="center",
        color=colour,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.5},
        arrowprops={"arrowstyle": "->", "color": colour},
    )


def _name_rows(ax: Axes, methods: list[str], answered: set[str]) -> None:
    ax.set_yticks(range(len(methods)), methods)
    for label, method in zip(ax.get_yticklabels(), methods, strict=True):
        if method not in answered:
            label.set_color(GREY)
            ax.annotate(
                "refused",
                (0.02, methods.index(method)),
                xycoords=("axes fraction", "data"),
                va="center",
                size=8.5,
                color=GREY,
            )
    ax.set_ylim(len(methods) - 0.5, -0.5)
    ax.grid(visible=False, axis="y")
    ax.tick_params(axis="y", length=0)
