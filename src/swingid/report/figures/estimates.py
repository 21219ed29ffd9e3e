"""Figures of the estimates of a result: by swing, log, time and kind of projection, and the uncertainty budget."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np

from swingid.format import common_exponent, last_place, percent, plus_minus, power_of_ten, pretty_unit
from swingid.report.style import beside, legend_above, name_rows, new_figure, points
from swingid.result.plot import BLUE, GREEN, GREY, INK, ORANGE, PALE, draw_swing_points, plot_result
from swingid.result.result import COVERAGE_FACTOR, Result, combined
from swingid.result.summary import folded, sorted_budget

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

HIDDEN = 5.0
"""How many times wider than the swings the answer's band must be for them to get a panel of their own."""

REACH = 0.3
"""The curve is shown within this share of the answer; it may come from ten times as far."""

COARSE = 30.0
"""An estimate so many times less certain than the others does not set the scale; its bar leaves the panel."""

MOST = 9

KINDS = {"A": (BLUE, "", "type A: from the data"), "B": (ORANGE, "////", "type B: from the rig's constants")}

WHITE = {"facecolor": "white", "edgecolor": "none", "pad": 0.8}


def draw_swings(result: Result) -> Figure | None:
    """`plot_result` on a figure of the report; None where the method gives one number for all swings.

    Where the band of the answer is so wide that the swings are a line in it, a second panel shows them alone.
    """
    swings = result.details.swings if result.details else None
    if swings is None or len(swings.times) == 0:
        return None
    inertia = result.main
    reach = COVERAGE_FACTOR * np.nan_to_num(swings.uncertainties)
    size = float(np.max(swings.values + reach) - np.min(swings.values - reach))
    hidden = inertia.interval95 is not None and inertia.interval95[1] - inertia.interval95[0] > HIDDEN * size
    apart = hidden and inertia.value != 0
    figure, axes = new_figure(5.0 if apart else 3.3, 2 if apart else 1)
    plot_result(result, axes[0])
    if apart:
        draw_swing_points(axes[1], swings, scale=100 / inertia.value, offset=-100.0)
        axes[1].axhline(0.0, color=GREEN, lw=1.6, zorder=0.6)
        axes[1].set_title("the swings alone, with what scatter and sensors explain (95 %)", pad=4)
        axes[1].set_ylabel("deviation from the estimate, %")
        axes[1].set_xlabel(axes[0].get_xlabel())
        axes[0].set_xlabel("")
        axes[1].set_xlim(axes[0].get_xlim())
    return figure


def draw_logs(result: Result) -> Figure | None:
    """`plot_result` of several logs on a figure of the report; None for one log."""
    if not result.per_log:
        return None
    figure, (axes,) = new_figure(3.3)
    plot_result(result, axes)
    return figure


def draw_convergence(result: Result) -> Figure | None:
    """The estimate over the log, ±5 % and ±1 % of the answer, and when it stays within these."""
    curve = result.details.convergence if result.details else None
    if curve is None or result.leading not in result.parameters:
        return None
    inertia = result.main
    exponent = common_exponent([inertia.value])
    scale = 10.0**-exponent
    figure, (ax,) = new_figure(2.9)
    ax.axvspan(*curve.settled, color=PALE, lw=0, zorder=0, label="averaged for the estimate")
    ax.axhline(inertia.value * scale, color=GREEN, lw=1.4, label="estimate")
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
    ax.set_ylabel(f"{result.leading}, {power}{pretty_unit(inertia.unit)}")
    legend_above(ax)
    return figure


