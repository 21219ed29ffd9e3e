"""Figures of a result over its log: channels, turning points, residuals, and friction against speed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from swingid.numerics.arrays import Array
from swingid.recording.recording import Recording
from swingid.report.style import envelope, legend_above, new_figure, prefixed
from swingid.result.data import Changing
from swingid.result.plot import BLUE, GREY, INK, ORANGE, PALE, PURPLE, SIDES, SKY, VERMILION
from swingid.result.result import COVERAGE_FACTOR, Details, FrictionCurve

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


CLOSE = 5
"""Turning points in the close look."""

LARGEST = 25
"""Half of its length in half-lengths of a modulating function."""

MOST_DOTS = 800

BINS = 120

_SAMPLE = ("sample", "angle")

CHANGING = {"friction": "friction", "zero": "zero of the angle"}
"""What may change within a log, in words."""

LONG = 36
"""Letters of a law's name that no longer leave room for two columns of the legend."""


@dataclass(frozen=True)
class Panel:
    """One quantity over time, with a second line behind it where there is one to compare."""

    label: str
    unit: str
    values: Array
    colour: str
    behind: Array | None = None


def draw_log(log: Recording, unused: Iterable[tuple[float, float]], *, linear: bool) -> Figure:
    """Panels of all channels that `log` has; the parts `unused` (s) are greyed."""
    panels = panels_of(log, linear=linear)
    figure, axes = new_figure(0.6 + 1.05 * len(panels), len(panels), sharex=True)
    for ax, panel in zip(axes, panels, strict=True):
        draw_panel(ax, log.time, panel)
        for begin, end in unused:
            ax.axvspan(begin, end, color=PALE, lw=0, zorder=0)
    axes[-1].set_xlabel("time, s")
    axes[-1].set_xlim(log.time[0], log.time[-1])
    figure.align_ylabels(axes)
    return figure


def panels_of(log: Recording, *, linear: bool) -> list[Panel]:
    """The channels that the log has, in the order of the drawing, in SI units."""
    angle, name = ("m", "position") if linear else ("rad", "angle")
    panels = [Panel(name, angle, log.angle, BLUE, log.reference)]
    if log.reference is not None:
        panels.append(Panel("tracking error", angle, log.reference - log.angle, VERMILION))
    panels += drives_of(log, linear=linear)
    if log.adaptive_gain is not None and np.isfinite(log.adaptive_gain).any():
        made = log.metadata.get("simulation")
        backstepping = isinstance(made, dict) and str(made.get("controller")).startswith("Backstepping")
        panels.append(Panel("estimate α̂₂" if backstepping else "adaptive gain k̃", "", log.adaptive_gain, INK))
    return panels


def drives_of(log: Recording, *, linear: bool) -> list[Panel]:
    """The channels of a log that drive the axis: wheel, voltage, torque or force."""
    panels = []
    if log.wheel_angle is not None:
        # 10 ms, or one step of a slower log on either side
        span = max(0.01, 2 / log.rate) if len(log) > 1 else 0.01
        panels.append(Panel("wheel speed", "rad/s", speed_of(log.time, log.wheel_angle, span), PURPLE))
    if log.voltage is not None:
        panels.append(Panel("voltage", "V", log.voltage, ORANGE))
    if log.torque is not None:
        panels.append(Panel("force" if linear else "torque", "N" if linear else "N m", log.torque, ORANGE))
    return panels


def speed_of(time: Array, angle: Array, span: float) -> Array:
    """Difference quotient of `angle` over about `span` seconds around each sample, for drawing only."""
    first = np.searchsorted(time, time - 0.5001 * span)
    last = np.searchsorted(time, time + 0.5001 * span, side="right") - 1
    spread = time[last] - time[first]
    usable = spread > 0
    return np.where(usable, (angle[last] - angle[first]) / np.where(usable, spread, 1.0), np.nan)


