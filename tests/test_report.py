"""The report stands alone, holds what there is, leaves out what there is not, and draws what the numbers say."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import factories
from swingid.errors import InputError, UsageError
from swingid.identify.plot import plot_result
from swingid.identify.result import COVERAGE_FACTOR, BudgetEntry, Message, Result
from swingid.model.rig import Rig
from swingid.recording.recording import Recording, Source
from swingid.report import write_report
from swingid.report.figures.budget import draw_budget
from swingid.report.figures.friction import draw_friction
from swingid.report.figures.kinds import draw_kinds
from swingid.report.figures.log import panels_of, speed_of
from swingid.report.figures.residuals import draw_residuals
from swingid.report.figures.swings import draw_swings
from swingid.report.figures.turning_points import sides_of
from swingid.report.html import render
from swingid.report.style import envelope, house_style, new_figure, prefixed, to_svg

VOID = {"meta", "br", "hr", "img", "input", "link"}
Case = tuple[Result, Recording | None, Rig | None]

CASES: dict[str, Callable[[], Case]] = {
    "clean": lambda: (factories.clean_result(), factories.rotary_log(), factories.rotary_rig()),
    "doubtful": lambda: (factories.doubtful_result(), factories.rotary_log(), factories.rotary_rig()),
    "refused": lambda: (factories.refused_result(), factories.rotary_log(), factories.rotary_rig()),
    "unreadable": lambda: (factories.refused_result(), None, None),
    "linear": lambda: (factories.linear_result(), factories.linear_log(), factories.linear_rig()),
    "free": lambda: (factories.free_result(), factories.free_log(), factories.free_rig()),
}

COMMON = {"answer", "parameters", "rig", "log", "turning-points", "budget", "notes", "provenance"}
SECTIONS = {
    "clean": COMMON | {"swings", "friction", "residuals", "kinds"},
    "doubtful": COMMON - {"budget"} | {"warnings", "swings", "friction", "residuals", "kinds"},
    "refused": {"answer", "provenance"},
    "unreadable": {"answer", "provenance"},
    "linear": COMMON | {"friction", "residuals"},
    "free": COMMON | {"swings"},
}


class Page(HTMLParser):
    """Balance of tags, ids, attributes and text of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.sections: set[str] = set()
        self.ids: list[str] = []
        self.tags: set[str] = set()
        self.attributes: list[tuple[str, str]] = []
        self.text = ""
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_startendtag(tag, attrs)
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        found = {key: value or "" for key, value in attrs}
        self.attributes += found.items()
        if "id" in found:
            self.ids.append(found["id"])
            if tag == "section":
                self.sections.add(found["id"])

    def handle_endtag(self, tag: str) -> None:
        assert self.open, f"</{tag}> closes nothing"
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] != "style":
            self.text += data


@pytest.fixture(scope="module")
def pages() -> dict[str, str]:
    return {name: render(*case()) for name, case in CASES.items()}


@pytest.mark.parametrize("name", CASES)
def test_the_page_is_whole_and_stands_alone(pages: dict[str, str], name: str) -> None:
    page = Page(pages[name])
    assert page.tags & {"script", "link", "iframe", "img", "image", "object"} == set()
    assert len(page.ids) == len(set(page.ids))
    for key, value in page.attributes:
        if key in ("href", "xlink:href", "src"):
            assert value.removeprefix("#") in page.ids
        elif not key.startswith("xmlns"):
            assert "//" not in value
        assert set(re.findall(r"url\(#([^)]*)\)", value)) <= set(page.ids)
    assert re.search(r"@import|url\((?!#)", pages[name]) is None


@pytest.mark.parametrize("name", CASES)
def test_sections_are_those_with_data(pages: dict[str, str], name: str) -> None:
    assert Page(pages[name]).sections == SECTIONS[name]


