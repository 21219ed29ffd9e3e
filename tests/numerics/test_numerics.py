"""Splines, quadrature, test functions and regression against closed forms and independent solutions."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial import Polynomial
from scipy.integrate import quad
from scipy.interpolate import CubicSpline

from swingid.numerics.arrays import median, quantile
from swingid.numerics.quadrature import GaussNodes
from swingid.numerics.regression import fit_linear, gram, squared_distance
from swingid.numerics.spline import intervals, local_cubic, spline_at, spline_slopes
from swingid.numerics.test_functions import (
    curvature_overlap,
    neighbour_overlaps,
    overlaps,
    project,
    project_hats,
    project_impulses,
    project_steps,
    superpose,
    superposed,
)

PHI = (1 - Polynomial([0, 0, 1])) ** 3
EXACT = 6
"""Gauss points with which φ times a quintic is integrated exactly (degree 11)."""

CASES = settings(max_examples=60, deadline=None)  # the first call may compile

seeds = st.integers(0, 2**32 - 1)


def stamps(seed, count=60, duration=3.0):
    """Rising irregular time stamps from 0 to `duration`, steps within a factor of about ten of each other."""
    steps = np.random.default_rng(seed).uniform(0.1, 1.0, count - 1)
    return np.concatenate([[0.0], np.cumsum(steps)]) * duration / steps.sum()


def closed_form(polynomial, order, centre, half):
    """∫φ^(order)((t − c)/L) x(t) dt over the window, by the antiderivative of the product."""
    test = PHI.deriv(order) / half**order if order else PHI
    antiderivative = (test * polynomial(Polynomial([centre, half]))).integ()
    return half * (antiderivative(1.0) - antiderivative(-1.0))


# splines


def test_natural_spline_through_three_points():
    # s(t) = 3t/2 − t³/2 on [0, 1], mirrored on [1, 2]: s'' vanishes at both ends and is continuous at 1.
    time, values = np.array([0.0, 1.0, 2.0]), np.array([0.0, 1.0, 0.0])
    slopes = spline_slopes(time, values)
    assert slopes == pytest.approx([1.5, 0.0, -1.5], abs=1e-14)
    assert spline_at(time, values, slopes, np.array([0.5, 1.5]), 0) == pytest.approx([0.6875, 0.6875], abs=1e-14)
    assert spline_at(time, values, slopes, np.array([0.0, 0.5, 2.0]), 1) == pytest.approx([1.5, 1.125, -1.5], abs=1e-14)


def test_two_knots_make_a_straight_line():
    assert spline_slopes(np.array([1.0, 3.0]), np.array([5.0, 1.0])).tolist() == [-2.0, -2.0]


@given(seeds, st.integers(3, 40))
@CASES
def test_slopes_are_those_of_the_natural_spline(seed, count):
    time = stamps(seed, count)
    values = np.random.default_rng(seed + 1).standard_normal(count)
    expected = CubicSpline(time, values, bc_type="natural")
    slopes = spline_slopes(time, values)
    assert slopes == pytest.approx(expected(time, 1), rel=1e-9, abs=1e-9 * np.abs(slopes).max())
    inside = np.sort(np.random.default_rng(seed + 2).uniform(0, time[-1], 50))
    for derivative in (0, 1):
        got = spline_at(time, values, slopes, inside, derivative)
        assert got == pytest.approx(expected(inside, derivative), rel=1e-8, abs=1e-9 * np.abs(slopes).max())


def test_inside_a_cubic_is_reproduced():
    # The natural ends are wrong for a cubic; on even knots their effect falls by 2 − √3 from knot to knot.
    time = np.linspace(-1.0, 1.0, 61)
    cubic = Polynomial([0.3, -1.0, 2.0, 4.0])
    error = np.abs(spline_slopes(time, cubic(time)) - cubic.deriv()(time))
    assert error[20:41].max() < 1e-10
    assert error[1:12] / error[:11] == pytest.approx(np.full(11, 2 - np.sqrt(3)), rel=0.05)


def test_slopes_converge_with_the_fourth_order():
    def errors(count):
        time = np.linspace(0.0, 2 * np.pi, count + 1)  # sin'' = 0 at both ends, as the natural spline wants
        slopes = spline_slopes(time, np.sin(time))
        middles = (time[1:] + time[:-1]) / 2
        values = spline_at(time, np.sin(time), slopes, middles, 0)
        return np.abs(slopes - np.cos(time)).max(), np.abs(values - np.sin(middles)).max()

    coarse, fine = np.array(errors(40)), np.array(errors(160))
    assert np.log(coarse / fine) / np.log(4) == pytest.approx([4.0, 4.0], abs=0.1)


@given(seeds)
@CASES
def test_local_cubic_is_exact_on_cubics_at_any_stamps(seed):
    time = stamps(seed, 80)
    cubic = Polynomial(np.random.default_rng(seed).uniform(-1, 1, 4))
    at = np.linspace(time[0], time[-1], 40)
    got = local_cubic(time, cubic(time), at, 0.4)
    assert got[:, 0] == pytest.approx(cubic(at), abs=1e-7)
    assert got[:, 1] == pytest.approx(cubic.deriv()(at), abs=1e-6)


def test_local_cubic_passes_the_noise_of_its_theory():
    # Slope of a cubic fitted to n samples over ±w: variance 75 σ²/(4 n w²) for many samples.
    time = np.arange(-300, 301) / 1000
    weights = np.array([local_cubic(time, unit, np.array([0.0]), 0.2)[0] for unit in np.eye(len(time))])
    assert (weights[:, 1] ** 2).sum() == pytest.approx(75 / 4 / (401 * 0.2**2), rel=0.02)
    assert weights[:, 0].sum() == pytest.approx(1.0, abs=1e-12)


def test_local_cubic_says_nothing_without_samples():
    time = np.array([0.0, 0.1, 0.2, 0.3, 0.4, 5.0, 5.1, 5.2, 5.3])
    got = local_cubic(time, time**3, np.array([0.2, 2.0, 5.1]), 0.25)
    assert got[0] == pytest.approx([0.008, 0.12], abs=1e-12)
    assert np.isnan(got[1:]).all()


# ranks and places


@given(st.lists(st.floats(-1e9, 1e9), min_size=1, max_size=60), st.floats(0, 1))
@CASES
def test_median_and_quantile_are_those_of_numpy(values, share):
    values = np.array(values)
    size = np.abs(values).max()
    assert median(values) == np.median(values)
    assert quantile(values, share) == pytest.approx(np.quantile(values, share), rel=1e-12, abs=1e-15 * size)


def test_median_and_quantile_of_nothing_are_no_number():
    assert np.isnan(median(np.empty(0)))
    assert np.isnan(quantile(np.empty(0), 0.5))


@given(seeds, st.sampled_from(["even", "uneven", "crowded"]), st.integers(1, 900))
@CASES
def test_the_interval_of_an_instant_is_that_of_a_bisection(seed, kind, count):
    rng = np.random.default_rng(seed)
    time = np.unique(rng.uniform(0, 1, int(rng.integers(2, 400))))
    if kind == "even":
        time = np.arange(len(time)) / 100
    elif kind == "crowded":
        time = np.unique(time**5)
    at = np.sort(np.concatenate([rng.uniform(-0.2, 1.2, count), rng.choice(time, 20), time[[0, -1]]]))
    expected = [min(max(int(np.sum(time <= instant)) - 1, 0), len(time) - 2) for instant in at]
    assert intervals(time, at).tolist() == expected


@given(seeds, st.integers(2, 70))
@CASES
def test_even_samples_are_smoothed_as_uneven_ones(seed, reach):
    rng = np.random.default_rng(seed)
    time = np.arange(400) * 1e-3
    values, at = rng.normal(size=400), np.sort(rng.uniform(0.0, 0.399, 60))
    nearly = time + 1e-9 * rng.uniform(-1, 1, 400)  # no longer even, and smoothed one by one
    width = (reach + 0.5) * 1e-3
    even, uneven = local_cubic(time, values, at, width), local_cubic(nearly, values, at, width)
    assert np.isnan(even).sum() == np.isnan(uneven).sum() < 120
    assert even == pytest.approx(uneven, rel=1e-3, abs=1e-3 * np.nanmax(np.abs(uneven)), nan_ok=True)


# quadrature


@given(seeds, st.integers(1, 6))
@CASES
def test_gauss_nodes_integrate_polynomials_of_their_degree(seed, points):
    nodes = GaussNodes(stamps(seed), points)
    polynomial = Polynomial(np.random.default_rng(seed).uniform(-1, 1, 2 * points))
    antiderivative = polynomial.integ()
    expected = antiderivative(nodes.time[-1]) - antiderivative(nodes.time[0])
    got = (nodes.weights * polynomial(nodes.instants)).sum()
    assert got == pytest.approx(expected, rel=1e-10, abs=1e-10 * 3.0 ** (2 * points))
    assert (np.diff(nodes.instants.ravel()) > 0).all()


def test_spline_and_hold_at_the_nodes():
    time = stamps(5)
    values = np.sin(2 * time)
    nodes = GaussNodes(time, 3)
    spline = CubicSpline(time, values, bc_type="natural")
    assert nodes.spline(values) == pytest.approx(spline(nodes.instants), abs=1e-12)
    assert nodes.spline(values, derivative=1) == pytest.approx(spline(nodes.instants, 1), abs=1e-10)
    held = (nodes.weights * nodes.hold(values)).sum()
    assert held == pytest.approx((np.diff(time) * values[:-1]).sum(), rel=1e-14)


@pytest.mark.parametrize("ahead", [2e-3, -0.7e-3, 0.31])
def test_a_signal_held_ahead_keeps_integral_and_first_moment(ahead):
    time, points = stamps(5), 3
    values = np.sin(2 * time)
    nodes = GaussNodes(time, points)
    line = nodes.hold(values, ahead)
    inside = (time[:-1] + ahead > time[0]) & (time[1:] + ahead < time[-1])
    # the true step function by small pieces between all its jumps
    cuts = np.unique(np.concatenate([time, time - ahead]))
    middles, widths = (cuts[1:] + cuts[:-1]) / 2, np.diff(cuts)
    held = values[np.clip(np.searchsorted(time, middles + ahead, side="right") - 1, 0, len(time) - 2)]
    interval = np.searchsorted(time, middles, side="right") - 1
    ours = (interval >= 0) & (interval < len(time) - 1)
    for weight in (np.ones_like, lambda t: t):
        exact = np.bincount(interval[ours], (widths * held * weight(middles))[ours], len(time) - 1)
        got = (nodes.weights * line * weight(nodes.instants)).sum(axis=1)
        assert got[inside] == pytest.approx(exact[inside], abs=1e-12)


# projections


@given(seeds, st.floats(0.02, 1.4), st.floats(0, 1))
@CASES
def test_projection_is_exact_wherever_the_window_lies(seed, half, place):
    # The window's ends fall anywhere: between stamps, both between the same two, on the log's ends.
    nodes = GaussNodes(stamps(seed), EXACT)
    centre = half + place * (nodes.time[-1] - 2 * half)
    polynomial = Polynomial(np.random.default_rng(seed).uniform(-1, 1, 6))
    signals = [(polynomial(nodes.instants), order) for order in (0, 1, 2)]
    got = project(nodes, signals, np.array([centre]), np.array([half]))[0]
    for order in (0, 1, 2):
        size = 3.0**5 * half ** (1 - order)
        assert got[order] == pytest.approx(closed_form(polynomial, order, centre, half), abs=1e-11 * size)


@given(seeds, st.integers(0, 50), st.integers(1, 9))
@CASES
def test_windows_that_end_on_stamps(seed, first, length):
    nodes = GaussNodes(stamps(seed), EXACT)
    begin, end = nodes.time[first], nodes.time[first + length]
    centre, half = (begin + end) / 2, (end - begin) / 2
    polynomial = Polynomial([0.2, -1.0, 0.5, 0.3])
    got = project(nodes, [(polynomial(nodes.instants), 2)], np.array([centre]), np.array([half]))[0, 0]
    assert got == pytest.approx(closed_form(polynomial, 2, centre, half), abs=1e-9 / half)


@pytest.mark.parametrize(("points", "order"), [(2, 4), (3, 5)])
def test_convergence_with_few_points_at_any_window_position(points, order):
    # In a cut interval x goes on as the polynomial through its nodes, off by h^points, where φ'' is of order h.
    def error(count):
        nodes = GaussNodes(np.linspace(0.0, 3.0, count + 1), points)
        centres = np.linspace(1.0, 2.0, 97) + 0.1 / count
        half = np.full(len(centres), 0.7)
        got = project(nodes, [(np.sin(5 * nodes.instants), 2)], centres, half)[:, 0]
        wave = quad(lambda s: (1 - s * s) ** 3 * np.cos(5 * 0.7 * s), -1, 1, epsabs=1e-14)[0]
        return np.abs(got + 25 * 0.7 * wave * np.sin(5 * centres)).max()  # ∫φ'' x = ∫φ x'' = −25 ∫φ x

    assert np.log2(error(60) / error(120)) == pytest.approx(order, abs=0.3)


@given(seeds, st.floats(-100, 100), st.floats(-10, 10))
@CASES
def test_constants_and_straight_lines_leave_nothing(seed, constant, slope):
    nodes = GaussNodes(stamps(seed), EXACT)
    centres, half = np.array([0.9, 1.5, 2.1]), np.array([0.3, 0.77, 0.9])
    got = project(nodes, [(constant + slope * nodes.instants, 2)], centres, half)
    assert np.abs(got).max() < 1e-9 * (abs(constant) + abs(slope) + 1)


def test_a_wheel_that_has_turned_far_leaves_next_to_nothing_at_two_points():
    # 1 kHz, windows of ±0.18 s, and a wheel 1000 rad away: below a millionth of the φ'' of a swing of 10 rad
    nodes = GaussNodes(np.arange(2001) / 1000, 2)
    centres, half = np.linspace(0.3, 1.6, 53), np.full(53, 0.18)
    got = project(nodes, [(np.full(nodes.instants.shape, 1000.0), 2)], centres, half)
    assert np.abs(got).max() < 1e-6 * 10 * 72 * 0.18 * 0.9


@given(seeds)
@CASES
def test_integration_by_parts(seed):
    nodes = GaussNodes(stamps(seed, 120), EXACT)
    t = nodes.instants
    x, rate, curvature = np.sin(4 * t) + t**2, 4 * np.cos(4 * t) + 2 * t, 2 - 16 * np.sin(4 * t)
    rng = np.random.default_rng(seed)
    half = rng.uniform(0.2, 1.0, 10)
    centres = rng.uniform(half, 3.0 - half)
    twice, once, never = project(nodes, [(x, 2), (-rate, 1), (curvature, 0)], centres, half).T
    assert twice == pytest.approx(never, abs=1e-8)
    assert once == pytest.approx(never, abs=1e-8)


@given(seeds, st.sampled_from([0, 2]))
@CASES
def test_superpose_is_the_adjoint_of_project(seed, order):
    # <K x, y> = <x, K'y>, to rounding where the windows end on stamps, so that both use the same nodes.
    rng = np.random.default_rng(seed)
    nodes = GaussNodes(stamps(seed), 3)
    begin = rng.integers(0, 45, 12)
    end = begin + rng.integers(2, 14, 12)
    centres, half = (nodes.time[begin] + nodes.time[end]) / 2, (nodes.time[end] - nodes.time[begin]) / 2
    x, y = rng.standard_normal(nodes.instants.shape), rng.standard_normal(12)
    left = project(nodes, [(x, order)], centres, half)[:, 0] @ y
    spread = superposed(nodes, centres, half, y[None], (order,))[0, 0]
    right = (nodes.weights * x).ravel() @ spread
    size = np.abs(project(nodes, [(np.abs(x), order)], centres, half)[:, 0] @ y) + np.abs(y).sum() / half.min() ** 2
    assert left == pytest.approx(right, abs=1e-9 * size)
    both = superpose(nodes.flat[0], centres, half, np.stack([y, 2 * y]), order)
    assert both == pytest.approx(np.stack([spread, 2 * spread]), abs=1e-9 * np.abs(spread).max())


@given(seeds)
@CASES
def test_steps_are_projected_exactly(seed):
    rng = np.random.default_rng(seed)
    edges = np.sort(rng.uniform(-0.5, 3.5, 8))
    levels = rng.uniform(-1, 1, 7)
    centre, half = rng.uniform(0.5, 2.5), rng.uniform(0.05, 1.5)
    antiderivative = PHI.integ()
    ends = antiderivative(np.clip((edges - centre) / half, -1, 1))
    got = project_steps(edges, levels, np.array([centre]), np.array([half]))
    assert got == pytest.approx([half * (levels * np.diff(ends)).sum()], abs=1e-12)


def test_one_step_is_the_window_itself():
    got = project_steps(np.array([0.0, 9.0]), np.array([2.0]), np.array([4.0, 1.0]), np.array([0.7, 1.0]))
    assert got == pytest.approx([2 * 0.7 * 32 / 35, 2 * 32 / 35], rel=1e-14)


@given(seeds)
@CASES
def test_a_held_signal_is_a_row_of_steps(seed):
    nodes = GaussNodes(stamps(seed), EXACT)
    values = np.random.default_rng(seed).standard_normal(len(nodes.time))
    centres, half = np.array([0.8, 1.5, 2.0]), np.array([0.31, 1.1, 0.02])
    held = project(nodes, [(nodes.hold(values), 0)], centres, half)[:, 0]
    assert held == pytest.approx(project_steps(nodes.time, values[:-1], centres, half), abs=1e-12)


def test_a_held_signal_lags_its_spline_by_half_a_step():
    h = 1e-3
    time = np.arange(3001) * h
    nodes = GaussNodes(time, 2)
    centres, half = np.linspace(0.5, 2.5, 41), np.full(41, 0.3)
    wave = quad(lambda s: (1 - s * s) ** 3 * np.cos(8 * 0.3 * s), -1, 1)[0]
    held = project(nodes, [(nodes.hold(np.sin(8 * time)), 0)], centres, half)[:, 0]
    smooth = project(nodes, [(nodes.spline(np.sin(8 * time)), 0)], centres, half)[:, 0]
    assert smooth == pytest.approx(0.3 * wave * np.sin(8 * centres), abs=1e-9)
    assert held == pytest.approx(0.3 * wave * np.sin(8 * (centres - h / 2)), abs=2e-6)


@given(seeds)
@CASES
def test_impulses_are_sampled(seed):
    rng = np.random.default_rng(seed)
    instants, strengths = np.sort(rng.uniform(0, 3, 20)), rng.standard_normal(20)
    centres, half = rng.uniform(0.5, 2.5, 9), rng.uniform(0.1, 1, 9)
    s = (instants - centres[:, None]) / half[:, None]
    expected = (np.where(np.abs(s) < 1, (1 - s**2) ** 3, 0.0) * strengths).sum(axis=1)
    assert project_impulses(instants, strengths, centres, half) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("distance", [0.0, 0.25, 0.5, 1.0, 1.7, 1.99, 2.0, 3.0, -0.5])
def test_overlap_of_curvatures(distance):
    curvature = PHI.deriv(2)
    d = abs(distance)
    expected = quad(lambda s: curvature(s) * curvature(s - d), d - 1, 1)[0] if d < 2 else 0.0
    assert curvature_overlap(np.array([distance]))[0] == pytest.approx(expected, abs=1e-9)


def test_overlap_is_the_variance_that_white_noise_leaves():
    assert curvature_overlap(np.zeros(1))[0] == pytest.approx((PHI.deriv(2) ** 2).integ()(1) * 2, rel=1e-12)


@pytest.mark.parametrize("distance", [0.0, 0.4, 1.3])
def test_overlap_with_gravity(distance):
    both = PHI.deriv(2) + 0.7 * PHI
    product = (both * both(np.polynomial.Polynomial([-distance, 1.0]))).integ()
    expected = product(1.0) - product(distance - 1.0)
    assert curvature_overlap(np.array([distance]), 0.7)[0] == pytest.approx(expected, abs=1e-9)
    h, half, centres = 1e-3, 0.2, np.array([1.0, 1.05, 1.2])
    nodes = GaussNodes(np.arange(2201) * h, 2)
    rows = superpose(nodes.time, centres, np.full(3, half), np.eye(3), 2) * h
    covariance = rows @ rows.T
    expected = curvature_overlap((centres - centres[:, None]) / half) * h / half**3
    assert covariance == pytest.approx(expected, rel=1e-3)


@given(seeds, st.floats(-3, 3))
@CASES
def test_overlaps_sum_pairs_of_windows(seed, gravity):
    """Σ Σ w w ∫g g over all pairs, and with Bartlett's weights, which end after 4 neighbours."""
    rng = np.random.default_rng(seed)
    half, count = 0.3, 40
    centres, weights = 1.0 + half / 2 * np.arange(count), rng.standard_normal(count)
    distance = (centres[:, None] - centres) / half
    taper = np.clip(1 - np.abs(np.arange(count)[:, None] - np.arange(count)) / 5, 0, None)
    with_gravity, without = overlaps(weights, neighbour_overlaps(centres, np.full(count, half), 8), 4, gravity)
    for got, own in ((with_gravity, gravity), (without, 0.0)):
        for value, weight in zip(got, (np.ones_like(taper), taper), strict=True):
            expected = (
                weights @ (weight * np.where(np.abs(distance) < 2, curvature_overlap(distance, own), 0)) @ weights
            )
            assert value == pytest.approx(expected, rel=1e-6, abs=1e-6)


