"""The uncertainty package: degrees of freedom, Student's quantile, joint covariance, dark uncertainty, significance."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import stdtrit

import swingid
from swingid.numerics.regression import fit_linear
from swingid.numerics.test_functions import phi
from swingid.result.file import load_result
from swingid.result.result import Result
from swingid.uncertainty.budget import (
    BudgetEntry,
    Declared,
    Parameter,
    Scatter,
    Source,
    combined,
    correlation_of,
    evaluate,
    freedom_of,
    joined,
    scatter,
    stated,
    systematic,
)
from swingid.uncertainty.dark import dark_uncertainty, shrunk
from swingid.uncertainty.freedom import (
    COVERAGE_FACTOR,
    bartlett,
    coverage_factor,
    effective_freedom,
    lag_weights_power,
    scatter_freedom,
)
from swingid.uncertainty.significance import CERTAIN, DETECTED, INDICATED, family_level

INFINITE = math.inf


def test_welch_and_satterthwaite_of_the_end_gauge() -> None:
    """JCGM 100 H.1.6: u = 32 nm, ν_eff = 16, t_99 = 2.92 (here the quantile of 95 %, table G.2: 2.12)."""
    parts = [(25.0, 18.0), (9.7, 25.6), (2.9, 50.0), (16.6, 2.0)]
    assert math.sqrt(sum(u**2 for u, _ in parts)) == pytest.approx(32.0, abs=0.5)
    assert effective_freedom(parts) == pytest.approx(16.7, abs=0.1)
    assert effective_freedom([*parts, (0.0, 1.0)]) == effective_freedom(parts)
    assert coverage_factor(16.0) == pytest.approx(2.12, abs=0.005)


def test_welch_and_satterthwaite_of_g_4() -> None:
    """JCGM 100 G.4.1, example: relative u_i of 0.25, 0.57, 0.82 % from 10, 5, 15 observations give ν_eff = 19."""
    parts = [(0.25, 9.0), (0.57, 4.0), (0.82, 14.0)]
    assert math.sqrt(sum(u**2 for u, _ in parts)) == pytest.approx(1.03, abs=0.005)
    assert effective_freedom(parts) == pytest.approx(19.0, abs=0.5)


def test_effective_freedom_of_nothing_and_of_extremes() -> None:
    assert effective_freedom([]) == INFINITE
    assert effective_freedom([(0.0, 3.0)]) == INFINITE
    assert effective_freedom([(1e-160, 5.0), (1e-170, INFINITE)]) == pytest.approx(5.0)
    assert effective_freedom([(1e160, 5.0), (1e160, 5.0)]) == pytest.approx(10.0)


@pytest.mark.parametrize("freedom", [1.0, 1.5, 2.0, 3.7, 5.0, 12.3, 30.0, 120.0, 999.0])
def test_coverage_factor_is_students_quantile(freedom: float) -> None:
    assert coverage_factor(freedom) == pytest.approx(float(stdtrit(freedom, 0.975)), rel=1e-12)


def test_coverage_factor_of_table_g_2_and_its_limits() -> None:
    table = {1: 12.71, 2: 4.30, 3: 3.18, 4: 2.78, 5: 2.57, 10: 2.23, 20: 2.09, 50: 2.01, 100: 1.984}
    for freedom, value in table.items():
        assert coverage_factor(float(freedom)) == pytest.approx(value, abs=0.006)
    assert coverage_factor(INFINITE) == coverage_factor(1e6) == COVERAGE_FACTOR
    assert coverage_factor(0.2) == coverage_factor(1.0)


def test_parameter_has_students_interval() -> None:
    wide, narrow = Parameter.of(10.0, 2.0, "kg", 4.0), Parameter.of(10.0, 2.0, "kg")
    assert wide.interval95 is not None
    assert narrow.interval95 is not None
    assert wide.interval95[1] == pytest.approx(10 + 2 * 2.776445, rel=1e-6)
    assert narrow.interval95[1] == pytest.approx(10 + 2 * COVERAGE_FACTOR)
    assert wide.coverage_factor == pytest.approx(2.776445, rel=1e-6)
    unknown = Parameter.of(1.0, None, "kg", 3.0)
    assert (unknown.interval95, unknown.coverage_factor, unknown.degrees_of_freedom) == (None, None, INFINITE)


def test_rows_that_one_degree_of_freedom_takes() -> None:
    """Σ w² of Bartlett's weights over m neighbours is (2 M² + 1)/(3 M), M = m + 1."""
    for lag in (0, 1, 4, 20):
        m = lag + 1
        assert lag_weights_power(bartlett(lag)) == pytest.approx((2 * m**2 + 1) / (3 * m))