def test_the_answer_comes_first_with_interval_and_status(pages: dict[str, str]) -> None:
    text = Page(pages["clean"]).text.replace("\u00a0", " ")
    head = text[: text.index("Parameters")]
    assert "J₁ = (3.0228 ± 0.0064) × 10⁻³ kg m²" in head
    assert "95 % interval [3.0103, 3.0353] × 10⁻³ kg m²" in head
    assert "0.21 % of the value" in head
    assert "ok: no known doubts" in head


def test_doubts_come_before_everything_but_the_answer(pages: dict[str, str]) -> None:
    text = Page(pages["doubtful"]).text
    assert "warning: doubt this number" in text
    assert text.index("near resonance") < text.index("Parameters")
    assert "its uncertainty is unknown" in text[: text.index("near resonance")]


@pytest.mark.parametrize("name", ["refused", "unreadable"])
def test_a_refusal_says_only_why(pages: dict[str, str], name: str) -> None:
    page = Page(pages[name])
    assert "the angle moves by 0.0004 only; record a swing." in page.text
    assert "svg" not in page.tags


def test_the_rig_says_what_is_exact_and_hides_what_is_sought(pages: dict[str, str]) -> None:
    rig = pages["clean"].split('<section id="rig">')[1].split("<details>")[0].replace("\u00a0", " ")
    row = {key: line for line in rig.splitlines() if (key := re.search(r'"key">([\w.]+)<', line))}
    by_key = {match[1]: line for match, line in row.items()}
    assert "(113.40 ± 0.30) × 10⁻⁶ kg m²" in by_key["drive.wheel.inertia"]
    assert "exact" in by_key["drive.motor.gear_ratio"]
    assert "exact" not in by_key["axis.gravity_torque"]
    assert "(−299.6 … 548.5) × 10⁻⁶ N m" in by_key["drive.motor.dead_zone"]
    assert not any(key.startswith(("axis.inertia", "axis.friction")) for key in by_key)


def test_a_linear_axis_is_told_in_kg_n_and_m(pages: dict[str, str]) -> None:
    text = Page(pages["linear"]).text
    assert "M\u00a0=\u00a0(95.10" in text
    assert re.search(r"force, m?N\b", text)
    assert "position, m" in text
    for rotary in ("kg m²", "N m", "rad"):
        assert re.search(rf"\b{rotary}\b", text) is None


def test_a_log_of_the_twin_says_so_and_how_far_off_the_answer_is() -> None:
    metadata = {"made_by": "swingid simulate", "truth": {"inertia": 3.022e-3}}
    text = Page(render(factories.clean_result(), replace(factories.rotary_log(), metadata=metadata), None)).text
    assert "swingid simulate" in text
    assert "off by +0.026\u00a0%" in text


def test_everything_foreign_is_escaped() -> None:
    evil = '<script>alert("1")</script> & $x_1$ </svg>'
    rig = Rig.from_text(factories.ROTARY.replace('"bench"', f"'{evil}'"), evil)
    log = replace(factories.rotary_log(), source=Source(evil, None), metadata={evil: evil})
    result = factories.clean_result(log)
    assert result.details is not None
    assert result.details.friction is not None
    result = replace(
        result,
        notes=(Message(evil, evil),),
        warnings=(Message(evil, evil),),
        budget=(BudgetEntry(evil, "A", "inertia", 1e-6),),
        provenance={evil: evil},
        details=replace(
            result.details,
            friction=replace(result.details.friction, law=evil, candidates={evil: 0.0, "b": 1.0}),
            estimates={evil: (3e-3, 1e-6), "b": (3e-3, 1e-6)},
        ),
    )
    page = Page(render(result, log, rig))
    assert "script" not in page.tags
    assert page.text.count('alert("1")') >= 8
    assert SECTIONS["clean"] <= page.sections


def test_the_same_result_gives_the_same_bytes(tmp_path: Path, pages: dict[str, str]) -> None:
    path = write_report(*CASES["clean"](), tmp_path / "report.html")
    assert path.read_text(encoding="utf-8") == pages["clean"]
    assert [p.name for p in tmp_path.iterdir()] == ["report.html"]


