"""Estimates that rest on different assumptions, side by side."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from swingid.format import last_place, plus_minus
from swingid.report.style import new_figure
from swingid.result.plot import BLUE, GREEN
from swingid.result.result import COVERAGE_FACTOR, Result, combined

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COARSE = 30.0
"""An estimate so many times less certain than the others does not set the scale; its bar leaves the panel."""


def draw_kinds(result: Result) -> Figure | None:
    """Inertia by kind of projection against the answer, in percent, with 95 % bars.

    The band is that part of the answer's interval which comes from the data: what the rig's constants contribute is
    common to all kinds.
    """
    inertia = result.parameters.get("inertia")
    estimates = result.details.estimates if result.details else {}
    if inertia is None or not inertia.value or len(estimates) < 2:
        return None
    figure, (ax,) = new_figure(0.85 + 0.32 * len(estimates))
    own = 100 * COVERAGE_FACTOR * combined((e for e in result.budget if e.type == "A"), "inertia") / inertia.value
    if own > 0:
        ax.axvspan(-own, own, color=GREEN, alpha=0.22, lw=0, label="answer, 95 % from the data alone")
    ax.axvline(0.0, color=GREEN, lw=1.6)
    spreads = {name: 100 * COVERAGE_FACTOR * abs(u / inertia.value) for name, (_, u) in estimates.items()}
    finest = min((spread for spread in spreads.values() if np.isfinite(spread)), default=0.0)
    reach = own
    for row, (name, (value, uncertainty)) in enumerate(estimates.items()):
        off = 100 * (value / inertia.value - 1)
        bar = spreads[name] if np.isfinite(spreads[name]) else 0.0
        ax.errorbar(off, row, xerr=bar, fmt="o", ms=5, mew=0, color=BLUE, elinewidth=1.1, capsize=2.5)
        if bar <= COARSE * max(finest, own):
            reach = max(reach, abs(off) + bar)
        ax.annotate(
            _in_percent(off, 100 * uncertainty / abs(inertia.value)),
            (1.0, row),
            xycoords=("axes fraction", "data"),
            xytext=(6, 0),
            textcoords="offset points",
            va="center",
            size=8.5,
        )
    if reach > 0:
        ax.set_xlim(-1.12 * reach, 1.12 * reach)
        _mark_cut_bars(
            ax, [100 * (value / inertia.value - 1) for value, _ in estimates.values()], list(spreads.values())
        )
    ax.set_yticks(range(len(estimates)), list(estimates))
    ax.set_ylim(len(estimates) - 0.5, -0.5)
    ax.grid(visible=False, axis="y")
    ax.tick_params(axis="y", length=0)
    ax.set_xlabel("from the answer, % (right: ± standard uncertainty)")
    if own > 0:
        ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2)
    return figure


def _in_percent(off: float, uncertainty: float) -> str:
    """'0.0036 ± 0.0050 %': as decimals, so that the rows compare at a glance, unless these would be long."""
    if not (np.isfinite(uncertainty) and uncertainty > 1e-6):
        return plus_minus(off, uncertainty, "%", fine=True)
    places = max(0, -last_place(uncertainty))
    shown = f"{round(off, places) + 0.0:.{places}f}".replace("-", "−")
    return f"{shown} ± {uncertainty:.{places}f}\u00a0%"


def _mark_cut_bars(ax: Axes, offs: list[float], spreads: list[float]) -> None:
    """An arrow head where a bar leaves the panel."""
    low, high = ax.get_xlim()
    for row, (off, spread) in enumerate(zip(offs, spreads, strict=True)):
        for edge, cut, marker in ((low, off - spread < low, "<"), (high, off + spread > high, ">")):
            if cut:
                ax.plot([edge], [row], ls="", marker=marker, ms=5, mew=0, color=BLUE, clip_on=False)
