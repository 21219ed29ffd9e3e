"""One sample of the consecutive compensator (14)-(20) as a compiled function, with the filter chain (16).

`compensator_step` is the controller of the twin's compiled loop and of `Compensator.step` alike. State and
parameters are flat arrays whose places are named here and made by `Compensator`. `firmware/core/compensator.c`
computes the same sums in the same order; no function of a mathematical library, whose last bits differ from machine
to machine, is used in either (`tests/firmware/test_firmware_controller.py`).

With the error e held, (16) is xi' = sigma(t) (A xi + B e) with a constant companion matrix A. All sigma(t)
A commute, so the move over a sample is exp(A s), s the integral of sigma, however sigma varies; the rest
point is (e, 0, ..., 0).
"""

from __future__ import annotations

import numpy as np

from swingid.numerics.arrays import Array
from swingid.numerics.compiled import njit, njit_called, njit_helper, njit_inlined

TAYLOR_TERMS = 14
"""Terms of the scaled exponential: 0.5^15/15! lies below rounding."""

MOST_SQUARINGS = 64
"""A matrix beyond 2^63 is no rig's; the bound ends the loop for one that is not finite."""

LOG2E, LN2_HIGH, LN2_LOW = 1.4426950408889634, 6.93147180369123816490e-01, 1.90821492927058770002e-10
"""1/ln 2, and ln 2 in two parts: n times the first is exact for n < 2^20 (fdlibm, e_exp.c)."""


@njit_called
def decay(x: float) -> float:
    """exp(-x) for x >= 0 by sums, products and halvings alone, so that it has the same bits on every machine.

    Firmware has no exp, or one of its own. Reduction by Cody and Waite, Taylor polynomial of degree 13 on
    |r| <= ln(2)/2: within one unit in the last place. Beyond 708, where numbers get subnormal, it is 0; below 0, 1.
    """
    if not x > 0.0:
        return 1.0
    if x > 708.0:
        return 0.0
    n = int(x * LOG2E + 0.5)
    r = (n * LN2_HIGH - x) + n * LN2_LOW
    p = 1 / 39916800 + r * (1 / 479001600 + r * (1 / 6227020800))
    p = 1 / 5040 + r * (1 / 40320 + r * (1 / 362880 + r * (1 / 3628800 + r * p)))
    p = 1 / 2 + r * (1 / 6 + r * (1 / 24 + r * (1 / 120 + r * (1 / 720 + r * p))))
    p = 1.0 + (r + r * r * p)
    for _ in range(n):
        p *= 0.5
    return p


@njit_helper
def exponential(matrix: Array) -> Array:
    """Exponential of a small stable matrix (n, n), by scaling and squaring of a Taylor polynomial."""
    n = matrix.shape[0]
    size = 0.0
    for i in range(n):
        row = 0.0
        for j in range(n):
            row += abs(matrix[i, j])
        size = max(size, row)
    squarings, scale = 0, 1.0
    while size > 0.5 and squarings < MOST_SQUARINGS:
        size *= 0.5
        scale *= 0.5
        squarings += 1
    result = np.zeros((n, n))
    for i in range(n):
        result[i, i] = 1.0
    for term in range(TAYLOR_TERMS, 0, -1):
        result = multiply(matrix, result, scale / term)
        for i in range(n):
            result[i, i] += 1.0
    for _ in range(squarings):
        result = multiply(result, result, 1.0)
    return result


@njit_helper
def multiply(a: Array, b: Array, factor: float) -> Array:
    """Product of two small square matrices and a factor, without BLAS."""
    n = a.shape[0]
    c = np.zeros((n, n))
    for i in range(n):
        for j in range(n):
            for m in range(n):
                c[i, j] += factor * a[i, m] * b[m, j]
    return c