def test_freedom_of_independent_rows_is_rows_less_unknowns() -> None:
    assert scatter_freedom(np.full(40, 0.3), bartlett(0), 3) == pytest.approx(37.0)
    assert scatter_freedom(np.full(4, 0.3), bartlett(4), 6) == 1.0
    assert scatter_freedom(np.zeros(4), bartlett(4), 6) == 1.0


def _windows(swings: int, share: float) -> tuple[np.ndarray, np.ndarray]:
    """Influence of rows on windows of ± `share` of a period on a sine, and their covariance by a white torque."""
    step = share / 40
    time = np.arange(0.0, swings / 2, step)
    centres = np.arange(share, swings / 2 - share, share / 2)
    place = (time - centres[:, None]) / share
    weights = np.where(np.abs(place) < 1, np.vectorize(phi)(np.clip(place, -1, 1), 0), 0.0) * step
    angle, speed = np.sin(2 * np.pi * time), np.cos(2 * np.pi * time)
    terms = (angle, np.sign(speed), speed, speed * np.abs(speed), np.ones_like(time), np.abs(speed))
    columns = np.column_stack([weights @ term for term in terms])
    fit = fit_linear(columns, np.zeros(len(columns)))
    spare = np.eye(len(columns)) - columns @ fit.influence
    return fit.influence, spare @ weights @ weights.T @ spare.T


@pytest.mark.parametrize(
    ("swings", "share"), [(5, 0.1), (12, 0.1), (40, 0.1), (12, 0.25), (40, 0.25), (20, 0.4), (40, 0.4)]
)
def test_freedom_of_overlapping_windows_is_near_the_exact_one(swings: int, share: float) -> None:
    """Bell and McCaffrey (2002): ν = tr(B)²/tr(B²), B the quadratic form times the residuals' covariance."""
    influence, left = _windows(swings, share)
    count, k, kernel = influence.shape[1], influence[0], np.zeros(influence.shape[1])
    kernel[:5] = bartlett(4)
    lags = np.abs(np.arange(count)[:, None] - np.arange(count))
    form = np.outer(k, k) * kernel[lags] @ left
    exact = np.trace(form) ** 2 / np.trace(form @ form)
    assert exact / 2.3 < scatter_freedom(k, bartlett(4), len(influence)) < 2.3 * exact


def test_joint_covariance_of_a_closed_form_fit() -> None:
    """Intercept and slope of a line through x = 1 … n, and a common scale: V = σ² (X'X)⁻¹ + s s'."""
    x, sigma = np.arange(1.0, 11.0), 0.3
    n, mean = len(x), x.mean()
    power = float(((x - mean) ** 2).sum())
    of_fit = sigma**2 * np.array([[1 / n + mean**2 / power, -mean / power], [-mean / power, 1 / power]])
    slopes = np.array([2.0, -0.5])
    found = evaluate(
        {"intercept": (2.0, "m"), "slope": (-0.5, "m")},
        Scatter("scatter", of_fit, np.full(2, n - 2.0)),
        [(systematic("grid"), "slope", 0.04), (systematic("nothing"), "slope", 0.0)],
        [Declared(stated("scale", "scale"), 0.1, slopes, constant=True), Declared(stated("k", "k"), 0.0, slopes, True)],
    )
    whole = of_fit + 0.01 * np.outer(slopes, slopes) + np.diag([0.0, 0.04**2])
    for k, name in enumerate(found.parameters):
        assert found.parameters[name].standard_uncertainty == pytest.approx(math.sqrt(whole[k, k]))
        expected = whole[k, k] ** 2 / (of_fit[k, k] ** 2 / (n - 2))
        assert found.parameters[name].degrees_of_freedom == pytest.approx(expected)
    r = whole[0, 1] / math.sqrt(whole[0, 0] * whole[1, 1])
    assert found.correlation["intercept"]["slope"] == pytest.approx(r)
    assert found.correlation["slope"]["intercept"] == pytest.approx(r)
    assert found.sensitivities == {"scale": 2.0, "k": 2.0}
    assert [entry.source for entry in found.budget if entry.parameter == "slope"] == ["scatter", "grid", "scale"]
    scale = next(e for e in found.budget if e.source == "scale" and e.parameter == "slope")
    assert (scale.standard_uncertainty, scale.sensitivity) == (pytest.approx(0.05), -0.5)


