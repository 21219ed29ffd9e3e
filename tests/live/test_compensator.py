"""The consecutive compensator against closed forms, the matrix exponential and plants that it must track."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swingid.control.compensator import Compensator, compensator_step
from swingid.control.law import FILTERED_ERROR, K_TILDE, XI, chain_output, exponential, held_chain, motor_compensation
from swingid.errors import UsageError

C1, C2, ETA, F3, D2, D1 = 52.04e-4, 3.697e-6, 0.9, 302.02e-5, -2.996e-4, 5.485e-4
MOTOR = {
    "coulomb_voltage": F3 / (C1 * ETA),
    "dead_zone_voltage": (D2 / (C1 * ETA), D1 / (C1 * ETA)),
    "back_emf_ratio": C2 / C1,
}


def run(compensator: Compensator, errors: np.ndarray, wheel: np.ndarray | None = None):
    """Voltages and states before each sample for a sequence of tracking errors."""
    state = compensator.initial_state(0.0, 0.0)
    wheel = np.zeros(len(errors)) if wheel is None else wheel
    voltages, states = [], []
    for k, (e, q2) in enumerate(zip(errors, wheel, strict=True)):
        states.append(state)
        voltage, state = compensator.step(k * compensator.sample_time, (e, 0.0, q2), state)
        voltages.append(voltage)
    return np.array(voltages), np.array(states)


@pytest.mark.parametrize("h", [1e-3, 0.05, 2.0])
def test_rho_2_is_equation_20_for_a_held_error(h: float) -> None:
    k_tilde, sigma0, e = 13.3, 0.1, 0.07
    compensator = Compensator(1.0, sigma0, 2.0, k_tilde0=k_tilde, sample_time=h)
    t = h * np.arange(40)
    sigma = sigma0 * k_tilde**2
    xi = e * (1.0 - np.exp(-sigma * t))
    expected = -(k_tilde * sigma * (e - xi) + k_tilde * xi)
    voltages, states = run(compensator, np.full(40, e))
    np.testing.assert_allclose(states[:, XI], xi, rtol=1e-12)
    np.testing.assert_allclose(voltages, expected, rtol=1e-12)


@pytest.mark.parametrize("differentiate", [True, False])
def test_rho_2_is_equation_20_while_the_gain_grows(differentiate: bool) -> None:
    # k = lambda t, so the integral of sigma is sigma0 lambda^2 t^3/3, whatever the sample time.
    h, lambda0, sigma0, e = 0.01, 2.0, 0.1, 0.3
    compensator = Compensator(0.08, sigma0, lambda0, filter_time=0.0, sample_time=h, differentiate_gain=differentiate)
    t = h * np.arange(600)
    k_tilde = lambda0 * t
    xi = e * (1.0 - np.exp(-sigma0 * lambda0**2 * t**3 / 3.0))
    rate = sigma0 * k_tilde**2 * (e - xi)
    expected = -(differentiate * lambda0 * xi + k_tilde * rate + k_tilde * xi)
    voltages, states = run(compensator, np.full(600, e))
    np.testing.assert_allclose(states[:, K_TILDE], k_tilde, rtol=1e-11)
    np.testing.assert_allclose(states[:, XI], xi, rtol=1e-10, atol=1e-15)
    np.testing.assert_allclose(voltages, expected, rtol=1e-10, atol=1e-14)


def test_sampling_converges_to_the_continuous_controller_with_first_order() -> None:
    k_tilde, sigma, omega, end = 13.3, 0.1 * 13.3**2, 8.5, 1.6
    xi = (
        sigma
        / (sigma**2 + omega**2)
        * (sigma * math.sin(omega * end) - omega * math.cos(omega * end) + omega * math.exp(-sigma * end))
    )
    exact = -k_tilde * (sigma * (math.sin(omega * end) - xi) + xi)
    errors = []
    for count in (200, 400, 800, 1600):
        compensator = Compensator(10.0, 0.1, 2.0, k_tilde0=k_tilde, sample_time=end / count)
        t = np.linspace(0.0, end, count + 1)
        voltages, _ = run(compensator, np.sin(omega * t))
        errors.append(abs(voltages[-1] - exact))
    slopes = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(slopes, 1.0, atol=0.05)


CHAINS = {2: (1.0,), 3: (1.0, 2.0), 4: (6.0, 11.0, 6.0), 5: (1.0, 3.0, 4.0, 2.5)}


@pytest.mark.parametrize("rho", [2, 3, 4, 5])
@pytest.mark.parametrize("turn", [1e-6, 0.3, 7.0, 4000.0])
def test_chain_over_a_held_sample_is_the_matrix_exponential(rho: int, turn: float) -> None:
    from scipy.linalg import expm

    k = np.array(CHAINS[rho])
    n, e = rho - 1, 0.37
    augmented = np.zeros((n + 1, n + 1))
    augmented[:-2, 1:-1] = np.eye(n - 1)
    augmented[n - 1, :n] = -k
    augmented[n - 1, n] = k[0]
    xi = np.random.default_rng(rho).normal(size=n)
    expected = (expm(augmented * turn) @ np.append(xi, e))[:n]
    held_chain(e, xi, turn, k)
    np.testing.assert_allclose(xi, expected, rtol=1e-9, atol=1e-11)


@settings(max_examples=100, deadline=None)
@given(st.lists(st.floats(-8.0, -0.05), min_size=2, max_size=4), st.floats(0.0, 20.0))
def test_exponential_of_a_companion_matrix_with_known_roots(roots: list[float], turn: float) -> None:
    # (1, r, r^2, ...) is an eigenvector of the companion matrix for its root r.
    coefficients = np.poly(roots)[1:]
    n = len(roots)
    matrix = np.eye(n, k=1)
    matrix[-1] = -coefficients[::-1]
    move = exponential(matrix * turn)
    for root in roots:
        vector = root ** np.arange(n)
        np.testing.assert_allclose(move @ vector, math.exp(root * turn) * vector, atol=1e-9 * np.abs(vector).max())


@pytest.mark.parametrize("differentiate", [True, False])
def test_alpha_of_rho_3_is_the_product_rule_written_out(differentiate: bool) -> None:
    e, k_tilde, slope, sigma0 = 0.2, 3.0, 2.0, 0.1
    xi, k, alpha = np.array([0.11, -0.3]), np.array([1.5, 2.0]), np.array([0.7, 2.0, 1.1])
    sigma, sigma_rate = sigma0 * k_tilde**2, 2.0 * sigma0 * k_tilde * slope
    first = sigma * xi[1]
    second = sigma_rate * xi[1] + sigma * sigma * (k[0] * e - k[0] * xi[0] - k[1] * xi[1])
    if differentiate:
        powers = (k_tilde * xi[0], slope * xi[0] + k_tilde * first, 2.0 * slope * first + k_tilde * second)
    else:
        powers = (k_tilde * xi[0], k_tilde * first, k_tilde * second)
    expected = alpha[2] * powers[0] + alpha[1] * powers[1] + alpha[0] * powers[2]
    got = chain_output(e, xi, k_tilde, slope, sigma0, alpha, k, differentiate)
    assert got == pytest.approx(expected, rel=1e-13)


def test_alpha_of_rho_4_is_the_derivative_of_the_motion() -> None:
    e, k_tilde, slope, sigma0 = 0.2, 2.0, 1.5, 0.2
    start, k, alpha = np.array([0.11, -0.3, 0.2]), np.array(CHAINS[4]), np.array([1.0, 3.0, 3.5, 1.2])
    nodes = 0.4 * np.cos(np.pi * np.arange(25) / 24)
    values = []
    for tau in nodes:
        # Backward in time as well: the exact move is analytic in the integral of sigma.
        later = k_tilde + slope * tau
        xi = start.copy()
        turn = sigma0 * (later**3 - k_tilde**3) / (3.0 * slope)
        if tau >= 0:
            held_chain(e, xi, turn, k)
        else:
            from scipy.linalg import expm

            companion = np.eye(3, k=1)
            companion[-1] = -k
            xi = expm(companion * turn) @ (xi - [e, 0, 0]) + [e, 0, 0]
        values.append(later * xi[0])
    polynomial = np.polynomial.Chebyshev.fit(nodes, values, 24)
    expected = sum(alpha[3 - j] * polynomial.deriv(j)(0.0) if j else alpha[3] * polynomial(0.0) for j in range(4))
    got = chain_output(e, start, k_tilde, slope, sigma0, alpha, k, True)
    assert got == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("rho", [2, 3, 4])
def test_stable_at_any_rate(rho: int) -> None:
    alpha = tuple(np.poly([-1.0] * (rho - 1)))
    compensator = Compensator(
        1.0, 10.0, 1.0, k_tilde0=1e4, alpha=alpha, k=CHAINS[rho], voltage_limit=10.0, sample_time=10.0
    )
    errors = np.random.default_rng(1).uniform(-0.5, 0.5, 50)  # sigma h = 1e10
    voltages, states = run(compensator, errors)
    np.testing.assert_allclose(states[1:, XI], errors[:-1], rtol=1e-9)
    np.testing.assert_allclose(states[1:, XI + 1 :], 0.0, atol=1e-9)
    assert np.all(np.abs(voltages) <= 10.0)


@settings(max_examples=50, deadline=None)
@given(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.floats(-50.0, 50.0), st.floats(0.0, 500.0), st.floats(-1.0, 1.0))
def test_step_leaves_its_state_alone_and_equals_the_kernel(
    reference: float, angle: float, wheel_angle: float, k_tilde: float, xi: float
) -> None:
    compensator = Compensator(0.08, 0.1, 2.0, voltage_limit=10.0, **MOTOR)
    state = compensator.initial_state(0.0, 0.0)
    state[K_TILDE], state[XI] = k_tilde, xi
    kept = state.copy()
    state.flags.writeable = False
    voltage, moved = compensator.step(0.0, (reference, angle, wheel_angle), state)
    np.testing.assert_array_equal(state, kept)
    again = kept.copy()
    assert voltage == compensator_step(reference, angle, wheel_angle, again, compensator.parameters(1e-3))
    np.testing.assert_array_equal(moved, again)
    assert abs(voltage) <= 10.0


def test_error_filter_and_adaptation_follow_18() -> None:
    h, time, delta0, lambda0, e = 1e-3, 0.0125, 0.08, 2.0, 0.1
    compensator = Compensator(delta0, 0.1, lambda0, filter_time=time, sample_time=h)
    _, states = run(compensator, np.concatenate([np.full(100, e), np.zeros(100)]))
    t = h * np.arange(101)
    np.testing.assert_allclose(states[:101, FILTERED_ERROR], e * (1.0 - np.exp(-t / time)), rtol=1e-12)
    np.testing.assert_allclose(states[100:, FILTERED_ERROR], states[100, FILTERED_ERROR] * np.exp(-t[:100] / time))
    outside = np.abs(states[:-1, FILTERED_ERROR]) > delta0
    np.testing.assert_allclose(np.diff(states[:, K_TILDE]), lambda0 * h * outside, atol=1e-15)
    # Up through delta0 at T ln(e/(e - delta0)), down at T ln(e/delta0) after the error is gone.
    expected = lambda0 * (0.1 - time * math.log(e / (e - delta0)) + time * math.log(e / delta0))
    assert states[-1, K_TILDE] == pytest.approx(expected, abs=2 * lambda0 * h)


def test_gain_stops_at_its_bound_and_the_chain_knows_it() -> None:
    compensator = Compensator(0.01, 0.1, 2.0, k_tilde_max=0.305, filter_time=0.0, sample_time=0.01)
    _, states = run(compensator, np.full(50, 0.3))
    assert states[-1, K_TILDE] == 0.305
    np.testing.assert_allclose(states[:16, K_TILDE], 0.02 * np.arange(16), atol=1e-15)
    free = replace(compensator, k_tilde_max=None)
    assert run(free, np.full(50, 0.3))[1][-1, K_TILDE] == pytest.approx(0.98)


def test_saturation() -> None:
    compensator = Compensator(1.0, 0.1, 2.0, k_tilde0=100.0, voltage_limit=10.0)
    assert run(compensator, np.array([0.5]))[0][0] == -10.0
    assert run(compensator, np.array([-0.5]))[0][0] == 10.0
    assert run(replace(compensator, plant_sign=1), np.array([0.5]))[0][0] == 10.0
    assert run(replace(compensator, voltage_limit=None), np.array([0.5]))[0][0] == -100.0 * 1000.0 * 0.5


def test_coulomb_compensation_follows_the_wheel_by_its_angles_alone() -> None:
    compensator = Compensator(1.0, 0.1, 2.0, coulomb_voltage=0.6)
    wheel = np.array([0.0, 0.01, 0.03, 0.03, 0.02, 0.02, 0.05])
    np.testing.assert_array_equal(run(compensator, np.zeros(7), wheel)[0], [0, 0.6, 0.6, 0, -0.6, 0, 0.6])
    # A state made without a wheel angle takes the first one as its past.
    state = compensator.initial_state()
    voltage, state = compensator.step(0.0, (0.0, 0.0, 123.0), state)
    assert voltage == 0.0
    assert compensator.step(0.0, (0.0, 0.0, 122.9), state)[0] == -0.6


def test_wheel_filter_is_the_held_first_order_lag_of_the_differences() -> None:
    time, h = 0.01, 1e-3
    compensator = Compensator(1.0, 0.1, 2.0, coulomb_voltage=0.6, wheel_filter_time=time)
    # A lag's output cannot change sign at a single count backwards during steady rotation.
    wheel = 5.0 * h * np.arange(200)
    wheel[100] -= 0.006
    voltages, _ = run(compensator, np.zeros(200), wheel)
    np.testing.assert_array_equal(voltages[1:], 0.6)
    assert np.any(run(replace(compensator, wheel_filter_time=0.0), np.zeros(200), wheel)[0][1:] < 0.0)


def motor_torque(voltage: float, speed: float) -> float:
    """Torque of (8), third branch corrected, less the Coulomb friction of motor and gearbox."""
    torque = ETA * (C1 * voltage - C2 * speed)
    dead = torque - D1 if torque > D1 else torque - D2 if torque < D2 else 0.0
    return dead - F3 * np.sign(speed)


@given(st.floats(-8.0, 8.0), st.floats(-200.0, 200.0))
def test_compensated_motor_is_linear(u2: float, speed: float) -> None:
    parameters = Compensator(1.0, 0.1, 2.0, **MOTOR).parameters()
    voltage = motor_compensation(u2, speed, parameters)
    assert motor_torque(voltage, speed) == pytest.approx(ETA * (C1 * u2 - C2 * speed), abs=1e-16)


@given(st.floats(-8.0, 8.0), st.floats(-200.0, 200.0))
def test_printed_dead_zone_switch_errs_only_below_the_back_emf(u2: float, speed: float) -> None:
    parameters = Compensator(1.0, 0.1, 2.0, dead_zone_switch="printed", **MOTOR).parameters()
    voltage = motor_compensation(u2, speed, parameters)
    error = motor_torque(voltage, speed) - ETA * (C1 * u2 - C2 * speed)
    before = u2 + MOTOR["coulomb_voltage"] * np.sign(speed)
    if abs(C1 * before) > abs(C2 * speed):
        assert abs(error) < 1e-16
    else:
        assert abs(error) <= D1 - D2


def test_printed_dead_zone_switch_errs_there() -> None:
    speed = 150.0
    u2 = -MOTOR["coulomb_voltage"] + 0.5 * C2 / C1 * speed
    parameters = Compensator(1.0, 0.1, 2.0, dead_zone_switch="printed", **MOTOR).parameters()
    error = motor_torque(motor_compensation(u2, speed, parameters), speed) - ETA * (C1 * u2 - C2 * speed)
    assert abs(error) > 1e-4


def track(compensator: Compensator, slope, order: int, duration: float, reference) -> tuple[np.ndarray, np.ndarray]:
    """Tracking error and k tilde at each sample of a plant x' = slope(x, u), y = x[0], Runge-Kutta per sample."""
    h = compensator.sample_time
    x, state = np.zeros(order), compensator.initial_state(0.0, 0.0)
    errors, gains = [], []
    for k in range(round(duration / h)):
        wanted = reference(k * h)
        errors.append(wanted - x[0])
        u, state = compensator.step(k * h, (wanted, x[0], 0.0), state)
        gains.append(state[K_TILDE])
        a = slope(x, u)
        b = slope(x + 0.5 * h * a, u)
        c = slope(x + 0.5 * h * b, u)
        x = x + h / 6.0 * (a + 2.0 * b + 2.0 * c + slope(x + h * c, u))
    return np.array(errors), np.array(gains)