def draw_panel(ax: Axes, time: Array, panel: Panel) -> None:
    """One quantity over time, with the prefix of its unit that suits it."""
    factor, unit = prefixed(panel.values, panel.unit)
    if panel.behind is not None:
        ax.plot(*envelope(time, panel.behind * factor), color=GREY, lw=0.9, ls=(0, (4, 2)))
    ax.plot(*envelope(time, panel.values * factor), color=panel.colour, lw=0.8)
    ax.set_title(f"{panel.label} (dashed: its reference)" if panel.behind is not None else panel.label, pad=3)
    ax.set_ylabel(unit)
    ax.locator_params(axis="y", nbins=4)


def draw_turning_points(log: Recording, details: Details, *, linear: bool) -> Figure | None:
    """The angle with its turning points; below, five of them with the support of one modulating function each."""
    times = details.turning_times
    if len(times) == 0:
        return None
    factor, unit = prefixed(log.angle, "m" if linear else "rad")
    figure, (whole, close) = new_figure(3.9, 2)
    label = f"{'position' if linear else 'angle'}, {unit}"
    _draw_angle(whole, log, details, factor, (float(log.time[0]), float(log.time[-1])))
    for k, (begin, end) in enumerate(details.unused(float(log.time[0]), float(log.time[-1]))):
        whole.axvspan(begin, end, color=PALE, lw=0, zorder=0, label=None if k else "not used")
    span = _close_span(details, log.duration)
    _draw_angle(close, log, details, factor, span)
    if details.window is not None:
        _draw_windows(close, times[(times > span[0]) & (times < span[1])], details.window)
    close.set_xlabel("time, s")
    for ax in (whole, close):
        ax.set_ylabel(label)
        legend_above(ax)
    return figure