def test_one_more_error_widens_as_if_it_had_been_there() -> None:
    values, matrix = {"inertia": (1.0, "kg m^2"), "viscous": (2.0, "N m s")}, np.array([[4.0, 1.0], [1.0, 9.0]])
    scattered = Scatter("scatter", matrix, np.array([5.0, 7.0]))
    source = systematic("more")
    whole = evaluate(values, scattered, [(source, "inertia", 1.5)])
    later = evaluate(values, scattered).widened(source, "inertia", 1.5)
    assert later.parameters == whole.parameters
    assert sorted(map(str, later.budget)) == sorted(map(str, whole.budget))
    assert later.correlation["viscous"]["inertia"] == pytest.approx(whole.correlation["inertia"]["viscous"])
    assert later.correlation["inertia"]["inertia"] == 1.0
    assert later.widened(source, "inertia", 0.0) == later


def test_what_is_unknown_has_no_interval_and_no_correlation() -> None:
    values = {"a": (1.0, ""), "b": (2.0, ""), "c": (3.0, "")}
    found = evaluate(values, Scatter("scatter", np.eye(3), np.full(3, INFINITE)), unknown=["b"])
    assert found.parameters["b"].standard_uncertainty is None
    assert set(found.correlation) == {"a", "c"}
    assert evaluate({"a": (1.0, "")}, None, [(systematic("x"), "a", 0.5)]).correlation == {}


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(1, 3), st.integers(0, 4))
def test_two_fits_joined_are_a_covariance(seed: int, p: int, q: int) -> None:
    """Diagonal blocks as given, positive semidefinite, and exact where the model is the covariance itself."""
    random = np.random.default_rng(seed)
    size = 10.0 ** random.uniform(-9, 3, p + q)
    noise = random.normal(size=(p + q, 12)) * size[:, None]
    model = noise @ noise.T
    blocks = model[:p, :p], model[p:, p:], model[:p, p:]
    same = joined(*blocks, blocks[0], blocks[1])
    np.testing.assert_allclose(same / np.outer(size, size), model / np.outer(size, size), atol=1e-6)
    other = random.normal(size=(p, p)) * size[:p, None]
    whole = joined(other @ other.T, blocks[1], blocks[2], blocks[0], blocks[1])
    np.testing.assert_allclose(whole[:p, :p], other @ other.T)
    np.testing.assert_allclose(whole[p:, p:], blocks[1])
    spread = np.sqrt(np.diag(whole))
    assert np.linalg.eigvalsh(whole / np.outer(spread, spread)).min() > -1e-9
    names = [str(k) for k in range(p + q)]
    for row in correlation_of(names, whole).values():
        assert all(-1.0 <= r <= 1.0 for r in row.values())


@settings(max_examples=200)
@given(st.floats(0, 30), st.floats(1e-3, 30), st.floats(0.01, 100), st.floats(1e-9, 1e9))
def test_dark_uncertainty_rises_with_the_gap_and_scales(gap: float, more: float, u: float, unit: float) -> None:
    one, other = dark_uncertainty(gap, 1.0, u), dark_uncertainty(-(gap + more), 1.0, u)
    assert 0 < one <= other * (1 + 1e-6)
    assert dark_uncertainty(gap * unit, unit**2, u * unit) == pytest.approx(one * unit, rel=1e-6)


@pytest.mark.parametrize("u", [0.1, 1.0, 10.0])
def test_dark_uncertainty_at_its_limits(u: float) -> None:
    """Little for a gap of chance, no more than a share of what is poorer known; the gap where it is large."""
    assert dark_uncertainty(0.0, 1.0, u) < 0.35 * min(1.0, u)
    assert dark_uncertainty(1.0, 1.0, u) < 0.5 * min(1.0, u)
    for gap in (10.0, 1e3, 1e6):
        assert dark_uncertainty(gap, 1.0, u) == pytest.approx(math.sqrt(gap**2 - 1), rel=0.3 / gap + 1e-6)
    assert dark_uncertainty(2.5, 0.0, u) == 2.5
    assert dark_uncertainty(0.0, 0.0, u) == 0.0


def test_dark_uncertainty_has_no_cliff() -> None:
    gaps = np.linspace(0, 8, 801)
    found = np.array([dark_uncertainty(gap, 1.0, 1.0) for gap in gaps])
    assert np.max(np.diff(found)) < 0.03  # a test at 3 standard deviations jumps by 2.8


def test_dark_uncertainty_hardly_widens_what_is_right() -> None:
    random = np.random.default_rng(7)
    for u in (0.2, 1.0, 3.0):
        widened = [math.hypot(1, dark_uncertainty(gap, 1.0, u) / u) for gap in random.normal(size=3000)]
        assert np.mean(widened) < 1.06


