"""Blocks of rows: what they keep exactly, and how their error falls with their length."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline
from test_numerics import CASES, seeds, stamps

from swingid.numerics.blocks import BlockNodes
from swingid.numerics.quadrature import GaussNodes
from swingid.numerics.test_functions import project

MONOMIALS = (np.ones_like, lambda t: t, lambda t: t * t)


def moments(nodes, values):
    """Integrals of the values over each block, times 1, t and t²."""
    return [(nodes.weights * values * weight(nodes.instants)).sum(axis=1) for weight in MONOMIALS]


def by_intervals(nodes, fine, values):
    """The same from values at many nodes of every interval between stamps."""
    return [
        np.add.reduceat((fine.weights * values * weight(fine.instants)).sum(axis=1), nodes.rows[:-1])
        for weight in MONOMIALS
    ]


@given(seeds, st.floats(0.0, 1.0))
@CASES
def test_blocks_are_as_long_as_allowed_and_cover_the_log(seed, longest):
    nodes = BlockNodes.of(stamps(seed), longest)
    assert nodes.rows[0] == 0
    assert nodes.rows[-1] == 59
    assert (np.diff(nodes.rows) >= 1).all()
    lengths, rows = np.diff(nodes.time), np.diff(nodes.rows)
    assert (lengths[rows > 1] <= longest).all()
    # one row more would have been too long
    assert (nodes.stamps[nodes.rows[1:-1] + 1] - nodes.time[:-2] > longest).all()


@given(seeds, st.floats(0.01, 1.0), st.sampled_from([0, 1]))
@CASES
def test_a_splines_moments_are_kept(seed, longest, derivative):
    nodes = BlockNodes.of(stamps(seed), longest)
    fine, values = GaussNodes(nodes.stamps, 4), np.sin(2 * nodes.stamps)
    spline = CubicSpline(nodes.stamps, values, bc_type="natural")(fine.instants, derivative)
    for got, exact in zip(
        moments(nodes, nodes.spline(values, derivative)), by_intervals(nodes, fine, spline), strict=True
    ):
        assert got == pytest.approx(exact, abs=1e-12)


@given(seeds, st.floats(0.01, 1.0), st.sampled_from([0.0, 0.004, -0.02]))
@CASES
def test_a_held_signals_moments_are_kept(seed, longest, ahead):
    nodes = BlockNodes.of(stamps(seed), longest)
    fine, values = GaussNodes(nodes.stamps, 3), np.cos(3 * nodes.stamps)
    exact = by_intervals(nodes, fine, fine.hold(values, ahead))
    for got, wanted in zip(moments(nodes, nodes.hold(values, ahead)), exact, strict=True):
        assert got == pytest.approx(wanted, abs=1e-12)


def test_errors_of_rounding_are_those_of_eight_grids():
    nodes = BlockNodes.of(stamps(3), 0.2)
    values = 7 * np.sin(nodes.stamps[:-1])
    shifted = values + np.arange(8)[:, None] / 8
    errors = np.floor(shifted + 0.5) - shifted
    got = nodes.rounded(values).reshape(8, -1, 3)
    assert got == pytest.approx(nodes.held(errors), abs=1e-14)


def test_the_error_of_a_projection_falls_as_the_fifth_power_of_the_length():
    """Sixth where windows end with blocks; here they cut them anywhere."""
    time = np.linspace(0.0, 3.0, 6001)
    values = np.sin(2 * np.pi * time)
    centres, half = np.linspace(1.2, 1.8, 37), np.full(37, 0.8)
    exact = project(GaussNodes(time, 3), [(GaussNodes(time, 3).spline(values), 2)], centres, half)
    lengths, errors = np.array([0.04, 0.08, 0.16]), []
    for longest in lengths:
        nodes = BlockNodes.of(time, longest + 1e-9)
        found = project(nodes, [(nodes.spline(values), 2)], centres, half)
        errors.append(np.sqrt(np.mean((found - exact) ** 2)))
    slopes = np.diff(np.log(errors)) / np.diff(np.log(lengths))
    assert errors[0] < 1e-7 * np.abs(exact).max()
    assert slopes == pytest.approx(5.0, abs=0.5)


def test_the_first_blocks_are_those_of_the_first_rows():
    nodes = BlockNodes.of(stamps(5), 0.2)
    first = nodes.until(1.5)
    assert first.time[-1] <= 1.5 < nodes.time[len(first.time)]
    assert first.stamps[-1] == first.time[-1]
    values = nodes.stamps**2
    assert first.hold(values[: len(first.stamps)]) == pytest.approx(nodes.hold(values)[: len(first.rows) - 1])