def test_a_place_that_cannot_be_written_is_an_input_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot write"):
        write_report(*CASES["unreadable"](), tmp_path / "nowhere" / "report.html")
    (tmp_path / "folder").mkdir()
    with pytest.raises(InputError, match="cannot write"):
        write_report(*CASES["unreadable"](), tmp_path / "folder")
    assert [p.name for p in tmp_path.iterdir()] == ["folder"]


def test_the_users_matplotlib_is_left_alone() -> None:
    import matplotlib

    before = dict(matplotlib.rcParams)
    with house_style():
        assert matplotlib.rcParams["svg.hashsalt"] == "swingid"
    assert dict(matplotlib.rcParams) == before


def test_importing_costs_no_matplotlib() -> None:
    code = "import sys, swingid.report, swingid.identify.plot; print({'matplotlib', 'jinja2'} & set(sys.modules))"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "set()"


@given(
    st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=400),
    st.integers(min_value=1, max_value=50),
)
def test_an_envelope_keeps_every_peak(values: list[float], bins: int) -> None:
    samples = np.array(values)
    time = np.arange(len(samples), dtype=float)
    shown_time, shown = envelope(time, samples, bins)
    assert (samples[shown_time.astype(int)] == shown).all()
    assert (np.diff(shown_time) > 0).all()
    assert len(shown) <= 2 * bins + 2
    assert shown[0] == samples[0]
    assert shown[-1] == samples[-1]
    part = np.ceil(len(samples) / bins)
    for instant, sample in zip(time, samples, strict=True):
        near = shown[np.abs(shown_time - instant) <= part]
        assert near.min() <= sample <= near.max()


def test_an_envelope_breaks_at_gaps_and_at_nan() -> None:
    time = np.concatenate([np.arange(50), 200 + np.arange(50)]) / 100
    shown_time, shown = envelope(time, np.ones(100))
    assert np.isnan(shown).sum() == 1
    assert shown_time[np.isnan(shown)] == pytest.approx(0.49)
    holes = np.ones(4000)
    holes[1000:2000] = np.nan
    shown_time, shown = envelope(np.arange(4000.0), holes, 100)
    assert np.isnan(shown[(shown_time > 1040) & (shown_time < 1960)]).all()
    assert np.isfinite(shown[(shown_time < 960) | (shown_time > 2040)]).all()


@pytest.mark.parametrize(
    ("peak", "unit", "answer"),
    [(0.8, "rad", "rad"), (0.02, "rad", "mrad"), (3e-6, "N m", "µN m"), (2e-9, "m", "nm"), (0.0, "N", "N")],
)
def test_axes_get_the_prefix_that_fits(peak: float, unit: str, answer: str) -> None:
    factor, shown = prefixed(np.array([0.0, -peak, np.nan]), unit)
    assert shown == answer
    assert peak == 0 or 0.1 <= factor * peak < 1000


def test_panels_are_the_channels_there_are() -> None:
    names = [panel.label for panel in panels_of(factories.rotary_log(), linear=False)]
    assert names == ["angle", "tracking error", "wheel speed", "voltage", "adaptive gain k̃"]
    assert [panel.label for panel in panels_of(factories.free_log(), linear=False)] == ["angle"]
    assert [panel.unit for panel in panels_of(factories.linear_log(), linear=True)] == ["m", "N"]


def test_the_wheels_speed_is_the_slope_of_its_angle_over_gaps_too() -> None:
    time = np.concatenate([np.arange(100), 300 + np.arange(100)]) / 1000
    assert speed_of(time, 7 * time, 0.01) == pytest.approx(7.0)
    assert np.isnan(speed_of(np.array([0.0, 1.0]), np.zeros(2), 0.01)).all()


def test_sides_follow_the_neighbours_not_zero() -> None:
    assert sides_of(np.array([3.0, 1.0, 2.5, 0.5])).tolist() == [1, -1, 1, -1]
    assert sides_of(np.array([-3.0, -1.0])).tolist() == [-1, 1]


