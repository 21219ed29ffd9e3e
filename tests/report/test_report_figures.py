"""The figures draw what the numbers say."""

from __future__ import annotations

import os
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure

import factories
from refusals import coded
from swingid.errors import UsageError
from swingid.report.figures.estimates import _in_percent, draw_budget, draw_kinds, draw_swings
from swingid.report.figures.motion import draw_friction, draw_residuals, panels_of, sides_of, speed_of
from swingid.report.style import envelope, house_style, new_figure, prefixed, to_svg
from swingid.report.tables import swings_off
from swingid.result.plot import plot_result
from swingid.result.result import COVERAGE_FACTOR


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
    with pytest.raises(UsageError, check=coded("nothing-to-plot")):
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


def test_a_bar_that_leaves_the_panel_ends_in_an_arrow() -> None:
    result = factories.clean_result()
    assert result.details is not None
    plain = draw_kinds(result)
    estimates = {**result.details.estimates, "swing": (result.inertia.value, 1.0)}
    cut = draw_kinds(replace(result, details=replace(result.details, estimates=estimates)))
    assert plain is not None
    assert cut is not None

    def arrows(figure: Figure) -> list[object]:
        return sorted(str(line.get_marker()) for line in figure.axes[0].lines if line.get_marker() in ("<", ">"))

    assert (arrows(plain), arrows(cut)) == ([], ["<", ">"])


def test_kinds_are_compared_in_decimals() -> None:
    assert _in_percent(-0.0001, 0.0113) == "0.000 ± 0.011\u00a0%"
    assert _in_percent(-0.0036, 0.005) == "−0.0036 ± 0.0050\u00a0%"
    assert _in_percent(3.61, 12.3) == "4 ± 12\u00a0%"


@pytest.mark.parametrize("law", ["viscous", "coulomb + viscous + quadratic, direction-dependent"])
def test_the_legend_of_the_friction_law_stays_in_the_figure(law: str) -> None:
    details = factories.clean_result().details
    assert details is not None
    assert details.friction is not None
    with house_style():
        figure = draw_friction(replace(details.friction, law=law), linear=False)
        assert figure is not None
        figure.draw_without_rendering()
        legend = figure.axes[0].get_legend()
        assert legend is not None
        assert legend.get_window_extent().x1 <= figure.bbox.x1


def test_swings_that_lie_off_the_answer_are_explained() -> None:
    result = factories.clean_result()
    assert result.details is not None
    assert result.details.swings is not None
    assert swings_off(result) == ""
    off = replace(result.details.swings, values=result.details.swings.values * 0.957)
    text = swings_off(replace(result, details=replace(result.details, swings=off)))
    assert text.startswith("Here they lie −4.3\u00a0% from the answer, more than its interval allows")


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


def test_names_of_logs_are_drawn_as_they_are() -> None:
    """Neither a name that is no text nor one that looks like mathematics stops a picture, in anyone's style."""
    clean = factories.clean_result()
    names = [os.fsdecode(b"runs/bad\xff.csv"), r"a$\frac$.csv"]
    runs = tuple(replace(clean, provenance=clean.provenance | {"log": name}) for name in names)
    axes = plot_result(replace(clean, per_log=runs))
    assert isinstance(axes.figure, Figure)
    axes.figure.draw_without_rendering()
    assert [label.get_text() for label in axes.get_xticklabels()] == [r"bad\udcff.csv", r"a$\frac$.csv"]