@njit_helper
def held_chain(e: float, xi: Array, turn: float, k: Array) -> None:
    """Move xi (n,) of (16) in place over one sample, the error e (rad or m) held.

    turn: integral of sigma over the sample, a pure number; k (n,): k_1 ... k_n of (16). Exact, so stable at any rate.
    """
    n = xi.shape[0]
    if n == 0:
        return
    if n == 1:
        xi[0] = e + (xi[0] - e) * decay(k[0] * turn)
        return
    companion = np.zeros((n, n))
    for i in range(n - 1):
        companion[i, i + 1] = turn
    for i in range(n):
        companion[n - 1, i] = -k[i] * turn
    move = exponential(companion)
    distance = xi.copy()
    distance[0] -= e
    for i in range(n):
        xi[i] = 0.0
        for j in range(n):
            xi[i] += move[i, j] * distance[j]
    xi[0] += e


@njit_helper
def chain_output(
    e: float,
    xi: Array,
    k_tilde: float,
    slope: float,
    sigma0: float,
    alpha: Array,
    k: Array,
    differentiate_gain: bool,
) -> float:
    """alpha(p)(k xi_1) of (20), or k alpha(p) xi_1 of (15), at the start of a sample: -u2 of the paper (V).

    e (rad or m) is held, xi (n,) the state of (16), k_tilde the gain, alpha (n + 1,) highest power first, k (n,);
    differentiate_gain: (20), else (15).

    `slope` is k tilde' (17). For order 1: alpha_1 (k' xi + k sigma k_1 (e - xi)) + alpha_0 k xi. Beyond,
    the powers of p are read from the Taylor series of xi_1(t), with k tilde linear and sigma = sigma0 k^2
    (19) quadratic in t.
    """
    n = xi.shape[0]
    if n == 0:
        return float(alpha[0] * k_tilde * e)
    if n == 1:
        rate = sigma0 * k_tilde * k_tilde * k[0] * (e - xi[0])
        gain_term = slope * xi[0] if differentiate_gain else 0.0
        return float(alpha[0] * (gain_term + k_tilde * rate) + alpha[1] * k_tilde * xi[0])
    sigma = (
        sigma0 * k_tilde * k_tilde,
        2.0 * sigma0 * k_tilde * slope,
        sigma0 * slope * slope,
    )
    series = np.zeros((n, n + 1))  # series[j, i]: coefficient of t^i of xi_(j+1)
    for j in range(n):
        series[j, 0] = xi[j]
    for i in range(n):
        for j in range(n):
            for m in range(min(i, 2) + 1):
                if j < n - 1:
                    drive = series[j + 1, i - m]
                else:
                    drive = k[0] * e if i == m else 0.0
                    for col in range(n):
                        drive -= k[col] * series[col, i - m]
                series[j, i + 1] += sigma[m] * drive / (i + 1)
    output, factorial = 0.0, 1.0
    for power in range(n + 1):
        if power > 1:
            factorial *= power
        value = k_tilde * series[0, power]
        if differentiate_gain and power > 0:
            value += slope * series[0, power - 1]
        output += alpha[n - power] * factorial * value
    return output


# Places in the state.
K_TILDE, FILTERED_ERROR, WHEEL_MEMORY, WHEEL_SEEN, XI = 0, 1, 2, 3, 4
# Places in the parameter array; alpha (order + 1 numbers) and k (order numbers) follow from ALPHA on.
ORDER, SAMPLE_TIME, DELTA0, LAMBDA0, SIGMA0, K_TILDE_MAX, ERROR_DECAY, WHEEL_DECAY = 0, 1, 2, 3, 4, 5, 6, 7
PLANT_SIGN, DIFFERENTIATE_GAIN, LIMIT, COULOMB = 8, 9, 10, 11
DEAD_NEGATIVE, DEAD_POSITIVE, BACK_EMF, ALPHA = 12, 13, 14, 15