def test_an_excess_counts_by_how_sure_it_is() -> None:
    assert shrunk(2.0, 0.0) == 2.0
    assert shrunk(1.0, 1.0) == 0.5
    assert shrunk(0.0, 0.0) == 0.0
    np.testing.assert_allclose(shrunk(np.array([0.1, -3.0]), 1.0), [0.001 / 1.01, -2.7])


def two_sided(level: float) -> float:
    """Probability that a normal quantity is farther than `level` standard deviations from its mean."""
    return math.erfc(level / math.sqrt(2))


def test_levels_have_the_probabilities_beside_them() -> None:
    assert two_sided(INDICATED) == pytest.approx(2.7e-3, rel=0.01)
    assert two_sided(DETECTED) == pytest.approx(6.3e-5, rel=0.01)
    assert two_sided(CERTAIN) == pytest.approx(5.7e-7, rel=0.01)
    assert two_sided(family_level(1)) == pytest.approx(0.01)
    assert two_sided(family_level(50)) == pytest.approx(0.01 / 50)


def test_few_swings_are_covered_by_students_interval() -> None:
    """A mean of six normal values: the normal factor covers 89 %, Student's 95 %."""
    random, count, runs = np.random.default_rng(3), 6, 4000
    values = random.normal(size=(runs, count))
    influence = np.full(count, 1 / count)
    spread = values.std(axis=1, ddof=1) / math.sqrt(count)
    freedom = scatter_freedom(influence, bartlett(0), 1)
    off = np.abs(values.mean(axis=1)) / spread
    assert freedom == pytest.approx(5.0)
    assert np.mean(off < coverage_factor(freedom)) == pytest.approx(0.95, abs=0.012)
    assert np.mean(off < COVERAGE_FACTOR) < 0.91


def test_sources_survive_the_file(tmp_path: Path) -> None:
    budget = (
        BudgetEntry(scatter("noise", 7.5), "inertia", 3.0),
        BudgetEntry(Source("rows", "A", None, False, INFINITE, "rectangular"), "inertia", 1.0),
        BudgetEntry(stated("wheel", "drive.wheel.inertia"), "inertia", 2.0, -0.5),
    )
    freedom = freedom_of(budget, "inertia")
    parameters = {"inertia": Parameter.of(100.0, combined(budget, "inertia"), "kg m^2", freedom)}
    correlation = {"inertia": {"inertia": 1.0, "viscous": -0.25}, "viscous": {"inertia": -0.25, "viscous": 1.0}}
    result = Result("momentum", "ok", parameters, budget=budget, correlation=correlation)
    path = tmp_path / "r.json"
    path.write_text(result.to_json(), encoding="utf-8")
    again = load_result(path)
    assert (again.parameters, again.budget, again.correlation) == (parameters, budget, correlation)
    data = json.loads(result.to_json())
    assert data["parameters"]["inertia"]["coverage_factor"] == pytest.approx(coverage_factor(freedom))
    assert list(data["budget"][0])[:6] == [
        "source",
        "type",
        "parameter",
        "standard_uncertainty",
        "sensitivity",
        "shared_id",
    ]


def test_files_without_the_new_keys_load(tmp_path: Path) -> None:
    result = Result(
        "momentum",
        "ok",
        {"inertia": Parameter.of(1.0, 0.1, "kg m^2")},
        budget=(BudgetEntry(scatter("scatter", 4.0), "inertia", 0.1),),
    )
    data = result.to_dict()
    for table in (*data["budget"], *data["parameters"].values()):  # type: ignore[misc, attr-defined]
        for key in ("degrees_of_freedom", "coverage_factor", "distribution", "averages_over_logs"):
            table.pop(key, None)
    path = tmp_path / "old.json"
    path.write_text(json.dumps(data), encoding="utf-8")
    again = load_result(path)
    assert again.inertia == result.inertia
    assert again.budget[0].origin == Source("scatter", "A")
    assert again.correlation == {}


def test_levels_are_named_in_one_file() -> None:
    """No check has a level of its own, as `CERTAIN = 5.0`."""
    names = re.compile(r"^(CERTAIN|SEEN|DETECTED|SURE|LIKELY|BETTER|FALSE_ALARMS|INDICATED) = ", re.M)
    package = Path(swingid.__file__).parent
    folders = ("balance", "batch", "calibration", "checks", "methods", "pooling", "recursive", "study")
    files = [file for folder in folders for file in sorted((package / folder).rglob("*.py"))]
    assert len(files) > 100
    assert [file.name for file in files if names.search(file.read_text(encoding="utf-8"))] == []
