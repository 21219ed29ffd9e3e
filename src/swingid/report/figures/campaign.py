"""Figures of a campaign: errors by level, coverage, boxes, maps over two factors, and the effect of each factor."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from swingid.format import percent
from swingid.report.figures.studies import LOOKS
from swingid.report.style import legend_above, name_rows, new_figure, plain_powers, points
from swingid.result.plot import BLUE, GREEN, GREY, INK, ORANGE, PALE, SKY, VERMILION
from swingid.result.result import COVERAGE_FACTOR
from swingid.study.campaign.summary import cell_name, median_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from swingid.study.campaign import Summary
    from swingid.study.campaign.summary import Cell, Effect

LEGEND_COLUMNS = 4

DECADE = 8.0
"""Ratio of errors from which on their axis is logarithmic: below it has no power of ten to label."""

ROW, METHOD = 0.28, 0.1
"""Height of a level by name, in inches, at least, and for each method."""

MANY_LOOKS = (*LOOKS, (GREEN, "P"), (INK, "X"), (GREY, "h"))
"""Colour and marker of a method, in turn."""

WANTED = 95.0

LEAST = 90.0
"""%, from which the axis reaches at least to 100 %."""

Values = np.ndarray[Any, np.dtype[np.float64]]

WHISKERS = (2.5, 97.5)
"""Percentiles at the ends of the whiskers: 95 % lie between."""

LINEAR = 3.0
"""Errors in stated uncertainties up to which the axis is linear."""

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

MOST = 20

DECADES = 4.0
"""Below so many decades from the largest effect the axis is linear."""


def draw_levels(summary: Summary, factor: str, quantity: str = "inertia") -> Figure | None:
    """RMSE by level: lines over a number, with the Cramér–Rao bound where it is known, dots by name else.

    None where a factor has fewer than two levels with an answer.
    """
    cells, levels = _of_factor(summary, factor, quantity, lambda cell: cell.statistics.rmse[0] > 0)
    if not cells:
        return None
    numbers = _numbers(levels)
    figure, ax = _by_method(cells, levels, 1, high=not numbers)
    for of_method, places, look in _each_method(cells, levels):
        sizes, errors = ([100 * cell.statistics.rmse[k] for cell in of_method] for k in (0, 1))
        if numbers:
            look["fmt"] += "-"
            ax.errorbar([numbers[cell.level] for cell in of_method], sizes, yerr=errors, **look)
        else:
            ax.errorbar(sizes, places, xerr=errors, **look)
    if numbers:
        _over_numbers(ax, factor, list(numbers.values()), cells, numbers)
    else:
        ax.set_xscale("log")
        plain_powers(ax.xaxis)
        ax.set_xlabel("RMSE of the inertia, %")
        name_levels(ax, levels)
    legend_above(ax, LEGEND_COLUMNS)
    return figure


def _of_factor(
    summary: Summary, factor: str, quantity: str, known: Callable[[Cell], bool]
) -> tuple[list[Cell], list[str]]:
    """The cells of a factor with an entry, none where fewer than two levels have one; and all its levels."""
    cells = [c for c in summary.by_level if (c.factor, c.quantity) == (factor, quantity)]
    entries = [cell for cell in cells if known(cell)]
    enough = len({cell.level for cell in entries}) > 1
    return entries if enough else [], list(dict.fromkeys(cell.level for cell in cells))


def _methods(cells: Sequence[Cell]) -> list[str]:
    return list(dict.fromkeys(cell.method for cell in cells))


def _by_method(cells: Sequence[Cell], levels: Sequence[str], more: int, *, high: bool) -> tuple[Figure, Axes]:
    """An empty figure for all methods; more: entries of the legend beside them; high: with a row per level."""
    count = len(_methods(cells))
    rows = math.ceil((count + more) / LEGEND_COLUMNS)
    figure, (ax,) = new_figure((0.8 + max(ROW, METHOD * count) * len(levels) if high else 2.8) + 0.2 * rows)
    return figure, ax


def _each_method(cells: Sequence[Cell], levels: list[str]) -> Iterator[tuple[list[Cell], list[float], dict[str, Any]]]:
    """The cells of each method, their rows, and how the method is drawn."""
    for k, method in enumerate(methods := _methods(cells)):
        colour, marker = MANY_LOOKS[k % len(MANY_LOOKS)]
        of_method = [cell for cell in cells if cell.method == method]
        places = [levels.index(cell.level) + shift(k, methods) for cell in of_method]
        yield of_method, places, points(colour, marker, elinewidth=1.0, capsize=0, label=method)


def shift(k: int, methods: Sequence[str]) -> float:
    """How far below the middle of a level's row the k-th method stands."""
    return (k - (len(methods) - 1) / 2) * 0.7 / len(methods)


def name_levels(ax: Axes, levels: Sequence[str]) -> None:
    """Levels by name on the vertical axis, the first on top, with lines between them."""
    name_rows(ax, levels)
    for k in range(len(levels) - 1):
        ax.axhline(k + 0.5, color=PALE, lw=0.8, zorder=0.4)


