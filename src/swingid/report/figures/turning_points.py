"""Where the motion reverses: the turning points of the used part, and a close look at a few of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from swingid.numerics.arrays import Array
from swingid.recording.recording import Recording
from swingid.report.style import envelope, legend_above, new_figure, prefixed
from swingid.result.plot import GREY, PALE, SIDES, SKY
from swingid.result.result import Details

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


CLOSE = 5
"""Turning points in the close look."""

LARGEST = 25
"""Half of its length in half-lengths of a test function."""


def draw_turning_points(log: Recording, details: Details, *, linear: bool) -> Figure | None:
    """The angle with its turning points; below, five of them with the reach of one test function each."""
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
    for k, centre in enumerate(centres):
        ax.fill_between(
            centre + half * s,
            0.0,
            0.28 * (1 - s**2) ** 3,
            transform=ax.get_xaxis_transform(),
            color=SKY,
            alpha=0.35,
            lw=0,
            zorder=1,
            label="a test function" if k == 0 else None,
        )
