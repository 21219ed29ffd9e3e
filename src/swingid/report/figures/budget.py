"""Where the uncertainty of the inertia comes from."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

from swingid.format import percent
from swingid.report.style import new_figure
from swingid.result.plot import BLUE, GREY, INK, ORANGE
from swingid.result.result import Result, combined
from swingid.result.summary import folded, sorted_budget

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST = 9
KINDS = {"A": (BLUE, "", "type A: from the data"), "B": (ORANGE, "////", "type B: from the rig's constants")}

WHITE = {"facecolor": "white", "edgecolor": "none", "pad": 0.8}


def draw_budget(result: Result) -> Figure | None:
    """Bars of standard uncertainty in percent of the inertia, largest first, and their sum in squares."""
    inertia = result.parameters.get("inertia")
    entries = sorted_budget(result.budget, "inertia")
    if inertia is None or not inertia.value or not entries:
        return None
    scale = 1 / abs(inertia.value)
    shown, rest = folded(entries, MOST)
    bars = [(entry.source, entry.standard_uncertainty * scale, str(entry.type)) for entry in shown]
    if rest:
        kinds = {entry.type for entry in rest}
        left = "A" if kinds == {"A"} else "B" if kinds == {"B"} else "both"
        bars.append((f"{len(rest)} smaller ones", combined(rest, "inertia") * scale, left))
    bars.append(("all together", combined(entries, "inertia") * scale, "all"))
    figure, (ax,) = new_figure(0.95 + 0.3 * len(bars))
    seen: set[str] = set()
    for row, (_source, share, kind) in enumerate(bars):
        colour, hatch, label = KINDS.get(kind, (GREY if kind == "both" else INK, "", ""))
        first = bool(label) and kind not in seen
        seen.add(kind)
        ax.barh(
            row,
            100 * share,
            color=colour,
            hatch=hatch,
            edgecolor="white",
            lw=0,
            height=0.66,
            label=label if first else None,
        )
        ax.annotate(
            percent(share),
            (100 * share, row),
            xytext=(4, 0),
            textcoords="offset points",
            va="center",
            size=8.5,
            bbox=WHITE,
        )
    ax.set_yticks(range(len(bars)), ["\n".join(textwrap.wrap(source, 38)) for source, _, _ in bars])
    ax.invert_yaxis()
    ax.set_xlim(0, 115 * max(share for _, share, _ in bars) or 1.0)
    ax.locator_params(axis="x", nbins=6)
    ax.grid(visible=False, axis="y")
    ax.tick_params(axis="y", length=0)
    ax.set_xlabel("standard uncertainty, % of the answer")
    ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, borderaxespad=0.2)
    return figure