def _numbers(levels: list[str]) -> dict[str, float]:
    """The levels as numbers, none where one is no number."""
    try:
        return {level: float(level) for level in levels}
    except ValueError:
        return {}


def _over_numbers(ax: Axes, factor: str, at: list[float], cells: list[Cell], numbers: dict[str, float]) -> None:
    """Axes over a number, logarithmic where it spans more than a decade, and the bound."""
    bounds = {
        numbers[c.level]: 100 * c.statistics.rmse[0] * math.sqrt(c.statistics.efficiency[0])
        for c in cells
        if math.isfinite(c.statistics.efficiency[0])
    }
    if bounds:
        where = sorted(bounds)
        ax.plot(where, [bounds[x] for x in where], "--", color=GREY, lw=1.2, label="Cramér–Rao bound")
    sizes = [100 * c.statistics.rmse[0] for c in cells] + list(bounds.values())
    if max(sizes) > DECADE * min(sizes):
        ax.set_yscale("log")
        plain_powers(ax.yaxis)
    else:
        ax.set_ylim(bottom=0.0)
        ax.yaxis.set_major_formatter(lambda value, _: f"{value:.6f}".rstrip("0").rstrip("."))
    if min(at) > 0 and max(at) > 10 * min(at):
        ax.set_xscale("log")
        plain_powers(ax.xaxis)
    else:
        ax.set_xticks(np.unique(at), [f"{place:g}" for place in np.unique(at)])
    ax.set(xlabel=factor, ylabel="RMSE of the inertia, %")


def draw_coverage(summary: Summary) -> Figure | None:
    """Share of the intervals that contain the true value, with its binomial standard error; None without intervals."""
    cells = [cell for cell in summary.overall if _has_intervals(cell)]
    if not cells:
        return None
    figure, (ax,) = new_figure(0.8 + 0.26 * len(cells))
    for row, cell in enumerate(cells):
        shares, bars = _shares([cell])
        ax.errorbar(shares, row, xerr=bars, **points(BLUE))
    _share_axis(ax, cells)
    name_rows(ax, [cell_name(cell) for cell in cells])
    return figure


def draw_coverage_by(summary: Summary, factor: str, quantity: str = "inertia") -> Figure | None:
    """The same for every method at each level of a factor; None with fewer than two levels that have intervals."""
    cells, levels = _of_factor(summary, factor, quantity, _has_intervals)
    if not cells:
        return None
    figure, ax = _by_method(cells, levels, 0, high=True)
    for of_method, places, look in _each_method(cells, levels):
        shares, bars = _shares(of_method)
        ax.errorbar(shares, places, xerr=bars, **look)
    _share_axis(ax, cells)
    name_levels(ax, levels)
    legend_above(ax, LEGEND_COLUMNS)
    return figure


def _has_intervals(cell: Cell) -> bool:
    return math.isfinite(cell.statistics.coverage[0])


def _shares(cells: Sequence[Cell]) -> tuple[list[float], list[list[float]]]:
    """Coverage (%) of cells, and lengths of its bars to both sides, none beyond 100 %."""
    shares, errors = ([100 * cell.statistics.coverage[k] for cell in cells] for k in (0, 1))
    return shares, [errors, [min(error, 100.0 - share) for share, error in zip(shares, errors, strict=True)]]


def _share_axis(ax: Axes, cells: Sequence[Cell]) -> None:
    """The axis of shares (%), with the line of the stated coverage probability."""
    lowest = min(100 * (cell.statistics.coverage[0] - 2 * cell.statistics.coverage[1]) for cell in cells)
    ax.axvline(WANTED, color=GREEN, lw=1.4, zorder=0.5)
    ax.set_xlim(max(min(lowest, LEAST), -2.0), 101.0)
    ax.set_xlabel("95 % intervals that contain the true value, % (bars: one binomial standard error)")


def draw_boxes(summary: Summary) -> Figure | None:
    """Absolute relative errors (log scale) and errors in standard uncertainties, a box per method; None without any."""
    cells = [cell for cell in summary.overall if cell.statistics.answered]
    if not cells:
        return None
    sizes, claimed = [], []
    for cell in cells:
        of_cell = (summary.columns["method"] == cell.method) & (summary.columns["quantity"] == cell.quantity)
        error = summary.columns["error"][of_cell]
        u = summary.columns["u"][of_cell] / np.abs(summary.columns["truth"][of_cell])
        sizes.append(100 * np.abs(error[np.isfinite(error)]))
        claimed.append((error / u)[np.isfinite(error / u)])
    figure, (left, right) = new_figure(1.2 + 0.3 * len(cells), ncols=2, sharey=True)
    _boxes(left, sizes)
    left.set_xscale("log")
    plain_powers(left.xaxis)
    left.set_xlabel("size of the error, %")
    name_rows(left, [cell_name(cell) for cell in cells])
    _boxes(right, claimed)
    right.axvspan(-COVERAGE_FACTOR, COVERAGE_FACTOR, color=GREEN, alpha=0.15, lw=0)
    far = max((float(np.max(np.abs(values))) for values in claimed if len(values)), default=0.0)
    if far > 10:
        right.set_xscale("symlog", linthresh=LINEAR, linscale=1.5)
        right.set_xlim(-1.5 * far, 1.5 * far)
        power = 10.0 ** np.floor(np.log10(far))
        _ticks(right, [-power, -2.0, 0.0, 2.0, power])
    else:
        reach = max(1.1 * far, 3.0)
        right.set_xlim(-reach, reach)
    right.set_xlabel("error, in stated standard uncertainties")
    right.grid(visible=False, axis="y")
    right.tick_params(axis="y", length=0)
    return figure