@given(seeds)
@CASES
def test_hats_share_out_the_window_and_reproduce_piecewise_lines(seed):
    rng = np.random.default_rng(seed)
    nodes = GaussNodes(stamps(seed), EXACT)
    signal = np.sin(3 * nodes.instants)
    knots = np.sort(rng.uniform(-1.2, 1.2, 9))
    knots[[0, -1]] = -1.3, 1.3
    on_stamps = nodes.time[rng.integers(0, 25, 5)], nodes.time[rng.integers(35, 60, 5)]
    centres, half = (on_stamps[0] + on_stamps[1]) / 2, (on_stamps[1] - on_stamps[0]) / 2
    hats = project_hats(nodes, signal, knots, centres, half)
    assert hats.sum(axis=1) == pytest.approx(half * 32 / 35, rel=1e-12)
    assert hats @ knots == pytest.approx(project(nodes, [(signal, 0)], centres, half)[:, 0], abs=1e-11)
    heights = rng.standard_normal(9)
    expected = project(nodes, [(np.interp(signal, knots, heights), 0)], centres, half)[:, 0]
    assert hats @ heights == pytest.approx(expected, abs=1e-11)


def test_hats_count_what_lies_beyond_for_the_outermost_knot():
    nodes = GaussNodes(np.linspace(0, 1, 101), 2)
    hats = project_hats(nodes, np.full((100, 2), 7.0), np.array([-1.0, 0.0, 2.0]), np.array([0.5]), np.array([0.5]))
    assert hats[0] == pytest.approx([0.0, 0.0, 0.5 * 32 / 35], rel=1e-6, abs=1e-12)


