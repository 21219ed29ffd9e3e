"""Least squares on segments with initial values of their own: a decay whose rate and drive are unknown."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from swingid.methods.output_error.problem import as_read
from swingid.numerics.gauss_newton import LEAST, STALLED, fit_at, solve
from swingid.numerics.shooting import Prediction, Shooting, widened

TIME, SEGMENTS = np.linspace(0.0, 1.0, 40), 3
RATE, DRIVE = 1.3, 0.4


def simulate(values, states, _=None):
    """x' = −λ x + c from a start of every segment, and its derivatives by that start, λ and c."""
    rate, drive = values
    decay = np.exp(-rate * TIME)
    outputs, slopes = [], []
    for (start,) in states:
        rest = drive / rate
        outputs.append(rest + (start - rest) * decay)
        of_rate = -TIME * (start - rest) * decay - drive / rate**2 * (1 - decay)
        slopes.append(np.column_stack([decay, of_rate, (1 - decay) / rate]))
    return Prediction(np.concatenate(outputs), np.vstack(slopes))


def decays(noise=0.0, **changes):
    measured = simulate((RATE, DRIVE), [[1.0], [-2.0], [0.5]]).outputs
    measured = measured + noise * np.random.default_rng(0).standard_normal(len(measured))
    rows = len(TIME) * np.arange(SEGMENTS + 1)
    anything = np.full(2, np.inf)
    shooting = Shooting(
        measured,
        np.full(len(measured), 0.01),
        rows,
        measured[rows[:-1], None],
        simulate,
        (-anything, anything),
        np.zeros(2),
        lambda values, _: values,
    )
    return replace(shooting, **changes)


def fitted(shooting, begin=(0.5, 0.1)):
    return solve(shooting, np.array(begin), shooting.starts, STALLED, LEAST)


def test_the_values_and_the_initial_values_are_found():
    fit = fitted(decays())
    assert fit.converged
    assert fit.values == pytest.approx([RATE, DRIVE], rel=1e-6)
    assert fit.states.ravel() == pytest.approx([1.0, -2.0, 0.5], rel=1e-6)


def test_the_influence_tells_what_changed_readings_do():
    shooting = decays(noise=0.01)
    fit = fitted(shooting)
    change = 1e-5 * np.random.default_rng(1).standard_normal(len(shooting.measured))
    other = fitted(replace(shooting, measured=shooting.measured + change), fit.values)
    assert fit.effect(change) == pytest.approx(other.values - fit.values, rel=0.02)
    several = fit.effect(np.column_stack([change, 2 * change]))
    assert several[:, 1] == pytest.approx(2 * fit.effect(change))


def test_the_covariance_is_that_of_the_whole_jacobian():
    fit = fitted(decays(noise=0.01))
    slopes, count = fit.prediction.slopes, len(TIME)
    whole = np.zeros((SEGMENTS * count, SEGMENTS + 2))
    for k in range(SEGMENTS):
        rows = slice(k * count, (k + 1) * count)
        whole[rows, k], whole[rows, SEGMENTS:] = slopes[rows, 0], slopes[rows, 1:]
    variance = float(np.sum((fit.residuals * 0.01) ** 2)) / (SEGMENTS * count - SEGMENTS - 2)
    expected = np.linalg.inv(whole.T @ whole)[SEGMENTS:, SEGMENTS:] * variance
    assert fit.white() == pytest.approx(expected, rel=1e-6)
    assert fit.white(least=4.0) == pytest.approx(expected / variance * 4e-4, rel=1e-6)


def test_scores_of_all_groups_add_up_to_the_step_that_is_left():
    shooting = decays(noise=0.01)
    fit = fit_at(shooting, np.array([RATE, DRIVE]), shooting.starts)
    scores = fit.scores(np.repeat(np.arange(SEGMENTS), len(TIME)))
    assert scores.sum(axis=1) == pytest.approx(fit.left, rel=1e-6)


def test_a_prior_and_what_is_allowed_hold_values_back():
    strong = decays(power=np.array([0.0, 1e12]))
    assert fitted(strong).values[1] == pytest.approx(0.0, abs=1e-6)
    held = decays(nearest=lambda values, _: np.minimum(values, [1.0, np.inf]))
    assert fitted(held).values[0] == 1.0


def test_a_covariance_is_widened_in_what_scatters_more():
    white, robust = np.array([[1.0, 0.5], [0.5, 1.0]]), np.diag([4.0, 0.1])
    covariance, stretch = widened(white, robust)
    assert stretch == pytest.approx([2.0, 1.0])
    assert covariance == pytest.approx(np.array([[4.0, 1.0], [1.0, 1.0]]))


def test_a_motion_that_diverged_has_no_readings() -> None:
    """Whatever is unknown of the sensors: with a latency its rates were asked for, which it has not."""
    diverged = Prediction(np.zeros(5), np.empty((5, 0)), finite=False)
    assert as_read(diverged, None, ["sensors.latency"], np.ones(1)) is diverged
