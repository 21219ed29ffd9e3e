"""A log at a glance: the motion with the part that serves, the drive, the spectrum, the steps of the clock."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from swingid.format import power_of_ten
from swingid.report.figures.log import speed_of, wheel_span
from swingid.report.style import WIDTH, envelope, prefixed
from swingid.result.plot import BLUE, GREY, INK, ORANGE, PALE, PURPLE, VERMILION

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from swingid.recording.inspect import Clock
    from swingid.recording.recording import Recording
    from swingid.study.inspect import Inspection
    from swingid.study.inspect.motion import Swings

SHOWN_POINTS = 200
"""Turning points beyond which single marks tell nothing."""


def draw_inspection(found: Inspection) -> Figure | None:
    """The picture of an inspection; None where no log could be read."""
    from matplotlib.figure import Figure

    log = found.log
    if log is None:
        return None
    drives = _drives(log, linear=found.linear)
    figure = Figure(figsize=(WIDTH, 1.9 + 1.15 * len(drives) + 1.9))
    grid = figure.add_gridspec(2 + len(drives), 2, height_ratios=[1.7, *[1.0] * len(drives), 1.6])
    top = figure.add_subplot(grid[0, :])
    _draw_motion(top, found, log)
    last = top
    for k, (label, unit, values, colour) in enumerate(drives, start=1):
        last = figure.add_subplot(grid[k, :], sharex=top)
        _draw_drive(last, log, label, unit, values, colour, found.swings)
    for axes in figure.axes[:-1]:
        axes.tick_params(labelbottom=axes is last)
    last.set_xlabel("time, s")
    _draw_spectrum(figure.add_subplot(grid[-1, 0]), log, found.swings, linear=found.linear)
    _draw_clock(figure.add_subplot(grid[-1, 1]), found.clock)
    figure.align_ylabels(figure.axes[:-2])
    return figure


def _drives(log: Recording, *, linear: bool) -> list[tuple[str, str, np.ndarray, str]]:
    """What moves the axis: label, unit, values, colour."""
    drives: list[tuple[str, str, np.ndarray, str]] = []
    if log.wheel_angle is not None:
        drives.append(("wheel speed", "rad/s", speed_of(log.time, log.wheel_angle, wheel_span(log)), PURPLE))
    if log.voltage is not None:
        drives.append(("voltage", "V", log.voltage, ORANGE))
    if log.torque is not None:
        drives.append(("force" if linear else "torque", "N" if linear else "N m", log.torque, ORANGE))
    return drives


def _grey_unused(axes: Axes, log: Recording, swings: Swings | None) -> None:
    first, last = float(log.time[0]), float(log.time[-1])
    axes.set_xlim(first, last)
    if swings is None:
        return
    for begin, end in ((first, swings.start), *log.left_out, (swings.stop, last)):
        if end > begin:
            axes.axvspan(begin, end, color=PALE, lw=0, zorder=0)


def _draw_motion(axes: Axes, found: Inspection, log: Recording) -> None:
    swings = found.swings
    axes.plot(*envelope(log.time, log.angle), color=BLUE, lw=0.8)
    title = "position" if found.linear else "angle"
    if swings is not None:
        inside = swings.motion.within(swings.start, swings.stop)
        if len(inside.turning_times) <= SHOWN_POINTS:
            axes.plot(inside.turning_times, inside.turning_angles, ".", color=INK, ms=3.5)
            title += ", its turning points"
        for begin, end in inside.rests:
            axes.axvspan(begin, end, color=VERMILION, alpha=0.15, lw=0, zorder=0)
        title += (
            "; grey: left out" if swings.start > log.time[0] or swings.stop < log.time[-1] or len(log.left_out) else ""
        )
        title += "; red: at rest" if len(inside.rests) else ""
    _grey_unused(axes, log, swings)
    axes.set_title(title, pad=3)
    axes.set_ylabel("m" if found.linear else "rad")


def _draw_drive(
    axes: Axes, log: Recording, label: str, unit: str, values: np.ndarray, colour: str, swings: Swings | None
) -> None:
    factor, shown = prefixed(values, unit)
    axes.plot(*envelope(log.time, values * factor), color=colour, lw=0.8)
    _grey_unused(axes, log, swings)
    axes.set_title(label, pad=3)
    axes.set_ylabel(shown)
    axes.locator_params(axis="y", nbins=4)


def _draw_spectrum(axes: Axes, log: Recording, swings: Swings | None, *, linear: bool) -> None:
    axes.set_title("frequencies of the motion", pad=3)
    if swings is None:
        axes.text(0.5, 0.5, "no motion", transform=axes.transAxes, ha="center", color=GREY)
        return
    from swingid.study.inspect.motion import amplitudes

    main = 1 / (2 * swings.motion.half_period)
    frequency, height = amplitudes(log.time, log.angle, swings.start, swings.stop, main)
    shown = (frequency > 0) & (frequency < 12 * main)
    axes.semilogy(frequency[shown], np.maximum(height[shown], 1e-12), color=BLUE, lw=0.8)
    top = float(height[shown].max(initial=1e-12))
    axes.set_ylim(max(1e-5 * top, float(height[shown].min(initial=top)) / 2), 4 * top)
    labelled: list[float] = []
    for place, size in swings.lines:
        if any(abs(place - other) < 1.5 * main for other in labelled):
            continue
        labelled.append(place)
        axes.annotate(f"{place:.3g} Hz", (place, size), (3, 2), textcoords="offset points", fontsize=8, color=INK)
    axes.yaxis.set_major_formatter(lambda value, _: power_of_ten(round(float(np.log10(value)))))
    axes.set_xlabel("frequency, Hz")
    axes.set_ylabel(f"amplitude, {'m' if linear else 'rad'}")


def _draw_clock(axes: Axes, clock: Clock | None) -> None:
    axes.set_title("steps of the clock", pad=3)
    if clock is None or clock.step <= 0:
        axes.text(0.5, 0.5, "no clock", transform=axes.transAxes, ha="center", color=GREY)
        return
    stamps = clock.stamps - np.nanmin(clock.stamps)
    steps = np.diff(stamps) * 1e3
    good = np.isfinite(steps)
    time, steps = stamps[1:][good], steps[good]
    axes.plot(*envelope(time, steps), color=GREY, lw=0.8)
    usual = clock.step * 1e3
    low, high = min(float(steps.min()), 0.0), float(steps.max())
    axes.set_ylim(low - 0.05 * usual, 1.15 * max(high, 1.5 * usual))
    axes.set_xlabel("time, s")
    axes.set_ylabel("step, ms")