# regression


@given(seeds, st.integers(1, 5))
@CASES
def test_least_squares(seed, unknowns):
    rng = np.random.default_rng(seed)
    columns = rng.standard_normal((40, unknowns)) * 10.0 ** rng.uniform(-6, 6, unknowns)
    target = rng.standard_normal(40)
    fit = fit_linear(columns, target)
    sizes = np.linalg.norm(columns, axis=0)
    expected, _, _, _ = np.linalg.lstsq(columns / sizes, target, rcond=None)
    assert fit.values * sizes == pytest.approx(expected, rel=1e-9, abs=1e-11)
    assert fit.influence @ target == pytest.approx(fit.values, rel=1e-9)
    assert fit.influence @ columns * np.outer(sizes, 1 / sizes) == pytest.approx(np.eye(unknowns), abs=1e-10)
    assert fit.residuals == pytest.approx(target - columns @ fit.values, abs=1e-12)
    assert columns.T @ fit.residuals == pytest.approx(np.zeros(unknowns), abs=1e-9 * np.abs(columns).sum(axis=0).max())


@given(seeds)
@CASES
def test_units_change_neither_condition_nor_uncertainty(seed):
    rng = np.random.default_rng(seed)
    columns, target = rng.standard_normal((60, 3)), rng.standard_normal(60)
    scale = 10.0 ** rng.uniform(-8, 8, 3)
    plain, scaled = fit_linear(columns, target), fit_linear(columns * scale, target)
    assert scaled.condition == pytest.approx(plain.condition, rel=1e-6)
    got = scaled.covariance(4) * np.outer(scale, scale)
    assert got == pytest.approx(plain.covariance(4), rel=1e-6, abs=1e-12)


