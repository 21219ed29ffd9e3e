"""Figures of single studies: comparison of methods, validation of a model, inspection of a log."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from swingid.format import power_of_ten
from swingid.report.figures.motion import draw_panel, drives_of
from swingid.report.style import WIDTH, envelope, legend_above, name_rows, new_figure, points, prefixed
from swingid.result.plot import BLUE, GREEN, GREY, INK, ORANGE, PALE, PURPLE, SKY, VERMILION, file_label
from swingid.result.result import COVERAGE_FACTOR

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from swingid.recording.inspect import Clock
    from swingid.recording.recording import Recording
    from swingid.study.compare import Comparison, Trial
    from swingid.study.inspect import Inspection
    from swingid.study.inspect.motion import Swings
    from swingid.study.validate import Prediction

LOOKS = ((BLUE, "o"), (ORANGE, "s"), (PURPLE, "D"), (SKY, "^"), (VERMILION, "v"))
"""Colour and marker of a log, in turn."""

WIDEST = 40.0
"""A bar so many times longer than the shortest does not set the scale; an arrow shows that it leaves the panel."""

CLOSE = 5.0
"""The upper panel shows the last so many swings, where a free run has had most time to go astray."""

SHOWN_POINTS = 200
"""Turning points beyond which single marks cannot be seen."""


def draw_forest(comparison: Comparison) -> Figure | None:
    """Inertia by method with 95 % bars, in percent from the truth of a simulated log, else from the first answer.

    None where no method answers.
    """
    answered = [trial for trial in comparison.trials if trial.result.leading in trial.result.parameters]
    if not answered:
        return None
    methods = list(dict.fromkeys(trial.method for trial in comparison.trials))
    logs = comparison.logs
    figure, (ax,) = new_figure(1.1 + (0.24 + 0.14 * len(logs)) * len(methods))
    origins = {log: _origin(comparison.of(log)) for log in logs}
    placed = []
    for trial in answered:
        k = logs.index(trial.log)
        row = methods.index(trial.method) + (k - (len(logs) - 1) / 2) * 0.6 / max(len(logs), 1)
        off = 100 * (trial.result.main.value / origins[trial.log] - 1)
        u = trial.result.main.standard_uncertainty
        placed.append((trial, row, off, 100 * COVERAGE_FACTOR * (u or 0.0) / abs(origins[trial.log])))
    # everything, but for what lies so far out that the rest would be a line
    ends = np.array([abs(off) + bar for _, _, off, bar in placed])
    reach = 1.15 * float(max(ends[ends <= WIDEST * max(float(np.min(ends)), 1e-4)].max(), 1e-6))
    for trial, row, off, bar in placed:
        colour, marker = LOOKS[logs.index(trial.log) % len(LOOKS)]
        ax.errorbar(off, row, xerr=bar, **points(colour, marker))
        _arrow_where_outside(ax, off, row, reach, colour)
    true = any(trial.truth is not None for trial in answered)
    ax.axvline(0.0, color=GREEN, lw=1.4, zorder=0.5)
    ax.set_xlim(-reach, reach)
    name_rows(ax, methods)
    _mark_refused(ax, methods, {trial.method for trial in answered})
    ax.set_xlabel(f"deviation of the inertia from {'the true value' if true else 'the first estimate'}, % (bars: 95 %)")
    if len(logs) > 1:
        for k, log in enumerate(logs):
            colour, marker = LOOKS[k % len(LOOKS)]
            ax.plot([], [], marker, ms=5, mew=0, color=colour, label=file_label(log))
        legend_above(ax)
    return figure


def _origin(trials: tuple[Trial, ...]) -> float:
    """Return the value at which a log's axis is 0: the truth, else the first answer."""
    for trial in trials:
        if trial.truth is not None:
            return trial.truth
    return next((t.result.main.value for t in trials if t.result.leading in t.result.parameters), 1.0)


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


def _mark_refused(ax: Axes, methods: list[str], answered: set[str]) -> None:
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


