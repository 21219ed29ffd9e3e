"""The velocity observers (23) and the filter W_f both ways, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from swingid.control.observer import VelocityObserver, filtered_both_ways
from swingid.errors import UsageError

TIME = np.arange(4001) / 1000


@pytest.mark.parametrize("sigma", [20.0, 1e3, 1e4])
def test_a_ramp_is_found_with_the_time_constant_of_sigma(sigma: float) -> None:
    """With rho = epsilon = 0: x2^ = v (1 - exp(-sigma t))."""
    speeds = VelocityObserver(sigma, 0.0, 0.0).run(TIME, 2.5 * TIME)
    np.testing.assert_allclose(speeds, 2.5 * (1 - np.exp(-sigma * TIME)), atol=1e-11)


def test_it_converges_to_the_differential_equation_with_second_order() -> None:
    sigma, rho, end = 40.0, 300.0, 2.0

    def rates(t: float, state: np.ndarray) -> list[float]:
        gap, p = np.sin(5 * t) - state[0], state[1]
        return [p + sigma * gap, rho * gap]

    made = solve_ivp(rates, (0, end), [0.0, 0.0], rtol=1e-11, atol=1e-12)
    exact = made.y[1, -1] + sigma * (np.sin(5 * end) - made.y[0, -1])
    errors = []
    for count in (250, 500, 1000, 2000):
        time = np.linspace(0, end, count + 1)
        errors.append(abs(VelocityObserver(sigma, 0.0, rho).run(time, np.sin(5 * time))[-1] - exact))
    slopes = np.diff(np.log(errors)) / -np.log(2)
    np.testing.assert_allclose(slopes, 2.0, atol=0.05)


def test_the_sign_is_that_of_the_error_not_of_the_angle() -> None:
    """As printed, sign(x1^), an angle far from zero would push p for ever; the speed does not know where zero is."""
    observer = VelocityObserver(200.0, 50.0, 1.0)
    speeds = observer.run(TIME, np.sin(8.5 * TIME))
    np.testing.assert_allclose(observer.run(TIME, np.sin(8.5 * TIME) + 100.0), speeds, atol=1e-9)


def test_the_sign_term_follows_an_acceleration_below_epsilon_without_error() -> None:
    """A linear observer is a/sigma behind for ever; p moves at up to epsilon and takes that up."""
    sigma, acceleration = 50.0, 2.0
    speed = acceleration * TIME
    behind = VelocityObserver(sigma, 0.0, 0.0).run(TIME, speed * TIME / 2) - speed
    np.testing.assert_allclose(behind[1000:], -acceleration / sigma, rtol=0.02)
    error = VelocityObserver(sigma, 4.0, 0.0).run(TIME, speed * TIME / 2) - speed
    assert abs(error[2000:].mean()) < 0.05 * acceleration / sigma
    assert np.abs(error[3000:]).max() < 0.6 * acceleration / sigma


@pytest.mark.parametrize("sigma", [1e3, 1e4])
def test_both_ways_has_no_delay(sigma: float) -> None:
    angle, speed = 0.8 * np.sin(8.5 * TIME), 6.8 * np.cos(8.5 * TIME)
    observer = VelocityObserver(sigma)
    inner = slice(50, -50)
    late = np.abs(observer.run(TIME, angle) - speed)[inner].max()
    assert np.abs(observer.both_ways(TIME, angle) - speed)[inner].max() < 0.02 * late


def test_both_ways_does_not_know_which_way_time_runs() -> None:
    observer = VelocityObserver(1e3, 0.0)
    angle = 0.8 * np.sin(8.5 * TIME)
    back = observer.both_ways(TIME[-1] - TIME[::-1], angle[::-1])[::-1]
    np.testing.assert_allclose(observer.both_ways(TIME, angle), -back, atol=1e-9)


def test_at_high_sigma_it_is_the_backward_difference_and_both_ways_the_central_one() -> None:
    angle = 0.8 * np.sin(8.5 * TIME)
    observer = VelocityObserver(1e6)
    np.testing.assert_allclose(observer.run(TIME, angle)[1:], np.diff(angle) / 1e-3, atol=1e-2)
    np.testing.assert_allclose(
        observer.both_ways(TIME, angle)[1:-1], 6.8 * np.cos(8.5 * TIME[1:-1]) * np.sin(8.5e-3) / 8.5e-3, atol=1e-5
    )


def test_uneven_stamps_cost_nothing_on_a_ramp() -> None:
    time = np.cumsum(np.random.default_rng(1).uniform(2e-4, 3e-3, 3000))
    speeds = VelocityObserver(300.0, 0.0, 0.0).run(time, -1.5 * time, start=0.0)
    np.testing.assert_allclose(speeds, -1.5 * (1 - np.exp(-300.0 * (time - time[0]))), atol=1e-9)


@pytest.mark.parametrize("sigma", [100.0, 1e3, 1e4])
def test_noise_gain_is_what_white_noise_shows(sigma: float) -> None:
    observer = VelocityObserver(sigma, 0.0)
    time = np.arange(40_001) / 1000
    noise = 1e-3 * np.random.default_rng(2).standard_normal(len(time))
    seen = observer.both_ways(time, noise)[500:-500].std()
    assert seen == pytest.approx(1e-3 * observer.noise_gain(1e-3), rel=0.02)


def test_w_f_both_ways_has_no_delay_and_a_known_loss() -> None:
    """A sine of frequency w keeps its phase and 1/(1 + (w T)^2) of its amplitude."""
    time = np.arange(200_001) / 1e5
    middle = (time > 0.3) & (time < 1.7)
    held = np.sin(8.5 * (time + 0.5e-5))
    filtered = filtered_both_ways(time, held, 0.0125)
    np.testing.assert_allclose(filtered[middle], np.sin(8.5 * time[middle]) / (1 + (8.5 * 0.0125) ** 2), atol=1e-7)
    np.testing.assert_allclose(filtered_both_ways(time, np.full(len(time), 3.0), 0.0125), 3.0)


def test_w_f_of_a_step_between_two_rows() -> None:
    """The step of a held signal comes at the row that brings it, also backward in time."""
    time = np.arange(1001) / 1000
    filtered = filtered_both_ways(time, np.where(time >= 0.4995, 1.0, 0.0), 0.02)
    after = np.abs(time - 0.5)
    expected = np.where(time >= 0.5, 1 - np.exp(-after / 0.02) / 2, np.exp(-after / 0.02) / 2)
    np.testing.assert_allclose(filtered, expected, atol=1e-9)


@pytest.mark.parametrize("gains", [{"sigma": 0.0}, {"sigma": -1.0}, {"rho": -1.0}, {"epsilon": float("nan")}])
def test_gains_that_observe_nothing_are_refused(gains: dict[str, float]) -> None:
    with pytest.raises(UsageError, match=next(iter(gains))):
        VelocityObserver(**gains)