def _close_span(details: Details, duration: float) -> tuple[float, float]:
    """Part of the log around its middle turning point: a few swings, fewer where windows would be too small to see."""
    times = details.turning_times
    half = CLOSE / 2 * float(np.median(np.diff(times))) if len(times) > 1 else 0.1 * duration
    if details.window is not None:
        half = min(half, LARGEST * details.window)
    centre = float(times[(len(times) - 1) // 2])
    return centre - half, centre + half


def _draw_angle(ax: Axes, log: Recording, details: Details, factor: float, span: tuple[float, float]) -> None:
    inside = (log.time >= span[0]) & (log.time <= span[1])
    ax.plot(*envelope(log.time[inside], log.angle[inside] * factor), color=GREY, lw=0.8)
    upper = sides_of(details.turning_angles)
    for side, marker, colour, label in SIDES:
        here = (upper == side) & (details.turning_times >= span[0]) & (details.turning_times <= span[1])
        ax.plot(
            details.turning_times[here],
            details.turning_angles[here] * factor,
            ls="",
            marker=marker,
            ms=5 if len(details.turning_times) < 120 else 3,
            mew=0,
            color=colour,
            label=label if span[0] <= log.time[0] else None,
            clip_on=False,
        )
    ax.set_xlim(span)


def sides_of(angles: Array) -> Array:
    """+1 for the upper, −1 for the lower ones of alternating turning points."""
    if len(angles) < 2:
        return np.ones(len(angles))
    before = np.concatenate([[angles[1]], angles[:-1]])
    return np.where(angles >= before, 1.0, -1.0)


def _draw_windows(ax: Axes, centres: Array, half: float) -> None:
    """A bump (1 − s²)³ at the foot of the panel for each shown turning point."""
    s = np.linspace(-1, 1, 61)
    height = 0.28 * (1 - s**2) ** 3
    look: dict[str, Any] = {"color": SKY, "alpha": 0.35, "lw": 0, "zorder": 1, "transform": ax.get_xaxis_transform()}
    for k, centre in enumerate(centres):
        label = "a modulating function" if k == 0 else None
        ax.fill_between(centre + half * s, 0.0, height, label=label, **look)


def draw_residuals(details: Details, *, linear: bool) -> Figure | None:
    """Mean torque (or force) that each window leaves, or the angle that each sample does, and how they are spread."""
    known = np.isfinite(details.residuals)
    if known.sum() < 2:
        return None
    times, values = details.residual_times[known], details.residuals[known]
    factor, unit = prefixed(values, details.residual_unit or ("N" if linear else "N m"))
    each, what = ("window", f"mean {'force' if linear else 'torque'}") if details.residual_unit is None else _SAMPLE
    figure, (ax, spread) = new_figure(2.2, ncols=2, sharey=True, width_ratios=(5, 1))
    if len(times) > MOST_DOTS:
        _draw_bands(ax, times, values * factor, f"all {each}s")
    else:
        ax.plot(times, values * factor, ls="", marker="o", ms=2.6, mew=0, color=BLUE, alpha=0.7)
    for axes in (ax, spread):
        axes.axhline(0, color=GREY, lw=0.8)
    spread.hist(
        values * factor, bins="sqrt" if len(values) < 2500 else 50, orientation="horizontal", color=BLUE, alpha=0.7
    )
    spread.set_xlabel(f"{each}s")
    spread.grid(visible=False)
    ax.set_xlabel("time, s" if each == "sample" else "time of the window, s")
    ax.set_ylabel(f"{what} left, {unit}")
    return figure


def _draw_bands(ax: Axes, times: Array, values: Array, everything: str) -> None:
    """Many values as bands: all of them, the middle 90 %, and the median, in equal counts."""
    groups = np.array_split(np.arange(len(times)), BINS)
    middle = [float(np.mean(times[group])) for group in groups]
    low, fifth, median, last, high = np.array([np.quantile(values[g], (0, 0.05, 0.5, 0.95, 1)) for g in groups]).T
    ax.fill_between(middle, low, high, color=BLUE, alpha=0.2, lw=0, label=everything)
    ax.fill_between(middle, fifth, last, color=BLUE, alpha=0.4, lw=0, label="nine in ten")
    ax.plot(middle, median, color=INK, lw=0.8, label="median")
    legend_above(ax)


def draw_friction(curve: FrictionCurve, *, linear: bool) -> Figure | None:
    """Torque (or force) over speed with 95 % bars; the law is drawn apart for the two directions of motion."""
    known = np.isfinite(curve.torques)
    if not known.any():
        return None
    torque, speed = ("N", "m/s") if linear else ("N m", "rad/s")
    factor, unit = prefixed(np.concatenate([curve.torques, curve.law_torques]), torque)
    speed_factor, speed_unit = prefixed(curve.speeds, speed)
    figure, (ax,) = new_figure(3.1)
    ax.axhline(0, color=GREY, lw=0.7)
    ax.axvline(0, color=GREY, lw=0.7)
    for k, side in enumerate((curve.speeds < 0, curve.speeds > 0)):
        ax.plot(
            curve.speeds[side] * speed_factor,
            curve.law_torques[side] * factor,
            color=VERMILION,
            lw=1.6,
            label=f"law: {curve.law}" if k == 0 and curve.law else None,
        )
    ax.errorbar(
        curve.speeds[known] * speed_factor,
        curve.torques[known] * factor,
        yerr=COVERAGE_FACTOR * np.nan_to_num(curve.uncertainties[known], nan=0.0) * factor,
        fmt="o",
        ms=4,
        mew=0,
        color=BLUE,
        elinewidth=0.9,
        label="from the log, without a law (95 %)",
    )
    ax.set_xlabel(f"{'speed' if linear else 'angular speed'}, {speed_unit}")
    ax.set_ylabel(f"{'force' if linear else 'torque'}, {unit}")
    legend_above(ax, 2 if len(curve.law) < LONG else 1)
    return figure


def draw_changing(changes: Sequence[Changing]) -> Figure | None:
    """What changes slowly within the log, against its mean, with 95 % bands; one panel each."""
    if not changes:
        return None
    figure, axes = new_figure(0.5 + 1.5 * len(changes), len(changes), sharex=True)
    for ax, change in zip(axes, changes, strict=True):
        factor, unit = (100.0, "%") if change.unit == "1" else prefixed(change.values, change.unit)
        values, reach = change.values * factor, COVERAGE_FACTOR * change.uncertainties * factor
        ax.axhline(0, color=GREY, lw=0.8)
        ax.fill_between(change.times, values - reach, values + reach, color=BLUE, alpha=0.25, lw=0)
        ax.plot(change.times, values, color=BLUE)
        ax.set_ylabel(f"{CHANGING[change.what]}, {unit}")
    axes[-1].set_xlabel("time, s")
    figure.align_ylabels(axes)
    return figure