def test_a_column_of_zeros_and_a_repeated_one():
    rng = np.random.default_rng(1)
    x, y = rng.standard_normal(30), rng.standard_normal(30)
    zeroed = fit_linear(np.column_stack([x, np.zeros(30)]), y)
    assert zeroed.values == pytest.approx([x @ y / (x @ x), 0.0])
    assert zeroed.condition == np.inf
    twice = fit_linear(np.column_stack([x, x]), y)
    assert twice.values == pytest.approx(np.full(2, x @ y / (x @ x) / 2), rel=1e-9)


@given(seeds, st.sampled_from(["any", "close", "zero", "parallel"]))
@CASES
def test_least_squares_is_that_of_the_svd(seed, kind):
    """Also where columns are all but parallel, zero or parallel, and whatever their units."""
    rng = np.random.default_rng(seed)
    rows, unknowns = int(rng.integers(8, 200)), int(rng.integers(3, 8))
    columns = rng.standard_normal((rows, unknowns))
    if kind == "close":
        columns[:, 1] = columns[:, 0] + 1e-5 * columns[:, 1]
    if kind == "zero":
        columns[:, 1] = 0.0
    if kind == "parallel":
        columns[:, 1] = 3 * columns[:, 0]
    units = 10.0 ** rng.integers(-6, 6, unknowns)
    target = rng.standard_normal(rows)
    fit = fit_linear(columns * units, target)
    length = np.linalg.norm(columns, axis=0)
    length[length == 0] = 1.0
    expected = np.linalg.pinv(columns / length, rcond=1e-9)
    size = np.abs(expected).max()
    assert fit.influence * (units * length)[:, None] == pytest.approx(expected, abs=1e-7 * size)
    assert fit.values * units * length == pytest.approx(expected @ target, abs=1e-7 * size * np.sqrt(rows))
    assert fit.residuals == pytest.approx(target - (columns / length) @ (expected @ target), abs=1e-9)
    if kind in ("any", "close"):
        assert fit.condition == pytest.approx(np.linalg.cond(columns / length), rel=1e-6)


