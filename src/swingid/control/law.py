"""One sample of the consecutive compensator (14)-(20) as a compiled function.

`compensator_step` is the controller of the twin's compiled loop and of `Compensator.step` alike. State and
parameters are flat arrays whose places are named here and made by `Compensator`.
"""

from __future__ import annotations

import numpy as np

from swingid.control.chain import chain_output, held_chain
from swingid.numerics.arrays import Array
from swingid.numerics.compiled import njit

# Places in the state.
K_TILDE, FILTERED_ERROR, WHEEL_MEMORY, WHEEL_SEEN, XI = 0, 1, 2, 3, 4
# Places in the parameter array; alpha (order + 1 numbers) and k (order numbers) follow from ALPHA on.
ORDER, SAMPLE_TIME, DELTA0, LAMBDA0, SIGMA0, K_TILDE_MAX, ERROR_DECAY, WHEEL_DECAY = 0, 1, 2, 3, 4, 5, 6, 7
PLANT_SIGN, DIFFERENTIATE_GAIN, LIMIT, COULOMB = 8, 9, 10, 11
DEAD_NEGATIVE, DEAD_POSITIVE, BACK_EMF, ALPHA = 12, 13, 14, 15


@njit
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


@njit
def motor_compensation(u2: float, speed: float, parameters: Array) -> float:
    """u0 = u1 + u2 + u3 (V), to which a motor with Coulomb friction and dead zone answers as a linear one.

    u2 in V, speed = q2' in rad/s, parameters as in `compensator_step`. Exact only for the constants it is told.

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

    # (17), (18): the filter has no feedthrough, so its state is what it says now; without a filter it is e.
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