def test_plant_of_relative_degree_3_is_tracked() -> None:
    # A pendulum behind a lagging drive: J y'' = w - f y' - b sin y, T w' = u - w; rho = 3, no zeros.
    J, f, b, lag = 0.02, 0.01, 0.08, 0.05

    def slope(x: np.ndarray, u: float) -> np.ndarray:
        y, v, w = x
        return np.array([v, (w - f * v - b * math.sin(y)) / J, (u - w) / lag])

    compensator = Compensator(
        0.02, 20.0, 2.0, alpha=(0.01, 0.2, 1.0), k=(1.0, 2.0), plant_sign=1, voltage_limit=20.0, sample_time=2e-3
    )
    errors, gains = track(compensator, slope, 3, 24.0, lambda t: 0.8 * math.sin(3.0 * t))
    last = len(errors) * 3 // 4
    assert np.max(np.abs(errors[last:])) < 0.02
    assert np.max(np.abs(errors[:last])) > 0.1
    assert gains[-1] == gains[last]


def test_plant_of_relative_degree_1_is_tracked_without_a_chain() -> None:
    compensator = Compensator(0.05, 0.1, 8.0, alpha=(1.0,), k=(), plant_sign=1, sample_time=2e-3)
    errors, gains = track(compensator, lambda x, u: -x + u, 1, 20.0, lambda t: math.sin(2.0 * t))
    assert np.max(np.abs(errors[-3000:])) < 0.051
    assert gains[-1] == gains[-3000]


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"delta0": -0.1}, "delta0"),
        ({"sigma0": math.nan}, "sigma0"),
        ({"filter_time": -1.0}, "filter_time"),
        ({"sample_time": 0.0}, "sample_time"),
        ({"k_tilde0": 5.0, "k_tilde_max": 4.0}, "k_tilde_max"),
        ({"voltage_limit": 0.0}, "voltage_limit"),
        ({"plant_sign": 0}, "plant_sign"),
        ({"dead_zone_switch": "best"}, "dead_zone_switch"),
        ({"alpha": (1.0, 1.0, 1.0)}, "one more than k"),
        ({"alpha": (1.0, -1.0)}, "alpha"),
        ({"alpha": (-1.0, -1.0)}, "alpha"),
        ({"k": (-1.0,)}, "unstable"),
        ({"alpha": (1.0, 3.0, 3.0, 1.0), "k": (9.0, 2.0, 1.0)}, "unstable"),
    ],
)
def test_gains_that_cannot_work_are_refused(change: dict, word: str) -> None:
    with pytest.raises(UsageError, match=word):
        Compensator(**{"delta0": 0.08, "sigma0": 0.1, "lambda0": 2.0, **change})