@given(seeds)
@CASES
def test_gram(seed):
    rng = np.random.default_rng(seed)
    rows = rng.standard_normal((int(rng.integers(1, 12)), int(rng.integers(1, 50))))
    assert gram(rows) == pytest.approx(rows @ rows.T, abs=1e-12)


def test_newey_west_knows_correlated_residuals():
    # Residuals as overlapping windows leave them: a moving average over four neighbours, where the plain formula
    # claims half of the true spread.
    rng = np.random.default_rng(7)
    trials, rows = 1500, 240
    columns = np.column_stack([np.sin(np.arange(rows) / 7.3), np.ones(rows)])
    white = rng.standard_normal((trials, rows + 3))
    residuals = white[:, :-3] + white[:, 1:-2] + white[:, 2:-1] + white[:, 3:]
    fits = [fit_linear(columns, columns @ [2.0, -1.0] + r) for r in residuals]
    true = np.std([fit.values for fit in fits], axis=0)
    robust = np.sqrt(np.mean([np.diag(fit.covariance(4)) for fit in fits], axis=0))
    naive = np.sqrt(np.mean([np.diag(fit.covariance(0)) for fit in fits], axis=0))
    assert robust == pytest.approx(true, rel=0.2)
    assert (naive < 0.6 * true).all()


