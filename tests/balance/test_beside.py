"""Further columns beside those of a fit: the same as one fit of all, where they are independent and where not."""

from __future__ import annotations

import numpy as np
import pytest

from swingid.numerics.regression import Beside, fit_linear

ROWS, KNOWN, MORE = 60, 4, 3


def problem(seed=1):
    """Columns of a fit, further ones in other units, and a target."""
    rng = np.random.default_rng(seed)
    columns = rng.standard_normal((ROWS, KNOWN)) * 10.0 ** rng.uniform(-3, 3, KNOWN)
    more = (rng.standard_normal((ROWS, MORE)) + columns[:, :1] / np.std(columns[:, 0])) * [1e-4, 1.0, 1e3]
    return columns, more, rng.standard_normal(ROWS)


def beside(columns, target, more):
    return Beside.of(columns, fit_linear(columns, target), more)


def augmented(columns, more, target, error, means):
    """Columns and target of all rows, with those of the prior as the last ones."""
    count = more.shape[1]
    prior = np.hstack([np.zeros((count, columns.shape[1])), error * np.eye(count)])
    return np.vstack([np.hstack([columns, more]), prior]), np.append(target, error * np.asarray(means))


def assert_same(found, expected):
    size = np.linalg.norm(expected.influence, axis=1)
    assert found.values == pytest.approx(expected.values, rel=1e-7)
    assert found.residuals == pytest.approx(expected.residuals, abs=1e-12)
    assert found.influence / size[:, None] == pytest.approx(expected.influence / size[:, None], abs=1e-7)


@pytest.mark.parametrize("seed", range(5))
def test_without_a_prior_it_is_one_fit_of_all_columns(seed):
    columns, more, target = problem(seed)
    found = beside(columns, target, more).solved()
    assert_same(found, fit_linear(np.hstack([columns, more]), target))
    assert found.covariance(4)[0, 0] == pytest.approx(
        fit_linear(np.hstack([columns, more]), target).covariance(4)[0, 0], rel=1e-6
    )


@pytest.mark.parametrize("error", [1e-6, 0.1, 100.0])
def test_a_prior_is_as_many_rows_more(error):
    columns, more, target = problem()
    means = [0.5, -1.0, 2.0]
    one = beside(columns, target, more)
    found, expected = one.solved(error, means), fit_linear(*augmented(columns, more, target, error, means))
    assert_same(found, expected)
    assert one.left(error, means) == pytest.approx(expected.residuals[:ROWS], abs=1e-9)


def test_several_sets_are_each_of_its_own():
    columns, more, target = problem()
    sets, errors = np.stack([more, more[:, ::-1] ** 2, np.sin(more)]), np.array([0.1, 1.0, 10.0])
    found = beside(columns, target, sets).solved(errors)
    for k, (own, error) in enumerate(zip(sets, errors, strict=True)):
        assert_same(found[k], beside(columns, target, own).solved(error))


def test_a_column_of_zeros_changes_nothing():
    columns, more, target = problem()
    zeroed = np.hstack([more, np.zeros((ROWS, 1))])
    found, expected = beside(columns, target, zeroed).solved(), beside(columns, target, more).solved()
    assert found.values == pytest.approx(np.append(expected.values, 0.0), rel=1e-9)
    assert found.residuals == pytest.approx(expected.residuals, abs=1e-12)


def test_a_column_that_the_fit_has_explains_nothing_more():
    """As gravity that is set free beside a spring of small swings: the residuals and the others' values stay."""
    columns, more, target = problem()
    fit = fit_linear(columns, target)
    again = (columns @ np.arange(1.0, KNOWN + 1))[:, None]
    alone = beside(columns, target, again).solved()
    assert alone.values == pytest.approx(np.append(fit.values, 0.0), rel=1e-9)
    assert alone.residuals == pytest.approx(fit.residuals, abs=1e-12)
    both = beside(columns, target, np.hstack([again, more])).solved()
    assert both.residuals == pytest.approx(beside(columns, target, more).solved().residuals, abs=1e-12)


def test_a_column_that_is_all_but_one_of_the_fit_is_a_column():
    columns, _, target = problem()
    rng = np.random.default_rng(3)
    close = columns[:, :1] * (1 + 1e-6 * rng.standard_normal((ROWS, 1)))
    found = beside(columns, target, close).solved()
    expected = np.linalg.lstsq(np.hstack([columns, (close - columns[:, :1]) * 1e6]), target, rcond=None)[0]
    assert found.values[-1] == pytest.approx(1e6 * expected[-1], rel=1e-6)
    assert found.residuals == pytest.approx(
        target - np.hstack([columns, (close - columns[:, :1]) * 1e6]) @ expected, abs=1e-9
    )


def test_a_repeated_column_is_halved():
    columns, more, target = problem()
    once = beside(columns, target, more[:, :1]).solved()
    twice = beside(columns, target, more[:, [0, 0]]).solved()
    assert twice.values[-2:] == pytest.approx(np.full(2, once.values[-1] / 2), rel=1e-9)
    assert twice.values[:-2] == pytest.approx(once.values[:-1], rel=1e-9)
    assert twice.residuals == pytest.approx(once.residuals, abs=1e-12)


def test_beside_a_fit_with_a_column_of_zeros():
    columns, more, target = problem()
    columns[:, 1] = 0.0
    found = beside(columns, target, more).solved()
    expected = fit_linear(np.hstack([np.delete(columns, 1, axis=1), more]), target)
    assert np.delete(found.values, 1) == pytest.approx(expected.values, rel=1e-7)
    assert found.values[1] == pytest.approx(0.0, abs=1e-12)
    assert found.condition == np.inf


def test_nothing_more_is_the_fit():
    columns, _, target = problem()
    found, fit = beside(columns, target, np.zeros((ROWS, 0))).solved(), fit_linear(columns, target)
    assert found.values == pytest.approx(fit.values)
    assert found.residuals == pytest.approx(fit.residuals)
    assert found.influence == pytest.approx(fit.influence)


def test_a_prior_without_weight_still_has_its_rows():
    """Of a log whose known side and residuals are 0; the further values are 0 then."""
    columns, more, _ = problem()
    found = beside(columns, np.zeros(ROWS), more).solved(np.array(0.0), np.ones(MORE))
    assert found.influence.shape == (KNOWN + MORE, ROWS + MORE)
    assert found.residuals == pytest.approx(np.zeros(ROWS + MORE))
    assert found.values == pytest.approx(np.zeros(KNOWN + MORE))