def draw_kinds(result: Result) -> Figure | None:
    """Inertia by kind of projection against the answer, in percent, with 95 % bars.

    The band is that part of the answer's interval which comes from the data: what the rig's constants contribute is
    common to all kinds.
    """
    inertia = result.parameters.get(result.leading)
    estimates = result.details.estimates if result.details else {}
    if inertia is None or not inertia.value or len(estimates) < 2:
        return None
    figure, (ax,) = new_figure(0.85 + 0.32 * len(estimates))
    half_width = (
        100 * COVERAGE_FACTOR * combined((e for e in result.budget if e.type == "A"), result.leading) / inertia.value
    )
    if half_width > 0:
        ax.axvspan(-half_width, half_width, color=GREEN, alpha=0.22, lw=0, label="estimate, 95 % from the data alone")
    ax.axvline(0.0, color=GREEN, lw=1.6)
    spreads = {name: 100 * COVERAGE_FACTOR * abs(u / inertia.value) for name, (_, u) in estimates.items()}
    offs = {name: 100 * (value / inertia.value - 1) for name, (value, _) in estimates.items()}
    finest = min((spread for spread in spreads.values() if np.isfinite(spread)), default=0.0)
    reach = half_width
    for row, (name, off) in enumerate(offs.items()):
        bar = spreads[name] if np.isfinite(spreads[name]) else 0.0
        ax.errorbar(off, row, xerr=bar, **points(BLUE, elinewidth=1.1))
        if bar <= COARSE * max(finest, half_width):
            reach = max(reach, abs(off) + bar)
        beside(ax, row, _in_percent(off, 100 * estimates[name][1] / abs(inertia.value)))
    if reach > 0:
        ax.set_xlim(-1.12 * reach, 1.12 * reach)
        _mark_cut_bars(ax, list(offs.values()), list(spreads.values()))
    name_rows(ax, list(estimates))
    ax.set_xlabel("deviation from the estimate, % (right: ± standard uncertainty)")
    legend_above(ax)
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


def draw_budget(result: Result) -> Figure | None:
    """Bars of standard uncertainty in percent of the inertia, largest first, and their sum in squares."""
    inertia = result.parameters.get(result.leading)
    entries = sorted_budget(result.budget, result.leading)
    if inertia is None or not inertia.value or not entries:
        return None
    scale = 1 / abs(inertia.value)
    shown, rest = folded(entries, MOST)
    bars = [(entry.source, entry.standard_uncertainty * scale, str(entry.type)) for entry in shown]
    if rest:
        kinds = {entry.type for entry in rest}
        types = "A" if kinds == {"A"} else "B" if kinds == {"B"} else "both"
        bars.append((f"{len(rest)} smaller ones", combined(rest, result.leading) * scale, types))
    bars.append(("combined", combined(entries, result.leading) * scale, "all"))
    figure, (ax,) = new_figure(0.95 + 0.3 * len(bars))
    seen: set[str] = set()
    for row, (_source, share, kind) in enumerate(bars):
        colour, hatch, label = KINDS.get(kind, (GREY if kind == "both" else INK, "", ""))
        first = bool(label) and kind not in seen
        seen.add(kind)
        look: dict[str, Any] = {"color": colour, "hatch": hatch, "edgecolor": "white", "lw": 0, "height": 0.66}
        ax.barh(row, 100 * share, label=label if first else None, **look)
        place = (100 * share, row)
        ax.annotate(percent(share), place, (4, 0), textcoords="offset points", va="center", size=8.5, bbox=WHITE)
    ax.set_yticks(range(len(bars)), ["\n".join(textwrap.wrap(source, 38)) for source, _, _ in bars])
    ax.invert_yaxis()
    ax.set_xlim(0, 115 * max(share for _, share, _ in bars) or 1.0)
    ax.locator_params(axis="x", nbins=6)
    ax.grid(visible=False, axis="y")
    ax.tick_params(axis="y", length=0)
    ax.set_xlabel("standard uncertainty, % of the estimate")
    legend_above(ax, 2)
    return figure


def draw_distribution(result: Result) -> Figure | None:
    """Histogram of the draws of the leading parameter with both 95 % intervals; None without draws."""
    drawn = result.monte_carlo.parameters.get(result.leading) if result.monte_carlo else None
    parameter = result.parameters.get(result.leading)
    if drawn is None or parameter is None or not parameter.standard_uncertainty or parameter.interval95 is None:
        return None
    exponent = common_exponent([parameter.value])
    scale = 10.0**-exponent
    figure, (ax,) = new_figure(2.7)
    ax.hist(drawn.values * scale, bins="sqrt", density=True, color=BLUE, alpha=0.5, label="draws")
    reach = np.linspace(-4, 4, 161)
    density = np.exp(-(reach**2) / 2) / np.sqrt(2 * np.pi) / (parameter.standard_uncertainty * scale)
    ax.plot(
        (parameter.value + reach * parameter.standard_uncertainty) * scale, density, color=GREEN, label="linear budget"
    )
    for ends, colour, style in ((drawn.interval95, BLUE, "-"), (parameter.interval95, GREEN, (0, (4, 2)))):
        for end in ends:
            ax.axvline(end * scale, color=colour, lw=1.1, ls=style)
    power = f"{power_of_ten(exponent)} " if exponent else ""
    ax.set_xlabel(f"{result.leading}, {power}{pretty_unit(parameter.unit)}")
    ax.set_yticks([])
    legend_above(ax)
    return figure
