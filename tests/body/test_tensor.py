"""The inertia tensor from several axes: closed forms, least squares of SciPy, coverage, refusals, files, twin."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import swingid as sw
from body_on_axis import inertia_about, rig_about
from refusals import coded
from swingid.body.answer import Tensor
from swingid.body.axes import Identities, read_axes
from swingid.body.directions import (
    NAMES,
    condition,
    elements_of,
    hemisphere,
    matrix_of,
    next_direction,
    rank_of,
    rows_of,
)
from swingid.body.fit import fit
from swingid.body.physical import closest, second_moments
from swingid.body.tables import axes_from_text
from swingid.cli import main
from swingid.errors import InputError, SwingidError, UnanswerableError, UsageError
from swingid.numerics.arrays import Array
from swingid.result.result import Message, Parameter, Result, combined
from swingid.uncertainty.budget import BudgetEntry, scatter, stated
from swingid.uncertainty.uncertain import covariance

GOLDEN = (1 + math.sqrt(5)) / 2
ICOSAHEDRON = [[0, 1, GOLDEN], [0, 1, -GOLDEN], [1, GOLDEN, 0], [1, -GOLDEN, 0], [GOLDEN, 0, 1], [-GOLDEN, 0, 1]]
DIAGONALS = [[1, 1, 0], [1, 0, 1], [0, 1, 1]]
THREE = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
NINE = [*THREE, *DIAGONALS, [1, -1, 0], [1, 0, -1], [0, 1, -1]]
THIRTEEN = [*NINE, [1, 1, 1], [1, 1, -1], [1, -1, 1], [-1, 1, 1]]
TRUE = np.array([[2.2e-3, -2e-4, 5e-5], [-2e-4, 2.7e-3, 5e-4], [5e-5, 5e-4, 1.8e-3]])
HEAD = '[every_axis]\ntilt = "0.05 deg"\ndistance = "0 mm"\n'


def unit(vectors: Any) -> Array:
    found = np.asarray(vectors, dtype=float)
    return found / np.linalg.norm(found, axis=-1, keepdims=True)


def made(value: float, u: float, common: float = 0.0, key: str = "drive.wheel.inertia") -> Result:
    """A result with scatter, and a relative uncertainty by a constant that all results share."""
    budget = [BudgetEntry(scatter("scatter of the windows"), "inertia", u)]
    if common:
        budget.append(BudgetEntry(stated(key, key), "inertia", common * value, value / 1e-4))
    parameter = Parameter.of(value, combined(budget, "inertia"), "kg m^2")
    return Result("momentum", "ok", {"inertia": parameter}, budget=tuple(budget))


def text_of(directions: Any, head: str = HEAD) -> str:
    return head + "".join(f"[[axis]]\ndirection = {list(map(float, n))}\n" for n in directions)


def solved(
    tensor: Array = TRUE,
    directions: Any = NINE,
    *,
    u: float = 1e-4,
    head: str = HEAD,
    noise: Array | None = None,
    common: float = 0.0,
) -> Tensor:
    """From exact inertias (times 1 + noise)."""
    values = rows_of(unit(directions)) @ elements_of(tensor)
    if noise is not None:
        values = values * (1 + noise)
    results = [made(float(value), u * float(value), common) for value in values]
    return sw.tensor(axes_from_text(text_of(directions, head), results=len(results)), results)


# closed forms


def test_a_brick_about_thirteen_axes() -> None:
    a, b, c, mass = 0.1, 0.2, 0.3, 2.0
    brick = mass / 12 * np.diag([b * b + c * c, a * a + c * c, a * a + b * b])
    found = solved(brick, THIRTEEN)
    assert np.allclose(found.matrix, brick, atol=1e-12 * brick.max())
    assert [p.moment.value for p in found.principal] == pytest.approx(sorted(np.diag(brick), reverse=True))
    assert found.status == "ok"
    assert found.chi_square == pytest.approx(0, abs=1e-9)
    assert found.degrees_of_freedom == 7


def test_rows_are_the_quadratic_form() -> None:
    rng = np.random.default_rng(1)
    n = unit(rng.normal(size=(20, 3)))
    assert np.allclose(rows_of(n) @ elements_of(TRUE), np.einsum("ni,ij,nj->n", n, TRUE, n))
    assert np.array_equal(matrix_of(elements_of(TRUE)), TRUE)


def test_condition_numbers_of_known_designs() -> None:
    assert condition(unit(THREE + DIAGONALS)) == pytest.approx(GOLDEN**2)
    assert condition(unit(ICOSAHEDRON)) == pytest.approx(math.sqrt(5 / 2))
    assert condition(unit(NINE)) == pytest.approx(math.sqrt(2))
    assert rank_of(unit(ICOSAHEDRON)) == 6


def test_a_distance_is_taken_out_by_huygens_and_steiner() -> None:
    mass, d = 1.5, 0.02
    head = f'[body]\nmass = "{mass} ± 0.001 kg"\n[every_axis]\ntilt = 0\ndistance = "20 ± 0.05 mm"\n'
    values = rows_of(unit(NINE)) @ elements_of(TRUE) + mass * d**2
    found = sw.tensor(axes_from_text(text_of(NINE, head), results=9), [made(v, 1e-9) for v in values.tolist()])
    assert np.allclose(found.matrix, TRUE, atol=1e-12)
    # one mass for all axes: each J_axis less m d², an isotropic change of the tensor
    budget = {e.source: e for e in found.budget if e.parameter == "xx"}
    assert budget["body.mass"].standard_uncertainty == pytest.approx(0.001 * d**2)
    assert "body.mass" not in {e.source for e in found.budget if e.parameter == "xy" and e.standard_uncertainty > 1e-15}
    assert found.axes[0].central.standard_uncertainty == pytest.approx(
        math.hypot(1e-9, 0.001 * d**2, 2 * mass * d * 5e-5, math.sqrt(3) * mass * 5e-5**2)
    )


def test_a_point_and_a_centre_of_mass_give_the_distance() -> None:
    mass, centre = 1.5, np.array([0.01, -0.02, 0.03])
    head = (
        '[body]\nmass = 1.5\ncentre_of_mass = ["10 mm", "-20 mm", "30 mm"]\n[every_axis]\ntilt = 0\npoint = [0, 0, 0]\n'
    )
    values = [inertia_about(TRUE, mass, centre, n, np.zeros(3))[0] for n in unit(NINE)]
    found = sw.tensor(axes_from_text(text_of(NINE, head), results=9), [made(v, 1e-7) for v in values])
    assert np.allclose(found.matrix, TRUE, atol=1e-12)
    assert {note.code for note in found.notes} == {"exact-constants"}


def test_a_gravity_torque_gives_the_distance() -> None:
    mass, g, d = 1.5, 9.81, 0.02
    head = f"[body]\nmass = {mass}\ngravity = {g}\n[every_axis]\ntilt = 0\ngravity_torque = {mass * g * d!r}\n"
    values = rows_of(unit(NINE)) @ elements_of(TRUE) + mass * d**2
    found = sw.tensor(axes_from_text(text_of(NINE, head), results=9), [made(v, 1e-7) for v in values.tolist()])
    assert np.allclose(found.matrix, TRUE, atol=1e-12)


def test_a_stated_gravity_torque_of_the_result_is_the_source_of_its_inertia() -> None:
    """An error of b moves the inertia of the result by s δb and m d² by 2 b δb/(m g²): both, with their signs."""
    mass, g, b, std, slope = 1.5, 9.81, 0.3, 3e-4, 0.01
    key = "axis.gravity_torque"
    budget = (
        BudgetEntry(scatter("scatter"), "inertia", 1e-9),
        BudgetEntry(stated(key, key), "inertia", slope * std, slope),
    )
    value = 3e-3
    parameters = {"inertia": Parameter.of(value, combined(budget, "inertia"), "kg m^2")}
    constants = {"constants": {key: {"value": b, "std": std}}}
    one = Result("momentum", "ok", parameters, budget=budget, provenance=constants)
    head = f'[body]\nmass = {mass}\ngravity = {g}\n[every_axis]\ntilt = 0\ngravity_torque = "result"\n'
    axes, _, _ = read_axes(axes_from_text(text_of([[1, 0, 0]], head), results=1), [one])
    assert axes[0].central.value == pytest.approx(value - b**2 / (mass * g**2))
    expected = abs(slope - 2 * b / (mass * g**2)) * std
    second = math.sqrt(3) * std**2 / (mass * g**2)
    assert axes[0].central.u == pytest.approx(math.hypot(1e-9, expected, second), rel=1e-9)


def test_an_identified_gravity_torque_is_correlated_with_its_inertia() -> None:
    """Scatter of both by their covariance: u² = u_J² + s² u_b² − 2 s r u_J u_b with s = 2 b/(m g²)."""
    mass, g, b, u_j, u_b, r = 1.5, 9.81, 0.3, 1e-6, 2e-5, 0.8
    budget = (
        BudgetEntry(scatter("scatter"), "inertia", u_j),
        BudgetEntry(scatter("scatter"), "gravity_torque", u_b),
    )
    parameters = {
        "inertia": Parameter.of(3e-3, u_j, "kg m^2"),
        "gravity_torque": Parameter.of(b, u_b, "N m"),
    }
    correlation = {
        "inertia": {"inertia": 1.0, "gravity_torque": r},
        "gravity_torque": {"inertia": r, "gravity_torque": 1.0},
    }
    one = Result("momentum", "ok", parameters, budget=budget, correlation=correlation)
    head = f'[body]\nmass = {mass}\ngravity = {g}\n[every_axis]\ntilt = 0\ngravity_torque = "result"\n'
    axes, _, _ = read_axes(axes_from_text(text_of([[1, 0, 0]], head), results=1), [one])
    s = 2 * b / (mass * g**2)
    expected = u_j**2 + (s * u_b) ** 2 - 2 * s * r * u_j * u_b
    assert axes[0].central.u == pytest.approx(math.sqrt(expected), rel=1e-3)


def test_a_fixture_is_subtracted_and_its_error_is_common(tmp_path: Path) -> None:
    empty = made(1e-3, 1e-6)
    (tmp_path / "empty.json").write_text(empty.to_json(), encoding="utf-8")
    head = '[every_axis]\ntilt = 0\ndistance = 0\nfixture = "empty.json"\n'
    values = rows_of(unit(NINE)) @ elements_of(TRUE) + 1e-3
    axes = axes_from_text(text_of(NINE, head), "axes.toml", tmp_path, 9)
    found = sw.tensor(axes, [made(v, 1e-12) for v in values.tolist()])
    assert np.allclose(found.matrix, TRUE, atol=1e-12)
    u = np.sqrt(np.diag(found.covariance))
    assert u[:3] == pytest.approx([1e-6] * 3, rel=1e-3)  # not averaged over nine axes
    assert u[3:] == pytest.approx([0] * 3, abs=1e-8)  # cancels in the products of inertia


def test_differences_with_one_tare_share_its_error() -> None:
    """Scatter of the run without the body is one error in all differences."""

    def body(value: float, k: int) -> Result:
        budget = (
            BudgetEntry(scatter("scatter (tare)"), "inertia", 1e-6),
            BudgetEntry(scatter("scatter (loaded)"), "inertia", 1e-12),
        )
        origin = {"tare": {"log_sha256": "same"}, "loaded": {"log_sha256": f"log {k}"}}
        parameter = Parameter.of(value, 1e-6, "kg m^2")
        return Result("difference", "ok", {"inertia": parameter}, budget=budget, provenance=origin)

    values = rows_of(unit(NINE)) @ elements_of(TRUE)
    head = "[every_axis]\ntilt = 0\ndistance = 0\n"
    found = sw.tensor(
        axes_from_text(text_of(NINE, head), results=9), [body(v, k) for k, v in enumerate(values.tolist())]
    )
    assert math.sqrt(found.covariance[0, 0]) == pytest.approx(1e-6, rel=1e-3)


# least squares


def test_the_estimate_is_generalised_least_squares() -> None:
    """Against whitened least squares of SciPy on the covariance that the axes state, with a mounting in common."""
    from scipy.linalg import cholesky, lstsq, solve_triangular

    head = '[mounting.cube]\nrotation = "0.03 deg"\n' + HEAD + 'mounting = "cube"\n'
    noise = 1e-3 * np.random.default_rng(2).normal(size=13)
    values = rows_of(unit(THIRTEEN)) @ elements_of(TRUE) * (1 + noise)
    sizes = values * np.linspace(1e-4, 1e-3, 13)
    results = [made(float(v), float(u)) for v, u in zip(values, sizes, strict=True)]
    axes, identities, _ = read_axes(axes_from_text(text_of(THIRTEEN, head), results=13), results)
    found = fit(axes, frozenset(identities.keys))
    spread = covariance(found.measured)
    root = cholesky(spread, lower=True)
    rows = solve_triangular(root, rows_of(unit(THIRTEEN)), lower=True)
    expected = lstsq(rows, solve_triangular(root, values, lower=True))[0]
    assert found.values == pytest.approx(expected, rel=1e-9)
    assert np.allclose(found.covariance, np.linalg.inv(rows.T @ rows), rtol=1e-6)
    residual = solve_triangular(root, values, lower=True) - rows @ expected
    assert found.chi_square == pytest.approx(float(residual @ residual), rel=1e-6)


def test_the_tilt_is_propagated_through_the_tensor() -> None:
    """u = 2 |J n − n nᵀJn| tilt to first order: by differences of the quadratic form."""
    n = unit([[1, 1, 0]])[0]
    axes, _, _ = read_axes(axes_from_text(text_of([[1, 1, 0]]), results=1), [made(float(n @ TRUE @ n), 1e-12)])
    step, changes = 1e-6, []
    for e in unit([[1, -1, 0], [0, 0, 1]]):
        m = unit(n + step * e)
        changes.append((m @ TRUE @ m - n @ TRUE @ n) / step * math.radians(0.05))
    assert axes[0].tilted(TRUE).u == pytest.approx(math.hypot(*changes), rel=1e-3)


def test_about_a_principal_axis_the_second_order_remains() -> None:
    tensor, tilt = np.diag([1.0, 2.0, 4.0]), math.radians(2.0)
    head = '[every_axis]\ntilt = "2 deg"\ndistance = 0\n'
    axes, _, _ = read_axes(axes_from_text(text_of([[1, 0, 0]], head), results=1), [made(1.0, 1e-12)])
    rng = np.random.default_rng(3)
    off = np.c_[np.ones(200_000), tilt * rng.normal(size=(200_000, 2))]
    n = unit(off)
    errors = np.einsum("ni,ij,nj->n", n, tensor, n) - 1.0
    assert axes[0].tilted(tensor).u == pytest.approx(math.sqrt(np.mean(errors**2)), rel=0.02)


def test_a_mounting_turns_the_tensor_and_leaves_its_moments() -> None:
    head = '[mounting.cube]\nrotation = "0.5 deg"\n[every_axis]\ntilt = 0\ndistance = 0\nmounting = "cube"\n'
    found = solved(head=head, u=1e-6)
    spread = [p.moment.standard_uncertainty / p.moment.value for p in found.principal if p.moment.standard_uncertainty]
    assert max(spread) < 2e-6
    assert math.sqrt(found.covariance[3, 3]) > 1e-3 * TRUE.max()
    assert all(math.degrees(p.angle) == pytest.approx(0.5, rel=0.01) for p in found.principal)


def test_what_results_share_scales_the_tensor_and_does_not_average() -> None:
    found = solved(common=1e-3, u=1e-7, head="[every_axis]\ntilt = 0\ndistance = 0\n")
    u = np.sqrt(np.diag(found.covariance))
    assert u == pytest.approx(1e-3 * np.abs(elements_of(TRUE)), rel=1e-3)
    budget = {e.source: e for e in found.budget if e.parameter == "zz"}
    assert budget["drive.wheel.inertia"].shared_id == "drive.wheel.inertia"


def test_a_common_scale_does_not_pull_the_estimate_towards_scatter() -> None:
    """In full generalised least squares an outlying axis moves a common scale (Peelle); weights leave that out."""
    noise = np.zeros(13)
    noise[4] = 0.02
    plain = solved(directions=THIRTEEN, noise=noise, u=1e-4)
    shared = solved(directions=THIRTEEN, noise=noise, u=1e-4, common=0.01)
    assert np.allclose(plain.matrix, shared.matrix, rtol=1e-9)


def test_constants_with_other_values_are_other_quantities() -> None:
    identities = Identities()
    one, other = made(1e-3, 1e-6, 1e-3), made(2e-3, 1e-6, 1e-3)
    keys = [identities.of(result, "x")(result.budget[1]) for result in (one, other)]
    assert keys[0] == keys[1]  # 0.1 % of 1e-4 kg m² in both
    further = made(1e-3, 1e-6, 2e-3)
    assert identities.of(further, "x")(further.budget[1]) != keys[0]


# consistency


def test_the_axis_that_disagrees_is_named() -> None:
    noise = np.zeros(13)
    noise[10] = 0.01
    found = solved(directions=THIRTEEN, noise=noise)
    assert found.status == "warning"
    assert [m.code for m in found.warnings] == ["axes-disagree"]
    assert "axis 11 disagrees" in found.warnings[0].message
    assert found.probability is not None
    assert found.probability < 1e-6


def test_in_a_plane_the_two_diagonals_cannot_be_told_apart() -> None:
    """Their sum is that of the two axes: an error of either gives the same residuals."""
    noise = np.zeros(9)
    noise[3] = 0.01
    found = solved(noise=noise)
    assert "axis 4, axis 7" in found.warnings[0].message
    assert "cannot be decided" in found.warnings[0].message


def test_six_axes_are_checked_by_nothing() -> None:
    found = solved(directions=ICOSAHEDRON)
    assert (found.degrees_of_freedom, found.probability) == (0, None)
    assert all(axis.deviation is None for axis in found.axes)
    assert "nothing checks them" in found.summary()


def test_an_axis_that_nothing_checks_is_named() -> None:
    directions = [*THREE, [1, 1, 0], [1, -1, 0], [1, 0, 1], [0, 1, 1]]
    found = solved(directions=directions)
    note = next(note for note in found.notes if note.code == "axes-unchecked")
    assert note.message.endswith("axis 3, axis 6, axis 7.")


def test_warnings_of_results_are_kept_with_the_axis() -> None:
    values = rows_of(unit(NINE)) @ elements_of(TRUE)
    results = [made(float(v), 1e-4 * float(v)) for v in values]
    doubtful = Result("momentum", "warning", results[0].parameters, (Message("late-channel", "the wheel is late."),),
                      budget=results[0].budget)  # fmt: skip
    found = sw.tensor(axes_from_text(text_of(NINE), results=9), [doubtful, *results[1:]])
    assert found.warnings == (Message("late-channel", "axis 1: the wheel is late."),)


# principal axes, prediction, next axis


def test_equal_moments_have_no_axes() -> None:
    found = solved(np.diag([3e-3, 3e-3, 1e-3]))
    assert [p.together for p in found.principal] == [(1,), (0,), ()]
    assert found.principal[0].moment.interval95 == found.principal[1].moment.interval95
    assert "axis not determined" in found.summary()
    assert all(p.together for p in solved(np.diag([3e-3, 3e-3, 3e-3])).principal)


def test_angles_of_principal_axes_have_their_scatter() -> None:
    """By draws of the elements from their covariance."""
    found = solved()
    rng = np.random.default_rng(4)
    draws = rng.multivariate_normal(elements_of(found.matrix), found.covariance, size=2000)
    _, vectors = np.linalg.eigh([matrix_of(draw) for draw in draws])
    axis = found.principal[0].direction
    across = [unit(np.cross(axis, other.direction)) for other in found.principal[1:]]
    sides = [np.std((vectors[:, :, 2] @ e) * np.sign(vectors[:, :, 2] @ axis)) for e in across]
    assert found.principal[0].angle == pytest.approx(max(sides), rel=0.06)


def test_prediction_about_another_axis() -> None:
    head = '[body]\nmass = "1.5 ± 0.001 kg"\n' + HEAD
    found = solved(head=head)
    n = unit([1, 2, 3])
    inside = found.about([1, 2, 3])
    assert inside.value == pytest.approx(float(n @ TRUE @ n))
    row = rows_of(n[None])[0]
    assert inside.standard_uncertainty == pytest.approx(math.sqrt(row @ found.covariance @ row))
    off = found.about([1, 2, 3], "10 ± 0.1 mm")
    assert off.value == pytest.approx(inside.value + 1.5 * 1e-4)
    assert off.standard_uncertainty == pytest.approx(
        math.hypot(inside.standard_uncertainty or 0, 1e-3 * 1e-4, 2 * 1.5 * 0.01 * 1e-4)
    )
    assert found.product([1, 0, 0], [0, 1, 0]).value == pytest.approx(TRUE[0, 1])
    with pytest.raises(UsageError, match=r"needs body\.mass"):
        solved().about([0, 0, 1], "1 mm")
    with pytest.raises(UsageError) as caught:
        solved().about([0, 0, 0])
    assert caught.value.code == "bad-direction"


def test_the_next_axis_is_the_best_of_all_tried() -> None:
    rows = rows_of(unit([*THREE, *DIAGONALS]))
    spread = np.linalg.inv(rows.T @ rows)
    weights = np.array([1, 1, 1, 2, 2, 2])
    direction, left = next_direction(spread, np.ones(len(hemisphere())))
    totals = [np.diag(np.linalg.inv(rows.T @ rows + np.outer(h, h))) @ weights for h in rows_of(hemisphere()[::10])]
    best = np.diag(np.linalg.inv(rows.T @ rows + np.outer(*[rows_of(direction[None])[0]] * 2))) @ weights
    assert best <= min(totals) + 1e-12
    assert left == pytest.approx(best / (np.diag(spread) @ weights))


# what a body can have


def test_a_tensor_that_no_body_has_is_refused() -> None:
    with pytest.raises(UnanswerableError, check=coded("not-physical")) as caught:
        solved(np.diag([3e-3, 1e-3, 1e-3]))
    assert (caught.value.code, caught.value.exit_code) == ("not-physical", 4)


def test_a_thin_body_within_its_uncertainty_gets_the_closest_tensor() -> None:
    plate = np.diag([3e-3, 1.8e-3, 1.2e-3])
    beyond = plate + np.diag([1e-7, -1e-7, 0])
    found = solved(beyond, u=1e-4)
    assert [note.code for note in found.notes] == ["triangle-inequality"]
    assert np.linalg.eigvalsh(second_moments(found.matrix))[0] > 0
    assert np.all(np.abs(elements_of(found.matrix - beyond)) < 2 * np.sqrt(np.diag(found.covariance)))


def test_the_closest_tensor_is_the_projection() -> None:
    """In the metric of the covariance, onto the edge where the largest moment is the sum of the others."""
    values = elements_of(np.diag([3.2e-3, 1.8e-3, 1.2e-3]))
    spread = np.diag([1.0, 2.0, 3.0, 1.0, 1.0, 1.0]) * 1e-14
    found = closest(values, spread)
    # by hand: least Σ (δ_k/u_k)² with δ_xx − δ_yy − δ_zz = −0.2e-3
    u = np.array([1.0, 2.0, 3.0])
    sign = np.array([1.0, -1.0, -1.0])
    expected = values[:3] - 2e-4 * sign * u / u.sum()
    assert found[:3] == pytest.approx(expected, rel=1e-4)
    assert found[3:] == pytest.approx([0, 0, 0], abs=1e-9)


def test_a_possible_tensor_stays() -> None:
    assert "triangle-inequality" not in {note.code for note in solved().notes}


# coverage


@pytest.mark.long
def test_intervals_cover_every_element() -> None:
    """Nine axes of 0.01 % with 0.05 deg of tilt: every element within 0.05 % (RMS), 93 … 97 % of intervals cover."""
    covered, errors = _draws(1000)
    assert np.all(covered > 0.93)
    assert np.all(covered < 0.97)
    assert np.all(errors < 5e-4)


def test_intervals_cover_in_a_few_draws() -> None:
    covered, errors = _draws(60)
    assert covered.mean() > 0.9
    assert np.all(errors < 5e-4)


def _draws(count: int) -> tuple[Array, Array]:
    rng, hits, off = np.random.default_rng(5), [], []
    tilt = math.radians(0.05)
    for _ in range(count):
        q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        true = q @ np.diag([3e-3, 2.2e-3, 1.5e-3]) @ q.T
        # a normal vector less its part along n has the same spread about both lines across
        n = unit(NINE)
        e = tilt * rng.normal(size=n.shape)
        m = unit(n + e - n * np.sum(n * e, axis=1, keepdims=True))
        values = (rows_of(m) @ elements_of(true)) * (1 + 1e-4 * rng.normal(size=9))
        found = sw.tensor(axes_from_text(text_of(NINE), results=9), [made(v, 1e-4 * v) for v in values.tolist()])
        ends = np.array([found.elements[name].interval95 for name in NAMES], dtype=float)
        hits.append((ends[:, 0] <= elements_of(true)) & (elements_of(true) <= ends[:, 1]))
        off.append((elements_of(found.matrix) - elements_of(true)) / 3e-3)
    return np.mean(hits, axis=0), np.sqrt(np.mean(np.square(off), axis=0))


# files and refusals

ONE = '[[axis]]\nname = "x"\ndirection = [1, 0, 0]\ninertia = "1 ± 0.01 g*m^2"\n'
BAD = {
    "no axis": ("[body]\nmass = 1", "axis must be a list of tables"),
    "no list": ("axis = 1", "axis must be a list of tables"),
    "zero": (HEAD + ONE.replace("[1, 0, 0]", "[0, 0, 0]"), "axis 1 (x): direction has no length"),
    "two numbers": (HEAD + ONE.replace("[1, 0, 0]", "[1, 0]"), "must be three numbers"),
    "not finite": (HEAD + ONE.replace("[1, 0, 0]", "[1, nan, 0]"), "must be three numbers"),
    "unit": (HEAD + ONE.replace("g*m^2", "g*m"), "inertia is given in 'g*m', but is expected in kg*m^2"),
    "no uncertainty": (HEAD + ONE.replace("± 0.01 ", ""), "inertia has no uncertainty"),
    "no tilt": ('[every_axis]\ndistance = "0 mm"\n' + ONE, "tilt is missing"),
    "tilt in degrees": ("[every_axis]\ntilt = 0.5\n" + ONE, "every_axis: tilt"),
    "no lever": ("[every_axis]\ntilt = 0\n" + ONE, "distance is missing"),
    "no mass": ('[every_axis]\ntilt = 0\ndistance = "1 mm"\n' + ONE, "body.mass is missing"),
    "two levers": (HEAD + ONE + 'point = [0, 0, 0]\ngravity_torque = "1 N*m"\n', "is given beside point"),
    "two inertias": (HEAD + ONE + 'result = "x.json"\n', "inertia is given beside result"),
    "no file": (HEAD + ONE.replace('inertia = "1 ± 0.01 g*m^2"', 'result = "none.json"'), "none.json does not exist"),
    "typo": (HEAD + ONE.replace("direction", "directon"), "did you mean direction?"),
    "mounting": (HEAD + 'mounting = "c"\n' + ONE, "no table [mounting.c]"),
    "no centre": ("[body]\nmass = 1\n[every_axis]\ntilt = 0\npoint = [0, 0, 0]\n" + ONE, "needs body.centre_of_mass"),
    "no result": ('[body]\nmass = 1\n[every_axis]\ntilt = 0\ngravity_torque = "result"\n' + ONE, "has no result"),
    "lever too long": ('[body]\nmass = 1\n[every_axis]\ntilt = 0\ndistance = "1 m"\n' + ONE, "m d^2 = 1 kg m^2"),
    "fixture": (HEAD + 'fixture = "2 g*m^2"\n' + ONE, "fixture has no less inertia"),
    "same name": (HEAD + ONE + ONE, "two axes are called 'x'"),
    "rig": ('name = "x"\n[drive]\nkind = "none"\n', "is a rig file"),
    "not toml": ('{"schema": 1}', "is not TOML"),
}  # fmt: skip


@pytest.mark.parametrize(("text", "words"), BAD.values(), ids=BAD)
def test_a_bad_file_is_one_sentence_with_its_remedy(text: str, words: str) -> None:
    with pytest.raises(InputError) as caught:
        sw.tensor(axes_from_text(text, "b.toml"))
    message = caught.value.message.replace("every_axis.tilt", "every_axis: tilt")
    assert words in message
    assert message.startswith("b.toml")
    assert caught.value.exit_code == 3


@pytest.mark.parametrize(
    ("directions", "words"),
    [
        (THREE, "3 axes cannot determine the six elements of the tensor; add 3 axes, the first along about"),
        ([[1, 0, 0]], "1 axis cannot"),
        ([[math.cos(a), math.sin(a), 0] for a in range(8)], "the 8 axes lie in one plane"),
        ([*THREE, *THREE], "the 6 axes have only 3 independent directions"),
        ([*THREE, [1, 1, 0], [1, -1, 0], [1, 2, 0]], "only 4 independent"),
        ([*THREE, [1, 1, 0], [1, 0, 1], [1, 0, -1]], "only 5 independent directions, and the tensor has six elements; "
         "add an axis along"),
    ],
)  # fmt: skip
def test_axes_that_do_not_determine_a_tensor(directions: Any, words: str) -> None:
    with pytest.raises(UnanswerableError) as caught:
        solved(directions=directions)
    assert words in caught.value.message
    assert caught.value.code == "not-identifiable"


def test_the_missing_axis_is_one_that_helps() -> None:
    directions = [*THREE, [1, 1, 0], [1, 0, 1], [1, 0, -1]]
    with pytest.raises(UnanswerableError) as caught:
        solved(directions=directions)
    named = [float(part) for part in caught.value.message.rpartition("[")[2].strip("].").split()]
    assert rank_of(unit([*directions, named])) == 6


def test_axes_close_to_a_plane_are_refused_for_their_uncertainty() -> None:
    nearly = [[math.cos(a), math.sin(a), 1e-2 * math.sin(3 * a)] for a in range(9)]
    with pytest.raises(UnanswerableError, check=coded("not-identifiable")):
        solved(directions=nearly)


def test_results_that_cannot_be_used(tmp_path: Path) -> None:
    axes = axes_from_text(text_of([[1, 0, 0]]), results=1)
    good = made(1e-3, 1e-6)
    linear = Result("momentum", "ok", {"inertia": Parameter.of(1.0, 0.1, "kg")})
    unknown = Result("momentum", "ok", {"inertia": Parameter.of(1.0, None, "kg m^2")})
    refused = Result("momentum", "refused", error=Message("x", "it does not swing."))
    for result, words in ((linear, "linear axis"), (unknown, "no uncertainty"), (refused, "it does not swing;")):
        with pytest.raises(InputError, match=words):
            sw.tensor(axes, [result])
    with pytest.raises(InputError, check=coded("count", "1 axes", "2 results")):
        sw.tensor(axes, [good, good])
    logged = Result("momentum", "ok", good.parameters, budget=good.budget, provenance={"log_sha256": "a"})
    with pytest.raises(InputError, check=coded("same-log")):
        sw.tensor(axes_from_text(text_of(THREE), results=3), [logged] * 3)


@settings(max_examples=150, deadline=None)
@given(
    st.recursive(
        st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=12) | st.just("1 ± 0.1 g*m^2"),
        lambda inner: st.lists(inner, max_size=4)
        | st.dictionaries(
            st.sampled_from(["body", "axis", "every_axis", "direction", "inertia", "tilt", "distance", "point", "mass",
                             "mounting", "rotation", "fixture", "gravity_torque", "result", "centre_of_mass", "q"]),
            inner, max_size=5),
        max_leaves=12,
    )
)  # fmt: skip
def test_any_document_is_read_or_refused(document: Any) -> None:
    from swingid.model.rig.edit import to_toml

    try:
        text = to_toml(document if isinstance(document, dict) else {"axis": [document]})
    except Exception:
        text = json.dumps(document)
    try:
        sw.tensor(axes_from_text(text))
    except SwingidError as error:
        assert error.exit_code in (2, 3, 4)


@settings(max_examples=100, deadline=None)
@given(st.lists(st.floats(0.2, 5), min_size=3, max_size=3), st.integers(0, 10_000))
def test_any_body_is_found_from_exact_axes(powers: list[float], seed: int) -> None:
    """Second moments of any size in any orientation."""
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    moments = q @ np.diag(powers) @ q.T
    tensor = 1e-3 * (np.trace(moments) * np.eye(3) - moments)
    assert np.allclose(solved(tensor, THIRTEEN).matrix, tensor, atol=1e-9 * np.trace(tensor))


# the command


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    values = rows_of(unit(NINE)) @ elements_of(TRUE)
    lines = [HEAD]
    for k, (n, value) in enumerate(zip(NINE, values.tolist(), strict=True)):
        (tmp_path / f"r{k}.json").write_text(made(value, 1e-4 * value).to_json(), encoding="utf-8")
        lines.append(f'[[axis]]\nname = "n{k}"\nresult = "r{k}.json"\ndirection = {n}\n')
    (tmp_path / "axes.toml").write_text("".join(lines), encoding="utf-8")
    (tmp_path / "bare.toml").write_text(text_of(NINE), encoding="utf-8")
    return tmp_path


def test_the_command_writes_json_and_a_picture(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target, picture = folder / "tensor.json", folder / "tensor.png"
    command = ["tensor", str(folder / "axes.toml"), "--json", str(target), "--plot", str(picture), "--about", "0 1 1"]
    assert main(command) == 0
    data = json.loads(target.read_text(encoding="utf-8"))
    assert data["schema"] == "swingid.tensor/1"
    assert np.allclose(data["matrix"], TRUE)
    assert np.shape(data["covariance"]) == (6, 6)
    assert data["principal"][0]["determined"] is True
    assert len(data["provenance"]["results"]) == 9
    assert data["predictions"][0]["inertia"]["value"] == pytest.approx(TRUE[1:, 1:].sum() / 2)
    assert picture.stat().st_size > 10_000
    assert "[[Principal moments and axes]]" in capsys.readouterr().out


def test_results_with_a_list_of_directions(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    results = [str(folder / f"r{k}.json") for k in range(9)]
    assert main(["tensor", *results, "--axes", str(folder / "bare.toml"), "--json", "-"]) == 0
    assert np.allclose(json.loads(capsys.readouterr().out)["matrix"], TRUE)
    assert main(["tensor", *results[:8], "--axes", str(folder / "bare.toml")]) == 3
    assert main(["tensor", *results]) == 2
    assert main(["tensor", results[0]]) == 3
    assert "a result file goes with --axes" in capsys.readouterr().err


def test_a_refusal_is_in_the_json(folder: Path) -> None:
    (folder / "few.toml").write_text(HEAD + ONE, encoding="utf-8")
    assert main(["tensor", str(folder / "few.toml"), "--json", str(folder / "no.json")]) == 4
    data = json.loads((folder / "no.json").read_text(encoding="utf-8"))
    assert data["status"] == "refused"
    assert data["error"]["code"] == "not-identifiable"


@pytest.mark.parametrize(
    ("more", "code"),
    [
        (["--about", "0 0"], 2),
        (["--about", "0 0 0"], 2),
        (["--about", "0 0 1 at 3 mm"], 2),
        (["--density", "3 kg/m^3"], 2),
        (["--plot", "x.jpg"], 2),
        (["--json", "axes.toml"], 2),
        (["--compare", "axes.toml"], 3),
        (["--compare", "none.urdf"], 3),
    ],
)
def test_options_that_do_not_fit(folder: Path, monkeypatch: pytest.MonkeyPatch, more: list[str], code: int) -> None:
    monkeypatch.chdir(folder)
    assert main(["tensor", "axes.toml", *more]) == code


# the twin


def test_the_rig_of_a_body_about_an_axis() -> None:
    plant = sw.Rig.load("paper")
    rig = rig_about(plant, TRUE, 1.2, [0.0, 0.0, 0.01], [1, 1, 0], [0.0, 0.0, 0.0])
    assert rig.axis.inertia is not None
    assert plant.axis.inertia is not None
    n = unit([1, 1, 0])
    assert rig.axis.inertia.value - plant.axis.inertia.value == pytest.approx(n @ TRUE @ n + 1.2 * 1e-4)
    torques = [float(one.axis.gravity_torque) for one in (rig, plant)]  # type: ignore[arg-type]
    assert torques[0] - torques[1] == pytest.approx(1.2 * 9.80665 * 0.01)
    off_axis = rig_about(plant, TRUE, 1.2, [0.1, 0.1, 0.0], [1, 1, 0])
    assert off_axis.axis.gravity_torque == plant.axis.gravity_torque


def test_inertia_about_an_axis_is_that_of_its_points() -> None:
    """Point masses, summed one by one."""
    rng = np.random.default_rng(6)
    places, masses = rng.normal(size=(30, 3)), rng.uniform(0.1, 1, 30)
    centre = masses @ places / masses.sum()
    r = places - centre
    tensor = sum(m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(masses, r, strict=True))
    n, point = unit([1, -2, 0.5]), np.array([0.3, 0.2, -0.1])
    across = np.cross(n, places - point)
    expected = masses @ np.einsum("ki,ki->k", across, across)
    assert inertia_about(tensor, masses.sum(), centre, n, point)[0] == pytest.approx(expected)


@pytest.mark.parametrize("key", ["mass", "gravity", "inertia", "distance"])
def test_numbers_that_no_body_has_are_refused_with_their_key(key):
    """Found by fuzzing: squares of such numbers overflow."""
    values = {"mass": "1 ± 0.1 kg", "gravity": "9.81 m/s^2", "inertia": "1 ± 0.1 g*m^2", "distance": "1 mm"}
    values[key] = {"mass": "1e300 kg", "gravity": "1e200 m/s^2"}.get(key, f"1e-200 ± 1e-200 {values[key].split()[-1]}")
    text = f'[body]\nmass = "{values["mass"]}"\ngravity = "{values["gravity"]}"\n'
    for k in range(6):
        text += f'[[axis]]\nname = "{k}"\ndirection = [{k}, 1, 2]\ntilt = "0.1 deg"\n'
        text += f'inertia = "{values["inertia"]}"\ndistance = "{values["distance"]}"\n'
    with pytest.raises(InputError, match=rf"{key} contains 1e[-+]\d+ in SI units, which nothing has"):
        axes_from_text(text)