def test_the_picture_shows_the_answer_its_band_and_each_swing_by_side() -> None:
    result = factories.clean_result()
    assert result.details is not None
    assert result.details.swings is not None
    _, (ax,) = new_figure(3.0)
    assert plot_result(result, ax) is ax
    assert ax.get_ylabel() == "inertia, 10⁻³ kg m²"
    low, high = ax.patches[0].get_extents().transformed(ax.transData.inverted()).intervaly
    assert (low, high) == pytest.approx(tuple(1e3 * np.array(result.inertia.interval95)))
    for container, side in zip(ax.containers, (1, -1), strict=True):
        points = container.lines[0].get_xydata()
        here = result.details.swings.sides == side
        assert points[:, 0] == pytest.approx(result.details.swings.times[here])
        assert points[:, 1] == pytest.approx(1e3 * result.details.swings.values[here])
        bar = container.lines[2][0].get_segments()[0]
        assert np.ptp(bar[:, 1]) == pytest.approx(2e3 * COVERAGE_FACTOR * 3e-7)
    markers = {container.lines[0].get_marker() for container in ax.containers}
    colours = {container.lines[0].get_color() for container in ax.containers}
    assert markers == {"^", "v"}
    assert len(colours) == 2


def test_what_has_no_number_cannot_be_plotted() -> None:
    with pytest.raises(UsageError, match="record a swing"):
        plot_result(factories.refused_result())


def test_swings_hidden_in_a_wide_band_get_their_own_panel() -> None:
    result = factories.clean_result()
    figure = draw_swings(result)
    assert figure is not None
    assert len(figure.axes) == 2
    lower = figure.axes[1].containers[0].lines[0].get_ydata()
    assert np.abs(lower).max() < 0.05  # percent
    narrow = replace(result, parameters={"inertia": replace(result.inertia, interval95=(3.0226e-3, 3.0230e-3))})
    assert len(draw_swings(narrow).axes) == 1  # type: ignore[union-attr]


def test_bars_of_the_budget_are_percent_of_the_answer_and_their_root_sum_of_squares() -> None:
    figure = draw_budget(factories.clean_result())
    assert figure is not None
    widths = [patch.get_width() for patch in figure.axes[0].patches]
    assert widths == pytest.approx(100 * np.array([6e-6, 2e-6, 1e-6, np.sqrt(41e-12)]) / 3.0228e-3)


def test_the_friction_law_is_not_drawn_through_zero_speed() -> None:
    details = factories.clean_result().details
    assert details is not None
    assert details.friction is not None
    figure = draw_friction(details.friction, linear=False)
    assert figure is not None
    laws = [line for line in figure.axes[0].lines if line.get_linewidth() == 1.6]
    assert [np.sign(line.get_xdata()).tolist() for line in laws] == [[-1.0] * 8, [1.0] * 8]
    assert figure.axes[0].get_ylabel() == "torque, mN m"
    nothing = replace(details.friction, torques=np.full(16, np.nan))
    assert draw_friction(nothing, linear=False) is None


def test_a_hopeless_kind_does_not_set_the_scale() -> None:
    result = factories.clean_result()
    assert result.details is not None
    estimates = {**result.details.estimates, "swing": (-50.0, 300.0)}
    figure = draw_kinds(replace(result, details=replace(result.details, estimates=estimates)))
    assert figure is not None
    assert figure.axes[0].get_xlim()[1] < 1.0  # percent


def test_thousands_of_residuals_become_bands() -> None:
    details = factories.clean_result().details
    assert details is not None
    count = 5000
    noise = np.random.default_rng(1).standard_normal(count)
    figure = draw_residuals(replace(details, residual_times=np.arange(count) / 10, residuals=noise), linear=False)
    assert figure is not None
    assert len(to_svg(figure, "r", "t")) < 60_000
    low, high = figure.axes[0].collections[0].get_datalim(figure.axes[0].transData).intervaly
    assert (low, high) == pytest.approx((noise.min(), noise.max()))


def test_figures_of_a_long_log_stay_small() -> None:
    log = factories.rotary_log(duration=200.0, rate=1000.0)
    assert len(render(factories.clean_result(log), log, None)) < 1_500_000
