"""The paper, reproduced: its figures 2 to 8, the page, and the tables of docs/paper.md."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swingid.numerics.arrays import Array
from swingid.report.page import filled, write_page
from swingid.report.style import envelope, house_style, legend_above, new_figure, to_svg
from swingid.result.plot import BLUE, GREY, INK, PALE, VERMILION
from swingid.study.reproduce.published import BACKSTEPPING, TIMES, stated_in
from swingid.study.reproduce.tables import tables
from swingid.table import Cell, Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from swingid.recording.recording import Recording
    from swingid.simulation.twin import Run
    from swingid.study.reproduce import Reproduction
    from swingid.study.reproduce.experiment import Simulation


MARKS = re.compile(r"(<!-- table: ([\w-]+) -->\n).*?(<!-- end -->)", re.DOTALL)

DOTS = 150
"""Dots per inch of the PNG files."""

Runs = Mapping[str, "Run"]

Channel = Callable[["Run"], tuple[Array, Array]]

CLOSE = (20.0, 22.0)

WORDS = 22
"""Characters from which a cell is words, not a number with its unit."""

STYLES: dict[str, dict[str, Any]] = {
    "plain": {"color": BLUE, "ls": "-", "lw": 1.2, "label": "without body, 0.8 sin 8.5t"},
    "body": {"color": VERMILION, "ls": (0, (5, 2)), "lw": 1.2, "label": "with body, 0.8 sin 6t"},
}

GREEN, RED, BROWN = "#009E73", "#C8102E", "#8C510A"
"""The colours that section 5 names, in tones that colour-blind readers distinguish."""

ABOUT_TIMES = (8.9, 10.0)

MAGNIFIED = 100


def write_paper(results: dict[str, Any], figures: list[Drawing], path: str | Path) -> Path:
    """Write the page of `Reproduction.results` and its figures to `path` and return it.

    Raises InputError when the file cannot be written.
    """
    from markupsafe import Markup

    page = filled(
        "paper.html.j2",
        tables={table.key: _of_page(table) for table in tables(results)},
        figures={figure.number: Markup(figure.svg) for figure in figures},
        captions={figure.number: (figure.caption, figure.here) for figure in figures},
        seed=results["seed"],
    )
    return write_page(page, path)


def _of_page(table: Table) -> Table:
    """A table of the page: verdicts and numbers with their forms, the misprints without the names of tests.

    The page may stand far from this project.
    """
    from swingid.study.reproduce.claims import FAILS, HOLDS, PARTLY

    verdicts = {HOLDS: "holds", PARTLY: "part", FAILS: "fails"}
    if table.key == "unclear":
        table = replace(table, columns=table.columns[:-1], rows=tuple(row[:-1] for row in table.rows), caption="")
    number = {True: "number", False: ""}
    rows = (
        tuple(Cell(text, form=verdicts.get(text, number[k > 0 and len(text) < WORDS])) for k, text in enumerate(row))
        for row in table.texts()[1:]
    )
    return replace(table, rows=tuple(rows))


def with_tables(text: str, results: dict[str, Any]) -> str:
    """The text of a page with every table between its marks renewed from `Reproduction.results`.

    A table goes between `<!-- table: KEY -->` and `<!-- end -->`. Raises KeyError for a key that no table has.
    """
    made = {table.key: table for table in tables(results)}
    return MARKS.sub(lambda match: f"{match[1]}\n{made[match[2]].markdown()}\n{match[3]}", text)


@dataclass(frozen=True)
class Drawing:
    """A figure of the paper: its number, its caption there, what differs here, and its pictures."""

    number: int
    caption: str
    here: str
    svg: str
    png: bytes

    def files(self) -> dict[str, bytes]:
        """File names and contents."""
        return {f"fig{self.number}.svg": self.svg.encode("utf-8"), f"fig{self.number}.png": self.png}


def drawn_figures(reproduction: Reproduction) -> list[Drawing]:
    """All figures of a reproduction; the same one gives the same bytes."""
    runs, ideal = reproduction.experiment.runs, reproduction.simulation
    with house_style():
        figures = {k: draw(runs) for k, draw in DRAW.items()} | {7: draw_fig7(ideal.log), 8: draw_fig8(ideal)}
        return [_drawing(k, figure, **stated_in("figures")[str(k)]) for k, figure in figures.items()]


def _drawing(number: int, figure: Figure, caption: str, here: str) -> Drawing:
    svg = to_svg(figure, f"fig{number}", f"Figure {number}. {caption}")
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=DOTS, metadata={"Software": None})
    return Drawing(number, caption, here, svg, buffer.getvalue())


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


def _tracking(run: Run) -> tuple[Array, Array]:
    assert run.recording.reference is not None
    return run.recording.time, run.recording.reference - run.recording.angle


def draw_twice(label: str, channel: Channel, levels: tuple[float, ...], runs: Runs) -> Figure:
    """Something over the whole run and over its last seconds, with and without body; levels: dotted lines."""
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
    handles = close.get_legend_handles_labels()
    whole.legend(*handles, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, borderaxespad=0.2)
    for axes in (whole, close):
        for level in levels:
            axes.axhline(level, color=GREY, lw=0.9, ls=":")
    return figure


DRAW: dict[int, Callable[[Runs], Figure]] = {
    2: partial(draw_twice, "tracking error e, rad", _tracking, (-0.08, 0.08)),
    3: partial(draw_twice, "q1', rad/s", lambda run: (run.truth.time, run.truth.speed), ()),
    4: partial(draw_twice, "q2', rad/s", lambda run: (run.truth.time, run.truth.wheel_speed), ()),
    5: partial(draw_twice, "control signal u0, V", lambda run: (run.truth.time, run.truth.command), (-10.0, 10.0)),
    6: draw_fig6,
}


def draw_fig7(log: Recording) -> Figure:
    """Angle, reference, error and 0.005 k tilde; below, around the paper's four times."""
    assert log.reference is not None
    assert log.adaptive_gain is not None
    figure, (whole, close) = new_figure(4.8, 2)
    error = log.reference - log.angle
    whole.plot(*envelope(log.time, log.angle), color=GREEN, lw=1.8, alpha=0.6, label="angle q1")
    whole.plot(log.time[::20], log.reference[::20], color=BLUE, lw=0.9, ls=(0, (4, 3)), label="program trajectory ym")
    whole.plot(*envelope(log.time, error), color=RED, lw=0.9, label="(1) tracking error e")
    whole.plot(log.time[::20], 0.005 * log.adaptive_gain[::20], color=BROWN, lw=1.6, label="(2) 0.005 k̃")
    whole.axvspan(*ABOUT_TIMES, color=PALE, lw=0, zorder=0)
    whole.set(xlim=(0, 12), ylabel="rad, and 0.005 k̃")
    part = (log.time >= ABOUT_TIMES[0]) & (log.time <= ABOUT_TIMES[1])
    close.plot(log.time[part], log.angle[part], color=GREEN, lw=3.4, alpha=0.55, label="_angle")
    close.plot(log.time[part], log.reference[part], color=BLUE, lw=1.1, ls=(0, (4, 3)), label="_reference")
    close.plot(log.time[part], MAGNIFIED * error[part], color=RED, lw=1.0, label="_error")
    for name, instant in zip(("t10", "t11", "t20", "t21"), TIMES, strict=True):
        close.axvline(instant, color=INK, lw=0.9, ls=":")
        place: dict[str, Any] = {"xycoords": ("data", "axes fraction"), "textcoords": "offset points", "va": "top"}
        offset, side = ((-3, -2), "right") if name in ("t10", "t11") else ((3, -2), "left")
        close.annotate(name, (instant, 1.0), offset, ha=side, **place)
    # the caption's numbers on the lines too, for those who cannot distinguish the colours
    for axes, words, instant, values in (
        (whole, "(2)", 3.0, 0.005 * log.adaptive_gain),
        (close, "(1)", 9.15, MAGNIFIED * error),
    ):
        point = (instant, float(values[log.time.searchsorted(instant)]))
        axes.annotate(words, point, (-8, 4), textcoords="offset points", color=INK, ha="center")
    close.set(xlim=ABOUT_TIMES, xlabel="time, s", ylabel=f"rad, e times {MAGNIFIED}")
    legend_above(whole, 4)
    return figure


def draw_fig8(simulation: Simulation) -> Figure:
    """J1 − J1^ of all runs, in 10^-5 kg m^2, with the band of 5 %: as a whole, and near zero."""
    figure, (whole, close) = new_figure(4.8, 2, sharex=True)
    colours = {2.0: VERMILION, 8.5: BLUE}
    for curve in simulation.curves:
        printed = curve.law == "printed"
        bold = printed and curve.frequency == 2.0
        style: dict[str, Any] = {"ls": "-" if printed else (0, (4, 2)), "lw": 2.0 if bold else 1.1}
        style |= {"color": colours[curve.frequency], "label": f"{curve.law} law, {curve.frequency:g} rad/s"}
        for axes in (whole, close):
            axes.plot(curve.time[::20], 1e5 * (simulation.truth - curve.inertia[::20]), **style)
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
