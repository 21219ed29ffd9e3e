"""The picture of a result: one inertia per swing, the estimate, its interval."""

from __future__ import annotations

from pathlib import PurePath
from typing import TYPE_CHECKING, Any

import numpy as np

from swingid.errors import UsageError
from swingid.format import common_exponent, plus_minus, power_of_ten, pretty_unit
from swingid.result.data import ResultData, SwingSeries
from swingid.uncertainty.budget import Parameter, combined
from swingid.uncertainty.freedom import COVERAGE_FACTOR

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BLUE, ORANGE, GREEN, VERMILION, PURPLE, SKY = "#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7", "#56B4E9"
INK, GREY, PALE = "#222222", "#767676", "#E4E7EA"
"""Okabe and Ito's colours, which colour-blind readers distinguish, and the neutral tones beside them."""

SIDES = ((1.0, "^", BLUE, "upper turning points"), (-1.0, "v", ORANGE, "lower turning points"))


def plot_result(result: ResultData, ax: Axes | None = None) -> Axes:
    """Draw the inertia of every swing with its 95 % interval, and the estimate with its own, into `ax`.

    Of several logs each one's inertia is drawn in the place of the swings'.
    Without `ax` a new figure is made by pyplot. Upper and lower turning points have their own marker and colour: a
    gap between them shows friction that depends on the direction, or an error of the angle's zero.
    Raises UsageError for a refused result, which has no number to draw.
    """
    if result.leading not in result.parameters:
        reason = f": {result.error.message}" if result.error else "."
        raise UsageError(f"a result without a number cannot be plotted{reason}", code="nothing-to-plot")
    if ax is None:
        import matplotlib.pyplot as plt

        ax = plt.subplots(figsize=(6.8, 3.6), layout="constrained")[1]
    inertia = result.main
    exponent = common_exponent([inertia.value])
    scale = 10.0**-exponent
    _draw_estimate(ax, inertia, scale)
    swings = result.details.swings if result.details else None
    if result.per_log:
        _draw_logs(ax, result, scale)
    elif swings is not None and len(swings.times):
        draw_swing_points(ax, swings, scale)
    else:
        ax.text(0.5, 0.9, "this method gives no number per swing", transform=ax.transAxes, ha="center", color=GREY)
        if result.details:
            ax.set_xlim(result.details.start, result.details.stop)
    unit = pretty_unit(inertia.unit)
    quantity = "mass" if inertia.unit == "kg" else result.leading
    ax.set_xlabel("" if result.per_log else "time, s")
    ax.set_ylabel(f"{quantity}, {power_of_ten(exponent)} {unit}" if exponent else f"{quantity}, {unit}".rstrip(", "))
    ax.ticklabel_format(axis="y", useOffset=False, style="plain")
    _add_deviation(ax, inertia.value * scale)
    ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, frameon=False, borderaxespad=0.2)
    return ax


def _draw_estimate(ax: Axes, inertia: Parameter, scale: float) -> None:
    estimate = plus_minus(inertia.value, inertia.standard_uncertainty, inertia.unit, fine=True)
    if inertia.interval95 is not None:
        low, high = inertia.interval95
        ax.axhspan(low * scale, high * scale, color=GREEN, alpha=0.22, lw=0, zorder=0.5, label="95 % interval")
    ax.axhline(inertia.value * scale, color=GREEN, lw=1.6, zorder=3, label=f"estimate {estimate}")


def _draw_logs(ax: Axes, result: ResultData, scale: float) -> None:
    """One point per log: thin bars hold everything (95 %), thick ones type A alone."""
    names = [file_label(str(of_log.provenance.get("log") or f"log {k + 1}")) for k, of_log in enumerate(result.per_log)]
    first = next(k for k, of_log in enumerate(result.per_log) if of_log.leading in of_log.parameters)
    for k, of_log in enumerate(result.per_log):
        if of_log.leading not in of_log.parameters:
            ax.annotate("refused", (k, 0.5), xycoords=("data", "axes fraction"), rotation=90, color=GREY, ha="center")
            continue
        scatter = [entry for entry in of_log.budget if entry.type == "A"]
        value, whole = scale * of_log.main.value, of_log.main.standard_uncertainty or 0.0
        bars = ((whole, 0.9, "a log, 95 %"), (combined(scatter, of_log.leading), 3.0, "type A alone"))
        for u, width, label in bars:
            reach, named = COVERAGE_FACTOR * u * scale, label if k == first else None
            ax.errorbar(k, value, yerr=reach, fmt="o", ms=5, color=BLUE, elinewidth=width, label=named)
    ax.set_xticks(range(len(names)), names, parse_math=False)
    ax.set_xlim(-0.5, len(names) - 0.5)
    if len(names) > 4:
        ax.tick_params(axis="x", labelrotation=30)


def draw_swing_points(ax: Axes, swings: SwingSeries, scale: float, offset: float = 0.0) -> None:
    """Points scale·value + offset with their 95 % bars, one colour and marker per side."""
    bars = COVERAGE_FACTOR * np.nan_to_num(swings.uncertainties, nan=0.0) * abs(scale)
    many = len(swings.times) > 150
    for side, marker, colour, label in SIDES:
        here = swings.sides == side
        if not here.any():
            continue
        ax.errorbar(
            swings.times[here],
            scale * swings.values[here] + offset,
            yerr=bars[here],
            fmt=marker,
            color=colour,
            ms=3 if many else 4.5,
            mew=0,
            elinewidth=0.5 if many else 0.8,
            label=label,
        )


def _add_deviation(ax: Axes, estimate: float) -> None:
    """A second scale on the right: deviation from the estimate in percent."""

    def to_percent(values: Any) -> Any:
        return 100 * (np.asarray(values) / estimate - 1)

    def from_percent(values: Any) -> Any:
        return estimate * (1 + np.asarray(values) / 100)

    if estimate:
        right = ax.secondary_yaxis("right", functions=(to_percent, from_percent))
        right.set_ylabel("from the estimate, %")


def file_label(path: str) -> str:
    """The name of a file as matplotlib can draw it, also one that is no text."""
    return PurePath(path).name.encode("utf-8", "backslashreplace").decode()