@given(seeds)
@CASES
def test_newey_west_is_bartletts_sum(seed):
    rng = np.random.default_rng(seed)
    columns, target = rng.standard_normal((80, 2)), np.cumsum(rng.standard_normal(80))
    fit = fit_linear(columns, target)
    score = columns * fit.residuals[:, None]
    weights = np.clip(1 - np.abs(np.subtract.outer(np.arange(80), np.arange(80))) / 5, 0, None)
    bread = np.linalg.inv(columns.T @ columns)
    expected = bread @ score.T @ weights @ score @ bread
    got = fit.covariance(4)
    factor = got[0, 0] / expected[0, 0]
    assert 1.0 < factor < 1.2  # few rows tell less than they seem to
    assert got == pytest.approx(factor * expected, rel=1e-9, abs=1e-12)


def test_squared_distance_is_that_of_independent_values_and_leaves_out_what_is_known():
    assert squared_distance(np.array([3.0, 8.0]), np.diag([9.0, 16.0])) == pytest.approx(1 + 4)
    # two values of one error count once, whatever their units
    assert squared_distance(np.array([2.0, 2e6]), np.outer([1.0, 1e6], [1.0, 1e6])) == pytest.approx(4.0)
    assert squared_distance(np.array([2.0, 3.0]), np.full((2, 2), np.nan)) == 0


def test_the_normal_matrix_of_a_line_is_its_closed_form():
    x = np.arange(11.0) - 5
    fit = fit_linear(np.column_stack([np.ones(11), x]), 2 + 3 * x)
    assert fit.values == pytest.approx([2, 3])
    assert fit.normal == pytest.approx(np.diag([1 / 11, 1 / 110]))