@njit_inlined
def wheel_speed(wheel_angle: float, state: Array, parameters: Array) -> float:
    """Wheel speed (rad/s) from sampled wheel angles (rad), and the memory in `state` moved on.

    wheel_angle: this sample's, state and parameters as in `compensator_step`.

    The memory follows the angle with the wheel filter's time constant; without a filter it is the previous
    angle, and the speed the plain difference. The first sample has no past and gives 0.
    """
    if state[WHEEL_SEEN] == 0.0:
        state[WHEEL_SEEN] = 1.0
        state[WHEEL_MEMORY] = wheel_angle
    change = (wheel_angle - state[WHEEL_MEMORY]) * (1.0 - parameters[WHEEL_DECAY])
    state[WHEEL_MEMORY] += change
    return float(change / parameters[SAMPLE_TIME])


@njit_inlined
def motor_compensation(u2: float, speed: float, parameters: Array) -> float:
    """u0 = u1 + u2 + u3 (V), to which a motor with Coulomb friction and dead zone answers as a linear one.

    u2 in V, speed = q2' in rad/s, parameters as in `compensator_step`. Exact only where the constants are.

    u1 = f3/(c1 eta) sign(q2') cancels the motor's and gearbox's Coulomb friction; u3 (12) the dead zone.
    With BACK_EMF = c2/c1 the switch is on c1 (u1 + u2) - c2 q2', which cancels the dead zone exactly; with
    0 it is the printed switch on u1 + u2.
    """
    u = u2 + parameters[COULOMB] * np.sign(speed)
    switch = u - parameters[BACK_EMF] * speed
    if switch > 0.0:
        return float(u + parameters[DEAD_POSITIVE])
    if switch < 0.0:
        return float(u + parameters[DEAD_NEGATIVE])
    return float(u)


@njit
def compensator_step(
    reference: float,
    angle: float,
    wheel_angle: float,
    state: Array,
    parameters: Array,
) -> float:
    """Voltage (V) to hold from this sample to the next; moves `state` on by one sample in place.

    `reference` and `angle` in rad (m), `wheel_angle` in rad relative to the pendulum (0 without a
    wheel), `state` from
    `Compensator.initial_state`, `parameters` from `Compensator.parameters`. Equations (14)-(20).
    """
    order = int(parameters[ORDER])
    h = parameters[SAMPLE_TIME]
    alpha = parameters[ALPHA : ALPHA + order + 1]
    k = parameters[ALPHA + order + 1 : ALPHA + 2 * order + 1]
    xi = state[XI : XI + order]
    e = reference - angle

    # (17), (18): the filter has no feedthrough, so its state is its output now; without a filter it is e.
    filtered = state[FILTERED_ERROR] if parameters[ERROR_DECAY] > 0.0 else e
    k_tilde = state[K_TILDE]
    k_next = k_tilde
    if abs(filtered) > parameters[DELTA0]:
        k_next = max(k_tilde, min(k_tilde + parameters[LAMBDA0] * h, parameters[K_TILDE_MAX]))
    slope = (k_next - k_tilde) / h

    differentiate = parameters[DIFFERENTIATE_GAIN] != 0.0
    output = chain_output(e, xi, k_tilde, slope, parameters[SIGMA0], alpha, k, differentiate)
    u2 = parameters[PLANT_SIGN] * output
    speed = wheel_speed(wheel_angle, state, parameters)
    u0 = motor_compensation(u2, speed, parameters)

    # k tilde is linear over the sample, so this is the exact integral of sigma = sigma0 k^2 (19).
    turn = parameters[SIGMA0] * h * (k_tilde * k_tilde + k_tilde * k_next + k_next * k_next) / 3.0
    held_chain(e, xi, turn, k)
    state[FILTERED_ERROR] = e + (state[FILTERED_ERROR] - e) * parameters[ERROR_DECAY]
    state[K_TILDE] = k_next
    return float(min(max(u0, -parameters[LIMIT]), parameters[LIMIT]))
