"""Figures 7 and 8: the ideal simulation, and the identification error of the backstepping controller."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from swingid.report.style import envelope, legend_above, new_figure
from swingid.result.plot import GREY, INK, PALE, VERMILION

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from swingid.recording.recording import Recording
    from swingid.study.reproduce.simulation import Simulation

GREEN, BLUE, RED, BROWN = "#009E73", "#0072B2", "#C8102E", "#8C510A"
"""The colours that section 5 names, in tones that colour-blind readers tell apart."""

CLOSE = (8.9, 10.0)
MAGNIFIED = 100


def draw_fig7(log: Recording) -> Figure:
    """Angle, reference, error and 0.005 k tilde; below, around the paper's four times."""
    from swingid.study.reproduce.published import TIMES

    assert log.reference is not None
    assert log.adaptive_gain is not None
    figure, (whole, close) = new_figure(4.8, 2)
    error = log.reference - log.angle
    whole.plot(*envelope(log.time, log.angle), color=GREEN, lw=1.8, alpha=0.6, label="angle q1")
    whole.plot(log.time[::20], log.reference[::20], color=BLUE, lw=0.9, ls=(0, (4, 3)), label="program trajectory ym")
    whole.plot(*envelope(log.time, error), color=RED, lw=0.9, label="(1) tracking error e")
    whole.plot(log.time[::20], 0.005 * log.adaptive_gain[::20], color=BROWN, lw=1.6, label="(2) 0.005 k̃")
    whole.axvspan(*CLOSE, color=PALE, lw=0, zorder=0)
    whole.set(xlim=(0, 12), ylabel="rad, and 0.005 k̃")
    part = (log.time >= CLOSE[0]) & (log.time <= CLOSE[1])
    close.plot(log.time[part], log.angle[part], color=GREEN, lw=3.4, alpha=0.55, label="_angle")
    close.plot(log.time[part], log.reference[part], color=BLUE, lw=1.1, ls=(0, (4, 3)), label="_reference")
    close.plot(log.time[part], MAGNIFIED * error[part], color=RED, lw=1.0, label="_error")
    for name, instant in zip(("t10", "t11", "t20", "t21"), TIMES, strict=True):
        close.axvline(instant, color=INK, lw=0.9, ls=":")
        before = name in ("t10", "t11")
        close.annotate(
            name,
            (instant, 1.0),
            (-3 if before else 3, -2),
            xycoords=("data", "axes fraction"),
            textcoords="offset points",
            ha="right" if before else "left",
            va="top",
        )
    # the caption's numbers on the lines too, for those who cannot tell the colours
    for axes, words, instant, values in (
        (whole, "(2)", 3.0, 0.005 * log.adaptive_gain),
        (close, "(1)", 9.15, MAGNIFIED * error),
    ):
        place = (instant, float(values[log.time.searchsorted(instant)]))
        axes.annotate(words, place, (-8, 4), textcoords="offset points", color=INK, ha="center")
    close.set(xlim=CLOSE, xlabel="time, s", ylabel=f"rad, e times {MAGNIFIED}")
    legend_above(whole, 4)
    return figure


def draw_fig8(simulation: Simulation) -> Figure:
    """J1 − J1^ of all runs, in 10^-5 kg m^2, with the band of 5 %: as a whole, and near zero."""
    from swingid.study.reproduce.published import BACKSTEPPING

    figure, (whole, close) = new_figure(4.8, 2, share_time=True)
    colours = {2.0: VERMILION, 8.5: BLUE}
    for curve in simulation.curves:
        printed = curve.law == "printed"
        bold = printed and curve.frequency == 2.0
        style: dict[str, Any] = {
            "ls": "-" if printed else (0, (4, 2)),
            "lw": 2.0 if bold else 1.1,
            "color": colours[curve.frequency],
        }
        label = f"{curve.law} law, {curve.frequency:g} rad/s"
        for axes in (whole, close):
            axes.plot(curve.time[::20], 1e5 * (simulation.truth - curve.inertia[::20]), label=label, **style)
    error, after = BACKSTEPPING
    band = 1e3 * error * simulation.truth
    for axes, least, most in ((whole, -2.2, 1.1), (close, -0.22, 0.11)):
        axes.axhspan(-band, band, color=PALE, lw=0, zorder=0)
        axes.axvline(after, color=GREY, lw=0.9, ls=":")
        limits = (least * 1e5 * simulation.truth, most * 1e5 * simulation.truth)
        axes.set(xlim=(0, 12), ylabel="J1 − Ĵ1, 10⁻⁵ kg m²", ylim=limits)
    close.set(xlabel="time, s")
    legend_above(whole, 2)
    return figure