def draw_validation(prediction: Prediction, *, linear: bool = False) -> Figure:
    """Above: the end of the log, measured and in the free run. Below: the error of both predictions over the log.

    The legend states the normalised fit of each in per cent.
    """
    from swingid.study.validate import fit_text

    figure, (top, bottom) = new_figure(4.2, 2)
    unit = "m" if linear else "rad"
    time, measured = prediction.time, prediction.measured
    shown = slice(-min(len(time), _rows_of_swings(measured)), None)
    top.plot(time[shown], measured[shown], color=GREY, lw=2.6, label="measured")
    top.plot(
        time[shown], prediction.free[shown], color=BLUE, lw=1.2, ls="--", label="free run from the start of the log"
    )
    top.set_ylabel(f"{'position' if linear else 'angle'}, {unit}")
    top.set_title("the end of the log", loc="right", color=GREY)
    legend_above(top)
    errors = {
        f"free run, fit {fit_text(prediction.free_fit)}": (prediction.free, BLUE),
        f"one swing ahead, fit {fit_text(prediction.swing_fit)}": (prediction.swing, ORANGE),
    }
    finite = [values - measured for values, _ in errors.values() if np.isfinite(values).all()]
    factor, name = prefixed(np.concatenate(finite) if finite else np.zeros(1), unit)
    for label, (values, colour) in errors.items():
        if np.isfinite(values).all():
            bottom.plot(*envelope(time, factor * (values - measured)), color=colour, lw=0.9, label=label)
    bottom.set_ylabel(f"error, {name}")
    bottom.set_xlabel("time, s")
    legend_above(bottom)
    return figure


def _rows_of_swings(measured: np.ndarray) -> int:
    """Rows that hold the last swings: from the sign changes of the angle about its mean."""
    crossings = np.nonzero(np.diff(np.sign(measured - measured.mean())))[0]
    if len(crossings) < CLOSE + 1:
        return len(measured)
    return int(len(measured) - crossings[-int(CLOSE) - 1])


def draw_inspection(inspection: Inspection) -> Figure | None:
    """The picture of an inspection; None where no log could be read."""
    from matplotlib.figure import Figure

    log = inspection.log
    if log is None:
        return None
    drives = drives_of(log, linear=inspection.linear)
    figure = Figure(figsize=(WIDTH, 1.9 + 1.15 * len(drives) + 1.9))
    grid = figure.add_gridspec(2 + len(drives), 2, height_ratios=[1.7, *[1.0] * len(drives), 1.6])
    top = figure.add_subplot(grid[0, :])
    _draw_motion(top, inspection, log)
    last = top
    for k, drive in enumerate(drives, start=1):
        last = figure.add_subplot(grid[k, :], sharex=top)
        draw_panel(last, log.time, drive)
        _grey_unused(last, log, inspection.swings)
    for axes in figure.axes[:-1]:
        axes.tick_params(labelbottom=axes is last)
    last.set_xlabel("time, s")
    _draw_spectrum(figure.add_subplot(grid[-1, 0]), log, inspection.swings, linear=inspection.linear)
    _draw_clock(figure.add_subplot(grid[-1, 1]), inspection.clock)
    figure.align_ylabels(figure.axes[:-2])
    return figure


def _grey_unused(axes: Axes, log: Recording, swings: Swings | None) -> None:
    first, last = float(log.time[0]), float(log.time[-1])
    axes.set_xlim(first, last)
    if swings is None:
        return
    for begin, end in ((first, swings.start), *log.left_out, (swings.stop, last)):
        if end > begin:
            axes.axvspan(begin, end, color=PALE, lw=0, zorder=0)


def _draw_motion(axes: Axes, inspection: Inspection, log: Recording) -> None:
    swings = inspection.swings
    axes.plot(*envelope(log.time, log.angle), color=BLUE, lw=0.8)
    title = "position" if inspection.linear else "angle"
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
    axes.set_ylabel("m" if inspection.linear else "rad")


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
