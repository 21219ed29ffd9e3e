"""The arithmetic of values with sources: closed forms, examples of JCGM 100, and Monte Carlo."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swingid.result.ratios import Ratio, transformed
from swingid.result.result import Result
from swingid.result.sources import values_of
from swingid.uncertainty.budget import Declared, Scatter, correlation_of, evaluate, scatter, stated, systematic
from swingid.uncertainty.uncertain import Uncertain, covariance, first_order, weighted_sum
from swingid.units import Quantity

WHEEL = Uncertain.of(2.0, 0.2, stated("wheel", "wheel", 0.2))
GEAR = Uncertain.of(4.0, 0.1, stated("gear", "gear", 0.1))


def test_products_and_quotients_add_relative_variances() -> None:
    """JCGM 100 5.1.6."""
    relative = math.hypot(0.2 / 2, 0.1 / 4)
    assert (WHEEL * GEAR).value == 8.0
    assert (WHEEL * GEAR).u == pytest.approx(8 * relative)
    assert (WHEEL / GEAR).value == 0.5
    assert (WHEEL / GEAR).u == pytest.approx(0.5 * relative)
    assert (3 * GEAR**3 / WHEEL).u == pytest.approx(96 * math.hypot(0.2 / 2, 3 * 0.1 / 4))
    assert (WHEEL**0.5).u == pytest.approx(0.2 / (2 * math.sqrt(2)))
    assert (1 / WHEEL).shifts["wheel"] == pytest.approx(-0.05)


def test_what_is_one_quantity_cancels() -> None:
    assert (WHEEL - WHEEL).u == 0.0
    assert (WHEEL / WHEEL).u == pytest.approx(0.0, abs=1e-17)
    assert (WHEEL * GEAR / WHEEL).u == pytest.approx(0.1)
    assert (WHEEL + WHEEL).u == pytest.approx(0.4)
    assert (WHEEL - 0.5).value == 1.5


def test_numbers_of_numpy_leave_the_product_to_the_value() -> None:
    found = np.float64(3.0) * WHEEL + np.float64(1.0)
    assert isinstance(found, Uncertain)
    assert (found.value, found.u) == (7.0, pytest.approx(0.6))


def test_ten_resistors_by_one_standard() -> None:
    """JCGM 100 5.2.2, example: each 1000 Ω ± 100 mΩ by one standard; in series they are 10 kΩ ± 1 Ω, not ± 0.32 Ω."""
    one = Uncertain.of(1000.0, 0.1, stated("standard", "standard", 0.1))
    series = weighted_sum([one] * 10, [1.0] * 10)
    assert (series.value, series.u) == (10e3, pytest.approx(1.0))
    own = [Uncertain.of(1000.0, 0.1, stated(f"R{k}", None)) for k in range(10)]
    assert weighted_sum(own, [1.0] * 10).u == pytest.approx(0.32, abs=0.005)


def test_the_end_gauge() -> None:
    """JCGM 100 H.1: 50.000838 mm ± 32 nm with 16 degrees of freedom, from δα and δθ whose values are 0."""
    standard = Uncertain.of(50.000623, 25e-6, scatter("standard", 18.0))
    difference = Uncertain.of(215e-6, 9.7e-6, scatter("difference", 25.6))
    expansion = Uncertain.of(0.0, 0.58e-6, scatter("difference of the expansions", 50.0))
    warmer = Uncertain.of(0.0, 0.029, scatter("difference of the temperatures", 2.0))
    length = standard + difference - standard * (expansion * -0.1 + 11.5e-6 * warmer)
    assert length.value == pytest.approx(50.000838, abs=1e-9)
    assert length.u == pytest.approx(32e-6, abs=0.5e-6)
    assert length.freedom == pytest.approx(16.7, abs=0.2)
    parts = {entry.source: entry.standard_uncertainty for entry in length.entries("length")}
    assert parts["difference of the expansions"] == pytest.approx(2.9e-6, abs=0.05e-6)
    assert parts["difference of the temperatures"] == pytest.approx(16.6e-6, abs=0.1e-6)
    parameter = length.parameter("mm")
    assert parameter.coverage_factor == pytest.approx(2.11, abs=0.01)
    assert parameter.standard_uncertainty == length.u


def test_resistance_and_reactance() -> None:
    """JCGM 100 H.2: three results of three correlated readings, with their correlation coefficients."""
    readings = {"V": (4.9990, 0.0032), "I": (19.6610e-3, 0.0095e-3), "phi": (1.04446, 0.00075)}
    known = {("V", "I"): -0.36, ("V", "phi"): 0.86, ("I", "phi"): -0.65}
    volt, ampere, phase = (
        Uncertain(x, {name: u}, {name: scatter(name, 4.0)}, known) for name, (x, u) in readings.items()
    )
    cosine = first_order(math.cos(phase.value), [phase], [-math.sin(phase.value)])
    sine = first_order(math.sin(phase.value), [phase], [math.cos(phase.value)])
    results = [volt / ampere * cosine, volt / ampere * sine, volt / ampere]
    assert [one.value for one in results] == pytest.approx([127.732, 219.847, 254.260], abs=2e-3)
    assert [one.u for one in results] == pytest.approx([0.071, 0.295, 0.236], abs=2e-3)
    table = correlation_of(["R", "X", "Z"], covariance(results))
    assert table["R"]["X"] == pytest.approx(-0.588, abs=0.01)
    assert table["R"]["Z"] == pytest.approx(-0.485, abs=0.01)
    assert table["X"]["Z"] == pytest.approx(0.993, abs=0.002)
    assert np.sqrt(np.diag(covariance(results))) == pytest.approx([one.u for one in results])


SHARED = {
    "product with a shared factor": lambda a, b, c: a * b * (a + c),
    "ratio of differences": lambda a, b, c: (a - c) / (b + a),
    "parallel axis": lambda a, b, c: a - b * c**2,
}


@pytest.mark.parametrize("name", list(SHARED))
def test_against_draws_of_the_sources(name: str) -> None:
    """Monte Carlo of functions of three values, two of which share a source, with small uncertainties."""
    function: Callable[..., Uncertain] = SHARED[name]
    own = [Uncertain.of(x, 1e-3 * x, stated(k, k)) for k, x in (("a", 5.0), ("b", 2.0), ("c", 0.7))]
    common = Uncertain.of(0.0, 2e-3, stated("common", "common"))
    found = function(own[0] + common, own[1] - 3 * common, own[2])
    draws = np.random.default_rng(5).normal(size=(4, 400_000))
    a, b, c = (one.value * (1 + 1e-3 * draws[k]) for k, one in enumerate(own))
    values = function(a + 2e-3 * draws[3], b - 6e-3 * draws[3], c)
    assert found.value == pytest.approx(values.mean(), abs=4 * found.u / math.sqrt(values.size) + 1e-5 * found.u)
    assert found.u == pytest.approx(values.std(), rel=0.005)
    for key, k in (("a", 0), ("b", 1), ("c", 2), ("common", 3)):
        slope = float(draws[k] @ (values - values.mean())) / draws.shape[1]
        assert found.shifts.get(key, 0.0) == pytest.approx(slope, abs=6 * found.u / math.sqrt(values.size))


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 5), st.integers(1, 4))
def test_linear_combinations_have_the_covariance_of_matrices(seed: int, n: int, m: int) -> None:
    """G V Gᵀ (JCGM 102 6.2.1), also where the sources are correlated."""
    random = np.random.default_rng(seed)
    keys = [f"s{k}" for k in range(4)]
    half = random.normal(size=(4, 6))
    table = correlation_of(keys, half @ half.T)
    known = {(a, b): table[a][b] for i, a in enumerate(keys) for b in keys[:i]}
    shifts, gain = random.normal(size=(n, 4)), random.normal(size=(m, n))
    sources = {key: scatter(key) for key in keys}
    values = [Uncertain(1.0, dict(zip(keys, row.tolist(), strict=True)), sources, known) for row in shifts]
    r = np.array([[table[a][b] for b in keys] for a in keys])
    expected = gain @ shifts @ r @ shifts.T @ gain.T
    found = [weighted_sum(values, row) for row in gain]
    assert np.allclose(covariance(found), expected)
    assert [one.u**2 for one in found] == pytest.approx(np.diag(expected), rel=1e-6, abs=1e-9)


def test_the_budget_adds_what_is_of_one_name_and_nature() -> None:
    """Two scatters with their degrees of freedom, a constant with its sensitivity coefficient, an error of all logs."""
    logs = [Uncertain.of(10.0, u, scatter("scatter", freedom), f"log {u}") for u, freedom in ((0.3, 5.0), (0.4, 7.0))]
    whole = weighted_sum(logs, [1.0, 1.0]) + 3 * WHEEL + Uncertain.of(0.0, 0.1, systematic("drift"))
    of_scatter, of_wheel, of_drift = whole.entries("inertia")
    assert of_scatter.standard_uncertainty == pytest.approx(0.5)
    assert of_scatter.origin.degrees_of_freedom == pytest.approx(0.5**4 / (0.3**4 / 5 + 0.4**4 / 7))
    assert of_scatter.origin.averages_over_logs
    assert (of_wheel.standard_uncertainty, of_wheel.sensitivity) == (pytest.approx(0.6), pytest.approx(3.0))
    assert (of_wheel.shared_id, of_wheel.parameter) == ("wheel", "inertia")
    assert (of_drift.standard_uncertainty, of_drift.sensitivity) == (0.1, None)
    assert whole.of_type("B").u == pytest.approx(0.6)
    assert whole.only(lambda key: key != "wheel").u == pytest.approx(math.hypot(0.5, 0.1))


def test_correlated_scatter_that_cancels_is_not_negative() -> None:
    pair = {("a", "b"): 1.0}
    one, other = (Uncertain(1.0, {key: 0.1}, {key: scatter("scatter")}, pair) for key in "ab")
    gap = other - one
    assert gap.u == pytest.approx(0.0, abs=1e-6)
    (entry,) = gap.entries("gap")
    assert entry.standard_uncertainty == gap.u
    assert (one + other).u == pytest.approx(0.2)


def test_stated_quantities_keep_whether_they_are_exact() -> None:
    exact, sure, loose = Quantity(2.0), Quantity(3.0, 0.0), Quantity(4.0, 0.4)
    assert Quantity.of(exact.uncertain("a") * 5) == Quantity(10.0)
    assert Quantity.of(exact.uncertain("a") * sure.uncertain("b")) == Quantity(6.0, 0.0)
    assert Quantity.of(exact.uncertain("a") * loose.uncertain("c")) == Quantity(8.0, 0.8)
    (entry,) = (3 * loose.uncertain("axis.mass")).entries("inertia")
    assert (entry.source, entry.shared_id, entry.type, entry.sensitivity) == (
        "axis.mass",
        "axis.mass",
        "B",
        pytest.approx(3.0),
    )


@pytest.mark.parametrize("lever", [0.0, 0.1])
def test_a_lever_of_zero_has_an_uncertain_gravity_torque(lever: float) -> None:
    """u(m l g)² = (l g u_m)² + (m g u_l)² + (m l u_g)² also where l is 0."""
    import swingid as sw

    text = f'axis.mass = "0.5 ± 0.01 kg"\naxis.lever = "{lever} ± 0.001 m"\naxis.g = "9.81 ± 0.01 m/s^2"\n'
    rig = sw.Rig.from_text(f'{text}drive.kind = "none"\n')
    torque = rig.axis.gravity_torque
    assert isinstance(torque, Quantity)
    assert torque.std == pytest.approx(math.hypot(lever * 9.81 * 0.01, 0.5 * 9.81 * 0.001, 0.5 * lever * 0.01))


def _fitted() -> tuple[Result, np.ndarray]:
    """A result of three parameters whose scatter is correlated, with a constant, and an error of each of two alone."""
    values = {"inertia": (2.0, "kg m^2"), "gravity_torque": (8.0, "N m"), "viscous": (0.5, "N m s")}
    own = np.array([[4e-4, 1.5e-3, -2e-5], [1.5e-3, 6.4e-3, 0.0], [-2e-5, 0.0, 1e-4]])
    slopes = np.array([2.0, 8.0, 0.5])
    found = evaluate(
        values,
        Scatter("scatter", own, np.array([9.0, 9.0, 7.0])),
        [(systematic("drift"), "inertia", 3e-3), (systematic("drift"), "gravity_torque", 4e-3)],
        [Declared(stated("scale", "scale"), 0.01, slopes)],
    )
    whole = own + np.diag([9e-6, 16e-6, 0.0]) + 1e-4 * np.outer(slopes, slopes)
    made = Result("m", "ok", found.parameters, budget=tuple(found.budget), correlation=found.correlation)
    return made, whole


def test_parameters_of_a_result_have_its_covariance() -> None:
    result, whole = _fitted()
    values = values_of(result, result.parameters)
    assert np.allclose(covariance(list(values.values())), whole, rtol=1e-9)
    for name, one in values.items():
        assert one.entries(name) == [entry for entry in result.budget if entry.parameter == name]
        assert one.parameter(result[name].unit).standard_uncertainty == pytest.approx(result[name].standard_uncertainty)
    bare = values_of(Result("m", "ok", result.parameters, budget=result.budget), ("inertia", "gravity_torque"))
    assert covariance(list(bare.values()))[0, 1] == pytest.approx(1e-4 * 16.0)


def test_a_ratio_has_what_the_covariance_leaves_of_it() -> None:
    """b/J: the scale cancels, of the scatter its correlation leaves little; u² = g V gᵀ, in the budget by source."""
    result, whole = _fitted()
    ratio = transformed(result, [Ratio("b/J", "1/s^2", {"gravity_torque": 1, "inertia": -1})])
    slopes = np.array([-8.0 / 4, 1 / 2, 0.0])
    assert ratio["b/J"].value == 4.0
    assert ratio["b/J"].standard_uncertainty == pytest.approx(math.sqrt(slopes @ whole @ slopes))
    parts = {entry.source: entry for entry in ratio.budget}
    assert list(parts) == ["scale", "drift", "scatter"]
    assert parts["scale"].standard_uncertainty == pytest.approx(0.0, abs=1e-15)
    assert parts["drift"].standard_uncertainty == pytest.approx(math.hypot(2 * 3e-3, 4e-3 / 2))
    left = 4 * 4e-4 + 6.4e-3 / 4 - 2 * 1.5e-3
    assert parts["scatter"].standard_uncertainty == pytest.approx(math.sqrt(left))