def _ticks(axes: Axes, ticks: Sequence[float]) -> None:
    """Ticks of the horizontal axis at these places alone."""
    axes.set_xticks(ticks, [f"{tick:g}".replace("-", "−", 1) if tick < 0 else f"{tick:g}" for tick in ticks])
    axes.minorticks_off()


def _boxes(axes: Axes, groups: list[Values]) -> None:
    axes.boxplot(
        groups,
        positions=range(len(groups)),
        orientation="horizontal",
        widths=0.5,
        whis=WHISKERS,
        patch_artist=True,
        manage_ticks=False,
        boxprops={"facecolor": SKY, "edgecolor": BLUE, "lw": 0.8},
        medianprops={"color": INK, "lw": 1.4},
        whiskerprops={"color": BLUE, "lw": 0.8},
        capprops={"color": BLUE, "lw": 0.8},
        flierprops={"marker": ".", "ms": 3, "mec": BLUE, "mew": 0, "mfc": BLUE, "alpha": 0.4, "rasterized": False},
    )


def draw_map(summary: Summary, pair: tuple[str, str]) -> Figure | None:
    """Four panels over the levels of two factors, the median over all else; None where one has fewer than two levels.

    Empty: no run there came to an end. The error is that of the first method.
    """
    kinds = [float if summary.columns[name].dtype.kind in "fi" else str for name in pair]
    across, up = (np.unique(summary.columns[name].astype(kind)) for name, kind in zip(pair, kinds, strict=True))
    if len(across) < 2 or len(up) < 2:
        return None
    figure, panels = new_figure(2.0 + 0.5 * len(up), 2, ncols=2, sharex=True, sharey=True)
    method = summary.plan.tables.base.methods[:1]
    rows = summary.columns["method"] == (method[0] if method else "")
    for axes, (column, factor, words) in zip(panels, PANELS, strict=True):
        values = np.full((len(up), len(across)), np.nan)
        for (i, y), (j, x) in product(enumerate(up), enumerate(across)):
            of_cell = rows & (summary.columns[pair[0]] == x) & (summary.columns[pair[1]] == y)
            values[i, j] = factor * median_of(np.abs(summary.columns[column][of_cell]))
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


def _label(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _cross_out(axes: Axes, summary: Summary, pair: tuple[str, str], levels: tuple[Values, Values]) -> None:
    """A cross over the cells where the loop does not follow in half of the runs."""
    share = summary.columns["tracking"] / summary.columns["wanted"]
    for (i, y), (j, x) in product(enumerate(levels[1]), enumerate(levels[0])):
        shares = share[(summary.columns[pair[0]] == x) & (summary.columns[pair[1]] == y)]
        if len(shares) and not np.nanmedian(np.where(np.isfinite(shares), shares, np.inf)) <= FOLLOWS:
            for side in (0.5, -0.5):
                axes.plot([j - 0.5, j + 0.5], [i - side, i + side], color=VERMILION, lw=0.9)


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
        place: dict[str, Any] = {"xycoords": ("axes fraction", "data"), "va": "center", "annotation_clip": False}
        ax.annotate(f"{percent(effect.rmse[0])} at {effect.rmse[1]}", (1.01, row), size=8.0, color=INK, **place)
    smallest = 100 * _size(effects[-1])
    if smallest < largest / 30:
        linear = max(largest / 10**DECADES, min(smallest, largest / 10))
        ax.set_xscale("symlog", linthresh=linear, linscale=0.5)
        decades = 10.0 ** np.arange(np.ceil(np.log10(linear)), np.floor(np.log10(largest)) + 1)
        decades = decades[:: max(1, len(decades) // 3)]
        _ticks(ax, [*(-decades[::-1]), 0.0, *decades])
    ax.set_xlim(-1.5 * largest, 1.5 * largest)
    ax.axvline(0.0, color=INK, lw=0.8)
    name_rows(ax, [effect.factor for effect in effects])
    ax.set_xlabel("error of the inertia, %")
    legend_above(ax)
    return figure


def _size(effect: Effect) -> float:
    return max(abs(effect.low[0]), abs(effect.high[0]), effect.rmse[0])
