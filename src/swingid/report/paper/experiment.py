"""Figures 2 to 6: the experiment with and without the body, each as the whole run and closely."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from swingid.numerics.arrays import Array
from swingid.report.style import envelope, legend_above, new_figure
from swingid.result.plot import BLUE, GREY, INK, PALE, VERMILION

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from swingid.simulation.twin import Run

Runs = Mapping[str, "Run"]

CLOSE = (20.0, 22.0)
STYLES: dict[str, dict[str, Any]] = {
    "plain": {"color": BLUE, "ls": "-", "lw": 1.2, "label": "without body, 0.8 sin 8.5t"},
    "body": {"color": VERMILION, "ls": (0, (5, 2)), "lw": 1.2, "label": "with body, 0.8 sin 6t"},
}


def draw_fig2(runs: Runs) -> Figure:
    """Tracking errors e."""
    figure = _twice(runs, _tracking, "tracking error e, rad")
    for axes in figure.axes:
        for level in (-0.08, 0.08):
            axes.axhline(level, color=GREY, lw=0.9, ls=":")
    return figure


def draw_fig3(runs: Runs) -> Figure:
    """Velocity of the pendulum."""
    return _twice(runs, lambda run: (run.truth.time, run.truth.speed), "q1', rad/s")


def draw_fig4(runs: Runs) -> Figure:
    """Velocity of the wheel."""
    return _twice(runs, lambda run: (run.truth.time, run.truth.wheel_speed), "q2', rad/s")


def draw_fig5(runs: Runs) -> Figure:
    """Control signal u0, held from sample to sample."""
    figure = _twice(runs, lambda run: (run.truth.time, run.truth.command), "control signal u0, V")
    for axes in figure.axes:
        for level in (-10.0, 10.0):
            axes.axhline(level, color=GREY, lw=0.9, ls=":")
    return figure


def draw_fig6(runs: Runs) -> Figure:
    """Tuning parameter over the run."""
    figure, (axes,) = new_figure(2.6)
    for case, style in STYLES.items():
        log = runs[case].recording
        assert log.adaptive_gain is not None
        axes.plot(log.time, log.adaptive_gain, **style)
        end = float(log.adaptive_gain[-1])
        axes.annotate(f"{end:.1f}", (log.time[-1], end), (-3, 5), textcoords="offset points", ha="right", color=INK)
    axes.axvspan(15.0, 22.0, color=PALE, lw=0, zorder=0)
    axes.set(xlabel="time, s", ylabel="tuning parameter k̃", xlim=(0, 25), ylim=(0, 15))
    legend_above(axes)
    return figure


DRAW: dict[int, Callable[[Runs], Figure]] = {2: draw_fig2, 3: draw_fig3, 4: draw_fig4, 5: draw_fig5, 6: draw_fig6}


def _tracking(run: Run) -> tuple[Array, Array]:
    assert run.recording.reference is not None
    return run.recording.time, run.recording.reference - run.recording.angle


def _twice(runs: Runs, channel: Callable[[Run], tuple[Array, Array]], label: str) -> Figure:
    figure, (whole, close) = new_figure(4.2, 2)
    for case, style in STYLES.items():
        time, values = channel(runs[case])
        # at this scale the run without body would hide the other
        thin: dict[str, Any] = {"alpha": 0.55} if case == "plain" else {"ls": (0, (4, 1))}
        whole.plot(*envelope(time, values), **(style | {"lw": 0.8} | thin))
        part = (time >= CLOSE[0]) & (time <= CLOSE[1])
        close.plot(time[part], values[part], **style)
    whole.axvspan(*CLOSE, color=PALE, lw=0, zorder=0)
    whole.set(xlim=(0, 25), ylabel=label)
    close.set(xlim=CLOSE, ylabel=label, xlabel="time, s")
    _legend(close, whole)
    return figure


def _legend(source: Axes, target: Axes) -> None:
    handles, labels = source.get_legend_handles_labels()
    target.legend(handles, labels, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, borderaxespad=0.2)
